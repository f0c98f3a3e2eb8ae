"""Torque curve in NumPy, independent of the compiled one, and a ship with all factors unlike 1."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.optimize import brentq

from shaftline.observers import ESTIMATE, Measurement, update
from shaftline.plant import Ship, load_ship
from shaftline.plant.open_water import PITCH_POWERS, b_series

SHIP = load_ship("frigate").with_values(
    {
        "propeller.relative_rotative_efficiency": 0.98,
        "propeller.entrained_inertia_kg_m2": 1500.0,
        "water.density_kg_m3": 1000.0,
    }
)
INERTIA = 14411.0 + 1500.0
DT = 0.05


class Screw:
    """Torque curve of a B-series propeller."""

    def __init__(self, ship: Ship = SHIP) -> None:
        screw = ship.propeller
        self.curve = b_series("KQ", screw.expanded_area_ratio, screw.blades)
        self.diameter = screw.diameter_m
        efficiency = ship.propeller.relative_rotative_efficiency
        self.factor = ship.water.density_kg_m3 * self.diameter**5 / efficiency

    def kq(self, j: float, pitch: float) -> float:
        powers = np.array([pitch**k for k in PITCH_POWERS])
        return float(powers @ self.curve @ np.array([1.0, j, j**2, j**3]))

    def torque(self, v: float, w: float, pitch: float) -> float:
        n = w / (2.0 * math.pi)
        return self.factor * n * n * self.kq(max(v / (n * self.diameter), -0.25), pitch)

    def slopes(self, v: float, w: float, pitch: float) -> tuple[float, float]:
        """Return the derivatives by omega and by v_a, from central differences."""
        h = 1e-5
        by_speed = (self.torque(v, w + h, pitch) - self.torque(v, w - h, pitch)) / (2 * h)
        by_velocity = (self.torque(v + h, w, pitch) - self.torque(v - h, w, pitch)) / (2 * h)
        return by_speed, by_velocity

    def velocity(self, torque: float, w: float, pitch: float) -> float:
        """Return the advance velocity at a torque on the curve."""
        top = 1.3 * w / (2.0 * math.pi) * self.diameter
        found: float = brentq(
            lambda v: self.torque(v, w, pitch) - torque, 0.0, top, xtol=1e-13, rtol=1e-14
        )
        return found


def sampled(observer: Any, measurements: Iterable[Any], estimate: Any = None) -> list[Any]:
    """Return a copy of the ESTIMATE record after each measurement."""
    estimate = np.zeros(1, ESTIMATE)[0] if estimate is None else estimate
    after = []
    for measurement in measurements:
        update(observer, estimate, Measurement(*measurement))
        after.append(estimate.copy())
    return after


def noisy_measurements(n: int, seed: int = 0) -> Any:
    """Return measurements about the design point with oscillations and noise, shape (n, 5)."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(n)
    screw = Screw()
    w = 10.5 + 0.3 * np.sin(1.1 * t)
    v = 8.0 + 0.8 * np.sin(0.7 * t)
    pitch = 1.3 + 0.05 * np.sin(0.4 * t)
    acceleration = 0.33 * np.cos(1.1 * t)
    torque = [
        screw.torque(*row) + INERTIA * a
        for row, a in zip(zip(v, w, pitch, strict=True), acceleration, strict=True)
    ]
    noise = rng.normal(size=(n, 4)) * (0.01, 1e3, 2e-3, 2e-2)
    return np.column_stack([np.column_stack([w, torque, pitch, acceleration]) + noise, v])
