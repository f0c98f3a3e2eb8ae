"""Recordings that are diagnosed together: files, checked recordings, tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.mismatch import Recording
from shaftline.mismatch.recordings.joint import LEAST_ROWS, load_jointly
from shaftline.plant import RecordingError, Ship

from .trials import voyage


def recording(name: str, limits: tuple[str, ...] = (), warnings: tuple[str, ...] = ()) -> Recording:
    table = pd.DataFrame({"time_s": [0.1 * i for i in range(LEAST_ROWS)]})
    return Recording(Path("runs") / name, table, 0.1, {}, warnings, limits)


def test_files_recordings_and_tables_go_together(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Path
) -> None:
    calm.to_csv(tmp_path / "a.csv", index=False)
    told: list[tuple[str, int, int]] = []
    checked, later = recording("b.csv"), voyage(frigate, seed=8)
    found = load_jointly(
        frigate, [str(tmp_path / "a.csv"), checked], [later], tick=lambda *said: told.append(said)
    )
    assert found.held_out == 1
    assert found.tables[1] is checked.table
    for table, given in ((found.tables[0], calm), (found.tables[2], later)):
        pd.testing.assert_frame_equal(table, given)
    assert told == [("loading recordings", i, 3) for i in range(4)]
    assert (found.limits, found.warnings) == ([], [])


def test_files_are_read_by_their_column_map(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Path
) -> None:
    calm.rename(columns={"ship_speed_m_s": "STW"}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "map.toml").write_text('[columns]\nSTW = "ship_speed_m_s"\n')
    found = load_jointly(frigate, [tmp_path / "a.csv"], columns=tmp_path / "map.toml")
    assert "ship_speed_m_s" in found.tables[0]


def test_one_recording_speaks_for_itself(frigate: Ship) -> None:
    found = load_jointly(frigate, [recording("a.csv", ("insufficient excitation",), ("clipped",))])
    assert (found.limits, found.warnings) == (["insufficient excitation"], ["clipped"])


def test_of_several_each_is_named_and_limits_count_where_all_have_them(frigate: Ship) -> None:
    dull, good = (
        recording("a.csv", ("insufficient excitation",)),
        recording("b.csv", (), ("clipped",)),
    )
    short = recording("c.csv", ("short",), ("late",))
    one = load_jointly(frigate, [dull, good])
    assert one.limits == []
    assert one.warnings == ["b.csv: clipped", "a.csv: insufficient excitation"]
    # what is set aside limits nothing, and does not lift the others' limits
    both = load_jointly(frigate, [dull, short], [good])
    assert both.limits == ["a.csv: insufficient excitation", "c.csv: short"]
    assert both.warnings == ["c.csv: late", "b.csv: clipped"]
    aside = load_jointly(frigate, [good], [dull])
    assert (aside.limits, aside.held_out) == ([], 1)


def test_lengths_are_counted_together(frigate: Ship, calm: pd.DataFrame) -> None:
    limits = ("too short: 150 rows; at least 200 are needed for a diagnosis",)
    parts = [
        Recording(Path(name), calm.iloc[a : a + 150], 0.1, {}, (), limits)
        for name, a in (("a.csv", 0), ("b.csv", 200), ("c.csv", 400))
    ]
    slow = [said for said in load_jointly(frigate, parts[:2]).limits if "rows" not in said]
    assert len(slow) == 1  # 30 s are too short for the hull, and said once
    assert slow[0].startswith("too short: 30 s")
    no_log = [
        Recording(p.source, p.table.drop(columns="ship_speed_m_s"), 0.1, {}, (), limits)
        for p in parts
    ]
    assert load_jointly(frigate, no_log[:2]).limits == []
    # what is set aside does not lengthen what is fitted
    assert load_jointly(frigate, no_log[:1], no_log[1:]).limits == list(limits)


def test_what_cannot_be_fitted_is_refused(frigate: Ship, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no recording to fit"):
        load_jointly(frigate, [], [recording("a.csv")])
    with pytest.raises(ValueError, match=r"a\.csv is given twice"):
        load_jointly(frigate, [tmp_path / "a.csv"], [str(tmp_path / "a.csv")])
    b = recording("b.csv")
    load_jointly(frigate, [b])
    with pytest.raises(RecordingError, match=r"b\.csv: 39 rows; at least 40 are needed"):
        load_jointly(frigate, [replace(b, table=b.table.iloc[1:])])


def test_short_parts_of_a_voyage_count_together(frigate: Ship, calm: pd.DataFrame) -> None:
    parts = [calm.iloc[:10], calm.iloc[10:20], calm.iloc[20:40]]
    assert len(load_jointly(frigate, parts).tables) == 3
    # what is set aside does not count
    with pytest.raises(
        RecordingError, match="table 1 and table 2: 20 rows; at least 40 are needed"
    ):
        load_jointly(frigate, parts[:2], parts[2:])
    with pytest.raises(
        RecordingError, match="table 2: 9 rows; at least 10 are needed in each recording"
    ):
        load_jointly(frigate, [calm, calm.iloc[:9]])


def test_a_table_with_one_name_twice_is_refused(frigate: Ship, calm: pd.DataFrame) -> None:
    twice = pd.concat([calm, calm[["ship_speed_m_s"]]], axis=1)
    with pytest.raises(RecordingError, match="table: column 'ship_speed_m_s' occurs twice"):
        load_jointly(frigate, [twice])


@pytest.mark.parametrize("other", [None, [1.0, 2.0], {"time_s": [0.0]}])
def test_what_is_no_recording_is_named(frigate: Ship, other: Any) -> None:
    with pytest.raises(TypeError, match=f"a recording is .*, not {type(other).__name__}"):
        load_jointly(frigate, [other])
