"""A parameter far from the file, or an effect that does the same."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch import diagnose
from shaftline.mismatch.judge.held_out import split_held_out
from shaftline.mismatch.search.catalogue import catalogue
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.diagnose import replace_far_parameters
from shaftline.mismatch.structure.output_error import OutputError
from shaftline.mismatch.structure.search import StructureSearch, choose
from shaftline.plant import load_ship
from shaftline.validation.cases import draw_case
from shaftline.validation.recording import simulate_case

from ..voyages import frigate_voyage, quick_frigate
from .rigs import INERTIA, motor, run, searched

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"


@pytest.fixture(scope="module")
def fouled() -> StructureSearch:
    """A frigate with a fifth more resistance, searched with hull and shaft effects alone."""
    ship = quick_frigate()
    table = frigate_voyage(ship.with_values({"hull.fouling_fraction": 0.2}), seconds=400.0, seed=2)
    balances = Balances(JointReplay(ship, table))
    fitted, aside = split_held_out(balances.replay, 0)[0]
    problem = OutputError(balances, fitted, aside)
    ids = ("hull-fouling", "current", "entrained-water-inertia", "propeller-roughness")
    effects = [e for e in catalogue() if e.id in ids and e.acts_on(ship)]
    return StructureSearch(problem, effects)


def test_a_resistance_far_from_the_file_is_fouling_with_the_parameter_beside_it(
    fouled: StructureSearch,
) -> None:
    problem = fouled.problem
    model = problem.fit_from_far(problem.fit((), problem.file_model()))
    moved = dict(zip([d.key for d in problem.priors], model.shifts, strict=True))
    assert moved[RESISTANCE] == pytest.approx(np.log(1.2), abs=0.02)
    found, replaced = replace_far_parameters(fouled, model)
    assert [p.effect.id for p in found.effects] == ["hull-fouling"]
    assert found.effects[0].values[0] == pytest.approx(0.2, abs=0.02)
    (was,) = replaced["hull-fouling (hull)"]
    assert was.key == RESISTANCE
    assert was.value == pytest.approx(1.2 * 3306.2, rel=0.02)
    place = [d.key for d in problem.priors].index(RESISTANCE)
    assert abs(found.shifts[place]) < 3.0 * problem.priors[place].near


@pytest.mark.slow
def test_an_effect_in_place_of_a_parameter_has_its_alternatives() -> None:
    """A steady cruise does not distinguish two frictions; the search had tried them at another eta_R."""
    case = draw_case(7703, 116, keys=("viscous-friction/propeller",))
    found = diagnose(load_ship(case.ship), simulate_case(case).recording)
    assert len(found.findings) == 1
    labels = {found.findings[0].effect.label, *found.alternatives}
    assert {"viscous-friction (propeller)", "coulomb-friction (propeller)"} <= labels


def test_the_parameters_of_a_guessed_file_stay_as_estimated() -> None:
    """An inertia that is off by more than physics could be."""
    truth = {INERTIA: 2.5e-3}
    search, ranked = searched(motor(), run(truth, 1), run(truth, 2), ids=("viscous-friction",))
    best, _ = choose(ranked, search.problem.held_error(search.problem.file_model()))
    found, replaced = replace_far_parameters(search, best.model)
    assert found is best.model
    assert replaced == {}
    place = [d.key for d in search.problem.priors].index(INERTIA)
    assert 1e-3 * np.exp(found.shifts[place]) == pytest.approx(2.5e-3, rel=0.03)
