"""The files of a result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.mismatch.report.index import PAGE, REPORT, Result
from shaftline.plant import Ship, load_ship


class Small(Result):
    tables = {"search": pd.DataFrame({"cost": [3.0, 1.0]})}  # noqa: RUF012

    def to_dict(self) -> dict[str, Any]:
        return {"a": 1}

    def _page(self) -> str:
        return "<p>found</p>"

    def _ships(self) -> dict[str, Ship]:
        return {"s.toml": load_ship("ferry")}


@pytest.mark.parametrize("page", [False, True])
def test_a_result_is_written_with_what_it_has(tmp_path: Path, page: bool) -> None:
    folder = Small().save(str(tmp_path / "new"), page=page)
    assert folder == tmp_path / "new"
    names = {REPORT, "s.toml", "search.csv"} | ({PAGE} if page else set())
    assert {file.name for file in folder.iterdir()} == names
    assert json.loads((folder / REPORT).read_text()) == {"a": 1}
    assert load_ship(folder / "s.toml") == load_ship("ferry")
    pd.testing.assert_frame_equal(pd.read_csv(folder / "search.csv"), Small.tables["search"])
    if page:
        assert (folder / PAGE).read_text() == "<p>found</p>"
