"""Polynomial surfaces of KT and KQ: arithmetic in NumPy, errors of the fit."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.baselines.working_point import fit_open_water, highest_j, surface, surface_slope
from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.open_water import open_water, open_water_slope

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


def test_a_surface_is_a_polynomial_in_both() -> None:
    matrix = np.random.default_rng(0).normal(size=(5, 6))
    for j, p in ((0.3, 0.7), (1.1, 1.3), (0.0, 0.9)):
        value = np.polynomial.polynomial.polyval2d(j, p, matrix)
        assert surface(matrix, j, p) == pytest.approx(value, rel=1e-12)
        slope = (surface(matrix, j + 1e-6, p) - surface(matrix, j - 1e-6, p)) / 2e-6
        assert surface_slope(matrix, j, p) == pytest.approx(slope, rel=1e-7)


def test_working_range_ends_a_little_above_the_pitch() -> None:
    assert highest_j(1.0) == pytest.approx(1.2)
    assert highest_j(0.4) == pytest.approx(0.57)


@by_ship
def test_surfaces_fit_within_the_papers_error(ship: Ship) -> None:
    fit, plant = fit_open_water(ship), ship.record()
    assert fit.thrust.shape == fit.torque.shape == (5, 6)
    assert 0.0 < max(fit.thrust_error, fit.torque_error) < 0.004
    for j, p in ((0.1, 0.7), (0.5, 0.9), (0.83, 1.13)):  # between the points of the fit
        assert surface(fit.thrust, j, p) == pytest.approx(open_water(plant["kt"], j, p), abs=2e-4)
        assert surface(fit.torque, j, p) == pytest.approx(open_water(plant["kq"], j, p), abs=2e-5)
        slope = surface_slope(fit.thrust, j, p)
        assert slope == pytest.approx(open_water_slope(plant["kt"], j, p), abs=2e-3)


@by_ship
def test_errors_are_shares_of_the_largest_coefficient(ship: Ship) -> None:
    fit, plant = fit_open_water(ship), ship.record()
    screw = ship.propeller
    for matrix, curve, error in (
        (fit.thrust, "kt", fit.thrust_error),
        (fit.torque, "kq", fit.torque_error),
    ):
        largest = open_water(plant[curve], 0.0, screw.pitch_ratio_max)
        worst = max(
            abs(surface(matrix, j, p) - open_water(plant[curve], j, p))
            for p in np.linspace(screw.pitch_ratio_min, screw.pitch_ratio_max, 30)
            for j in np.linspace(0.0, p, 30)
        )
        assert worst / largest < 2.0 * error + 1e-12
        assert error < 20.0 * worst / largest + 1e-12


def test_four_quadrant_curves_are_fitted_or_refused_by_name() -> None:
    other = SHIPS[0].with_values({"propeller.model": "four-quadrant"})
    with pytest.raises(ShipError, match=r"differ from the open-water curves by .*allowed: 0.4 %"):
        fit_open_water(other)
    fixed = SHIPS[0].with_values(
        {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
    )
    with pytest.raises(ShipError, match="needs a controllable-pitch propeller"):
        fit_open_water(fixed)
