"""The errata: what is said to follow does."""

from __future__ import annotations

import re

import pytest

from shaftline.studies import errata


def test_each_says_what_is_printed_what_shows_it_and_what_is_used() -> None:
    found = errata.errata()
    assert len(found) >= 27
    assert len({(one.source, one.where) for one in found}) == len(found)
    assert {one.source for one in found} <= set(errata.SOURCES)
    for one in found:
        assert all(part.strip() for part in one)


@pytest.mark.parametrize(
    ("where", "numbers"),
    [
        ("Table 2.2, draught", [0.640, 0.832]),
        ("eq. 3.30", [0.490, 2.217]),
        ("chapter 5", [43.0]),
        ("section 5.1.4", [0.71, 0.91, 0.073]),
        ("Table 3-11, C", [-1.983]),
        ("Table 5, set IV", [2.14, 1.35, 2.11]),
        ("text beside Table 1", [22.8]),
    ],
)
def test_what_follows(where: str, numbers: list[float]) -> None:
    (one,) = (one for one in errata.errata() if one.where.startswith(where))
    shown = [float(text) for text in re.findall(r"-?\d+\.?\d*", one.shown)]
    for number in numbers:
        assert any(number == pytest.approx(value, abs=1e-9) for value in shown), one.shown


def test_the_printed_loop_is_unstable() -> None:
    (one,) = (one for one in errata.errata() if one.where == "eq. 5.32")
    assert "unstable" in one.shown
