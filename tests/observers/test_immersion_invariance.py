"""Immersion and invariance: the continuous equation, and the limits of the estimate."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shaftline.observers import ESTIMATE, get_observer
from shaftline.observers.immersion_invariance import ImmersionInvariance

from .screw import DT, INERTIA, SHIP, Screw, noisy_measurements, sampled

SCREW = Screw()


def continuous(gain: float, measurements: Any, dt: float) -> Any:
    """Integrate eq. 3-13 with linear interpolation, from the inverse of the first sample."""
    times = dt * np.arange(len(measurements))

    def rate(t: float, zeta: Any) -> Any:
        w, torque, pitch = (np.interp(t, times, measurements[:, i]) for i in range(3))
        return gain / INERTIA * (SCREW.torque(zeta[0] + gain * w, w, pitch) - torque)

    v = SCREW.velocity(measurements[0, 1], measurements[0, 0], measurements[0, 2])
    found = [v]
    shaft_speeds = itertools.pairwise(measurements[:, 0])
    for (start, end), (first, last) in zip(itertools.pairwise(times), shaft_speeds, strict=True):
        zeta = solve_ivp(rate, (start, end), [v - gain * first], rtol=1e-9, atol=1e-9).y[0, -1]
        v = zeta + gain * last
        found.append(v)
    return np.array(found)


@pytest.mark.parametrize("gain", [1.0, 4.0, 20.0])
def test_estimate_follows_the_equation(gain: float) -> None:
    """The error of the trapezoidal rule is proportional to the square of the step."""
    errors = []
    for dt in (0.02, 0.01):
        t = np.arange(0.0, 1.0, dt)
        w = 10.0 + 0.4 * np.sin(3.0 * t)
        torque = 1.75e5 + 2e4 * np.sin(4.0 * t + 1.0)
        pitch = 1.3 - 0.1 * t
        measurements = np.column_stack([w, torque, pitch, 0.0 * t, 0.0 * t])
        after = sampled(ImmersionInvariance(gain).discretise(SHIP, dt), measurements)
        estimate = np.array([e["advance_velocity"] for e in after])
        expected = continuous(gain, measurements, dt)
        assert np.ptp(expected) > 0.25
        errors.append(np.abs(estimate - expected).max())
    assert errors[1] < 6e-3
    assert errors[1] < 0.35 * errors[0]


def test_each_step_solves_the_trapezoidal_rule() -> None:
    gain, measurements = 4.0, noisy_measurements(20)
    after = sampled(ImmersionInvariance(gain).discretise(SHIP, DT), measurements)
    assert after[0]["advance_velocity"] == pytest.approx(
        SCREW.velocity(measurements[0, 1], measurements[0, 0], measurements[0, 2])
    )
    for k in range(1, len(measurements)):
        (w0, m0, p0), (w1, m1, p1) = measurements[k - 1, :3], measurements[k, :3]
        v0, v1 = (float(after[i]["advance_velocity"]) for i in (k - 1, k))
        rates = [
            gain / INERTIA * (SCREW.torque(v, w, p) - m)
            for v, w, p, m in ((v0, w0, p0, m0), (v1, w1, p1, m1))
        ]
        # The change of zeta is dt times the mean of its rates.
        moved = (v1 - gain * w1) - (v0 - gain * w0)
        assert moved == pytest.approx(0.5 * DT * sum(rates), abs=1e-9)


def test_tunings_are_the_printed_gains() -> None:
    gains = {name: observer.gain for name, observer in ImmersionInvariance.tunings.items()}
    assert gains == {"low": 1.0, "moderate": 4.0, "high": 20.0}
    assert get_observer("immersion-invariance-high").discretise(SHIP, DT)["gain"] == 20.0


def held(velocity: float, w: float, torque: float) -> Any:
    """Return the estimate that follows one at ``velocity``, with the same shaft speed."""
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"], estimate["advance_velocity"] = 1, velocity
    estimate["shaft_speed"], estimate["shaft_torque"], estimate["pitch_ratio"] = w, torque, 1.3
    record = ImmersionInvariance(4.0).discretise(SHIP, DT)
    (after,) = sampled(record, [(w, torque, 1.3, 0.0, 0.0)], estimate)
    return after


def test_estimate_ends_where_the_torque_curves_do() -> None:
    w = 10.0
    top = 1.6 * w / (2.0 * math.pi) * 4.2
    # One torque keeps the estimate, the other increases it slightly.
    for start, valid in ((top - 0.05, 1), (top + 0.05, 0)):
        after = held(start, w, SCREW.torque(start, w, 1.3))
        assert after["valid"] == valid
        assert after["advance_velocity"] == pytest.approx(min(start, top), rel=1e-9)


def test_estimate_may_go_astern_but_is_not_valid_there() -> None:
    w = 10.0
    lowest = -0.25 * 1.6 * w / (2.0 * math.pi) * 4.2
    for start in (0.05, -0.05, lowest + 0.05, lowest - 0.05):
        after = held(start, w, SCREW.torque(start, w, 1.3))
        assert after["valid"] == (start > 0.0)
        assert after["advance_velocity"] == pytest.approx(max(start, lowest), rel=1e-9)


def test_an_estimate_that_has_run_away_is_never_valid() -> None:
    assert held(1e200, 10.0, 1e5)["valid"] == 0


@pytest.mark.parametrize(("w", "follows"), [(0.00099, False), (0.00101, True)])
def test_a_shaft_at_rest_holds_the_estimate(w: float, follows: bool) -> None:
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"], estimate["advance_velocity"], estimate["pitch_ratio"] = 1, 0.001, 1.3
    record = ImmersionInvariance(4.0).discretise(SHIP, DT)
    (after,) = sampled(record, [(w, 0.0, 1.3, 0.0, 0.0)], estimate)
    assert (after["advance_velocity"] != 0.001) == follows
    assert after["valid"] == 0
