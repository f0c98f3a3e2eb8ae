"""Arguments and columns of types that a recording cannot have, and times that are no seconds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import load_recording
from shaftline.mismatch.recordings.noise import Noise
from shaftline.plant import RecordingError, Ship

from .conftest import Load


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"ship": "frigate"}, r'ship must be a Ship, such as load_ship\("frigate"\) .*, not str'),
        ({"ship": None}, r"ship must be a Ship.*, not NoneType"),
        (
            {"source": None},
            r"source must be the path of a file or a pandas\.DataFrame, not NoneType",
        ),
        ({"source": {"time_s": [0.0]}}, r"source must be .*, not dict"),
        ({"source": np.zeros((9, 4))}, r"source must be .*, not ndarray"),
        (
            {"columns": {"columns": {}}},
            r"columns must be the path of a column map, or None, not dict",
        ),
    ],
)
def test_an_argument_of_another_type_is_named(
    frigate: Ship, calm: pd.DataFrame, changed: dict[str, Any], words: str
) -> None:
    with pytest.raises(TypeError, match=words):
        load_recording(**({"source": calm, "ship": frigate} | changed))


@pytest.mark.parametrize("part", [0j, 1j])
@pytest.mark.parametrize("kind", ["complex", "object"])
def test_complex_values_are_refused_by_their_column(
    frigate: Ship, calm: pd.DataFrame, part: complex, kind: str
) -> None:
    for column in ("shaft_torque_N_m", "time_s", "fuel_rack_mm"):
        table = calm.assign(**{column: (calm[column] + part).astype(kind)})
        with pytest.raises(RecordingError, match=f"table: {column} holds complex numbers"):
            load_recording(table, frigate)
    wind = calm.assign(wind=calm["time_s"] + part)
    assert "wind" not in load_recording(wind, frigate)
    with pytest.raises(RecordingError, match="table: wind holds complex numbers"):
        load_recording(wind, frigate, signals={"wind": "m/s"})


def test_a_complex_column_of_a_map_is_refused_by_its_own_name(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Any
) -> None:
    (tmp_path / "map.toml").write_text(
        '[columns]\nQ = { column = "shaft_torque_N_m", scale = 1.0 }'
    )
    table = calm.rename(columns={"shaft_torque_N_m": "Q"}).assign(Q=calm["shaft_torque_N_m"] + 1j)
    with pytest.raises(RecordingError, match="table: Q holds complex numbers"):
        load_recording(table, frigate, tmp_path / "map.toml")


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_dates_and_durations_of_a_table_are_read_as_seconds(
    frigate: Ship, calm: pd.DataFrame, zone: str | None
) -> None:
    lasted = pd.to_timedelta(calm["time_s"], unit="s")
    first = pd.Timestamp("2024-10-27 00:59", tz="UTC").tz_convert(zone)  # clocks go back at 01:00
    dates = calm.assign(time_s=first + lasted)
    found = load_recording(dates, frigate)
    assert found.time_s == pytest.approx(calm["time_s"].to_numpy())
    assert found.warnings[0].startswith(
        "time_s holds dates; it was read as seconds since 2024-10-27"
    )
    found = load_recording(calm.assign(time_s=lasted), frigate)
    assert found.time_s == pytest.approx(calm["time_s"].to_numpy())


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S.%f", "%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f"])
def test_texts_of_dates_are_refused_with_what_to_say(
    load: Load, calm: pd.DataFrame, form: str
) -> None:
    dates = pd.Timestamp("2024-05-03 12:00") + pd.to_timedelta(calm["time_s"], unit="s")
    table = calm.assign(time_s=dates.dt.strftime(form))
    with pytest.raises(RecordingError, match="time_s holds dates or times of day") as refused:
        load(table)
    advice = str(refused.value).split("; add ")[1].removesuffix(" to the column map")
    assert len(load(table, f"[columns]\n{advice}")) == len(calm)


def test_times_that_fall_or_begin_below_zero_are_refused_with_what_to_do(
    load: Load, calm: pd.DataFrame
) -> None:
    with pytest.raises(RecordingError, match="must rise from row to row; sort the rows by it"):
        load(calm.assign(time_s=calm["time_s"].to_numpy()[::-1]))
    early = calm.assign(time_s=calm["time_s"] - 40.0)
    with pytest.raises(
        RecordingError, match=r"time_s begins at -40 s.* offset = 40 in the column map"
    ):
        load(early)
    load(early, '[columns]\ntime_s = { column = "time_s", offset = 40 }')


def test_a_time_in_minutes_is_suspected_where_the_rows_come_too_fast(
    load: Load, calm: pd.DataFrame
) -> None:
    advice = 'if time_s counts minutes, set unit = "min" in the column map'
    (said,) = (s for s in load(calm.assign(time_s=calm["time_s"] / 60.0)).limits if "time_s" in s)
    assert said.endswith(advice)
    assert advice not in "".join(load(calm.iloc[:900]).limits)


def test_the_steps_of_commands_are_not_reported_as_noise(frigate: Ship, calm: pd.DataFrame) -> None:
    """A rack that is commanded anew every 30 s is no instrument that answers every 30 s."""
    rows = np.arange(0.0, 1800.0)
    steps = np.resize([20.0, 25.0, 16.0, 22.0], 60)[(rows // 30).astype(int)]
    table = pd.DataFrame(
        {
            "time_s": rows,
            "fuel_rack_mm": steps,
            "pitch_ratio_command": 1.2,
            "shaft_speed_rad_s": 0.45 * steps,
        }
    )
    table["shaft_speed_rad_s"] += 0.1 * np.random.default_rng(1).standard_normal(len(rows))
    found = load_recording(table, frigate)
    assert found.noise["fuel_rack_mm"] == Noise(0.0, 0.0, 1.0)
    assert found.noise["shaft_speed_rad_s"].white_rms > 0.05


@pytest.mark.parametrize("mass", [1.0, 100.0])
def test_a_ship_that_diverges_at_once_refuses_every_recording(
    frigate: Ship, calm: pd.DataFrame, mass: float
) -> None:
    light = frigate.with_values({"hull.mass_kg": mass})
    with pytest.raises(
        RecordingError,
        match="cannot be simulated with the recorded commands: frigate: the simulation diverges",
    ):
        load_recording(calm, light)
