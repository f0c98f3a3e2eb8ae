"""What a diagnosis says, gives and writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shaftline.mismatch.report.html import report_html
from shaftline.mismatch.report.index import PAGE, REPORT, SHIP
from shaftline.plant import load_ship

from .diagnoses import diagnosis_of

VERDICTS = ("explained", "nothing-missing", "unexplained")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_it_saves_what_it_says(verdict: str, tmp_path: Path) -> None:
    diagnosis = diagnosis_of(verdict)
    assert diagnosis.save(tmp_path / "new", page=False) == tmp_path / "new"
    assert {file.name for file in (tmp_path / "new").iterdir()} == {REPORT, SHIP}
    assert json.loads((tmp_path / "new" / REPORT).read_text()) == diagnosis.to_dict()
    assert load_ship(tmp_path / "new" / SHIP) == diagnosis.corrected
    assert diagnosis.to_dict()["verdict"] == verdict
    assert diagnosis.to_dict()["sentence"] == diagnosis.sentence
    assert diagnosis.summary().startswith(f"{diagnosis.headline}\n")
    assert diagnosis.to_dict()["headline"] == diagnosis.headline


def test_the_page_is_written_unless_it_is_not_wanted(tmp_path: Path) -> None:
    diagnosis = diagnosis_of("nothing-missing")
    diagnosis.save(str(tmp_path))
    assert {file.name for file in tmp_path.iterdir()} == {REPORT, PAGE, SHIP}
    assert (tmp_path / PAGE).read_text(encoding="utf-8") == report_html(diagnosis)


def test_nothing_is_written_where_the_report_fails(tmp_path: Path) -> None:
    broken = diagnosis_of("nothing-missing", measured=None)
    with pytest.raises(AttributeError):
        broken.save(tmp_path)
    assert not list(tmp_path.iterdir())


def test_in_a_notebook_it_shows_verdict_and_ship() -> None:
    assert repr(diagnosis_of("unexplained")) == "<Diagnosis of frigate: unexplained>"
