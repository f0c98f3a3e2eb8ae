"""The errata: what is said to follow does."""

from __future__ import annotations

import re

import pytest

from reproductions import errata


def test_each_says_what_is_printed_what_shows_it_and_what_is_used() -> None:
    found = errata.errata()
    assert len(found) >= 26
    assert len({(one.source, one.where) for one in found}) == len(found)
    assert {one.source for one in found} <= set(errata.SOURCES)
    for one in found:
        assert all(part.strip() for part in one[:5])


@pytest.mark.parametrize(
    ("where", "numbers"),
    [
        ("Table 2.2, draught", [0.640, 0.832]),
        ("eq. 3.30", [0.490, 2.217]),
        ("chapter 5", [20.4, 32.0, 2.8]),
        ("section 5.1.4", [0.71, 0.91, 0.073]),
        ("Table 3-11, C", [-1.983]),
        ("Table 5, set IV", [2.81, 2.90, 1.35, 2.11, -10.5, -4.5]),
        ("eq. 31", [0.304, 2.626, 0.209, -7.63, 0.105]),
        ("section 5.2", [-7.63, -8.91]),
        ("eq. 5.32", [90.98, 0.328, 9.56]),
        ("Tables 1 and 2", [0.4, -9.2, -9.3]),
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


def test_no_erratum_takes_a_bound_on_the_wave_resistance_for_the_whole() -> None:
    """The optimiser paper says "wave resistance variations (up to 15 %)"; Table 2 is within that."""
    assert not any("15 %" in one.printed + one.shown for one in errata.errata())


def test_the_drive_trains_formulas_by_hand() -> None:
    """Set I of Table 5 at point C of Table 4, written out."""
    constant, ohm, inertia, friction = 1.37e-2, 2.31, 1.72e-5, 1.23e-2
    current, speed = 1.29, 215.0
    efficiency = 1.0 - friction / (constant * current)
    stiffness = 1.0 + constant * speed / (2.0 * efficiency * ohm * current)
    shaft = inertia * speed / (constant * current)
    slow = -2.0 * stiffness * efficiency / shaft
    (one,) = (one for one in errata.errata() if one.where == "eq. 31")
    for number, digits in ((efficiency, 3), (stiffness, 3), (shaft, 3), (slow, 2)):
        assert f"{number:.{digits}f}" in one.shown
    assert f"{-stiffness * efficiency / slow:.3f} s back" in one.shown
