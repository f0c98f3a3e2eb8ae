"""A number that moved far, or physics that does the same."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.judge.held_out import set_aside
from shaftline.mismatch.search.catalogue import catalogue
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.choice import chosen
from shaftline.mismatch.structure.naming import named
from shaftline.mismatch.structure.output_error import OutputError
from shaftline.mismatch.structure.search import StructureSearch

from ..voyages import frigate_voyage, quick_frigate
from .rigs import INERTIA, motor, run, searched

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"


@pytest.fixture(scope="module")
def fouled() -> StructureSearch:
    """A frigate with a fifth more resistance, searched with hull and shaft effects alone."""
    ship = quick_frigate()
    table = frigate_voyage(ship.with_values({"hull.fouling_fraction": 0.2}), seconds=400.0, seed=2)
    balances = Balances(JointReplay(ship, table))
    fitted, aside = set_aside(balances.replay, 0)[0]
    problem = OutputError(balances, fitted)
    ids = ("hull-fouling", "current", "entrained-water-inertia", "propeller-roughness")
    effects = [e for e in catalogue() if e.id in ids and e.acts_on(ship)]
    rows = np.concatenate([np.arange(a, b) for a, b in aside])
    return StructureSearch(problem, effects, rows)


def test_a_resistance_that_moved_far_is_fouling_with_the_number_beside_it(
    fouled: StructureSearch,
) -> None:
    problem = fouled.problem
    model = problem.freed(problem.fit((), problem.nothing()))
    moved = dict(zip([d.key for d in problem.doubts], model.numbers, strict=True))
    assert moved[RESISTANCE] == pytest.approx(np.log(1.2), abs=0.02)
    found, replaced = named(fouled, model)
    assert [p.effect.id for p in found.effects] == ["hull-fouling"]
    assert found.effects[0].values[0] == pytest.approx(0.2, abs=0.02)
    (was,) = replaced["hull-fouling (hull)"]
    assert was.key == RESISTANCE
    assert was.value == pytest.approx(1.2 * 3306.2, rel=0.02)
    place = [d.key for d in problem.doubts].index(RESISTANCE)
    assert abs(found.numbers[place]) < 3.0 * problem.doubts[place].near


def test_the_numbers_of_a_file_that_was_guessed_stay_numbers() -> None:
    """An inertia that is off by more than physics could be."""
    truth = {INERTIA: 2.5e-3}
    search, ranked = searched(motor(), run(truth, 1), run(truth, 2), ids=("viscous-friction",))
    best, _ = chosen(ranked, search.problem.held_error(search.problem.nothing(), search.held))
    found, replaced = named(search, best.model)
    assert found is best.model
    assert replaced == {}
    place = [d.key for d in search.problem.doubts].index(INERTIA)
    assert 1e-3 * np.exp(found.numbers[place]) == pytest.approx(2.5e-3, rel=0.03)
