"""Random-walk filters: state and covariance of a Kalman filter with matrices in NumPy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from shaftline.observers import ESTIMATE, get_observer
from shaftline.observers.random_walk_kalman import PrintedRandomWalkKalman, RandomWalkKalman

from .screw import DT, INERTIA, SHIP, Screw, noisy_measurements, sampled

SCREW = Screw()
TOTAL = 53697.0 + INERTIA
SAMPLES = 300
Step = Callable[[Any, Any, Any], tuple[Any, Any, float]]


def extended(x: Any, before: Any, now: Any) -> tuple[Any, Any, float]:
    """Return the predicted state, its Jacobian, and the measurement of the encoder."""
    w, v = x
    torque, pitch = 0.5 * (before[1] + now[1]), 0.5 * (before[2] + now[2])
    middle = w + 0.5 * DT * (torque - SCREW.torque(v, w, pitch)) / INERTIA
    predicted = w + DT * (torque - SCREW.torque(v, middle, pitch)) / INERTIA
    by_speed, by_velocity = SCREW.slopes(v, middle, pitch)
    slope = np.eye(2) + DT / INERTIA * np.array([[-by_speed, -by_velocity], [0.0, 0.0]])
    return np.array([predicted, v]), slope, now[0]


def printed(x: Any, before: Any, now: Any) -> tuple[Any, Any, float]:
    """Eq. 3-24: the first state is the deviation from the measured speed, which measures 0."""
    deviation, v = x
    w, torque, pitch = now[:3]
    by_speed, by_velocity = SCREW.slopes(v, w, pitch)
    engine = -45.5 * 7.38**2 * 0.95
    a = np.array([[(engine - by_speed) / TOTAL, -by_velocity / INERTIA], [0.0, 0.0]])
    drift = (torque - SCREW.torque(v, w, pitch)) / INERTIA
    predicted = deviation + DT * (a[0, 0] * deviation + drift)
    return np.array([predicted, v]), np.eye(2) + DT * a, 0.0


def filtered(step: Step, measurements: Any, first: float, q: Any, r: float) -> tuple[Any, Any]:
    """Return states and covariances by matrix equations, in Joseph's form."""
    x = np.array(
        [first, SCREW.velocity(measurements[0, 1], measurements[0, 0], measurements[0, 2])]
    )
    p, h = np.diag([r, 1.0]), np.array([[1.0, 0.0]])
    states, covariances = [x], [p]
    for before, now in itertools.pairwise(measurements):
        x, f, measured = step(x, before, now)
        p = f @ p @ f.T + q
        k = p @ h.T / (h @ p @ h.T + r)
        x = x + k[:, 0] * (measured - x[0])
        left = np.eye(2) - k @ h
        p = left @ p @ left.T + r * k @ k.T
        states.append(x)
        covariances.append(p)
    return np.array(states), np.array(covariances)


def test_extended_filter_is_the_textbooks() -> None:
    measurements = noisy_measurements(SAMPLES)
    observer = RandomWalkKalman(0.3, 1e-4, 2500.0, 0.03)
    q = np.diag([1e-4 * DT + (DT * 2500.0 / INERTIA) ** 2, 0.3 * DT])
    states, covariances = filtered(extended, measurements, measurements[0, 0], q, 0.03**2)
    after = sampled(observer.discretise(SHIP, DT), measurements)
    np.testing.assert_allclose([e["x"][:2] for e in after], states, rtol=1e-7)
    np.testing.assert_allclose([e["covariance"][:2, :2] for e in after], covariances, rtol=1e-6)
    np.testing.assert_allclose([e["advance_velocity"] for e in after], states[:, 1], rtol=1e-7)
    assert all(e["valid"] for e in after)
    assert np.std(states[100:, 1] - measurements[100:, 4]) < 0.3  # the estimate follows the truth


def test_printed_filter_is_the_textbooks() -> None:
    measurements = noisy_measurements(SAMPLES)
    observer = PrintedRandomWalkKalman(3.0, 1e-3, 0.0, 0.02)
    q = np.diag([1e-3 * DT, 3.0 * DT])
    states, covariances = filtered(printed, measurements, 0.0, q, 0.02**2)
    after = sampled(observer.discretise(SHIP, DT), measurements)
    np.testing.assert_allclose([e["x"][1] for e in after], states[:, 1], rtol=1e-7)
    np.testing.assert_allclose([e["x"][0] for e in after], states[:, 0], atol=1e-9)
    np.testing.assert_allclose([e["covariance"][:2, :2] for e in after], covariances, rtol=1e-6)
    assert all(e["valid"] for e in after)


@pytest.mark.parametrize("tuning", ["extended", "printed"])
def test_covariance_stays_symmetric_and_positive(tuning: str) -> None:
    record = get_observer("random-walk-kalman", tuning).discretise(SHIP, DT)
    for e in sampled(record, noisy_measurements(SAMPLES, seed=1)):
        p = e["covariance"]
        assert p[0, 1] == p[1, 0]
        assert p[0, 0] > 0.0
        assert p[1, 1] >= 0.0
        assert p[0, 0] * p[1, 1] - p[0, 1] ** 2 > -1e-9 * p[0, 0] * p[1, 1]


def test_default_covariances_are_those_of_instruments() -> None:
    assert RandomWalkKalman() == RandomWalkKalman(0.25, 0.0, 2e3, 0.02)
    record = RandomWalkKalman().discretise(SHIP, DT)
    assert record["process"][:2] == pytest.approx([(DT * 2e3 / INERTIA) ** 2, 0.25 * DT])
    assert record["measurement"] == pytest.approx(0.0004)
    record = get_observer("random-walk-kalman-printed").discretise(SHIP, DT)
    assert record["process"][:2] == pytest.approx([1e4 * DT, 1e11 * DT])  # section 3-6-3
    assert record["measurement"] == 1.0


@pytest.mark.parametrize("observer", [RandomWalkKalman(), PrintedRandomWalkKalman()])
def test_estimate_is_held_where_the_torque_curve_is_known(observer: RandomWalkKalman) -> None:
    w = 10.0
    top = 1.6 * w / (2.0 * math.pi) * 4.2
    record = observer.discretise(SHIP, DT)
    for torque, edge in ((5e5, 0.0), (-2e5, top)):
        (*_, last) = sampled(record, [(w, torque, 1.3, 0.0, 0.0)] * 400)
        assert last["x"][1] == last["advance_velocity"] == pytest.approx(edge, rel=1e-12)
        assert last["valid"] == 0
    (first,) = sampled(record, [(w, 5e5, 1.3, 0.0, 0.0)])
    assert first["valid"] == 0  # off the torque curve


@pytest.mark.parametrize(("w", "valid"), [(0.00099, 0), (0.00101, 1)])
@pytest.mark.parametrize("observer", [RandomWalkKalman(), PrintedRandomWalkKalman()])
def test_a_shaft_at_rest_gives_no_valid_estimate(
    observer: RandomWalkKalman, w: float, valid: int
) -> None:
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"], estimate["pitch_ratio"], estimate["shaft_speed"] = 1, 1.3, w
    estimate["x"][:2] = (w if type(observer) is RandomWalkKalman else 0.0), 0.0
    (after,) = sampled(observer.discretise(SHIP, DT), [(w, 0.0, 1.3, 0.0, 0.0)], estimate)
    assert after["valid"] == valid


def test_a_later_start_forgets_the_covariance() -> None:
    record = RandomWalkKalman().discretise(SHIP, DT)
    measurements = noisy_measurements(40)
    estimate = sampled(record, measurements)[-1]
    estimate["started"] = 0
    assert sampled(record, measurements[:1], estimate)[0] == sampled(record, measurements[:1])[0]
