"""Linear observer and its exact discretisation."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from shaftline.observers import ESTIMATE, get_observer
from shaftline.observers.linear import LinearObserver, first_order_hold, shaft_model
from shaftline.plant import Ship

from .screw import DT, INERTIA, SHIP, Screw, noisy_measurements, sampled

LINEAR = ["luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman"]


def test_first_order_hold_equals_lsim() -> None:
    """SciPy's lsim interpolates its input linearly by another formula."""
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


def test_shaft_model_is_eq_3_3() -> None:
    a, b, c = shaft_model(INERTIA)
    acceleration = a @ [10.0, 2e5] + b.ravel() * 3e5
    np.testing.assert_allclose(acceleration, [(3e5 - 2e5) / INERTIA, 0.0])
    assert (c @ [10.0, 2e5]).tolist() == [10.0]


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("dt", [1e-4, 0.05, 1.0])
def test_discrete_observer_is_stable_at_any_step(frigate: Ship, name: str, dt: float) -> None:
    transition = get_observer(name).discretise(frigate, dt)["transition"]
    assert np.abs(np.linalg.eigvals(transition)).max() < 1.0


@pytest.mark.parametrize("name", LINEAR)
def test_steady_measurements_are_a_fixed_point(frigate: Ship, name: str) -> None:
    record = get_observer(name).discretise(frigate, 0.05)
    steady = np.array([10.5, 143850.0])  # omega, M_m = M_p
    following = (record["transition"] + record["before"] + record["now"]) @ steady
    np.testing.assert_allclose(following, steady, rtol=1e-9)


@pytest.mark.parametrize("name", ["luenberger-low", "shaft-kalman"])
def test_states_follow_the_continuous_observer(name: str) -> None:
    """omega^' = (M_m - M_p^)/I + k1 (omega - omega^), M_p^' = k2 (omega - omega^)."""
    measurements = noisy_measurements(25)
    observer = get_observer(name)
    assert isinstance(observer, LinearObserver)
    k1, k2 = observer.gain(SHIP).ravel()
    times = DT * np.arange(len(measurements))

    def rate(t: float, x: NDArray[np.float64]) -> Any:
        w, torque = (np.interp(t, times, measurements[:, i]) for i in (0, 1))
        return [(torque - x[1]) / INERTIA + k1 * (w - x[0]), k2 * (w - x[0])]

    x = measurements[0, :2]  # steady state at the first sample
    expected = [x]
    for start, end in itertools.pairwise(times):
        x = solve_ivp(rate, (start, end), x, "DOP853", rtol=1e-11, atol=1e-9).y[:, -1]
        expected.append(x)
    after = sampled(observer.discretise(SHIP, DT), measurements)
    np.testing.assert_allclose([e["x"][:2] for e in after], expected, rtol=1e-8)
    velocities = [
        Screw().velocity(x[1], x[0], row[2]) for x, row in zip(expected, measurements, strict=True)
    ]
    assert [e["advance_velocity"] for e in after] == pytest.approx(velocities, rel=1e-7)


@pytest.mark.parametrize(("share", "valid"), [(0.198, 1), (-0.198, 1), (0.202, 0), (-0.202, 0)])
def test_an_estimate_is_trusted_within_a_fifth_of_the_shaft_speed(share: float, valid: int) -> None:
    record = get_observer("luenberger").discretise(SHIP, DT)
    record["transition"], record["before"], record["now"] = np.eye(2), 0.0, 0.0  # constant x
    w, pitch = 10.0, 1.3
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"] = 1
    estimate["x"][:2] = (1.0 + share) * w, Screw().torque(5.0, (1.0 + share) * w, pitch)
    (after,) = sampled(record, [(w, 1e5, pitch, 0.0, 0.0)], estimate)
    assert after["advance_velocity"] == pytest.approx(5.0)
    assert after["valid"] == valid
