"""Stretches in which an episode of resistance may have been."""

from __future__ import annotations

from typing import Any

import pytest

from shaftline.mismatch.search.catalogue import SizedEffect, Window
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.search.selection import MOST_WINDOWS, find_episodes

from ..toy import FOULING, ROWS, Toy, bands, entry, white


def hull(seed: int, share: float, first: int = 150, end: int = 325) -> Fitter:
    """A resistance that is a share larger between two rows, in noise of 2 % of it."""
    noise = white(seed, 1.0, 0.02 * 1.5e5)
    noise[1, first:end] += share * 1.5e5
    toy: Any = Toy({}, noise)
    return Fitter(toy, bands())


def stretches(fitter: Fitter) -> list[Window]:
    return find_episodes(fitter, fitter.null)


@pytest.mark.parametrize(("first", "end"), [(150, 325), (0, 100), (400, 600)])
def test_the_stretch_of_an_episode_comes_first(first: int, end: int) -> None:
    start, stop = stretches(hull(1, 0.03, first, end))[0]
    assert start == pytest.approx(first, abs=26.0)  # pieces are 25 s long
    assert stop == pytest.approx(end, abs=26.0)


def test_other_stretches_that_stay_are_of_another_place() -> None:
    found = stretches(hull(2, 0.03))
    assert 1 <= len(found) <= MOST_WINDOWS
    for i, (a, b) in enumerate(found):
        for c, d in found[:i]:
            shared = max(0.0, min(b, d) - max(a, c))
            assert shared < 0.6 * (b - a + d - c - shared)


def test_noise_alone_has_few_stretches_and_what_lasts_throughout_is_none() -> None:
    counts = [len(stretches(hull(seed, 0.0))) for seed in range(10, 20)]
    assert sum(counts) <= 10
    for a, b in stretches(hull(3, 0.03, 0, ROWS)):
        assert (a, b) != (0.0, float(ROWS))


def test_what_is_known_to_be_missing_hides_no_episode() -> None:
    """Fouling over the whole voyage, and a tow: the tow stands out beside the fouling alone."""
    noise = white(4, 1.0, 20.0)
    noise[1, 400:500] += 50.0
    toy: Any = Toy({FOULING: 2.0}, noise)
    fitter = Fitter(toy, bands())
    known = fitter.refine_effect(
        fitter.evaluate((SizedEffect(entry("hull-fouling (hull)"), (1.5,)),)), 0
    )
    start, stop = find_episodes(fitter, known)[0]
    assert (start, stop) == pytest.approx((400.0, 500.0), abs=26.0)


def test_without_a_speed_log_there_is_none() -> None:
    fitter = hull(1, 0.03)
    fitter.balances.names = ["engine", "thrust"]
    assert stretches(fitter) == []


@pytest.mark.parametrize("end", [450, 600])
def test_a_stretch_that_meets_held_out_rows_goes_on_to_their_end(end: int) -> None:
    """The fitted rows end at 450 s; whether the episode does as well, they cannot decide."""
    noise = white(5, 1.0, 0.02 * 1.5e5)
    noise[1, 350:end] += 0.03 * 1.5e5
    toy: Any = Toy({}, noise)
    found = stretches(Fitter(toy, bands(450)))
    start, stop = found[0]
    assert start == pytest.approx(350.0, abs=26.0)
    assert stop == float(ROWS)
    assert not any(425.0 < b < ROWS for _, b in found)
