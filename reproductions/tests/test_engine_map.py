"""The engine map inferred from the optimiser paper's tables: its fit, its ship, the optimiser on it."""

from __future__ import annotations

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


def test_consumption_asks_for_a_larger_rise_than_the_held_thrust() -> None:
    """With 15 % more of the whole resistance: 0.20, 0.73 and 1.38 g/kWh; with Table 2's rise 1.55."""
    ship = load_ship(study.SHIP)
    whole = study.compare_forms(study.states(ship, (1.15,) * 5)).set_index("form")
    own = study.compare_forms(study.states(ship)).set_index("form")
    paper = "the paper's form, 12"
    assert whole.loc[paper].tolist() == pytest.approx([0.20, 0.73, 1.38], abs=0.02)
    assert own.loc[paper].iloc[0] == pytest.approx(1.55, abs=0.02)


def test_where_the_optimiser_goes() -> None:
    found = study.optimiser_states(load_ship(study.SHIP))
    assert (found["engine [rpm]"] - found["printed [rpm]"]).abs().max() < 45.0
    assert (found["SFOC [g/kWh]"] - found["printed [g/kWh]"]).abs().max() < 10.0


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

    assert steepest(study.fit_map(known)) < 0.25 < steepest(study.fit_map(known, slope_weight=0.0))
