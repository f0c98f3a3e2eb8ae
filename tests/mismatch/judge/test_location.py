"""Windows and regimes, from both sides of their limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.verdict import active_windows, regime

# -- windows -----------------------------------------------------------------------------------


def trace(*stretches: tuple[int, int, float]) -> Any:
    found = np.zeros(2000)
    for first, end, size in stretches:
        found[first:end] = size
    return found


def test_an_effect_acts_where_a_tenth_of_it_is_felt() -> None:
    # means over 5 s: the ends of a stretch reach 2 s beyond and a tenth is felt from there
    strong = (200, 400, -10.0)
    assert active_windows(trace(strong), 1.0, 2000.0) == [(198.0, 402.0)]
    assert active_windows(trace(strong, (800, 900, 1.01)), 1.0, 2000.0) == [
        (198.0, 402.0),
        (802.0, 898.0),  # only where all five rows are in it
    ]
    assert active_windows(trace(strong, (800, 900, 0.99)), 1.0, 2000.0) == [(198.0, 402.0)]


def test_stretches_that_nearly_touch_are_one() -> None:
    near = trace((200, 400, 5.0), (423, 500, 5.0))  # 4 of the 23 s between are blurred
    apart = trace((200, 400, 5.0), (424, 500, 5.0))
    assert active_windows(near, 1.0, 2000.0) == [(198.0, 502.0)]
    assert active_windows(apart, 1.0, 2000.0) == [(198.0, 402.0), (422.0, 502.0)]


def test_gaps_and_means_are_told_in_seconds() -> None:
    # two rows a second: of 23 s between, 19 are left after the means over 5 s; of 27, 23
    found = active_windows(trace((200, 400, 5.0), (446, 800, 5.0)), 0.5, 1000.0)
    assert found == [pytest.approx((100.0, 400.0), abs=2.5)]
    apart = active_windows(trace((200, 400, 5.0), (454, 800, 5.0)), 0.5, 1000.0)
    assert apart == [
        pytest.approx((100.0, 200.0), abs=2.5),
        pytest.approx((227.0, 400.0), abs=2.5),
    ]


def test_what_acts_most_of_the_time_acts_always() -> None:
    assert active_windows(trace((0, 1190, 5.0)), 1.0, 2000.0) == [(0.0, 1192.0)]
    assert active_windows(trace((0, 1210, 5.0)), 1.0, 2000.0) == [(0.0, 2000.0)]
    assert active_windows(trace(), 1.0, 2000.0) == []


def test_windows_end_with_the_recording() -> None:
    late = trace((1900, 2000, 5.0))
    assert active_windows(late, 1.0, 1999.0) == [(1898.0, 1999.0)]


# -- regimes -----------------------------------------------------------------------------------

SPEED = np.linspace(5.0, 15.0, 1001)


@pytest.mark.parametrize(
    ("where", "words"),
    [
        (SPEED > 13.5, "shaft_speed above 13 rad/s"),  # the best of three shares: a fifth
        (SPEED < 6.5, "shaft_speed below 7 rad/s"),
        (SPEED > 12.0, "shaft_speed above 11.5 rad/s"),
        (SPEED > 10.5, "shaft_speed above 10 rad/s"),
        (SPEED > 5.5, ""),  # nearly everywhere
    ],
)
def test_a_regime_holds_most_of_the_effect(where: Any, words: str) -> None:
    assert regime(np.where(where, 1.0, 0.0), {"shaft_speed": (SPEED, "rad/s")}) == words


def shared(upper: Any, share: float) -> Any:
    """An effect of which a share of its energy acts in one place, the rest at the lowest speeds."""
    lower = SPEED < 6.0
    return np.where(
        upper,
        math.sqrt(share / upper.sum()),
        np.where(lower, math.sqrt((1 - share) / lower.sum()), 0.0),
    )


@pytest.mark.parametrize(("share", "words"), [(0.81, "v above 13 m/s"), (0.79, "")])
def test_four_fifths_must_lie_in_a_regime(share: float, words: str) -> None:
    assert regime(shared(SPEED > 14.0, share), {"v": (SPEED, "m/s")}) == words


@pytest.mark.parametrize(("share", "words"), [(0.86, "v above 10 m/s"), (0.84, "")])
def test_a_regime_must_hold_more_than_its_share_of_time(share: float, words: str) -> None:
    middle = (SPEED > 10.0) & (SPEED < 11.0)  # half of the time lies above
    assert regime(shared(middle, share), {"v": (SPEED, "m/s")}) == words


def test_a_level_belongs_to_its_regime() -> None:
    levels = np.repeat([5.0, 6.0], 500)
    assert regime(np.where(levels == 5.0, 1.0, 0.0), {"v": (levels, "m/s")}) == "v below 5 m/s"
    assert regime(np.where(levels == 6.0, 1.0, 0.0), {"v": (levels, "m/s")}) == "v above 6 m/s"


def test_signals_that_rest_and_the_clock_have_no_regimes() -> None:
    late = np.where(np.arange(1001) > 800, 1.0, 0.0)
    time = np.arange(1001.0)
    assert regime(late, {"time": (time, "s")}) == ""
    assert regime(late, {"pitch_ratio": (1.2 + 1e-6 * time, "")}) == ""
    assert regime(late, {"pitch_ratio": (1.2 + 1e-5 * time, "")}) == "pitch_ratio above 1.21"
    assert regime(np.zeros(1001), {"v": (SPEED, "m/s")}) == ""


def test_the_sharpest_of_several_regimes_is_told() -> None:
    late = np.where(SPEED > 13.0, 1.0, 0.0)
    other = np.random.default_rng(0).permutation(SPEED)
    signals = {"a": (other, "m"), "v": (SPEED, "m/s"), "b": (SPEED**2, "m2/s2")}
    assert regime(late, signals) == "v above 13 m/s"
