"""The engine map inferred from the optimiser paper's tables: its fit, its ship, the optimiser on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reproductions.ferry import engine_map as study
from reproductions.ferry.experiment import COMBINATOR
from shaftline.plant import load_ship
from shaftline.plant.fuel import specific_consumption


@pytest.fixture(scope="module")
def known() -> study.States:
    return study.states(load_ship(study.SHIP))


def test_thirty_entries_of_twenty_states(known: study.States) -> None:
    assert len(known.consumption) == 30
    assert len(set(zip(known.ship_speed, known.speed, strict=True))) == 20
    assert (known.consumption.min(), known.consumption.max()) == (291.2, 343.5)


def test_the_ship_has_the_fitted_map(known: study.States) -> None:
    ship = load_ship(study.SHIP)
    for key, value in study.ship_keys(study.fit_map(known)).items():
        assert ship.parameter(key).value == pytest.approx(value, abs=2e-6), key
    plant = ship.record()
    engine = known.speed * float(plant["engine_speed_max"])
    torque = known.power * study.RATED_W / engine
    found = [
        specific_consumption(plant, float(w), float(m)) for w, m in zip(engine, torque, strict=True)
    ]
    surface = study.form_terms(known.power, known.speed) @ study.fit_map(known)
    assert found == pytest.approx(surface.tolist(), rel=1e-5)


def test_errors_of_the_forms(known: study.States) -> None:
    """Consumption left out of the fit is off by more than consumption that was used."""
    found = study.compare_forms(known).set_index("form")
    paper, quadratic = (found.loc[f] for f in ("the paper's form, 12", found.index[0]))
    assert paper.tolist() == pytest.approx([0.87, 2.86, 2.47], abs=0.02)
    assert quadratic.tolist() == pytest.approx([1.45, 3.37, 2.14], abs=0.02)


def test_where_the_optimiser_goes() -> None:
    found = study.optimiser_states(load_ship(study.SHIP))
    assert (found["engine [rpm]"] - found["printed [rpm]"]).abs().max() < 6.0
    assert (found["SFOC [g/kWh]"] - found["printed [g/kWh]"]).abs().max() < 3.0


def test_nothing_in_the_envelope_consumes_less_than_the_floor(known: study.States) -> None:
    terms = study.form_terms(*study.envelope_states())
    assert (terms @ study.fit_map(known)).min() > study.FLOOR - 1e-6
    free = terms @ study.fit_map(known, floor=-math.inf)
    assert free.min() < 0.0


def test_optima_are_stationary_points_of_the_fuel(known: study.States) -> None:
    """What the weight of the slopes is for: without it the fuel falls along equal thrust."""
    best = np.array([name != COMBINATOR for name in known.table])

    def steepest(coefficients: study.Floats) -> float:
        h, p, s = 1e-6, known.power, known.speed
        ahead = (p + h * known.slope) * (
            study.form_terms(p + h * known.slope, s + h) @ coefficients
        )
        fuel = p * (study.form_terms(p, s) @ coefficients)
        return float(np.abs((ahead / fuel - 1.0) / h)[best].max())

    assert steepest(study.fit_map(known)) < 0.35 < 1.5 < steepest(study.fit_map(known, 0.0))
