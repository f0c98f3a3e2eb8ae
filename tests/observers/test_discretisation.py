from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from shaftline.observers import get_observer
from shaftline.observers.linear import first_order_hold, shaft_model
from shaftline.observers.shaft_kalman import ShaftKalman
from shaftline.plant import Ship

LINEAR = ["luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman"]
INERTIA = 14411.0


def test_first_order_hold_equals_lsim() -> None:
    """lsim interpolates its input linearly between samples, by a different formula."""
    rng = np.random.default_rng(0)
    a = rng.normal(size=(3, 3)) - 2.0 * np.eye(3)
    b = rng.normal(size=(3, 2))
    times, inputs = 0.1 * np.arange(60), rng.normal(size=(60, 2))
    transition, before, now = first_order_hold(a, b, 0.1)
    x = [np.zeros(3)]
    for u0, u1 in itertools.pairwise(inputs):
        x.append(transition @ x[-1] + before @ u0 + now @ u1)
    _, _, expected = lsim((a, b, np.eye(3), np.zeros((3, 2))), inputs, times)
    np.testing.assert_allclose(x, expected, rtol=1e-9, atol=1e-12)


def test_first_order_hold_equals_integration_over_one_step() -> None:
    a, b = np.array([[-3.0, 1.0], [0.0, -0.5]]), np.array([[1.0, 0.0], [2.0, -1.0]])
    x0, u0, u1, dt = np.array([0.3, -1.0]), np.array([1.0, 2.0]), np.array([-0.5, 4.0]), 0.4

    def rate(t: float, x: NDArray[np.float64]) -> Any:
        return a @ x + b @ (u0 + (u1 - u0) * t / dt)

    exact = solve_ivp(rate, (0.0, dt), x0, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    transition, before, now = first_order_hold(a, b, dt)
    np.testing.assert_allclose(transition @ x0 + before @ u0 + now @ u1, exact, rtol=1e-10)


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("dt", [1e-4, 0.05, 1.0])
def test_discrete_observer_is_stable_at_any_step(frigate: Ship, name: str, dt: float) -> None:
    transition = get_observer(name).discretise(frigate, dt)["transition"]
    assert np.abs(np.linalg.eigvals(transition)).max() < 1.0


@pytest.mark.parametrize("name", LINEAR)
def test_steady_readings_are_a_fixed_point(frigate: Ship, name: str) -> None:
    record = get_observer(name).discretise(frigate, 0.05)
    steady = np.array([10.5, 143850.0])  # omega, M_m = M_p
    following = (record["transition"] + record["before"] + record["now"]) @ steady
    np.testing.assert_allclose(following, steady, rtol=1e-9)


@pytest.mark.parametrize(
    ("tuning", "k1", "k2"),
    [("high", 1.1e5, -1.4e13), ("low", 11.0, -1.4e5), ("moderate", 110.0, -1.4e7)],
)
def test_luenberger_gains_are_the_printed_ones(
    frigate: Ship, tuning: str, k1: float, k2: float
) -> None:
    dt = 1e-11  # so short that the transition's slope shows A - K C
    slope = (
        get_observer("luenberger", tuning).discretise(frigate, dt)["transition"] - np.eye(2)
    ) / dt
    assert -slope[0, 0] == pytest.approx(k1, rel=1e-3)
    assert -slope[1, 0] == pytest.approx(k2, rel=0.04)  # printed with two digits


@pytest.mark.parametrize(
    ("tuning", "poles"),
    [("low", (-10.0, -1.0)), ("moderate", (-100.0, -10.0))],
)
def test_luenberger_poles_survive_discretisation(
    frigate: Ship, tuning: str, poles: tuple[float, float]
) -> None:
    transition = get_observer("luenberger", tuning).discretise(frigate, 0.05)["transition"]
    found = np.log(np.sort(np.linalg.eigvals(transition))) / 0.05
    np.testing.assert_allclose(found, poles, rtol=1e-6)


def test_shaft_kalman_poles_are_the_printed_ones(frigate: Ship) -> None:
    first, second = ShaftKalman().poles(frigate)
    assert np.round([first.real, abs(first.imag)], 2).tolist() == [-10.53, 10.41]
    assert second == np.conj(first)


def test_shaft_kalman_gain_solves_its_riccati_equation(frigate: Ship) -> None:
    # P C' = K R gives P's first column; the Riccati equation's three entries follow in closed form
    k1, k2 = ShaftKalman().gain(frigate).ravel()
    assert k2**2 == pytest.approx(1e13)
    assert k1**2 == pytest.approx(5.0 - 2.0 * k2 / INERTIA)


def test_shaft_model_is_eq_3_3() -> None:
    a, b, c = shaft_model(INERTIA)
    acceleration = a @ [10.0, 2e5] + b.ravel() * 3e5
    np.testing.assert_allclose(acceleration, [(3e5 - 2e5) / INERTIA, 0.0])
    assert (c @ [10.0, 2e5]).tolist() == [10.0]
