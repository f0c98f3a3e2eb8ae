"""Recordings of different sampling rates, and rows with equal times."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import load_recording
from shaftline.mismatch.recordings.joint import at_common_interval, load_jointly
from shaftline.mismatch.recordings.time_base import resample_evenly, seconds_since_first
from shaftline.plant import RecordingError, Ship, simulate_recording

from ..structure.rigs import motor


@pytest.fixture(name="rig")
def _rig() -> Ship:
    return motor()


def orders(interval_s: float, seconds: float = 60.0) -> pd.DataFrame:
    """A motor run both ways, with rests in between."""
    time = np.arange(0.0, seconds, interval_s)
    voltage = 8.0 * np.round(np.sin(0.4 * time))
    return pd.DataFrame({"time_s": time, "motor_voltage_V": voltage})


def run(ship: Ship, interval_s: float, seed: int) -> pd.DataFrame:
    """A noisy recording of a motor whose friction stops it at once where its command is 0."""
    friction = {"transmission.coulomb_friction_engine_side_N_m": 0.02}
    table = orders(interval_s)
    true = simulate_recording(ship.with_values(friction), table.assign(shaft_speed_rad_s=0.0))
    speed = true["shaft_speed_rad_s"]
    noise = 0.3 * np.random.default_rng(seed).standard_normal(len(table))
    resting = speed.abs() < 0.02 * speed.abs().max()
    return table.assign(shaft_speed_rad_s=np.where(resting, 0.0, speed + noise))


def test_the_faster_recording_is_brought_to_the_slower_one(rig: Ship) -> None:
    fast, slow = (load_recording(run(rig, dt, k), rig) for k, dt in enumerate((0.02, 0.05)))
    one, other = at_common_interval(rig, [fast, slow])
    assert other is slow
    assert one.interval_s == pytest.approx(slow.interval_s)
    assert np.diff(one.time_s) == pytest.approx(slow.interval_s)
    assert one.time_s[-1] <= fast.time_s[-1]
    # two rows are averaged: half of the noise's power is left
    ratio = one.noise["shaft_speed_rad_s"].white_rms / fast.noise["shaft_speed_rad_s"].white_rms
    assert 0.4 < ratio < 0.85
    assert "from one row every 0.02 s to one row every 0.05 s" in one.warnings[-1]
    np.testing.assert_allclose(
        one["motor_voltage_V"], np.interp(one.time_s, fast.time_s, fast["motor_voltage_V"])
    )
    together = load_jointly(rig, [fast], [slow])
    assert {round(float(np.diff(t["time_s"]).mean()), 6) for t in together.tables} == {0.05}


def test_rates_that_are_too_far_apart_are_refused(rig: Ship) -> None:
    fast, slow = (load_recording(run(rig, dt, 0), rig) for dt in (0.01, 0.25))
    with pytest.raises(RecordingError, match=r"every 0\.01 s, .* every 0\.25 s; up to 20 times"):
        at_common_interval(rig, [fast, slow])


def test_a_motor_at_rest_without_a_command_is_no_dead_sensor(rig: Ship) -> None:
    """The ship file has no friction: its shaft coasts on where the real one stands."""
    table = run(rig, 0.02, 1)
    long = pd.concat([table, table.iloc[:1500].assign(motor_voltage_V=0.0, shaft_speed_rad_s=0.0)])
    long["time_s"] = 0.02 * np.arange(len(long))
    found = load_recording(long.reset_index(drop=True), rig)
    assert not [said for said in found.warnings if "stopped there" in said or "saturated" in said]
    dead = table.copy()  # but one that stops reading under way is
    dead.loc[1000:2600, "shaft_speed_rad_s"] = dead.loc[1000, "shaft_speed_rad_s"]
    with pytest.raises(RecordingError, match="dead sensor or a stopped logger"):
        load_recording(dead, rig)


def test_a_motor_that_coasts_without_a_current_has_no_dead_current_sensor(rig: Ship) -> None:
    """Without a command the ship file's motor brakes; a real one may be open and take no current."""
    table = run(rig, 0.02, 1)
    true = simulate_recording(rig, table.assign(motor_current_A=0.0))["motor_current_A"]
    rows = len(table)
    table["motor_current_A"] = true + 0.01 * np.random.default_rng(2).standard_normal(rows)
    table.loc[rows // 3 : 2 * rows // 3, "motor_voltage_V"] = 0.0
    table.loc[rows // 3 : 2 * rows // 3, "motor_current_A"] = 0.0
    load_recording(table, rig)
    table.loc[rows // 3 : 2 * rows // 3, "motor_voltage_V"] = 3.0
    with pytest.raises(
        RecordingError, match=r"motor_current_A is constant at 0 A .* a dead sensor"
    ):
        load_recording(table, rig)


def test_rows_with_the_time_of_the_row_before_are_averaged(tmp_path: object) -> None:
    time = np.arange(100.0)
    table = pd.DataFrame({"time_s": time, "x": time})
    twice = pd.concat([table, table.iloc[[40, 70]].assign(x=[42.0, 70.0])]).sort_values("time_s")
    found, said = resample_evenly(tmp_path, twice.reset_index(drop=True))  # type: ignore[arg-type]
    assert len(found) == 100
    assert found["x"].iloc[40] == 41.0
    assert said == ["2 rows have the time of the row before, first row 42; such rows were averaged"]
    often = pd.concat([table, table.iloc[::5]]).sort_values("time_s").reset_index(drop=True)
    with pytest.raises(RecordingError, match="time must rise"):
        resample_evenly(tmp_path, often)  # type: ignore[arg-type]


def test_milliseconds_behind_a_colon_are_read() -> None:
    stamps = pd.Series(["2019-11-05 17:14:08:947", "2019-11-05 17:14:09:047"])
    assert seconds_since_first(stamps).tolist() == pytest.approx([0.0, 0.1])


def test_stamps_without_a_fraction_of_zero_are_read() -> None:
    stamps = pd.Series(["01.05.2026 10:00:00", "01.05.2026 10:00:00.5", "01.05.2026 10:00:01"])
    assert seconds_since_first(stamps).tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("other", ["2026-05-01 10:00:01", "40.05.2026 10:00:01", "none"])
def test_a_stamp_in_another_form_is_named_with_its_row(other: str) -> None:
    stamps = pd.Series(["01.05.2026 10:00:00", other])
    with pytest.raises(ValueError, match=f"the time stamp '{other}' of row 2 cannot be read"):
        seconds_since_first(stamps)
