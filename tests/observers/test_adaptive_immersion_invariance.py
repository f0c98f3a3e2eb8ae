"""Immersion and invariance with an adaptive gain: its equations in NumPy, noise and sea."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from shaftline.observers import follow, get_observer, simulated_measurements, variance_accounted_for
from shaftline.observers.immersion_invariance import (
    AdaptiveImmersionInvariance,
    CovarianceImmersionInvariance,
    ImmersionInvariance,
)
from shaftline.plant import Equilibrium, Schedule, Ship, simulate

from .screw import DT, INERTIA, SHIP, Screw, noisy_measurements, sampled

SCREW = Screw()
RULES = [AdaptiveImmersionInvariance(), CovarianceImmersionInvariance(scale=8.0)]


def gain_of(observer: Any, x: Any, p: Any, a: float) -> float:
    """Return gamma of a rule, without its limits."""
    if isinstance(observer, CovarianceImmersionInvariance):
        return observer.scale * math.sqrt(p[1, 1])
    return float((x[1] / (4.0 * a * x[0])) ** (1.0 / 3.0))


@pytest.mark.parametrize("observer", RULES)
def test_gain_noise_and_sea_are_those_of_the_equations(observer: Any) -> None:
    measurements = noisy_measurements(120)
    after = sampled(observer.discretise(SHIP, DT), measurements)
    p, x = np.diag([0.0004, 1.0]), np.array([0.0004, 0.25, after[0]["advance_velocity"], 0.0])
    gains = []
    for (before, now), (last, this) in zip(
        itertools.pairwise(measurements), itertools.pairwise(after), strict=True
    ):
        v, w = float(last["advance_velocity"]), before[0]
        slopes = SCREW.slopes(v, w, before[2])
        gain = min(max(gain_of(observer, x, p, -slopes[1] / INERTIA), 0.1), 20.0)
        gains.append(gain)
        # The innovation is the change of the shaft speed that the trapezoidal rule does not explain.
        v_now = float(this["advance_velocity"])
        torques = [SCREW.torque(v, w, before[2]), SCREW.torque(v_now, now[0], now[2])]
        model = 0.5 * DT * (before[1] + now[1] - sum(torques)) / INERTIA
        innovation = now[0] - w - model
        assert v_now == pytest.approx(v + gain * innovation, rel=1e-6)
        away = v_now - x[2]
        x[0] += DT / 5.0 * ((innovation - x[3]) ** 2 / 6.0 - x[0])
        x[1] += DT / 30.0 * (2.0 * away * away - x[1])
        x[2] += DT * away
        x[3] = innovation
        f = np.eye(2) + DT / INERTIA * np.array([[-slopes[0], -slopes[1]], [0.0, 0.0]])
        p = f @ p @ f.T + np.diag([0.0, x[1] * DT])
        k = p[:, 0] / (p[0, 0] + x[0])
        p = p - np.outer(k, p[0])
        np.testing.assert_allclose(this["x"], x, rtol=1e-4, atol=1e-7)
        if isinstance(observer, CovarianceImmersionInvariance):
            np.testing.assert_allclose(this["covariance"][:2, :2], p, rtol=1e-4)
        assert this["valid"] == 1
    assert np.ptp(gains) > 0.1


@pytest.fixture(scope="module")
def swell(frigate: Ship, design_point: Equilibrium) -> Any:
    def of(amplitude: float) -> Any:
        schedule = Schedule(22.0, 1.4, inflow=lambda t: amplitude * np.sin(0.7 * t))
        run = simulate(frigate, schedule, 90.0, initial=design_point.state, dt=0.01)
        return simulated_measurements(run)

    return of


def final(observer: Any, ship: Ship, measurements: Any, noise: float) -> Any:
    """Return the final ESTIMATE record with white noise on the shaft speed [rad/s]."""
    measurements = measurements.copy()
    measurements[:, 0] += noise * np.random.default_rng(3).standard_normal(len(measurements))
    return sampled(observer.discretise(ship, 0.01), measurements)[-1]


def test_noise_and_sea_are_distinguished(frigate: Ship, swell: Any) -> None:
    """White noise is estimated within 10 %; sin(0.7 t) about its 1 s mean has 0.57 of its size."""
    for amplitude, noise in ((0.5, 0.01), (0.5, 0.04), (1.0, 0.02)):
        x = final(get_observer("immersion-invariance-adaptive"), frigate, swell(amplitude), noise)[
            "x"
        ]
        assert math.sqrt(x[0]) == pytest.approx(noise, rel=0.1)
        share = 0.7 / math.hypot(1.0, 0.7)
        assert math.sqrt(x[1]) == pytest.approx(amplitude * share, rel=0.3)


def test_noise_reduces_the_gain_and_sea_increases_it(frigate: Ship, swell: Any) -> None:
    def gain(observer: Any, amplitude: float, noise: float) -> float:
        last = final(observer, frigate, swell(amplitude), noise)
        a = -Screw(frigate).slopes(last["advance_velocity"], last["shaft_speed"], 1.4)[1] / 14411.0
        return gain_of(observer, last["x"], last["covariance"], a)

    optimal, by_covariance = RULES
    assert gain(optimal, 0.5, 0.01) > 1.7 * gain(optimal, 0.5, 0.05)
    assert gain(optimal, 1.0, 0.02) > 1.2 * gain(optimal, 0.3, 0.02)
    assert gain(by_covariance, 1.0, 0.02) > 1.2 * gain(by_covariance, 0.3, 0.02)
    assert gain(by_covariance, 0.5, 0.05) > gain(by_covariance, 0.5, 0.01)  # the wrong way


def test_one_setting_is_close_to_the_best_fixed_gain_of_each_noise(
    frigate: Ship, swell: Any
) -> None:
    measurements = swell(0.8)
    fixed = {g: ImmersionInvariance(g) for g in (0.35, 0.7, 1.4, 2.8, 5.6, 11.2)}
    short: dict[Any, list[float]] = {}
    for noise in (0.003, 0.03, 0.15):
        noisy = measurements.copy()
        noisy[:, 0] += noise * np.random.default_rng(5).standard_normal(len(noisy))

        def vaf(observer: Any, given: Any = noisy) -> float:
            velocity, _ = follow(observer, frigate, given, 0.01)
            return variance_accounted_for(given[3000:, 4], velocity[3000:])

        found: dict[Any, float] = {g: vaf(observer) for g, observer in fixed.items()}
        found["adaptive"] = vaf(get_observer("immersion-invariance-adaptive"))
        best = max(found[g] for g in fixed)
        for name, own in found.items():
            short.setdefault(name, []).append(best - own)
    assert max(short.pop("adaptive")) < 0.5
    assert min(max(lost) for lost in short.values()) > 4.0  # no fixed gain is good for all noises


def test_the_gain_is_that_of_the_least_error() -> None:
    """The gain minimises the error of the linear equation with a given random walk and white noise."""
    rng, a, q, r, dt, n = np.random.default_rng(1), 2.5, 0.3, 4e-4, 0.01, 400_000
    walk, noise = math.sqrt(q * dt) * rng.standard_normal(n), math.sqrt(r) * rng.standard_normal(n)

    def variance(gain: float) -> float:
        # The error of the observer decays and changes by gamma (n+ - n) - walk per sample.
        forced = gain * np.diff(noise, prepend=0.0) - walk
        decay = math.exp(-gain * a * dt)
        return float(np.var(lfilter([1.0], [1.0, -decay], forced)[1000:]))

    best = gain_of(AdaptiveImmersionInvariance(), [r, q], None, a)
    least = min(variance(best * f) for f in (0.8, 0.9, 1.0, 1.1, 1.25))
    assert variance(best) < 1.01 * least
    assert variance(0.5 * best) > 1.1 * least
    assert variance(2.0 * best) > 1.1 * least


def test_the_gain_stays_within_its_limits_and_restarts() -> None:
    measurements = noisy_measurements(30)
    for limit in (0.3, 9.0):
        held = AdaptiveImmersionInvariance(lowest=limit, highest=limit).discretise(SHIP, DT)
        fixed = ImmersionInvariance(limit).discretise(SHIP, DT)
        for own, other in zip(
            sampled(held, measurements), sampled(fixed, measurements), strict=True
        ):
            assert own["advance_velocity"] == other["advance_velocity"]
    for observer in RULES:
        record = observer.discretise(SHIP, DT)
        estimate = sampled(record, measurements)[-1]
        estimate["started"] = 0
        again, first = (
            sampled(record, measurements[:1], estimate)[0],
            sampled(record, measurements[:1])[0],
        )
        for field in ("x", "covariance", "advance_velocity"):
            assert again[field] == pytest.approx(first[field], rel=1e-9)
