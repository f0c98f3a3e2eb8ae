"""Coverage of intervals: rows of the page, and right and narrow intervals."""

from __future__ import annotations

from pathlib import Path

import pytest

from reproductions import intervals


def test_coverage_is_counted_for_every_distribution_and_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(intervals, "COUNTS", (4, 20))
    monkeypatch.setattr(intervals, "TRAININGS", ((5, 20),))
    monkeypatch.setattr(intervals, "_LARGE", 10_000)
    intervals.main(["--out", str(tmp_path), "--repeats", "100"])
    rows = list(intervals.coverage_by_episodes(100))
    assert len(rows) == 2 * len(intervals.DISTRIBUTIONS)
    few = [row for row in rows if row["episodes"] == 4]
    narrow, stretched = (
        sum(float(str(row[name])) for row in few) for name in ("bootstrap", "stretched")
    )
    assert narrow / len(few) < 90.0 < stretched / len(few)
    page = (tmp_path / "intervals.md").read_text()
    assert page.count("| two peaks") == 2
    assert page.count("| 5 | 20 |") == len(intervals.SHARES)
    assert (tmp_path / "intervals.csv").is_file()
