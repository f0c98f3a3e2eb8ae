from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.core.files import write_atomically, write_json
from shaftline.plant import Schedule, Ship, equilibrium, load_ship, simulate
from shaftline.plant.columns import input_columns
from shaftline.plant.recording import RecordingError, read_recording
from shaftline.plant.replay import simulate_recording

MEASURED = ["pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"]
LAGS = {"prime_mover.lag_s": 1.5, "propeller.inflow_lag_s": 2.0}


def sailed(ship: Ship, period: float = 0.05, rows: int = 400) -> pd.DataFrame:
    """A recording of the ship itself, its rack and pitch stepping on the way."""
    time = period * np.arange(rows)
    rack = np.where(time < 0.3 * time[-1], 22.0, 27.0)
    pitch = np.where(time < 0.6 * time[-1], 1.4, 1.2)
    per_row = round(period / ship.time_step_s)
    schedule = Schedule(np.repeat(rack[:-1], per_row), np.repeat(pitch[:-1], per_row))
    start = equilibrium(ship, 22.0, 1.4).state
    s = simulate(ship, schedule, time[-1], initial=start)[::per_row]
    names = ["measured_pitch_ratio", "shaft_speed", "measured_shaft_torque", "measured_ship_speed"]
    inputs = {"time_s": time, "fuel_rack_mm": rack, "pitch_ratio_command": pitch}
    return pd.DataFrame(inputs | dict(zip(MEASURED, (s[n] for n in names), strict=True)))


@pytest.mark.parametrize("period", [0.05, 0.1])
@pytest.mark.parametrize("values", [{}, LAGS], ids=["nominal", "lags"])
def test_ship_repeats_its_own_recording(
    frigate: Ship, values: dict[str, float], period: float
) -> None:
    ship = frigate.with_values(values)
    recording = sailed(ship, period)
    found = simulate_recording(ship, recording)
    for name in MEASURED:
        np.testing.assert_allclose(found[name], recording[name], rtol=1e-7, err_msg=name)


def test_recording_of_inputs_alone_starts_in_their_steady_state(frigate: Ship) -> None:
    recording = sailed(frigate)
    found = simulate_recording(frigate, recording[input_columns(frigate)])
    np.testing.assert_allclose(found["ship_speed_m_s"], recording["ship_speed_m_s"], rtol=1e-8)


@pytest.mark.parametrize("values", [{}, LAGS | {"hull.current_m_s": 0.4}], ids=["calm", "lags"])
def test_measured_inflow_and_submergence_act(frigate: Ship, values: dict[str, float]) -> None:
    """A gust and a rising surface that the recording knows only by what was measured."""
    losses = {"propeller.cavitation_breakdown": 0.3, "propeller.cavitation_onset_number": 8.0}
    ship = frigate.with_values(losses | values)
    schedule = Schedule(24.0, 1.3, inflow=lambda t: 0.05 * t, elevation=lambda t: -0.1 * t)
    s = simulate(ship, schedule, 20.0, initial=equilibrium(ship, 24.0, 1.3).state)
    water = s["ship_speed"] - ship.hull.current_m_s
    recording = pd.DataFrame(
        {
            "time_s": s["time"], "fuel_rack_mm": s["drive"], "pitch_ratio_command": 1.3,
            "pitch_ratio": s["measured_pitch_ratio"], "shaft_speed_rad_s": s["shaft_speed"],
            "shaft_torque_N_m": s["measured_shaft_torque"],
            "ship_speed_m_s": s["measured_ship_speed"],
            "inflow_velocity_m_s": 0.95 * water + 0.05 * s["time"],
            "propeller_submergence_m": s["submergence"],
        }
    )  # fmt: skip
    found = simulate_recording(ship, recording)
    for name in [*MEASURED, "inflow_velocity_m_s", "propeller_submergence_m"]:
        np.testing.assert_allclose(found[name], recording[name], rtol=1e-7, err_msg=name)
    blind = simulate_recording(ship, recording.drop(columns="inflow_velocity_m_s"))
    assert np.ptp(blind["shaft_speed_rad_s"] - recording["shaft_speed_rad_s"]) > 0.01
    deep = simulate_recording(ship, recording.drop(columns="propeller_submergence_m"))
    assert np.ptp(deep["shaft_speed_rad_s"] - recording["shaft_speed_rad_s"]) > 0.01


def test_measured_inflow_of_a_fixed_hull_needs_no_speed(frigate: Ship) -> None:
    moored = frigate.with_values({"hull.fixed": True})
    s = simulate(
        moored, Schedule(15.0, 0.8, inflow=2.0), 10.0, initial=equilibrium(moored, 15, 0.8).state
    )
    recording = pd.DataFrame(
        {
            "time_s": s["time"], "fuel_rack_mm": 15.0, "pitch_ratio_command": 0.8,
            "pitch_ratio": 0.8, "shaft_speed_rad_s": s["shaft_speed"], "ship_speed_m_s": 0.0,
            "inflow_velocity_m_s": 2.0,
        }
    )  # fmt: skip
    found = simulate_recording(moored, recording)
    np.testing.assert_allclose(found["shaft_speed_rad_s"], s["shaft_speed"], rtol=1e-9)


def test_measured_inflow_of_a_moving_hull_needs_its_speed(frigate: Ship) -> None:
    recording = sailed(frigate).drop(columns="ship_speed_m_s").assign(inflow_velocity_m_s=8.0)
    with pytest.raises(RecordingError, match="inflow_velocity_m_s asks for ship_speed_m_s"):
        simulate_recording(frigate, recording)


def test_recording_survives_its_file(frigate: Ship, tmp_path: Path) -> None:
    recording = sailed(frigate)
    recording.to_csv(tmp_path / "r.csv", index=False)
    found = read_recording(tmp_path / "r.csv", input_columns(frigate))
    pd.testing.assert_frame_equal(found, recording, rtol=1e-14)


def test_fixed_pitch_tug_needs_time_and_voltage() -> None:
    assert input_columns(load_ship("tito-neri-sine")) == ["time_s", "motor_voltage_V"]


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("fuel_rack_mm", 7, math.nan, r"r\.csv: fuel_rack_mm, row 8: .*nan.* is not a finite"),
        ("fuel_rack_mm", 7, "full", r"fuel_rack_mm, row 8: 'full' is not a finite number"),
        ("fuel_rack_mm", 3, 2200.0, r"fuel_rack_mm, row 4: 2200 mm lies outside 0 to 200 mm"),
        ("shaft_speed_rad_s", 0, math.inf, r"shaft_speed_rad_s, row 1: .*inf"),
        ("time_s", 5, 0.1, r"time_s, row 6: time does not rise"),
        ("time_s", 399, 30.0, r"time_s, row 400: a step of .* where 0\.05 s is usual"),
    ],
)
def test_bad_value_is_named_with_column_and_row(
    frigate: Ship, tmp_path: Path, column: str, row: int, value: object, words: str
) -> None:
    recording = sailed(frigate).astype(object)
    recording.loc[row, column] = value
    recording.to_csv(tmp_path / "r.csv", index=False)
    with pytest.raises(RecordingError, match=words):
        read_recording(tmp_path / "r.csv", input_columns(frigate))


def test_missing_column_is_named(frigate: Ship, tmp_path: Path) -> None:
    sailed(frigate).drop(columns="fuel_rack_mm").to_csv(tmp_path / "r.csv", index=False)
    with pytest.raises(RecordingError, match=r"column 'fuel_rack_mm' is missing; needed: time_s"):
        read_recording(tmp_path / "r.csv", input_columns(frigate))


@pytest.mark.parametrize("text", ["", "time_s\n0.0\n"])
def test_recording_without_rows_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(RecordingError, match=r"r\.csv"):
        read_recording(tmp_path / "r.csv", ["time_s"])


def test_failed_writing_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    target.write_text("old")

    def half(file: Path) -> None:
        file.write_text("ha")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(target, half)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_json_refuses_what_is_no_number(tmp_path: Path) -> None:
    write_json(tmp_path / "new" / "a.json", {"x": 1.5})
    assert json.loads((tmp_path / "new" / "a.json").read_text()) == {"x": 1.5}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "b.json", {"x": math.nan})
