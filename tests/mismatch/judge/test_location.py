"""Change points, windows and regimes, from both sides of their limits."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.location import (
    _correlation,
    active_windows,
    change_points,
    regime,
    segmented,
    windows_between,
)

PER_BLOCK = 4  # rows of 5 s in a block of 20 s


def residual(blocks: Any) -> Any:
    """Rows whose block means are these."""
    return np.repeat(np.asarray(blocks, dtype=float), PER_BLOCK)


def changes(blocks: Any) -> list[float]:
    return [t / 20.0 for t in change_points(residual(blocks), 5.0)]


# -- change points -----------------------------------------------------------------------------


def test_correlation_of_blocks_behind_their_steps() -> None:
    # products of neighbours 2, -2, -2, 2: median 0; squares 1, 4, 1, 4, 1: median 1
    assert _correlation(np.array([1.0, 2.0, -1.0, 2.0, 1.0])) == pytest.approx(0.5)
    # products 3, 3, 6: median 3; squares 1, 9, 1, 36: median 5
    assert _correlation(np.array([1.0, 3.0, 1.0, 6.0])) == pytest.approx(3.0 / 5.0 + 0.5)
    assert _correlation(np.zeros(8)) == 0.0


def stepped(pattern: list[float], count: int, gain: float) -> Any:
    """A pattern that is lifted halfway, so that cutting it there explains a given sum of squares."""
    blocks = np.resize(np.array(pattern), count)
    return blocks + np.where(np.arange(count) < count // 2, 0.0, math.sqrt(gain / (count / 4.0)))


# mean size of a step, and its scale as a normal variable's: (1.4826 |step|)^2 / 2
WHITE = [1.0, -1.0]  # neighbours oppose each other: correlation below 0, counted as none
TRIANGLE = [0.0, 1.0, 2.0, 1.0, 0.0, -1.0, -2.0, -1.0]  # neighbours follow: 1 + 2 (1 + 1/2) = 4


@pytest.mark.parametrize(
    ("pattern", "step", "correlation"), [(WHITE, 2.0, 1.0), (TRIANGLE, 1.0, 4.0)]
)
def test_a_change_must_pay_three_ln_n_of_the_long_run_variance(
    pattern: list[float], step: float, correlation: float
) -> None:
    count = 48
    penalty = 3.0 * math.log(count) * (1.4826 * step) ** 2 / 2.0 * correlation
    assert changes(stepped(pattern, count, 1.08 * penalty)) == [24.0]
    assert changes(stepped(pattern, count, 0.92 * penalty)) == []


# steps 1, 1, 1/2, -1, -1, -1/2: median of the squares 1, of neighbours' products 1/2
SLOWER = [0.0, 1.0, 2.0, 2.5, 1.5, 0.5]


@pytest.mark.parametrize(
    ("pattern", "step", "correlation"),
    [(WHITE, 2.0, 1.0), (SLOWER, 1.0, 1.0 + 2.0 * (0.5 + 0.5)), (TRIANGLE, 1.0, 4.0)],
)
def test_the_penalty_is_told_to_the_search(
    monkeypatch: pytest.MonkeyPatch, pattern: list[float], step: float, correlation: float
) -> None:
    asked = []

    def spied(values: Any, penalty: float) -> Any:
        asked.append(penalty)
        return segmented(values, penalty)

    monkeypatch.setattr("shaftline.mismatch.judge.location.segmented", spied)
    changes(np.resize(pattern, 60))
    variance = (1.4826 * step) ** 2 / 2.0
    assert asked == [pytest.approx(3.0 * math.log(60) * variance * correlation)]
    asked.clear()
    changes(np.resize(pattern, 48) + np.repeat(100.0 * np.arange(8), 6))  # seven are too many
    assert asked[1:] == pytest.approx([1.5 * penalty for penalty in asked[:-1]])


def test_stretches_are_those_of_least_cost() -> None:
    """Against every way to cut eleven values into stretches of two or more."""
    values = np.random.default_rng(4).standard_normal(11) + np.repeat([0.0, 2.0, -1.0], [4, 3, 4])

    def cost(cuts: tuple[int, ...], penalty: float) -> float:
        parts = np.split(values, cuts)
        if min(map(len, parts)) < 2:
            return math.inf
        return sum(float(np.sum((p - p.mean()) ** 2)) + penalty for p in parts)

    for penalty in (0.3, 1.0, 3.0, 100.0):
        ways = [w for k in range(6) for w in itertools.combinations(range(1, 11), k)]
        best = min(ways, key=lambda cuts, penalty=penalty: cost(cuts, penalty))  # type: ignore[misc]
        assert segmented(values, penalty) == list(best)


def test_few_blocks_or_none_that_move_have_no_changes() -> None:
    assert changes([0.0, 0.1, 0.0, 9.0, 9.1]) == []
    assert len(changes([0.0, 0.1, 0.0, 9.0, 9.1, 9.0])) == 1
    assert changes([1.0] * 20 + [1.0] * 20) == []
    # rows beyond the last whole block are left out
    assert change_points(np.append(residual([0.0, 0.1, 0.0, 9.0, 9.1, 9.0]), 1e9), 5.0) == [60.0]


def test_at_most_five_changes_are_told() -> None:
    blocks = np.resize([1.0, -1.0], 120) * 0.01 + np.repeat(np.arange(12) % 2, 10) * 5.0
    assert len(changes(blocks + np.repeat(np.arange(12), 10) * 0.5)) <= 5
    assert changes(np.resize([1.0, -1.0], 60) * 0.01 + np.repeat(np.arange(6) % 2, 10)) == [
        10.0, 20.0, 30.0, 40.0, 50.0,
    ]  # fmt: skip


def test_white_noise_has_no_changes_and_a_step_two() -> None:
    rng = np.random.default_rng(0)
    assert change_points(rng.standard_normal(6000), 0.1) == []
    trace = np.zeros(6000)
    trace[2000:3000] = 5.0
    found = change_points(trace + rng.standard_normal(6000), 0.1)
    assert found == pytest.approx([200.0, 300.0], abs=20.0)


# -- windows -----------------------------------------------------------------------------------


def test_windows_lie_between_any_two_changes() -> None:
    assert windows_between([], 90.0) == []
    assert windows_between([20.0, 50.0], 90.0) == [
        (0.0, 20.0), (0.0, 50.0), (20.0, 50.0), (20.0, 90.0), (50.0, 90.0),
    ]  # fmt: skip
    assert windows_between([20.0, 20.0], 90.0) == [
        (0.0, 20.0),
        (0.0, 20.0),
        (20.0, 90.0),
        (20.0, 90.0),
    ]


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
