"""Recordings whose only measured channel is a power, and shafts faster than any ship's."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import identify, load_recording
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import RecordingError, Ship, load_ship, simulate_recording

from ...plant.test_fluid import fan

RIG = fan(prime_mover={"type": "speed-command", "speed_max_rad_s": 1300.0, "drive_efficiency": 0.8})
TIME = 0.1 * np.arange(600)


def powered(ship: Ship, drive: str, demand: object, column: str) -> pd.DataFrame:
    """A recording with noise of 0.1 % of the power, simulated."""
    inputs = pd.DataFrame({"time_s": TIME, drive: demand, column: 0.0})
    found = simulate_recording(ship, inputs)[["time_s", drive, column]]
    noise = np.random.default_rng(1).standard_normal(len(found))
    return found.assign(**{column: found[column] + 1e-3 * found[column].std() * noise})


def fast() -> pd.DataFrame:
    speed = 900.0 + 300.0 * np.sin(0.3 * TIME)
    return powered(RIG, "shaft_speed_rad_s", speed, "electric_power_W")


def test_speeds_of_a_small_fast_rig_are_not_taken_for_revolutions_per_minute() -> None:
    found = load_recording(fast(), RIG)
    assert found["shaft_speed_rad_s"].max() == pytest.approx(1200.0, rel=1e-3)
    assert found.channels == ("shaft_speed_rad_s", "electric_power_W")


def test_revolutions_per_minute_of_that_rig_are_refused_by_its_own_top_speed() -> None:
    table = fast()
    table["shaft_speed_rad_s"] *= 30.0 / np.pi
    with pytest.raises(
        RecordingError, match=r"looks like rpm.*takes -1\.3e\+03 to 1\.3e\+03 rad/s"
    ):
        load_recording(table, RIG)


def test_a_power_in_kilowatts_is_named() -> None:
    table = fast()
    table["electric_power_W"] *= 1e-3
    with pytest.raises(RecordingError, match=r'electric_power_W looks like kW .*unit = "kW"'):
        load_recording(table, RIG)


@pytest.mark.parametrize("column", ["shaft_power_W", "electric_power_W"])
def test_a_power_may_be_the_only_measured_channel_of_a_motor(column: str) -> None:
    tug = load_ship("tito-neri-sine")
    volts = 4.0 + 2.0 * np.sin(0.7 * TIME)
    found = load_recording(powered(tug, "motor_voltage_V", volts, column), tug)
    assert found.channels == ("motor_voltage_V", column)
    with pytest.raises(RecordingError, match="column 'shaft_speed_rad_s' is missing"):
        load_recording(pd.DataFrame({"time_s": TIME, "motor_voltage_V": volts}), tug)


def test_a_loss_of_the_rig_is_identified_by_its_power() -> None:
    """A torque coefficient 20 % above the file's is found from electric power alone."""
    truth = RIG.with_values({"propeller.torque_coefficient": 1.2 * 0.017})
    speed = 900.0 + 300.0 * np.sin(0.3 * TIME)
    table = powered(truth, "shaft_speed_rad_s", speed, "electric_power_W")
    found = identify(RIG, table, free=["propeller.torque_coefficient"])
    assert found.parameters["propeller.torque_coefficient"] == pytest.approx(1.2 * 0.017, rel=5e-3)


def test_a_survey_does_not_miss_a_torque_that_a_power_tells(tmp_path: Path) -> None:
    file = tmp_path / "rig.csv"
    fast().to_csv(file, index=False)
    found = survey(file, RIG)
    assert found.recording is not None
    assert "shaft_torque_N_m" not in found.absent
    assert "thrust_N" in found.absent


@pytest.mark.skipif("SHAFTLINE_DATA" not in os.environ, reason="needs SHAFTLINE_DATA")
def test_a_propeller_in_air_is_read_as_it_was_recorded(tmp_path: Path) -> None:
    """12 000 rpm, airspeed and electric power, by volts and amperes."""
    (tmp_path / "map.toml").write_text(
        """[columns]
        t_s = "time_s"
        rpm = { column = "shaft_speed_rad_s", unit = "rpm" }
        airspeed_mps = "inflow_velocity_m_s"
        electric_power_W = { formula = "voltage_V * current_A" }
        """
    )
    file = Path(os.environ["SHAFTLINE_DATA"]) / "recordings/propeller_inflow/windtunnel_10Hz.csv"
    found = load_recording(file, RIG, tmp_path / "map.toml")
    assert found["shaft_speed_rad_s"].max() == pytest.approx(1254.0, abs=1.0)
    assert found["inflow_velocity_m_s"].max() == pytest.approx(18.02)
    assert found["electric_power_W"].max() == pytest.approx(378.0, abs=5.0)
