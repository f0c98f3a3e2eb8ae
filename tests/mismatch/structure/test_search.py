"""Effects and parameters estimated together: pairs of effects, and cases with nothing missing."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.structure.search import StructureSearch, choose

from .rigs import COULOMB, INERTIA, VISCOUS, effects, motor, problem, run, searched

OPEN = "prime_mover.open_circuit_fraction"

BY_SWITCHING = ("open-circuit", "braking-loss")
"""Effects of a voltage that is switched."""


def test_a_pair_is_found_with_the_inertia_that_the_file_has_wrong() -> None:
    """An open armature and dry friction: in one direction a linear law takes up either."""
    truth = {OPEN: 1.0, COULOMB: 0.02, INERTIA: 1.6e-3}
    ids = (
        "open-circuit",
        "coulomb-friction",
        "viscous-friction",
        "supply-limit",
        "torque-offset",
        "speed-sensor-lag",
        "quadratic-drag",
    )
    search, ranked = searched(motor(), run(truth, 1), run(truth, 2), ids=ids)
    before = search.problem.held_error(search.problem.file_model())
    best, alike = choose(ranked, before)
    found = {p.effect.id: p.values[0] for p in best.model.effects}
    assert set(found) == {"open-circuit", "coulomb-friction"}
    # it never turns astern: an offset of the torque is the same, and said to be
    assert [sorted(one.model.labels) for one in alike] == [
        ["open-circuit (motor)", "torque-offset (motor)"]
    ]
    tried = search.alternatives(best, search.without_each(best.model))
    assert [sorted(one.model.labels) for one in tried] == [
        ["open-circuit (motor)", "torque-offset (motor)"]
    ]
    assert found["open-circuit"] == pytest.approx(1.0, abs=0.03)
    assert found["coulomb-friction"] == pytest.approx(0.02, rel=0.05)
    numbers = dict(zip([d.key for d in search.problem.priors], best.model.shifts, strict=True))
    assert 1e-3 * np.exp(numbers[INERTIA]) == pytest.approx(1.6e-3, rel=0.05)
    assert float(best.held[0]) < 0.35 < 0.05 * float(before[0])  # the noise is 0.3


@pytest.mark.parametrize("effect", BY_SWITCHING)
def test_an_open_switch_is_told_from_a_supply_that_takes_nothing_back(effect: str) -> None:
    """From 12 V to 6 the one brakes and the other does not; from 6 V to none neither. A motor that has
    no torque astern is the second one as long as it turns ahead, and left out here.
    """
    key = f"prime_mover.{effect.replace('-', '_')}_fraction"
    ids = (*BY_SWITCHING, "coulomb-friction", "viscous-friction")
    search, ranked = searched(motor(), run({key: 1.0}, 1), run({key: 1.0}, 2), ids=ids)
    before = search.problem.held_error(search.problem.file_model())
    best, _ = choose(ranked, before)
    found = {p.effect.id: p.values[0] for p in best.model.effects}
    assert found == {effect: pytest.approx(1.0, abs=0.03)}


@pytest.mark.parametrize("seed", [3, 5])
def test_nothing_is_named_where_nothing_is_missing(seed: int) -> None:
    search, ranked = searched(motor(), run(seed=seed), run(seed=seed + 1))
    before = search.problem.held_error(search.problem.file_model())
    best, alike = choose(ranked, before)
    assert best.model.effects == ()
    assert alike == []
    assert np.abs(best.model.shifts).max() < 0.02


def test_screening_counts_the_cost_of_a_parameter_that_has_taken_an_effect_s_place() -> None:
    """The file knows a friction within 5 %, and it is 50 % too low: the effect saves the cost."""
    sure = motor().with_values({"tolerances.numbers": {VISCOUS: 5e-6}})
    own = problem(sure, *(run({VISCOUS: 1.5e-4}, seed, noise=0.05) for seed in (1, 2)))
    own.hold(range(len(own.priors)))
    moved = own.fit((), own.file_model())
    cost = own.prior.penalty(moved.shifts)
    screened = StructureSearch(own, effects(motor(), "viscous-friction")).screen(moved)
    assert cost > 30.0
    assert screened[0].gain > 0.3 * cost


def test_effects_cost_more_the_more_there_are() -> None:
    own = problem(motor(), run(seed=1), run(seed=2))
    search = StructureSearch(own, effects(motor()))
    one = [next(own.trial_ship.trials(e, [])) for e in search.effects[:3]]
    prices = [search.price(tuple(one[:k])) for k in range(4)]
    assert prices[0] == 0.0
    kinds = len({e.kind for e in search.effects})
    assert prices[1] == pytest.approx(
        search.threshold(one[0].effect) + 2.0 * np.log(kinds), rel=1e-12
    )
    assert np.all(np.diff(prices) > 15.0)


def test_the_weakest_effect_is_left_out_until_each_is_significant() -> None:
    """Friction is in the recordings, quadratic drag is not."""
    own = problem(motor(), run({COULOMB: 0.02}, 1), run({COULOMB: 0.02}, 2))
    search = StructureSearch(own, effects(motor()))
    ids = ("coulomb-friction", "quadratic-drag")
    both = [next(e for e in search.effects if e.id == name) for name in ids]
    trials = tuple(next(own.trial_ship.trials(effect, [])) for effect in both)
    model = own.fit(trials, own.file_model())
    rest = search.without_weakest(model, search.without_each(model))
    assert rest is not None
    assert [sized.effect.id for sized in rest.effects] == ["coulomb-friction"]
    assert model.score - rest.score < search.threshold(both[1])
    assert search.without_weakest(rest, search.without_each(rest)) is None
    assert search.without_weakest(own.fit((), rest), []) is None
