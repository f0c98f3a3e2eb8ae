"""Published designs of experiments: their numbers, the criteria, and what an experiment decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy

from reproductions.trial_design import bioreactor, reactor
from reproductions.trial_design.bioreactor import HOURS, LAWS, TRUE, TRUTH
from reproductions.trial_design.criteria import (
    PLANNER,
    PUBLISHED,
    largest_differences,
    wrong_choice,
)
from reproductions.trial_design.page import (
    STARTS,
    Cell,
    better_starts,
    cells_of,
    discordant_table,
    vessel_table,
    voyage_table,
)
from shaftline.mismatch.planning.evidence import Noise, Predictions


def test_the_information_of_the_reactor_is_the_published_one() -> None:
    """The published tests round to two decimals; more digits follow from the same collocation."""
    for one in reactor.printed_numbers():
        digits = 2 if one.published in (2.96, 1.84) else 3
        assert one.ours == pytest.approx(one.published, abs=0.6 * 10.0**-digits), one.figure


def test_the_reactor_follows_its_equations_at_constant_temperature() -> None:
    """Closed form of A -> B -> C at 400 K."""
    parameters = np.array([*reactor.NOMINAL.values()])
    found = reactor.concentrations(5.0, np.full(9, 400.0), parameters)
    k1, k2 = parameters[:2] * np.exp(-parameters[2:] / (reactor.GAS_CONSTANT * 400.0))
    a = 5.0 * np.exp(-k1 * reactor.TIMES)
    b = 5.0 * k1 / (k2 - k1) * (np.exp(-k1 * reactor.TIMES) - np.exp(-k2 * reactor.TIMES))
    np.testing.assert_allclose(found, [a, b, 5.0 - a - b], atol=3e-4)


def test_the_planner_finds_the_published_optimum() -> None:
    design = reactor.planned()
    assert design.start == 5.0
    assert design.temperatures == pytest.approx([580.0] + [300.0] * 8)
    assert design.log10_det == pytest.approx(reactor.PUBLISHED[-1][-1], abs=2e-5)


def test_the_merit_of_one_model_grows_with_the_determinant() -> None:
    """The planner's merit is the gain of log det over the prior, times a constant."""
    designs = [np.array([first] + [300.0] * 8) for first in (400.0, 500.0, 579.2, 700.0)]
    merits = [reactor.merit_of(5.0, design) for design in designs]
    gains = [reactor.log10_det(5.0, design) for design in designs]
    assert np.argsort(merits).tolist() == np.argsort(gains).tolist()
    assert max(merits) == merits[2]


def predictions(own: Any, effects: Any = (), owners: Any = ()) -> Predictions:
    values = np.array(own, dtype=float)[:, None]
    none = np.zeros((0, *values.shape[1:]))
    slopes = np.array(effects, dtype=float)[:, None] if len(effects) else none
    return Predictions(
        values, none, np.zeros(0, dtype=bool), slopes, np.array(owners, dtype=np.int64)
    )


def test_the_published_criterion_is_the_mean_of_the_largest_squared_differences() -> None:
    three = predictions([[0.0, 0.0], [1.0, -2.0], [0.0, 4.0]])
    assert largest_differences(three, [Noise(1.0)]) == pytest.approx((4.0 + 16.0 + 36.0) / 3.0)
    assert largest_differences(three, [Noise(2.0)]) == pytest.approx((4.0 + 16.0 + 36.0) / 12.0)


def test_only_the_planner_sees_that_a_rival_can_follow() -> None:
    """The second model may change its own parameter by much: the difference decides nothing."""
    fixed = predictions([[0.0, 0.0], [3.0, 3.0]])
    free = predictions([[0.0, 0.0], [3.0, 3.0]], [[100.0, 100.0]], [1])
    noise = [Noise(1.0)]
    assert largest_differences(fixed, noise) == largest_differences(free, noise) == 9.0
    assert wrong_choice(fixed, noise) > wrong_choice(free, noise)


def test_the_bioreactor_follows_its_equations() -> None:
    """Monod's law with a feed, against another integrator; the substrate is eaten without a feed."""
    feed = np.array([0.0, 2.0, 5.0] + [1.0] * (HOURS - 3))

    def slope(t: float, state: Any) -> list[float]:
        s, x, v = state
        rate, q = TRUE[0] * s / (TRUE[1] + s) * x, feed[min(int(t), HOURS - 1)]
        return [
            -rate / bioreactor.YIELD + q / v * (bioreactor.FEED_SUBSTRATE - s),
            rate - q / v * x,
            q,
        ]

    state, expected = np.array(bioreactor.START), [bioreactor.START[0]]
    for hour in range(HOURS):
        solved = scipy.integrate.solve_ivp(
            slope, (hour, hour + 1 - 1e-12), state, rtol=1e-9, atol=1e-12
        )
        state = solved.y[:, -1]
        expected.append(state[0])
    found = bioreactor._substrate(TRUTH, TRUE, feed)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def test_a_law_is_fitted_to_what_it_made() -> None:
    feed = np.full(HOURS, 2.0)
    measured = bioreactor._substrate(TRUTH, TRUE, feed)
    found = bioreactor.fit(TRUTH, [feed], [measured], 0.1)
    np.testing.assert_allclose(np.exp(found.logs), TRUE, rtol=0.02)
    wrong = bioreactor.fit(2, [feed], [measured], 0.1)
    assert wrong.lack > found.lack + bioreactor.ALIKE
    assert [LAWS[one.law].name for one in bioreactor.plausible([wrong, found])] == ["Monod"]


def test_outcomes_are_counted_by_noise_and_way() -> None:
    def outcome(alone: bool) -> dict[str, Any]:
        return {"left": ["Monod"] if alone else ["Monod", "Tessier"], "right": True, "alone": alone}

    cells = cells_of(1, 2)
    assert len(cells) == 4 + 4 * STARTS
    assert len({cell.name for cell in cells}) == len(cells)
    trial = {"least": 4.0, "decided": 1, "pairs": 2, "wrong": 0.1}
    vessel = {
        "known": 9,
        "random": outcome(False),
        PLANNER: outcome(True),
        PUBLISHED: outcome(False),
    }
    voyage = {
        "random": trial,
        PLANNER: trial | {"least": 8.0, "wrong": 0.01},
        PUBLISHED: trial,
    }
    found = [voyage if cell.question else vessel for cell in cells]
    counts = discordant_table(cells, found).set_index(["noise [g/L]", "success"])
    alone = counts.loc[(bioreactor.NOISES[0], "true law alone")].tolist()
    assert alone == pytest.approx([2, 0, 0.5])
    assert counts.loc[(bioreactor.NOISES[0], "true law best")].tolist() == [0, 0, 1.0]
    assert better_starts(cells, found) == (4 * STARTS, 4 * STARTS)
    table = vessel_table(cells, found).set_index(["noise [g/L]", "feed chosen by"])
    assert table.loc[(bioreactor.NOISES[1], PLANNER), "true law alone (95 %)"].startswith("1.00")
    assert table.loc[(bioreactor.NOISES[1], PUBLISHED), "laws left by both"] == 2.0
    trials = voyage_table(cells, found).set_index(["question", "trial chosen by"])
    assert trials.loc[("pitch", PLANNER), "closest pair, median"] == 8.0
    assert trials.loc[("pitch", "random"), "pairs decided"] == f"{STARTS} of {2 * STARTS}"
    assert trials.loc[("pitch", PUBLISHED), "wrong choice, median of the bound"] == "1.0e-01"
    assert Cell("", 0.1, 1).name != Cell("pitch", 0.0, 1).name
