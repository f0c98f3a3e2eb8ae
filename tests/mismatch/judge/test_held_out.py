"""What is set aside, and what it says of a model."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.held_out import HeldOut, bands_of, split_held_out
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.spectra import Likelihood
from shaftline.mismatch.simulate.balances import Balances, tolerance_perturbations
from shaftline.mismatch.simulate.joint_replay import JointReplay

from ..toy import FRICTION, ROWS, entry, fitter, white
from ..turning import quick_tanker, swinging


def replay(demand: Any, command: Any = None, segments: Any = None) -> Any:
    demand = np.asarray(demand, dtype=float)
    still = np.full(len(demand), 1.2)
    return SimpleNamespace(
        drive_rows=demand,
        command=still if command is None else np.asarray(command, dtype=float),
        rudder_rows=np.zeros(len(demand)),
        segments=segments or [(0, len(demand))],
    )


def first_choice(demand: Any, command: Any = None, segments: Any = None) -> tuple[Any, Any]:
    return split_held_out(replay(demand, command, segments), 0)[0]


EVEN = np.tile(np.linspace(0.0, 1.0, 50), 8)  # each quarter covers all of the range


def test_the_last_quarter_is_set_aside_where_all_are_alike() -> None:
    assert first_choice(EVEN) == ([(0, 300)], [(300, 400)])


def test_each_quarter_is_set_aside_in_turn() -> None:
    ways = split_held_out(replay(EVEN), 0)
    assert ways[0][1] == [(300, 400)]
    assert sorted(held for _, held in ways) == [[(a, a + 100)] for a in (0, 100, 200, 300)]
    fitted = {held[0][0]: train for train, held in ways}
    assert fitted[0] == [(100, 400)]
    assert fitted[100] == [(0, 100), (200, 400)]


def quarters(*spans: float) -> Any:
    """A demand that moves over a share of its range in each quarter; in the first over all of it."""
    return np.concatenate([np.tile(np.linspace(0.0, span, 50), 2) for span in spans])


@pytest.mark.parametrize(("last", "start"), [(0.72, 300), (0.68, 0)])
def test_another_quarter_must_cover_the_demands_clearly_better(last: float, start: int) -> None:
    # of the demand's middle nine tenths the first quarter covers 0.966, the last 0.845 or 0.797
    assert first_choice(quarters(1.0, 0.2, 0.2, last))[1] == [(start, start + 100)]
    # what moves not at all does not count, what moves counts alike
    both = quarters(1.0, 0.2, 0.2, last)
    assert first_choice(both, 1.0 + 0.1 * both)[1] == [(start, start + 100)]
    assert first_choice(np.full(400, 20.0))[1] == [(300, 400)]


def test_a_recording_that_hardly_moves_is_not_held_out() -> None:
    """The others cover the range without it, but it cannot judge a model."""
    part = np.linspace(0.0, 1.0, 100)
    demand = np.concatenate([part, 0.5 + 0.1 * part, 0.95 * part])
    segments = [(0, 100), (100, 200), (200, 300)]
    assert [held for _, held in split_held_out(replay(demand, None, segments), 0)] == [
        [(200, 300)],
        [(0, 100)],
    ]


def test_the_only_quarter_that_moves_is_not_held_out() -> None:
    """Where the others move by 0.4 of the range, the quarter that covers the range is held out."""
    ways = split_held_out(replay(quarters(1.0, 0.0, 0.0, 0.0)), 0)
    assert sorted(held for _, held in ways) == [[(a, a + 100)] for a in (100, 200, 300)]
    assert first_choice(quarters(1.0, 0.2, 0.2, 0.2))[1] == [(300, 400)]
    assert first_choice(quarters(1.0, 0.4, 0.4, 0.4))[1] == [(0, 100)]


def test_of_two_recordings_the_longer_is_parted() -> None:
    segments = [(0, 100), (100, 500)]
    train, held = first_choice(np.tile(np.linspace(0.0, 1.0, 50), 10), None, segments)
    assert held == [(400, 500)]
    assert train == [(0, 100), (100, 400)]


def test_of_a_long_steady_recording_and_a_lively_one_the_lively_one_is_parted() -> None:
    """A steady part judges no model."""
    lively = quarters(1.0, 1.0, 1.0, 1.0)
    demand = np.concatenate([np.full(900, 0.5), lively])
    train, held = first_choice(demand, None, [(0, 900), (900, 1300)])
    assert held == [(1200, 1300)]
    assert train == [(0, 900), (900, 1200)]


def test_of_three_the_one_is_set_aside_without_which_the_rest_covers_most() -> None:
    segments = [(0, 100), (100, 200), (200, 300)]
    part = np.linspace(0.0, 1.0, 100)
    # only the second reaches the upper half; of the others the third covers more itself
    demand = np.concatenate([0.3 * part, part, 0.5 * part])
    ways = split_held_out(replay(demand, None, segments), 0)
    assert ways[0] == ([(0, 100), (100, 200)], [(200, 300)])
    assert [held for _, held in ways[1:]] == [[(0, 100)], [(100, 200)]]


def test_of_alike_recordings_the_last_is_set_aside_and_of_six_two() -> None:
    segments = [(100 * i, 100 * i + 100) for i in range(6)]
    demand = np.tile(np.linspace(0.0, 1.0, 50), 12)
    assert first_choice(demand, None, segments)[1] == [(400, 500), (500, 600)]
    assert first_choice(demand[:400], None, segments[:4])[1] == [(300, 400)]


def test_half_of_everything_is_not_set_aside() -> None:
    segments = [(0, 100), (100, 500), (500, 600)]
    ways = split_held_out(replay(np.tile(np.linspace(0.0, 1.0, 50), 12), None, segments), 0)
    assert [held for _, held in ways] == [[(500, 600)], [(0, 100)]]


def test_whole_recordings_are_set_aside_where_the_user_says_so() -> None:
    segments = [(0, 100), (100, 500), (500, 600)]
    both = replay(np.zeros(600), None, segments)
    assert split_held_out(both, 1) == [([(0, 100), (100, 500)], [(500, 600)])]
    assert split_held_out(both, 2) == [([(0, 100)], [(100, 500), (500, 600)])]


def test_crumbs_are_not_fitted() -> None:
    demand = np.tile(np.linspace(0.0, 1.0, 20), 4)
    ways = split_held_out(replay(demand), 0)
    assert {held[0]: train for train, held in ways}[(20, 40)] == [(40, 80)]  # not the first 20 rows
    longer = split_held_out(replay(np.tile(np.linspace(0.0, 1.0, 21), 4)), 0)
    assert {held[0]: train for train, held in longer}[(21, 42)] == [(0, 21), (42, 84)]


def test_bands_reach_four_fifths_of_nyquist_s_frequency() -> None:
    balances: Any = SimpleNamespace(
        replay=SimpleNamespace(interval_s=0.2, ship=SimpleNamespace(turns=False)),
        names=["engine", "propeller", "hull"],
    )
    found = bands_of(balances, [(0, 1000)])
    assert found.frequency_Hz[-1] == pytest.approx(2.0)
    assert found.edges[1] == 9  # three times the balances
    assert (found.starts, found.ends) == ((0,), (1000,))


def test_bands_of_a_ship_that_turns_hold_more_than_her_many_numbers_explain() -> None:
    """Nine frequencies of three balances are explained perfectly by 14 numbers of her file."""
    balances = Balances(JointReplay(quick_tanker(), swinging(quick_tanker(), seconds=120.0)))
    free = len(list(tolerance_perturbations(balances.replay)))
    assert free >= 14
    assert bands_of(balances, [(0, 600)]).edges[1] == free + 4


def test_a_rudder_that_moves_in_a_quarter_is_not_set_aside_with_it() -> None:
    still: Any = replay(np.ones(400))
    rows = np.arange(400)
    still.rudder_rows = np.where(rows < 300, 0.0, 0.4 * np.sin(rows))
    assert [(300, 400)] not in [held for _, held in split_held_out(still, 0)]
    still.rudder_rows[rows < 100] = 0.3 * np.sin(rows[:100])
    assert split_held_out(still, 0)[0][1] == [
        (300, 400)
    ]  # the quarter that covers most of the range


def test_the_part_set_aside_is_judged_alone() -> None:
    fit = fitter({FRICTION: 6000.0})
    judge = HeldOut(fit, [(300, ROWS)])
    grid = bands_of(fit.balances, [(300, ROWS)])
    scores = []
    for value in (0.0, 6000.0):
        placed = SizedEffect(entry("coulomb-friction (engine)"), (value,))
        record = fit.trial_ship.record((placed,))
        replayed = fit.balances.replay.simulate(record)
        lacking = fit.balances.residuals_against(fit.balances.replay.simulated(replayed))
        left = grid.transform(lacking)
        by_hand = Likelihood(grid, np.zeros((1, *left.shape), complex))(left).score
        assert judge(record) == pytest.approx(by_hand)
        scores.append(by_hand)
    assert scores[1] > scores[0] + 100.0
    noise = grid.transform(white(0, 0.5, 2.0))
    assert scores[1] == pytest.approx(
        Likelihood(grid, np.zeros((1, *noise.shape), complex))(noise).score
    )


@pytest.mark.parametrize(
    ("column", "level", "off", "lost"),
    [
        ("shaft_torque_N_m", 1e5, 0.26, True),
        ("shaft_torque_N_m", 1e5, 0.24, False),
        ("shaft_torque_N_m", 0.12, 1e6, True),
        ("yaw_rate_rad_s", 1e-3, 9.0, False),
        ("shaft_angle_rad", 10.0, 9.0, False),
    ],
)
def test_a_model_that_loses_a_channel_is_refuted(
    column: str, level: float, off: float, lost: bool
) -> None:
    """Waves of the channel's own size are in the recording and not in the simulation."""
    fit = fitter({FRICTION: 6000.0})
    toy: Any = fit.balances.replay
    waves = 0.9 * level * np.sin(2.0 * np.pi * np.arange(ROWS) / 8.25)
    toy.recorded = {column: level + waves}
    simulated = toy.simulated
    toy.simulated = lambda samples: simulated(samples) | {column: np.full(ROWS, level)}
    judge = HeldOut(fit, [(300, ROWS)])
    chosen = fit.evaluate((SizedEffect(entry("coulomb-friction (engine)"), (6000.0,)),))
    size = float(np.sqrt(np.mean(toy.recorded[column][300:] ** 2)))
    assert np.isfinite(judge.score(chosen))
    toy.simulated = lambda samples: simulated(samples) | {column: np.full(ROWS, level + off * size)}
    assert judge.lost_channels(chosen) == ([column] if lost else [])
    assert np.isneginf(judge.score(chosen)) == lost
    assert np.isfinite(judge.score(fit.null))
