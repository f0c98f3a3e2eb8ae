"""The files of a result."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch.report.index import PAGE, REPORT, write_result
from shaftline.plant import load_ship


@pytest.mark.parametrize("page", [None, "<p>found</p>"])
def test_a_result_is_written_with_what_it_has(tmp_path: Path, page: str | None) -> None:
    table = pd.DataFrame({"cost": [3.0, 1.0]})
    folder = write_result(
        str(tmp_path / "new"), {"a": 1}, page, {"s.toml": load_ship("ferry")}, {"search": table}
    )
    assert folder == tmp_path / "new"
    names = {REPORT, "s.toml", "search.csv"} | ({PAGE} if page else set())
    assert {file.name for file in folder.iterdir()} == names
    assert json.loads((folder / REPORT).read_text()) == {"a": 1}
    assert load_ship(folder / "s.toml") == load_ship("ferry")
    pd.testing.assert_frame_equal(pd.read_csv(folder / "search.csv"), table)
    if page:
        assert (folder / PAGE).read_text() == page
