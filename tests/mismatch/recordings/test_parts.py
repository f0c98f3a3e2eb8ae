"""Recordings with gaps, cut there into parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.recordings.load import load_parts
from shaftline.mismatch.recordings.survey import survey
from shaftline.mismatch.recordings.time_base import split_at_gaps
from shaftline.plant import RecordingError, Ship

from .trials import voyage


def with_gaps(calm: pd.DataFrame) -> pd.DataFrame:
    """Parts of 600, 6 and 1094 rows: 100 s are missing before row 601, 2 s before row 607."""
    late = calm["time_s"] + 100.0 * (calm.index >= 600) + 2.0 * (calm.index >= 606)
    return calm.assign(time_s=late).drop(index=range(1700, len(calm)))


def test_rows_between_long_gaps_are_parts() -> None:
    time = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 11.6, 12.6])
    assert split_at_gaps(time) == [
        (0, 5),
        (5, 7),
    ]  # 4 s are three missing samples, which are filled in
    coarse = np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 9.0, 9.0])
    assert split_at_gaps(coarse) == [(0, 6), (6, 8)]
    for odd in ([0.0, 9.0, 8.0], [0.0, np.nan, 8.0], [1.0, 1.0]):
        assert split_at_gaps(np.array(odd)) == [(0, len(odd))]


def test_each_part_is_a_recording_of_its_own(frigate: Ship, calm: pd.DataFrame) -> None:
    table = with_gaps(calm)
    one, other = load_parts(table, frigate)
    assert (len(one), len(other)) == (600, 1094)
    np.testing.assert_allclose(other["shaft_speed_rad_s"], calm["shaft_speed_rad_s"].iloc[606:1700])
    assert other.source.name == "table part 2 (from row 607)"
    assert one.warnings[0] == (
        "the recording was cut at 2 gaps (100.1 s before row 601, 2.1 s before row 607) into 2 parts; "
        "each part is simulated from its own first row; 6 rows in parts of fewer than 10 rows were "
        "left out"
    )
    assert not any("cut" in said for said in other.warnings)


def test_a_recording_without_gaps_is_one_part(frigate: Ship, calm: pd.DataFrame) -> None:
    (one,) = load_parts(calm, frigate)
    assert len(one) == len(calm)


def test_parts_that_are_too_short_are_refused_as_gaps(frigate: Ship, calm: pd.DataFrame) -> None:
    with pytest.raises(RecordingError, match=r"a gap of .* at least 10 rows"):
        load_parts(calm[calm.index % 12 < 6], frigate)


def test_parts_of_what_is_held_out_stay_held_out(frigate: Ship, calm: pd.DataFrame) -> None:
    found = load_jointly(frigate, [calm], [with_gaps(voyage(frigate, seed=5))])
    assert [len(table) for table in found.tables] == [len(calm), 600, 1094]
    assert found.held_out == 2


def test_a_survey_says_where_it_is_cut(frigate: Ship, calm: pd.DataFrame, tmp_path: Path) -> None:
    with_gaps(calm).to_csv(tmp_path / "a.csv", index=False)
    found = survey(tmp_path / "a.csv", frigate)
    assert found.recording is not None
    assert len(found.recording) == 1694
    assert any(
        said.startswith("note: the recording was cut at 2 gaps") for said in found.sentences()
    )
