"""Steady Kalman gain: another solver, closed form, printed values."""

from __future__ import annotations

import control
import numpy as np
import pytest

from shaftline.observers.linear import shaft_model
from shaftline.observers.shaft_kalman import ShaftKalman
from shaftline.plant import Ship

from .screw import INERTIA, SHIP


@pytest.mark.parametrize(
    ("process", "measurement"), [((5.0, 1e13), 1.0), ((0.3, 4e9), 2.5e-4), ((40.0, 1e11), 3.0)]
)
def test_gain_is_that_of_another_solver(process: tuple[float, float], measurement: float) -> None:
    a, _, c = shaft_model(INERTIA)
    # Units of 1e5 N m keep the other solver accurate.
    scale = np.diag([1.0, 1e5])
    inverse = np.linalg.inv(scale)
    noise = inverse @ np.diag(process) @ inverse
    expected, _, _ = control.lqe(
        inverse @ a @ scale, np.eye(2), c @ scale, noise, np.array([[measurement]])
    )
    gain = ShaftKalman(process, measurement).gain(SHIP)
    np.testing.assert_allclose(gain, scale @ expected, rtol=1e-7)


@pytest.mark.parametrize("measurement", [1.0, 0.04])
def test_gain_solves_its_riccati_equation(frigate: Ship, measurement: float) -> None:
    # P C' = K R gives P's first column; the Riccati equation's three entries follow in closed form
    k1, k2 = ShaftKalman(measurement=measurement).gain(frigate).ravel()
    assert k2 < 0.0 < k1
    assert k2**2 == pytest.approx(1e13 / measurement)
    assert k1**2 == pytest.approx(5.0 / measurement - 2.0 * k2 / 14411.0)


def test_poles_are_the_printed_ones(frigate: Ship) -> None:
    first, second = ShaftKalman().poles(frigate)
    assert np.round([first.real, abs(first.imag)], 2).tolist() == [-10.53, 10.41]
    assert second == np.conj(first)


def test_poles_are_those_of_the_continuous_observer() -> None:
    # s^2 + k1 s - k2 / I = 0
    observer = ShaftKalman((20.0, 1e10), 0.5)
    k1, k2 = observer.gain(SHIP).ravel()
    np.testing.assert_allclose(
        np.sort_complex(observer.poles(SHIP)), np.sort_complex(np.roots([1.0, k1, -k2 / INERTIA]))
    )
