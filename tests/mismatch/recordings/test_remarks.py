"""What `check` remarks on: rectified channels, leads and lags, rests, and quantisation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from shaftline.mismatch.recordings.checks import constant_channel_warnings, may_stick
from shaftline.mismatch.recordings.load import load_recording
from shaftline.mismatch.recordings.noise import Noise
from shaftline.mismatch.recordings.remarks import (
    estimate_lag,
    quantisation_grid,
    quantisation_remark,
    remarks,
)
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import Ship, load_ship, simulate_recording

from .trials import EFFECTS, voyage

SPEED, THRUST, TORQUE = "shaft_speed_rad_s", "thrust_N", "shaft_torque_N_m"


@pytest.fixture(scope="module")
def rov() -> Ship:
    return load_ship("rov-thruster")


@pytest.fixture(scope="module")
def bench(rov: Ship) -> pd.DataFrame:
    """A minute of a thruster at random voltages of either sign, with noise."""
    rng = np.random.default_rng(0)
    time = 0.04 * np.arange(1500)
    volts = np.interp(time, np.arange(0.0, 61.0, 1.5), rng.uniform(-4.5, 4.5, 41))
    table = pd.DataFrame({"time_s": time, "motor_voltage_V": volts})
    logged = simulate_recording(rov, table.assign(**dict.fromkeys((SPEED, THRUST, TORQUE), 0.0)))
    for column, rms in ((SPEED, 0.5), (THRUST, 0.2), (TORQUE, 0.01)):
        table[column] = logged[column] + rms * rng.standard_normal(len(time))
    return table


def said(table: pd.DataFrame, ship: Ship) -> list[str]:
    return list(remarks(load_recording(table, ship), ship))


def late(values: pd.Series, rows: float) -> NDArray[np.float64]:
    at = np.arange(len(values), dtype=float)
    return np.asarray(np.interp(at - rows, at, values))


def test_nothing_is_odd_in_a_good_recording(bench: pd.DataFrame, rov: Ship, frigate: Ship) -> None:
    assert said(bench, rov) == []
    for seed, sea in ((3, None), (4, "state-5")):
        assert said(voyage(frigate, sea, seed=seed), frigate) == []


@pytest.mark.parametrize("effect", ["fouled", "friction", "derated", "gauge-low", "head-current"])
def test_an_effect_is_no_lag(frigate: Ship, effect: str) -> None:
    assert said(voyage(frigate.with_values(EFFECTS[effect])), frigate) == []


@pytest.mark.parametrize("column", [SPEED, THRUST, TORQUE])
def test_a_rectified_channel_is_named(bench: pd.DataFrame, rov: Ship, column: str) -> None:
    (found,) = said(bench.assign(**{column: bench[column].abs()}), rov)
    assert found.startswith(f"{column} looks rectified: it is never below ")
    assert "reverses (42% of the rows below zero)" in found
    assert "give the column the sign of motor_voltage_V (numpy.copysign)" in found


def test_a_turned_sign_is_still_refused(bench: pd.DataFrame, rov: Ship) -> None:
    with pytest.raises(ValueError, match=r"thrust_N looks like itself with the opposite sign"):
        load_recording(bench.assign(**{THRUST: -bench[THRUST]}), rov)


@pytest.mark.parametrize("rows", [-4.0, -1.5, 1.0, 6.0])
def test_a_lead_or_lag_is_measured(bench: pd.DataFrame, rov: Ship, rows: float) -> None:
    table = bench.assign(**{THRUST: late(bench[THRUST], rows)})
    found = [sentence for sentence in said(table, rov) if sentence.startswith(THRUST)]
    assert len(found) == 1
    word = "lags" if rows > 0.0 else "leads"
    assert found[0].startswith(f"{THRUST} {word} the simulation by ")
    seconds = float(found[0].split(" by ")[1].split(" s (")[0])
    assert seconds == pytest.approx(abs(rows) * 0.04, abs=0.012)
    assert f"{SPEED} +0.0 rows" in found[0] or f"{SPEED} -0.0 rows" in found[0]


def test_a_late_command_makes_all_channels_lead_alike(bench: pd.DataFrame, rov: Ship) -> None:
    table = bench.assign(motor_voltage_V=late(bench["motor_voltage_V"], 3.0))
    found = said(table, rov)
    assert {sentence.split()[0] for sentence in found} >= {SPEED, THRUST}
    for sentence in found:
        assert "leads the simulation by 0.1" in sentence
        assert "all channels have this shift; the command is logged late" in sentence


def test_a_torque_gauge_that_is_seconds_late_is_found(frigate: Ship) -> None:
    (found,) = said(voyage(frigate.with_values(EFFECTS["gauge-late"])), frigate)
    assert found.startswith("shaft_torque_N_m lags the simulation by 5.0")


def test_a_heading_is_compared_with_its_rate(turning: pd.DataFrame) -> None:
    table = turning.assign(heading_rad=late(turning["heading_rad"], 4.0))
    found = [s for s in said(table, load_ship("kvlcc2")) if "later than the integral" in s]
    assert len(found) == 1
    assert found[0].startswith("heading_rad is ")
    assert float(found[0].split(" s (")[0].split()[-1]) == pytest.approx(4.0 * 0.5, abs=0.25)


@pytest.fixture(scope="module")
def turning() -> pd.DataFrame:
    time = 0.5 * np.arange(2400)
    rudder = 0.25 * np.sign(np.sin(0.02 * time) + 0.8 * np.sin(0.033 * time)) * (time > 20.0)
    orders = pd.DataFrame({"time_s": time, SPEED: 8.0, "rudder_rad": rudder})
    logged = simulate_recording(load_ship("kvlcc2"), orders)
    noise = np.random.default_rng(1).standard_normal((2, len(time)))
    rate = logged["yaw_rate_rad_s"] + 1e-5 * noise[0]
    heading = logged["heading_rad"] + 1e-5 * noise[1]
    return orders.assign(yaw_rate_rad_s=rate, heading_rad=heading)


def test_chance_is_no_lag() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        walk = np.cumsum(rng.standard_normal(1000))
        other = np.cumsum(rng.standard_normal(1000))
        lag = estimate_lag(walk, other)
        assert lag is None or not lag.is_significant
        noisy = estimate_lag(
            walk + 2.0 * rng.standard_normal(1000), walk + 2.0 * rng.standard_normal(1000)
        )
        assert noisy is None or not noisy.is_significant


def test_a_grid_is_found_under_rounding_and_not_in_noise_or_few_levels() -> None:
    rng = np.random.default_rng(2)
    swing = np.sin(0.01 * np.arange(2000)) + 0.05 * rng.standard_normal(2000)
    step, levels = quantisation_grid(np.round(np.round(swing / 0.0245) * 0.0245, 3))
    assert step == pytest.approx(0.0245, rel=2e-3)
    assert levels > 60
    assert quantisation_grid(swing) == (0.0, 0)
    assert quantisation_grid(np.round(3.0 * swing)) == (0.0, 0)  # seven levels
    assert quantisation_remark("thrust_N", np.round(swing, 4)) == ""
    assert "in steps of 0.02 V" in quantisation_remark("motor_voltage_V", np.round(swing * 50) / 50)


@pytest.fixture(scope="module")
def drive() -> tuple[Ship, pd.DataFrame, pd.DataFrame]:
    """A motor without a propeller, its simulation, and a recording that rests in rows 300 to 380."""
    ship = load_ship("rov-thruster")
    time = 0.01 * np.arange(1000)
    volts = 3.0 * np.sin(1.3 * time)
    angle = np.cumsum(np.sin(1.3 * time)) * 0.1
    table = pd.DataFrame({"time_s": time, "motor_voltage_V": volts, "shaft_angle_rad": angle})
    stuck = table.copy()
    shift = angle[380] - angle[300]
    stuck.loc[300:380, "shaft_angle_rad"] = angle[300]
    stuck.loc[381:, "shaft_angle_rad"] -= shift
    return ship, table, stuck


NOISY = {"shaft_angle_rad": Noise(0.01, 0.0, 0.01)}


def test_a_machine_that_sticks_is_no_dead_sensor(
    drive: tuple[Ship, pd.DataFrame, pd.DataFrame],
) -> None:
    ship, free, stuck = drive
    (found,) = constant_channel_warnings(stuck, ship, NOISY, free)
    assert (
        "does not change for 81 rows (0.81 s) from row 301 and continues from the same value"
        in found
    )
    low, high = (stuck["motor_voltage_V"][300:381].agg(f) for f in ("min", "max"))
    assert (
        f"motor_voltage_V lies between {low:.4g} and {high:.4g} V: static friction may hold the machine"
        in found
    )
    dead = free.copy()
    dead.loc[300:380, "shaft_angle_rad"] = free.loc[300, "shaft_angle_rad"]
    (found,) = constant_channel_warnings(dead, ship, NOISY, free)
    assert found.endswith("in other rows: the sensor or its logger stopped there")
    assert not list(constant_channel_warnings(free, ship, NOISY, free))


def test_an_angle_that_rests_while_the_speed_does_not_is_a_dead_sensor(
    drive: tuple[Ship, pd.DataFrame, pd.DataFrame],
) -> None:
    ship, free, stuck = drive
    assert may_stick(stuck, ship, "shaft_angle_rad", 300, 381, 5.6)
    turning = stuck.assign(shaft_speed_rad_s=np.gradient(free["shaft_angle_rad"], 0.01))
    assert not may_stick(turning, ship, "shaft_angle_rad", 300, 381, 5.6)
    assert not may_stick(stuck, load_ship("frigate"), "shaft_angle_rad", 300, 381, 5.6)


def test_check_says_them(bench: pd.DataFrame, rov: Ship, tmp_path: Path) -> None:
    bench.assign(**{SPEED: bench[SPEED].abs()}).to_csv(tmp_path / "r.csv", index=False)
    found = survey(tmp_path / "r.csv", rov)
    assert any(s.startswith("remark: shaft_speed_rad_s looks rectified") for s in found.sentences())
    assert found.recording is not None
    assert found.recording.table[SPEED].min() >= 0.0  # the data are not changed
