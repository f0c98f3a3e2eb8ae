"""Observers with M_p = M_m - I_R omega' and a measured or derived acceleration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.observers import get_observer
from shaftline.observers.shaft_acceleration import ShaftAccelerationDerived

from .screw import DT, INERTIA, SHIP, Screw, noisy_measurements, sampled


def test_measured_acceleration_takes_the_inertia_out() -> None:
    measurements = noisy_measurements(30)
    after = sampled(get_observer("shaft-acceleration").discretise(SHIP, DT), measurements)
    expected = [
        Screw().velocity(torque - INERTIA * acceleration, w, pitch)
        for w, torque, pitch, acceleration, _ in measurements
    ]
    assert [e["advance_velocity"] for e in after] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("lost", [math.nan, math.inf, -math.inf])
def test_without_an_acceleration_the_estimate_is_held(lost: float) -> None:
    record = get_observer("shaft-acceleration").discretise(SHIP, DT)
    first, second = sampled(record, [(10.0, 1.8e5, 1.3, 0.1, 8.0), (10.0, 1.5e5, 1.3, lost, 8.0)])
    assert first["valid"] == 1
    assert second["advance_velocity"] == first["advance_velocity"]
    assert second["valid"] == 0


@pytest.mark.parametrize("time_constant", [0.1, 0.4])
def test_derivative_of_a_ramp_comes_with_the_filters_lag(time_constant: float) -> None:
    """s / (T s + 1) of a ramp with slope a is a (1 - exp(-t / T)), exactly at every sample."""
    slope, t = 0.2, DT * np.arange(12)
    w = 9.0 + slope * t
    record = ShaftAccelerationDerived(time_constant).discretise(SHIP, DT)
    after = sampled(record, [(speed, 1.7e5, 1.3, math.nan, 0.0) for speed in w])
    derived = slope * (1.0 - np.exp(-t / time_constant))
    expected = [
        Screw().velocity(1.7e5 - INERTIA * a, speed, 1.3)
        for a, speed in zip(derived, w, strict=True)
    ]
    assert [e["advance_velocity"] for e in after] == pytest.approx(expected, rel=1e-7)
    assert get_observer("shaft-acceleration-derived") == ShaftAccelerationDerived(0.1)
