"""Values, the time base, and what a recording cannot show."""

from __future__ import annotations

import math
import re

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.checks import insufficient_excitation, pitch_columns_swapped
from shaftline.plant import RecordingError, Ship, equilibrium, load_ship

from .conftest import Load
from .trials import COLUMNS, NOISE, voyage


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("shaft_speed_rad_s", 0, math.inf, r"shaft_speed_rad_s, row 1: .*inf.*rad/s"),
        ("fuel_rack_mm", 2, "full", r"fuel_rack_mm, row 3: 'full' is not a finite number"),
        (
            "ship_speed_m_s",
            0,
            70.0,
            r"ship_speed_m_s, row 1: 70 m/s lies outside the physical range of -40 to 40 m/s",
        ),
        ("time_s", 5, 0.1, r"time_s, row 6: 0\.1 s after 0\.4 s; time must rise"),
        ("time_s", 1799, 280.0, r"time_s, row 1800: a gap of 100.* s .* cut the recording"),
    ],
)
def test_bad_value_is_named(
    load: Load, calm: pd.DataFrame, column: str, row: int, value: object, words: str
) -> None:
    table = calm.astype(object)
    table.loc[row, column] = value
    with pytest.raises(RecordingError, match=rf"r\.csv: {words}"):
        load(table)


@pytest.mark.parametrize("missing", [1, 3])
def test_short_gap_is_filled_with_a_warning(load: Load, calm: pd.DataFrame, missing: int) -> None:
    found = load(calm.drop(index=range(500, 500 + missing)))
    assert len(found) == len(calm)
    assert "missing before row 501" in found.warnings[0]
    np.testing.assert_allclose(found["ship_speed_m_s"], calm["ship_speed_m_s"], atol=0.2)


def test_long_gap_is_refused(load: Load, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"time_s, row 501: a gap of 0\.5 s after 49\.9 s"):
        load(calm.drop(index=range(500, 504)))


def test_jitter_is_resampled_with_a_warning(load: Load, calm: pd.DataFrame) -> None:
    jitter = np.random.default_rng(2).uniform(-0.02, 0.02, len(calm))
    jitter[[0, -1]] = 0.0
    found = load(calm.assign(time_s=calm["time_s"] + jitter))
    assert "onto an even time base" in found.warnings[0]
    np.testing.assert_allclose(np.diff(found.time_s), 0.1, rtol=1e-3)


def test_irregular_time_is_resampled_and_said(load: Load, calm: pd.DataFrame) -> None:
    kept = np.random.default_rng(2).random(len(calm)) < 0.7
    kept[[0, -1]] = True
    while (gaps := np.diff(np.flatnonzero(kept)) > 4).any():
        kept[np.flatnonzero(kept)[np.flatnonzero(gaps)] + 2] = True
    found = load(calm[kept])
    assert "steps of time range from 0.1 to 0.4 s" in found.warnings[0]
    assert "every channel was interpolated linearly" in found.warnings[0]
    expected = np.interp(found.time_s, calm["time_s"], calm["ship_speed_m_s"])
    assert np.sqrt(np.mean((found["ship_speed_m_s"] - expected) ** 2)) < 0.06  # its noise


def test_time_in_milliseconds_is_refused_and_mended(load: Load, calm: pd.DataFrame) -> None:
    table = calm.assign(time_s=1000 * calm["time_s"])
    with pytest.raises(RecordingError, match=r"time_s steps by 100 s .*unit = .ms."):
        load(table)
    assert load(table, '[columns]\ntime_s = { column = "time_s", unit = "ms" }').interval_s == (
        pytest.approx(0.1)
    )


def test_saturated_and_frozen_sensors_are_warned_of(load: Load, calm: pd.DataFrame) -> None:
    limit = calm["shaft_torque_N_m"].quantile(0.9)
    table = calm.assign(shaft_torque_N_m=calm["shaft_torque_N_m"].clip(upper=limit))
    table.loc[1000:1100, "ship_speed_m_s"] = table.loc[1000, "ship_speed_m_s"]
    warnings = load(table).warnings
    assert any("shaft_torque_N_m stays at its extreme value" in w and "10%" in w for w in warnings)
    assert any("ship_speed_m_s does not change for 101 rows from row 1001" in w for w in warnings)


def test_drive_at_its_stop_is_warned_of(load: Load, frigate: Ship) -> None:
    table = voyage(frigate).assign(fuel_rack_mm=40.0)
    assert any("fuel_rack_mm is at its end stop in 100.0%" in w for w in load(table).warnings)


def test_short_and_dull_are_limits_not_errors(load: Load, frigate: Ship) -> None:
    start = equilibrium(frigate, 22.0, 1.3).state
    rng = np.random.default_rng(3)
    values = [start.pitch_ratio, start.shaft_speed, 1.3e5, start.ship_speed]
    table = pd.DataFrame(
        {"time_s": 0.1 * np.arange(100), "fuel_rack_mm": 22.0, "pitch_ratio_command": 1.3}
    )
    for (column, rms), value in zip(NOISE.items(), values, strict=True):
        table[column] = value + rms * rng.standard_normal(100)
    limits = load(table).limits
    assert any(sentence.startswith("too short: 100 rows") for sentence in limits)
    (hull,) = (sentence for sentence in limits if "hull's time constant" in sentence)
    of_it, needed = (float(number) for number in re.findall(r"([\d.]+) s\b", hull)[-2:])
    assert needed == pytest.approx(3.0 * of_it, rel=0.02)
    for column in COLUMNS:
        assert any(
            sentence.startswith(f"insufficient excitation: {column} varies") for sentence in limits
        ), column


def test_the_range_of_a_demand_either_way_is_both_ways() -> None:
    rov = load_ship("rov-thruster")
    top = rov.parameter("prime_mover.voltage_max_V").value
    volts = 0.04 * top * np.linspace(-1.0, 1.0, 4001)  # the middle 95 % of 4 % of its range
    table = pd.DataFrame({"motor_voltage_V": volts})
    (said,) = insufficient_excitation(table, rov, {})
    assert said.endswith("3.8% of its range")


def test_a_step_from_rest_is_not_dull_although_the_command_then_stands() -> None:
    rov, time = load_ship("rov-thruster"), np.arange(400.0)
    table = pd.DataFrame({"motor_voltage_V": np.where(time < 1.0, 0.0, 7.0)})
    assert (
        insufficient_excitation(
            table.assign(shaft_speed_rad_s=50.0 - 50.0 * np.exp(-time / 50.0)), rov, {}
        )
        == []
    )
    (said,) = insufficient_excitation(table.assign(shaft_speed_rad_s=50.0), rov, {})
    assert said.startswith("insufficient excitation: motor_voltage_V varies over 0 V")


def test_a_pitch_that_leads_its_command_is_swapped(frigate: Ship) -> None:
    table = voyage(frigate)
    assert not pitch_columns_swapped(table, 0.1, frigate)
    names = {"pitch_ratio": "pitch_ratio_command", "pitch_ratio_command": "pitch_ratio"}
    assert pitch_columns_swapped(table.rename(columns=names), 0.1, frigate)
