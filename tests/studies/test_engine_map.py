"""The engine map inferred from the optimiser paper's tables: its fit, its ship, the optimiser on it."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import load_ship
from shaftline.plant.fuel import specific_consumption
from shaftline.studies.ferry import engine_map as study
from shaftline.studies.ferry.lever_points import COMBINATOR


@pytest.fixture(scope="module")
def known() -> study.States:
    return study.states(load_ship(study.SHIP))


def test_thirty_entries_of_twenty_states(known: study.States) -> None:
    assert len(known.consumption) == 30
    assert len(set(zip(known.ship_speed, known.speed, strict=True))) == 20
    assert (known.consumption.min(), known.consumption.max()) == (291.2, 343.5)


def test_the_ship_has_the_fitted_map(known: study.States) -> None:
    ship = load_ship(study.SHIP)
    for key, value in study.keys(study.fitted(known)).items():
        assert ship.number(key).value == pytest.approx(value, abs=2e-6), key
    plant = ship.record()
    engine = known.speed * float(plant["engine_speed_max"])
    torque = known.power * study.RATED_W / engine
    found = [
        specific_consumption(plant, float(w), float(m)) for w, m in zip(engine, torque, strict=True)
    ]
    surface = study.form(known.power, known.speed) @ study.fitted(known)
    assert found == pytest.approx(surface.tolist(), rel=1e-5)


def test_forms_hold_the_entries_as_far_as_was_found() -> None:
    """With the square of the speed: 0.22, 0.66 and 1.3 g/kWh wanted; a quadratic has 2.7 and 4.0."""
    square = study.forms(study.states(load_ship("ferry"))).set_index("form")
    paper = square.loc["the paper's form, 12"]
    assert paper.tolist() == pytest.approx([0.20, 0.73, 1.38], abs=0.02)
    assert square.iloc[0, 0] > 10.0 * paper.iloc[0]


def test_the_optimiser_comes_near_the_printed_pairs() -> None:
    found = study.chosen(load_ship(study.SHIP))
    four = found[found["lever"] != "5"]
    assert (four["engine [rpm]"] - four["printed [rpm]"]).abs().max() < 15.0
    assert (four["SFOC [g/kWh]"] - four["printed [g/kWh]"]).abs().max() < 4.5


def test_optima_are_stationary_points_of_the_fuel(known: study.States) -> None:
    """What the weight of the slopes is for: without it the fuel falls along equal thrust."""
    best = np.array([name != COMBINATOR for name in known.table])

    def steepest(coefficients: study.Floats) -> float:
        h, p, s = 1e-6, known.power, known.speed
        ahead = (p + h * known.slope) * (study.form(p + h * known.slope, s + h) @ coefficients)
        fuel = p * (study.form(p, s) @ coefficients)
        return float(np.abs((ahead / fuel - 1.0) / h)[best].max())

    assert steepest(study.fitted(known)) < 0.25 < steepest(study.fitted(known, slope_weight=0.0))
