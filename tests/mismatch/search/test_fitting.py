"""Fits of a plant of straight lines, where least squares can be written out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.fitting import Fit, Fitter
from shaftline.mismatch.search.trial_ship import EDGE_S, EffectSearch, TrialShip

from ..toy import (
    FOULING,
    FRICTION,
    RESISTANCE,
    ROWS,
    SLOPES,
    VISCOUS,
    Toy,
    bands,
    entry,
    fitter,
    white,
)

ENGINE_FRICTION = entry("coulomb-friction (engine)")
VISCOUS_FRICTION = entry("viscous-friction (engine)")
HULL_FOULING = entry("hull-fouling (hull)")


def rub(value: float) -> SizedEffect:
    return SizedEffect(ENGINE_FRICTION, (value,))


def foul(value: float) -> SizedEffect:
    return SizedEffect(HULL_FOULING, (value,))


def by_hand(fit: Fitter, found: Fit, keys: list[str]) -> tuple[Any, Any]:
    """Best values and their covariance, by weighted least squares on every frequency by itself.

    The resistance is free with its tolerance as its standard deviation.
    """
    count, frequencies = 2, len(fit.bands.order)
    columns = [fit.bands.transform(SLOPES[key]) for key in keys]
    columns.append(fit.bands.transform(SLOPES[RESISTANCE]))
    prior = np.zeros(len(columns))
    known = fit.balances.replay.ship.tolerances.resistance
    nominal = fit.balances.replay.ship.hull.resistance_coefficient_N_s2_m2
    prior[-1] = (known * nominal) ** -2 if known > 0.0 else 1e30
    gram, right = np.diag(prior), np.zeros(len(columns))
    measured = fit.bands.transform(fit.balances.residuals_against(fit.balances.nominal))
    band = np.searchsorted(fit.bands.edges, np.arange(frequencies), side="right") - 1
    for f in range(frequencies):
        weight = 2.0 * fit.bands.weights[f] * found.weight[band[f]]
        stack = np.array([column[:, f] for column in columns]).reshape(-1, count)
        gram += (stack.conj() @ weight @ stack.T).real
        right += (stack.conj() @ weight @ measured[:, f]).real
    return np.linalg.solve(gram, right), np.linalg.inv(gram)


def test_nominal_numbers_take_up_what_their_tolerances_allow() -> None:
    nominal = 3306.2
    fit = fitter({RESISTANCE: 1.03 * nominal}, known=0.05)
    assert fit.nuisance.shape == (3, 2, len(fit.bands.order))  # the resistance, the first state
    assert 0.05 * fit.null.tolerances[0] == pytest.approx(0.03, abs=0.003)
    assert fit.null.tolerances[1:] == pytest.approx([0.0, 0.0])
    stiff = fitter({RESISTANCE: 1.03 * nominal})
    assert stiff.null.score < fit.null.score - 100.0


def test_a_small_effect_is_scaled_to_what_least_squares_asks_for() -> None:
    fit = fitter({FRICTION: 6000.0}, known=0.02)
    scaled = fit.scale_effect(fit.null, rub(100.0))
    assert scaled is not None
    (best, _), _ = by_hand(fit, fit.null, [FRICTION])
    assert scaled.values[0] == pytest.approx(best, rel=1e-6)
    again = fit.scale_effect(fit.null, rub(4000.0))
    assert again is not None
    assert again.values == pytest.approx(scaled.values)


def test_an_effect_is_not_scaled_the_wrong_way_or_beyond_its_range() -> None:
    toy: Any = Toy({}, white(3, 0.5, 2.0) - 3e3 * SLOPES[FRICTION])
    turned = Fitter(toy, bands())
    assert turned.scale_effect(turned.null, rub(100.0)) is None  # friction drives nothing
    toy = Toy({}, white(3, 0.5, 2.0) + 3e7 * SLOPES[FRICTION])
    far = Fitter(toy, bands())
    top = far.scale_effect(far.null, rub(100.0))
    assert top is not None
    assert top.values[0] == far.trial_ship.ship.parameter(FRICTION).info.high


def test_an_effect_absent_at_infinity_has_no_straight_line() -> None:
    fit = fitter({})
    assert (
        fit.scale_effect(fit.null, SizedEffect(entry("rack-rate-limit (engine)"), (1.0,))) is None
    )


def test_a_simulation_that_runs_away_is_no_candidate() -> None:
    fit = fitter({FRICTION: 5000.0})
    away = SizedEffect(ENGINE_FRICTION, (math.nan,))
    found = fit.evaluate((away,))
    assert found.score == -math.inf
    assert found.effects == (away,)
    assert fit.scale_effect(fit.null, away) is None


def test_predictions_are_those_of_single_records_and_each_is_simulated_once() -> None:
    fit = fitter({})
    sizes = (10.0, 20.0, 10.0, 30.0, 40.0, 0.0, 50.0)
    records = [fit.trial_ship.record((rub(size),)) for size in sizes]
    before = fit.simulations
    found = list(fit.predictions(records))
    assert fit.simulations == before + 5  # the nominal ship was simulated before
    for record, prediction in zip(records, found, strict=True):
        assert prediction is fit.predict(record)
    other = fitter({})
    for record, prediction in zip(records, found, strict=True):
        assert np.array_equal(prediction, other.predict(record))
    assert fit.simulations == before + 5


def test_models_are_evaluated_in_order_as_by_themselves() -> None:
    fit, other = fitter({FRICTION: 5000.0}), fitter({FRICTION: 5000.0})
    models = [(rub(1e3),), (), (rub(2e3), foul(0.1)), (foul(0.1),), (rub(3e3),), (rub(4e3),)]
    for found, effects in zip(fit.evaluate_models(models), models, strict=True):
        assert found.effects == effects
        assert found.score == other.evaluate(effects).score


def test_simulations_are_remembered() -> None:
    fit = fitter({})
    before = fit.simulations
    fit.evaluate((rub(10.0),))
    fit.evaluate((rub(10.0),))
    assert fit.simulations == before + 1
    for value in range(70):
        fit.evaluate((rub(20.0 + value),))
    fit.evaluate((rub(89.0),))
    assert fit.simulations == before + 71
    fit.evaluate((rub(10.0),))  # forgotten by now
    assert fit.simulations == before + 72
    for value in range(70):
        fit.evaluate((rub(120.0 + value),))
        fit.evaluate((rub(10.0),))  # used again and again, and so never forgotten
    assert fit.simulations == before + 142


def test_refining_finds_the_best_size() -> None:
    fit = fitter({FRICTION: 6000.0}, known=0.02)
    found = fit.refine_effect(fit.evaluate((rub(3000.0),)), 0)
    sizes = np.linspace(5000.0, 7000.0, 401)
    scores = [fit.evaluate((rub(float(size)),)).score for size in sizes]
    assert found.effects[0].values[0] == pytest.approx(sizes[int(np.argmax(scores))], rel=0.01)
    assert found.score >= max(scores) - 0.1


def test_effects_are_refined_one_by_one_or_jointly() -> None:
    fit = fitter({FRICTION: 6000.0, FOULING: 0.3})
    start = fit.evaluate((rub(4000.0), foul(0.25)))
    one = fit.refine_effect(start, 1)
    assert one.effects[0] == start.effects[0]
    assert one.effects[1].values[0] == pytest.approx(0.3, rel=0.05)
    both = fit.refine_effects(start)
    assert both.score > one.score > start.score
    assert [p.values[0] for p in both.effects] == pytest.approx([6000.0, 0.3], rel=0.05)


def test_standard_errors_are_those_of_least_squares() -> None:
    fit = fitter({FRICTION: 6000.0, FOULING: 0.3}, known=0.02)
    found = fit.refine_effects(fit.evaluate((rub(6000.0), foul(0.3))))
    _, covariance = by_hand(fit, found, [FRICTION, FOULING])
    (friction,), (fouling,) = fit.estimates(found)
    errors = np.sqrt(np.diag(covariance))[:2]
    assert [friction.standard_error, fouling.standard_error] == pytest.approx(errors, rel=1e-4)
    assert (friction.key, fouling.key) == (FRICTION, FOULING)
    assert (friction.unit, friction.value) == ("N m", found.effects[0].values[0])
    assert friction.form_error == 0.0
    stiff = fitter({FRICTION: 6000.0, FOULING: 0.3})
    surer = stiff.estimates(stiff.evaluate(found.effects))[1][0]
    assert surer.standard_error < 0.95 * fouling.standard_error  # nothing else may take its part


def test_the_form_s_error_widens_by_a_share_of_the_size() -> None:
    fit = fitter({FRICTION: 6000.0})
    ((friction,),) = fit.estimates(fit.evaluate((rub(6000.0),)), 0.03)
    assert friction.form_error == pytest.approx(0.03 * 6000.0)
    assert friction.neutral == 0.0


def test_a_size_counts_from_the_ship_s_own_value() -> None:
    ship = fitter({}).balances.replay.ship.with_values({FRICTION: 2000.0})
    toy: Any = Toy({FRICTION: 5000.0}, white(0, 0.5, 2.0), ship=ship)
    fit = Fitter(toy, bands())
    ((friction,),) = fit.estimates(fit.evaluate((rub(5000.0),)), 0.04)
    assert friction.form_error == pytest.approx(0.04 * 3000.0)
    assert friction.neutral == 2000.0


def test_a_size_counts_on_either_side() -> None:
    fit = fitter({FOULING: -0.2})
    ((fouling,),) = fit.estimates(fit.evaluate((foul(-0.2),)), 0.04)
    assert fouling.form_error == pytest.approx(0.04 * 0.2)
    assert fouling.standard_error > 0.0


def test_no_effects_have_no_estimates() -> None:
    fit = fitter({})
    assert fit.estimates(fit.null) == []


def test_intervals_cover_as_often_as_they_say() -> None:
    inside = []
    for seed in range(80):
        fit = fitter({VISCOUS: 300.0}, seed=seed, rms=(1.0, 2.0))
        found = fit.refine_effect(fit.evaluate((SizedEffect(VISCOUS_FRICTION, (280.0,)),)), 0)
        low, high = fit.estimates(found)[0][0].ci95
        inside.append(low <= 300.0 <= high)
    assert 0.90 <= np.mean(inside) <= 0.99


# -- the coordinates of the search -------------------------------------------------------------


@pytest.fixture(scope="module")
def trial_ship() -> TrialShip:
    return fitter({}).trial_ship


def test_sizes_are_searched_on_the_logarithm_of_their_distance(trial_ship: TrialShip) -> None:
    gain = SizedEffect(entry("torque-sensor-gain (sensor)"), (0.9,))
    search = EffectSearch(trial_ship, gain)
    assert search.point() == pytest.approx([math.log(0.1)])
    assert search.effects_at([math.log(0.2)]).values == pytest.approx((0.8,))
    assert search.effects_at(math.log(0.1)).effect is gain.effect
    more = EffectSearch(trial_ship, SizedEffect(gain.effect, (1.2,)))
    assert more.effects_at([math.log(0.3)]).values == pytest.approx((1.3,))
    limit = EffectSearch(trial_ship, SizedEffect(entry("rack-rate-limit (engine)"), (2.0,)))
    assert limit.point() == pytest.approx([math.log(2.0)])  # absent at infinity, counted from 0
    assert EffectSearch(trial_ship, SizedEffect(gain.effect, (1.0,))).point() == pytest.approx(
        [math.log(1e-12)]
    )


def test_a_size_stays_where_it_can_be_told_from_others(trial_ship: TrialShip) -> None:
    air = SizedEffect(entry("ventilation (propeller)"), (0.4, 1.1))
    least = air.effect.parameters[0].least
    assert least > 0.0
    search = EffectSearch(trial_ship, air)
    assert search.effects_at([-40.0, 0.0]).values[0] == pytest.approx(least)
    assert search.effects_at([math.log(2.0 * least), 0.0]).values[0] == pytest.approx(2.0 * least)
    assert search.effects_at([99.0, 0.0]).values[0] == 0.95  # as much as can be lost


def test_windows_are_searched_by_their_edges(trial_ship: TrialShip) -> None:
    episode = SizedEffect(entry("resistance-episode (hull)"), (0.5,), (60.0, 150.0))
    search = EffectSearch(trial_ship, episode)
    assert search.point() == pytest.approx([math.log(0.5), 60.0 / EDGE_S, 150.0 / EDGE_S])
    assert EDGE_S == 30.0
    assert search.effects_at([0.0, 7.0, 3.0]).window == (90.0, 210.0)  # whichever came first
    assert search.effects_at([0.0, -2.0, -1.0]).window == (0.0, 0.0)
    assert search.effects_at([0.0, -2.0, 4.0]).values == (1.0,)


def test_the_recording_is_what_is_fitted() -> None:
    fit = fitter({})
    assert fit.measured.shape == (2, len(fit.bands.order))
    assert fit.null.difference == pytest.approx(fit.bands.transform(white(0, 0.5, 2.0)), abs=1e-9)
    assert fit.bands.ends == (ROWS,)
