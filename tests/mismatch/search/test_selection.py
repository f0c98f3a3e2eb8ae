"""The search's own arithmetic, on models whose scores are given."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from shaftline.mismatch import Effect
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.fitting import Fit
from shaftline.mismatch.search.selection import (
    CALIBRATION,
    REFINED,
    RISK,
    Calibration,
    Selector,
    chance_bound,
    p_value,
    threshold,
)
from shaftline.mismatch.search.spectra import chance_gain

from ..toy import entry

DEAD_TIME = entry("engine-dead-time (engine)")
LAG = entry("engine-torque-lag (engine)")
FOULING = entry("hull-fouling (hull)")
CURRENT = entry("current (hull)")
EPISODE = entry("resistance-episode (hull)")
BEND = entry("engine-torque-curvature (engine)")
DERATING = entry("engine-derating (engine)")


class Scores:
    """Stands for the fitter: what each set of effects is worth, and how much refining adds."""

    def __init__(self, worth: dict[Any, float], refining: float = 0.0) -> None:
        self.worth = {frozenset(k if isinstance(k, tuple) else (k,)): v for k, v in worth.items()}
        self.worth.setdefault(frozenset(), 0.0)
        self.refining = refining
        self.trial_ship = SimpleNamespace(
            trials=self._trials,
            smallest_trials=self._smallest,
            record=lambda effects: effects,
            nominal=(),
            ship=SimpleNamespace(turns=False),
        )
        self.null = self.evaluate(())
        self.refined_labels: list[str] = []
        self.jointly: list[tuple[str, ...]] = []
        self.evaluations: list[int] = []

    def _trials(self, effect: Effect, windows: Any) -> Any:
        yield SizedEffect(effect, (1.0,))
        yield SizedEffect(effect, (2.0,))

    def _smallest(self, effect: Effect, windows: Any) -> Any:
        yield SizedEffect(effect, (1.0,))

    def scale_effect(self, base: Any, placed: SizedEffect) -> SizedEffect | None:
        return None

    def score(self, effects: tuple[SizedEffect, ...]) -> float:
        """A probe of 1 is worth half of what one of 2 is."""
        names = frozenset(p.effect.label for p in effects)
        if names not in self.worth:
            return sum(self.score((p,)) for p in effects)
        half = any(p.values[0] == 1.0 for p in effects)
        return self.worth[names] * (0.5 if half else 1.0)

    def increases_residual(self, fit: Any) -> bool:
        """Nothing is too bad here."""
        return False

    def polish(self, fit: Any) -> Any:
        """What is refined is the best already."""
        return fit

    def predict(self, effects: Any) -> Any:
        """A single number: the score."""
        return np.array([complex(self.score(effects))])

    def predictions(self, records: Any) -> Any:
        """A single number of each: the score."""
        return map(self.predict, records)

    def simulate_ahead(self, records: Any) -> None:
        """Nothing is simulated here."""

    def evaluate(self, effects: tuple[SizedEffect, ...]) -> Any:
        return fit_of(effects, self.score(effects))

    def evaluate_models(self, models: Any) -> Any:
        return map(self.evaluate, models)

    def refine_effect(self, fit: Any, which: int) -> Any:
        self.refined_labels.append(fit.effects[which].effect.label)
        better = fit.score + self.refining
        return fit_of(fit.effects, better)

    def refine_effects(self, fit: Any, evaluations: int = 90) -> Any:
        self.jointly.append(tuple(p.effect.label for p in fit.effects))
        self.evaluations.append(evaluations)
        return fit


def fit_of(effects: tuple[SizedEffect, ...], score: float) -> Fit:
    """Return a fit with a difference of one balance at one frequency."""
    nothing = np.zeros((1, 1), np.complex128)
    return Fit(effects, score, nothing, np.zeros(0), nothing)


@pytest.fixture(autouse=True)
def straight_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a probe of 1 moves tells what one of 2 is worth, and there are no episodes."""
    line = SimpleNamespace(amount=lambda *told: (2.0, 2.0 * told[-1].real[0]))
    there = "shaftline.mismatch.search.selection"
    monkeypatch.setattr(f"{there}.likelihood_with_free_effects", lambda fitter, fit: line)
    monkeypatch.setattr(f"{there}.find_episodes", lambda fitter, fit: [(0.0, 9.0)])


def selector(scores: Scores, *effects: Effect) -> Selector:
    return Selector(scores, list(effects), lambda *_: None)  # type: ignore[arg-type]


def test_the_threshold_is_what_chance_reaches_once_in_a_hundred() -> None:
    search = selector(Scores({}), LAG, EPISODE, BEND)
    for effect, freedom in ((LAG, 1), (BEND, 2)):
        assert search.threshold(effect) == pytest.approx(1.5 * chi2.isf(0.01 / 3.0, freedom))
    # a window is two parameters more, and 299 stretches were scanned for it
    assert search.threshold(EPISODE) == pytest.approx(1.5 * chi2.isf(0.01 / 302.0, 3))


def test_a_screen_ranks_by_what_exceeds_the_threshold() -> None:
    limit = chance_gain(2, 3, 0.01) - chance_gain(1, 3, 0.01)
    scores = Scores({BEND.label: 300.0 + 0.9 * limit, LAG.label: 300.0, FOULING.label: 40.0})
    told = []
    search = selector(scores, FOULING, BEND, LAG)
    search.tick = lambda *said: told.append(said)
    found = search.screen(scores.null, "screening")
    assert [c.effect for c in found] == [LAG, BEND, FOULING]  # one parameter more has its price
    assert found[0].gain == 300.0
    assert found[0].sized_effect == SizedEffect(LAG, (2.0,))  # the better of its probes
    assert told == [("screening", i, 3) for i in range(4)]


def test_what_is_named_is_not_tried_again_in_its_balance() -> None:
    scores = Scores({LAG.label: 300.0, FOULING.label: 40.0})
    base = scores.evaluate((SizedEffect(LAG, (2.0,)),))
    assert [c.effect for c in selector(scores, LAG, FOULING).screen(base, "")] == [FOULING]


@pytest.mark.parametrize(("second", "tried"), [(31.0, [FOULING]), (29.0, [])])
def test_on_top_of_others_only_what_may_gain_is_tried(second: float, tried: list[Effect]) -> None:
    scores = Scores({LAG.label: 400.0, CURRENT.label: 300.0, FOULING.label: second})
    search = selector(scores, LAG, CURRENT, FOULING)
    base: Any = scores.evaluate((SizedEffect(LAG, (2.0,)),))
    assert [c.effect for c in search.screen(base, "")] == [CURRENT, *tried]  # a tenth of the best
    alone = selector(scores, LAG, FOULING)
    hope = 0.3 * alone.threshold(FOULING)
    for gain, names in ((1.01 * hope, [FOULING]), (0.99 * hope, [])):
        poor = Scores({LAG.label: 400.0, FOULING.label: gain})
        found = selector(poor, LAG, FOULING).screen(base, "")
        assert [c.effect for c in found] == names


def test_beside_others_that_must_give_way_an_effect_is_polished_before_it_is_judged() -> None:
    scores = Scores({LAG.label: 400.0, FOULING.label: 60.0, (LAG.label, FOULING.label): 405.0})
    polished = []
    scores.polish = lambda fit: polished.append(fit) or fit  # type: ignore[method-assign,func-returns-value]
    base: Any = scores.evaluate((SizedEffect(LAG, (2.0,)),))
    selector(scores, LAG, FOULING).screen(base, "")
    assert [f.effects[-1].effect for f in polished] == [FOULING]  # 5 where 60 was foretold
    polished.clear()
    scores.worth[frozenset((LAG.label, FOULING.label))] = 455.0
    selector(scores, LAG, FOULING).screen(base, "")
    assert polished == []


def test_a_screen_tries_the_size_that_the_smallest_probe_points_to() -> None:
    scores = Scores({LAG.label: 300.0})
    scores.scale_effect = lambda base, placed: placed.with_values([2.0])  # type: ignore[method-assign]
    scores.trial_ship.trials = lambda effect, windows: iter([SizedEffect(effect, (1.0,))])
    (found,) = selector(scores, LAG).screen(scores.null, "")
    assert (found.gain, found.sized_effect.values) == (300.0, (2.0,))


def test_a_model_that_runs_away_is_left_out() -> None:
    scores = Scores({LAG.label: -math.inf, FOULING.label: 40.0})
    assert [c.effect for c in selector(scores, LAG, FOULING).screen(scores.null, "")] == [FOULING]


@pytest.mark.parametrize(("second", "count"), [(101.0, 2), (99.0, 1)])
def test_only_what_comes_near_the_best_is_refined(second: float, count: int) -> None:
    scores = Scores({LAG.label: 400.0, FOULING.label: second}, refining=3.0)
    search = selector(scores, LAG, FOULING)
    found = search.refine(scores.null, search.screen(scores.null, ""))
    assert len(found) == count
    assert found[0].gain == 403.0


def test_what_may_be_taken_for_the_best_is_refined_though_its_probes_missed_it() -> None:
    """A play is sharp: a probe beside its size gains a tenth of what it does."""
    scores = Scores({LAG.label: 400.0, DEAD_TIME.label: 30.0, FOULING.label: 30.0})
    search = selector(scores, LAG, DEAD_TIME, FOULING)
    found = search.refine(scores.null, search.screen(scores.null, ""))
    assert {c.effect for c in found} == {LAG, DEAD_TIME}


def test_at_most_five_are_refined_and_none_that_gains_nothing() -> None:
    effects = [LAG, DEAD_TIME, FOULING, CURRENT, DERATING, BEND]
    scores = Scores({e.label: 400.0 for e in effects})
    search = selector(scores, *effects)
    assert len(search.refine(scores.null, search.screen(scores.null, ""))) == REFINED == 5
    idle = Scores({LAG.label: 0.9})
    search = selector(idle, LAG)
    assert search.refine(idle.null, search.screen(idle.null, "")) == []
    some = Scores({LAG.label: 1.1})
    search = selector(some, LAG)
    assert len(search.refine(some.null, search.screen(some.null, ""))) == 1


def test_nothing_below_its_threshold_is_named() -> None:
    limit = chance_gain(1, 2, 0.01)
    for gain, names in ((0.999 * limit, ()), (1.001 * limit, (LAG,))):
        found = selector(Scores({LAG.label: gain, FOULING.label: 1.5}), LAG, FOULING).search()
        assert tuple(p.effect for p in found.fit.effects) == names
    assert found.thresholds == pytest.approx((limit,))
    assert found.gains == pytest.approx((1.001 * limit,))


def test_what_came_near_an_effect_is_kept_beside_it() -> None:
    scores = Scores({LAG.label: 300.0, DEAD_TIME.label: 90.0, (LAG.label, DEAD_TIME.label): 300.0})
    (rivals,) = selector(scores, LAG, DEAD_TIME).search().rivals
    assert [(c.effect, c.gain) for c in rivals] == [(DEAD_TIME, 90.0)]


def test_a_model_that_is_louder_than_none_is_not_chosen() -> None:
    scores = Scores({LAG.label: 300.0, FOULING.label: 90.0})
    scores.increases_residual = lambda fit: fit.effects[-1].effect is LAG  # type: ignore[method-assign]
    found = selector(scores, LAG, FOULING).search()
    assert [p.effect for p in found.fit.effects] == [FOULING]


def test_the_ranking_tells_the_first_round_by_gain() -> None:
    scores = Scores(
        {
            LAG.label: 300.0,
            FOULING.label: 60.0,
            BEND.label: 310.0,
            (LAG.label, FOULING.label): 360.0,
        },
        refining=2.0,
    )
    found = selector(scores, FOULING, LAG, BEND).search()
    assert [(c.effect, c.gain) for c in found.ranking] == [
        (BEND, 312.0),
        (LAG, 302.0),
        (FOULING, 60.0),  # not worth refining beside those
    ]


def test_effects_are_added_while_they_pass_and_three_at_most() -> None:
    worth: dict[Any, float] = {
        LAG.label: 400.0,
        FOULING.label: 300.0,
        DERATING.label: 200.0,
        CURRENT.label: 100.0,
    }
    scores = Scores(worth)
    found = selector(scores, CURRENT, DERATING, FOULING, LAG).search()
    assert [p.effect for p in found.fit.effects] == [LAG, FOULING, DERATING]
    assert found.gains == pytest.approx((400.0, 300.0, 200.0))
    assert scores.jointly[:2] == [(LAG.label,), (LAG.label, FOULING.label)]
    assert len(found.thresholds) == len(found.rivals) == 3


@pytest.mark.parametrize(
    ("own_share", "kept"), [(0.99, [FOULING, CURRENT]), (1.01, [LAG, FOULING, CURRENT])]
)
def test_an_effect_that_a_later_one_makes_superfluous_is_dropped(
    own_share: float, kept: list[Effect]
) -> None:
    limit = chance_gain(1, 3, 0.01)
    three = 700.0 + 2.0 * limit
    scores = Scores(
        {
            LAG.label: 400.0,
            FOULING.label: 300.0,
            CURRENT.label: 100.0,
            (LAG.label, FOULING.label): 700.0,
            (LAG.label, FOULING.label, CURRENT.label): three,
            (FOULING.label, CURRENT.label): three - own_share * limit,
        }
    )
    found = selector(scores, LAG, FOULING, CURRENT).search()
    assert [p.effect for p in found.fit.effects] == kept
    assert found.fit.score == scores.score(found.fit.effects)


def test_after_one_is_dropped_the_rest_is_looked_at_anew() -> None:
    limit = chance_gain(1, 3, 0.01)
    scores = Scores(
        {
            (LAG.label, FOULING.label, CURRENT.label): 900.0,
            (FOULING.label, CURRENT.label): 900.0 - 5.0 * limit,
            (LAG.label, CURRENT.label): 900.0 - 0.5 * limit,
            CURRENT.label: 900.0 - 1.4 * limit,
        }
    )
    all_three: Any = scores.evaluate(tuple(SizedEffect(e, (2.0,)) for e in (LAG, FOULING, CURRENT)))
    left = selector(scores, LAG, FOULING, CURRENT)._drop_superfluous(all_three)
    assert [p.effect for p in left.effects] == [CURRENT]


def test_without_an_effect_the_others_are_fitted_again() -> None:
    worth: dict[Any, float] = {e.label: 100.0 for e in (LAG, FOULING, CURRENT)}
    scores = Scores(worth, refining=3.0)
    search = selector(scores, LAG, FOULING, CURRENT)
    three: Any = scores.evaluate(tuple(SizedEffect(e, (2.0,)) for e in (LAG, FOULING, CURRENT)))
    assert [p.effect for p in search._without(three, 1).effects] == [LAG, CURRENT]
    assert (scores.jointly, scores.evaluations) == ([(LAG.label, CURRENT.label)], [60])
    two: Any = scores.evaluate(three.effects[:2])
    assert search._without(two, 0).score == 103.0
    assert scores.refined_labels == [FOULING.label]
    one: Any = scores.evaluate(three.effects[:1])
    assert search._without(one, 0).score == 0.0
    assert (len(scores.jointly), len(scores.refined_labels)) == (1, 1)


def test_gains_are_those_beside_the_others() -> None:
    scores = Scores({LAG.label: 400.0, FOULING.label: 300.0, (LAG.label, FOULING.label): 500.0})
    found = selector(scores, LAG, FOULING).search()
    assert found.fit.score == 500.0
    assert found.gains == (200.0, 100.0)


def test_the_bound_is_the_risk_at_the_threshold_of_any_candidate() -> None:
    """At the threshold it is RISK; elsewhere it is the union bound over all candidates."""
    for effect in (FOULING, BEND):
        limit = threshold(effect, 40)
        values = len(effect.parameters)
        assert chance_bound(effect, limit, limit) == pytest.approx(RISK)
        gain = 1.1 * limit
        expected = 40 * chi2.sf(gain / 1.5, values)
        assert chance_bound(effect, gain, limit) == pytest.approx(expected)
        assert chance_bound(effect, 0.0, limit) == 1.0
        assert p_value(effect, gain, limit) == pytest.approx(CALIBRATION(expected))


def test_a_calibration_makes_the_p_values_of_null_cases_uniform() -> None:
    rng = np.random.default_rng(1)
    bounds = rng.uniform(size=4000) ** (1.0 / 0.4)  # shares below x are x^0.4
    found = Calibration.of(bounds.tolist())
    assert found.power == pytest.approx(0.4, abs=0.03)
    for level in (0.05, 0.01):
        share = np.mean([found(bound) < level for bound in bounds])
        assert share == pytest.approx(level, rel=0.3)
    assert found(1.0) == 1.0
    assert found(0.2 - 1e-9) == pytest.approx(found(0.2), rel=1e-6)
    values = [found(bound) for bound in (1e-9, 1e-3, 0.1, 0.3, 0.9)]
    assert values == sorted(values)


def test_the_candidates_of_a_screen_do_not_hold_their_differences() -> None:
    scores = Scores({LAG.label: 300.0, BEND.label: 200.0})
    search = selector(scores, LAG, BEND)
    screened = search.screen(scores.null, "screening")
    assert len(screened) == 2
    assert all(candidate.fit.difference.size == 0 for candidate in screened)
    refined = search.refine(scores.null, screened)
    assert refined
    assert all(candidate.fit.difference.size == 1 for candidate in refined)
