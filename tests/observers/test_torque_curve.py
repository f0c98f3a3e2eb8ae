"""Torque curve: the B-series in NumPy, its inverse, and the ends of the curve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.observers.torque_curve import (
    AT_REST,
    highest_velocity,
    model_torque,
    torque_slopes,
    velocity_from_torque,
)
from shaftline.plant.propeller import torque_coefficient

from .screw import SHIP, Screw

PLANT, SCREW = SHIP.record(), Screw()
POINTS = [(8.0, 10.5, 1.3), (2.0, 6.0, 0.7), (-0.5, 9.0, 1.1), (12.0, 13.0, 1.4)]


@pytest.mark.parametrize(("v", "w", "pitch"), POINTS)
def test_torque_is_the_b_series(v: float, w: float, pitch: float) -> None:
    assert model_torque(PLANT, v, w, pitch) == pytest.approx(SCREW.torque(v, w, pitch), rel=1e-12)


@pytest.mark.parametrize(("v", "w", "pitch"), POINTS)
def test_slopes_are_the_derivatives(v: float, w: float, pitch: float) -> None:
    assert torque_slopes(PLANT, v, w, pitch) == pytest.approx(SCREW.slopes(v, w, pitch), rel=1e-7)


def test_torque_is_held_below_the_least_advance_ratio() -> None:
    w = 9.0
    edge = -0.25 * w / (2.0 * math.pi) * 4.2
    held = model_torque(PLANT, edge, w, 1.2)
    assert model_torque(PLANT, edge - 5.0, w, 1.2) == pytest.approx(held, rel=1e-12)
    assert model_torque(PLANT, edge + 0.1, w, 1.2) != pytest.approx(held, rel=1e-4)
    # The derivatives are those at the end of the curve.
    beyond, at = (torque_slopes(PLANT, edge - away, w, 1.2) for away in (5.0, 0.0))
    assert beyond == pytest.approx(at, rel=1e-9)


@pytest.mark.parametrize(("v", "w", "pitch"), [p for p in POINTS if p[0] > 0.0])
def test_velocity_is_the_inverse(v: float, w: float, pitch: float) -> None:
    torque = SCREW.torque(v, w, pitch)
    for guess in (0.0, v, 30.0, math.nan):
        found, valid = velocity_from_torque(PLANT, torque, w, pitch, guess)
        assert found == pytest.approx(v, rel=1e-9)
        assert valid


def test_a_torque_off_the_curve_is_held_at_its_edge() -> None:
    w, pitch = 10.0, 1.2
    bollard = SCREW.torque(0.0, w, pitch)
    assert velocity_from_torque(PLANT, 1.001 * bollard, w, pitch, 5.0) == (0.0, False)
    found, valid = velocity_from_torque(PLANT, 0.999 * bollard, w, pitch, 5.0)
    assert valid
    assert 0.0 < found < 0.1
    top, valid = velocity_from_torque(PLANT, -2.0 * bollard, w, pitch, 5.0)
    assert not valid
    assert top == pytest.approx(1.6 * w / (2.0 * math.pi) * 4.2)  # KQ falls over the whole range
    assert highest_velocity(PLANT, w) == pytest.approx(top)


def test_near_standstill_the_estimate_is_not_valid() -> None:
    slowest = 1e-3 * 2.0 * math.pi  # one revolution in 1000 s
    assert velocity_from_torque(PLANT, 0.0, 0.999 * slowest, 1.2, 3.0) == (3.0, False)
    assert velocity_from_torque(PLANT, 0.0, -5.0, 1.2, 3.0) == (3.0, False)
    torque = SCREW.torque(1e-3, 1.001 * slowest, 1.2)
    assert velocity_from_torque(PLANT, torque, 1.001 * slowest, 1.2, 0.0)[1]
    assert np.isclose(AT_REST, 1e-3)


def test_a_table_of_ones_own_is_inverted_like_the_polynomials() -> None:
    """With an open-water table: torque, derivatives, and the velocity from the torque."""
    ratios, pitches = [0.05 * k - 0.1 for k in range(32)], [0.7, 1.0, 1.3]
    rows = [[float(torque_coefficient(PLANT, j, p)) for j in ratios] for p in pitches]
    tabled = SHIP.with_values(
        {
            "propeller.model": "table",
            "propeller.pitch_ratio_min": 0.7,
            "propeller.pitch_ratio_max": 1.3,
            "propeller.open_water": {
                "advance_ratio": ratios,
                "pitch_ratio": pitches,
                "thrust_coefficient": rows,
                "torque_coefficient": rows,
            },
        }
    ).record()
    for v, w, pitch in ((8.0, 10.5, 1.3), (2.0, 6.0, 0.7), (5.0, 9.0, 1.15)):
        torque = model_torque(tabled, v, w, pitch)
        found, valid = velocity_from_torque(tabled, torque, w, pitch, 3.0)
        assert valid
        assert found == pytest.approx(v, rel=1e-9)
        by_speed, by_velocity = torque_slopes(tabled, v, w, pitch)
        more = model_torque(tabled, v + 1e-5, w, pitch) - model_torque(tabled, v - 1e-5, w, pitch)
        assert by_velocity == pytest.approx(more / 2e-5, rel=1e-5)
        faster = model_torque(tabled, v, w + 1e-5, pitch) - model_torque(tabled, v, w - 1e-5, pitch)
        assert by_speed == pytest.approx(faster / 2e-5, rel=1e-5)
    assert model_torque(tabled, 8.0, 10.5, 1.3) == pytest.approx(
        SCREW.torque(8.0, 10.5, 1.3), rel=1e-3
    )
    assert highest_velocity(tabled, 9.0) == pytest.approx(1.45 * 4.2 * 9.0 / (2.0 * math.pi))
