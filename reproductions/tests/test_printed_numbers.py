"""The count of the printed numbers."""

from __future__ import annotations

import itertools
from pathlib import Path

import pandas as pd
import pytest

from reproductions import printed_numbers
from reproductions.cells import Kind, Reason, number

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"


def test_every_page_with_printed_numbers_belongs_to_one_source() -> None:
    pages = [*itertools.chain(*printed_numbers.PAGES.values())]
    assert sorted(pages) == sorted(file.stem for file in (RESULTS / "cells").glob("*.csv"))


def test_inputs_and_calibrated_numbers_are_not_counted_as_predicted() -> None:
    cells = [
        number("1", "a", "", 1.0, 1.0, 0.1, "digit", Kind.INPUT),
        number("1", "b", "", 1.0, 1.0, 0.1, "digit", Kind.CALIBRATED),
        number("1", "c", "", 2.0, 1.0, 0.1, "digit", Kind.CALIBRATED),
        number("1", "d", "", 1.05, 1.0, 0.1, "digit"),
        number("1", "e", "", 2.0, 1.0, 0.1, "digit", reason=Reason("slope", -1.0)),
        number("1", "f", "", 2.0, 1.0, 0.1, "digit"),
        number("1", "g", "", 3.0, 1.0, 0.1, "digit"),
        number("1", "h", "", 1.0, 1.0, 0.1, "digit", Kind.DERIVED),
        number("1", "i", "", 2.0, 1.0, 0.1, "digit", Kind.DERIVED),
    ]
    assert printed_numbers.count_cells(cells) == {
        "inputs": 1,
        "calibrated, met": "1 of 2",
        "derived, consistent": "1 of 2",
        "predicted": 4,
        "met": 1,
        "reason calculated": 1,
        "unexplained": 2,
        "met or reason calculated": "50 %",
        "lower bound": "25 %",
    }


def test_the_page_is_that_of_the_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    printed_numbers.main(["--out", str(tmp_path)])
    made, kept = (pd.read_csv(folder / "printed-numbers.csv") for folder in (tmp_path, RESULTS))
    pd.testing.assert_frame_equal(made, kept)
