"""The index of many diagnoses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.mismatch import DiagnosisIndex
from shaftline.mismatch.report.data import diagnosis_as_dict
from shaftline.mismatch.report.index import INDEX_COLUMNS, index_html, index_row

from ..diagnoses import diagnosis_of


def report(verdict: str, **changes: Any) -> dict[str, Any]:
    return diagnosis_as_dict(diagnosis_of(verdict, **changes))


def row(name: str, verdict: str, gain: float = 0.0) -> dict[str, Any]:
    fit = {"pitch_ratio": 50.0, "shaft_speed_rad_s": 50.0}
    after = {"pitch_ratio": 50.0, "shaft_speed_rad_s": 50.0 + gain}
    return index_row(
        name, "2024-05-03", report(verdict, fit_before=fit, fit_after=after), f"{name}/r.html"
    )


BAD = index_row("bad <1>.csv", "2024-05-04", error="bad <1>.csv: time_s, row 3")


@pytest.fixture
def index() -> DiagnosisIndex:
    rows = [
        BAD,
        row("quiet.csv", "nothing-missing"),
        row("b.csv", "explained", 5.0),
        row("a b.csv", "unexplained", 30.0),
        row("a.csv", "explained", 5.0),
    ]
    return DiagnosisIndex.of(rows)


def test_a_row_tells_what_was_found_where() -> None:
    found = row("a.csv", "explained", 12.0)
    assert list(found) == list(INDEX_COLUMNS)
    assert found == {
        "recording": "a.csv",
        "ship": "frigate",
        "date": "2024-05-03",
        "verdict": "explained",
        "balances": "engine",
        "found": "coulomb-friction or viscous-friction (coulomb_friction_engine_side_N_m = 8000)",
        "windows_s": "60..120",
        "regime": "shaft_speed above 11 rad/s",
        "channel": "shaft_speed_rad_s",
        "fit_before": 50.0,
        "fit_after": 62.0,
        "sentence": diagnosis_of("explained").sentence,
        "report": "a.csv/r.html",
        "error": "",
    }
    assert row("b.csv", "unexplained")["found"] == "unknown cause; depends on shaft speed"
    nameless = index_row("c.csv", "", report("unexplained", shape=None))
    assert nameless["found"] == "unknown cause"
    assert row("d.csv", "nothing-missing")["found"] == ""


def test_without_a_fit_there_is_no_channel() -> None:
    found = index_row("a.csv", "", report("explained", fit_before={}, fit_after={}))
    assert found["channel"] == ""
    assert pd.isna(found["fit_before"])
    absent = report("explained")
    absent["fit"]["held_out"]["before"]["pitch_ratio"] = None
    absent["fit"]["held_out"]["after"]["shaft_speed_rad_s"] = None
    assert index_row("a.csv", "", absent)["channel"] == ""


def test_the_worst_stands_first(index: DiagnosisIndex) -> None:
    order = ["a b.csv", "a.csv", "b.csv", "quiet.csv", "bad <1>.csv"]
    assert list(index.table["recording"]) == order
    assert list(index.table.columns) == list(INDEX_COLUMNS)
    assert list(index.diagnosed["recording"]) == order[:4]
    assert list(index.failed["recording"]) == order[4:]
    gained = [row("a.csv", "explained", 5.0), row("z.csv", "explained", 9.0)]
    assert list(DiagnosisIndex.of(gained).table["recording"]) == ["z.csv", "a.csv"]


def test_a_summary_tells_findings_and_failures(index: DiagnosisIndex) -> None:
    lines = index.summary().splitlines()
    assert lines[0] == "Largest mismatch first; FitPercent on the held-out data, 100 is perfect"
    assert lines[1].split() == [
        "recording",
        "date",
        "verdict",
        "balances",
        "found",
        "before",
        "after",
    ]
    assert lines[2].split()[:5] == ["a", "b.csv", "2024-05-03", "unexplained", "engine"]
    assert lines[2].split()[-2:] == ["50.0", "80.0"]
    assert lines[-1] == "could not be diagnosed: bad <1>.csv: time_s, row 3"
    assert DiagnosisIndex.of([BAD]).summary() == lines[-1]
    empty = DiagnosisIndex.of(
        [index_row("a.csv", "", report("explained", fit_before={}, fit_after={}))]
    )
    assert empty.summary().splitlines()[2].split()[-2:] == ["–", "–"]


def test_as_data_it_is_fit_for_json(index: DiagnosisIndex) -> None:
    told = json.loads(json.dumps(index.to_dict(), allow_nan=False))
    assert [entry["recording"] for entry in told["recordings"]] == list(index.table["recording"])
    assert told["recordings"][-1]["fit_before"] is None


def test_it_is_saved_as_table_and_page(index: DiagnosisIndex, tmp_path: Path) -> None:
    assert index.save(str(tmp_path / "out")) == tmp_path / "out"
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"index.csv", "index.html"}
    kept = pd.read_csv(tmp_path / "out" / "index.csv", keep_default_na=False)
    assert list(kept["recording"]) == list(index.table["recording"])
    assert (tmp_path / "out" / "index.html").read_text(encoding="utf-8") == index_html(index)


def test_the_page_counts_links_and_escapes(index: DiagnosisIndex) -> None:
    text = index_html(index)
    counts = "1 unexplained, 2 explained, 1 nothing missing, 1 could not be diagnosed."
    assert f"<b>5 recordings of frigate</b>: {counts}" in text
    assert '<a href="a%20b.csv/r.html">a b.csv</a>' in text
    assert "50.0 → 80.0<br><small>shaft_speed_rad_s</small>" in text
    assert "bad &lt;1&gt;.csv: time_s, row 3" in text
    assert "<small>20..50 s</small>" in text
    assert "Could not be diagnosed" in text
    good = index_html(DiagnosisIndex.of([row("a.csv", "explained")]))
    assert "ould not be diagnosed" not in good
    bad = index_html(DiagnosisIndex.of([BAD]))
    assert "<b>1 recordings</b>: 1 could not be diagnosed." in bad
    assert "FitPercent" not in bad
