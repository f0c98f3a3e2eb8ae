"""A plant of straight lines: two balances whose residuals are linear in some numbers of the frigate.

What a search, a fit or a judgement makes of it can be worked out by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from shaftline.mismatch import Effect, catalogue
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.search.spectra import Bands, make_bands
from shaftline.plant import Ship, load_ship

Array = NDArray[np.float64]

ROWS = 600
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
VISCOUS = "transmission.viscous_friction_engine_side_N_m_s_rad"
FOULING = "hull.fouling_fraction"
RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
TIME = np.arange(float(ROWS))
SPEED = 10.0 + np.sin(TIME / 17.0)


def entry(label: str) -> Effect:
    """An entry of the catalogue by its label."""
    return next(effect for effect in catalogue() if effect.label == label)


def steps(seed: int) -> Array:
    """Levels that change every 30 rows, of rms about 1."""
    return np.repeat(np.random.default_rng(seed).standard_normal(ROWS // 30), 30)


def white(seed: int, *rms: float) -> Array:
    """Independent noise, one row a balance."""
    return np.array(rms)[:, None] * np.random.default_rng(seed).standard_normal((len(rms), ROWS))


SLOPES: dict[str, Array] = {
    FRICTION: np.array([1e-3 * (1.0 + 0.3 * steps(1)), np.zeros(ROWS)]),
    VISCOUS: np.array([1e-2 * np.random.default_rng(3).standard_normal(ROWS), np.zeros(ROWS)]),
    FOULING: np.array([np.zeros(ROWS), 40.0 * steps(2)]),
    RESISTANCE: np.array([np.zeros(ROWS), 0.02 * steps(4)]),
}
"""Residual of the engine's and the hull's balance for each unit of a number."""


class Toy:
    """Stands for the balances and for the replay behind them.

    Args:
        truth: numbers of the true ship, by key.
        noise: of the two residuals.
        known: tolerance of the resistance; everything else is known exactly.
    """

    names = ("engine", "hull")
    units = ("N m", "N")
    moving = True
    has_torque = True
    prime_mover = "engine"
    controllable = False
    start = (1.2, 10.0, 7.0)
    segments = ((0, ROWS),)
    interval_s = 1.0
    dt = 0.05
    rows = ROWS
    excited = True
    outside: ClassVar[dict[str, Any]] = {}
    recorded: ClassVar[dict[str, Any]] = {}
    line = False
    every = 1
    steady = False

    def __init__(
        self, truth: dict[str, float], noise: Array, known: float = 0.0, ship: Ship | None = None
    ) -> None:
        self.replay = self
        frigate = load_ship("frigate") if ship is None else ship
        known_by = (key for key, value in frigate.tolerances if isinstance(value, float))
        exact = {f"tolerances.{key}": 0.0 for key in known_by}
        self.ship = frigate.with_values(exact | {"tolerances.resistance": known})
        self.plant = self.ship.record()
        self.runs = [self]
        self.quantisation: dict[str, float] = {}
        self.time_s = TIME
        self.drive_rows = 20.0 + 3.0 * steps(5)
        self.command = np.full(ROWS, 1.2)
        self.nominal_samples = self.simulate(self.plant)
        self.nominal = self.simulated(self.nominal_samples)
        record = self.ship.with_values(truth).record()
        true = self.simulate(record)
        self.measured = {
            name: true[name] + row for name, row in zip(self.names, noise, strict=True)
        }

    def simulate(self, plant: Any, shift: Any = (0.0, 0.0, 0.0)) -> dict[str, Array]:
        own = self.ship.record()
        rows = np.zeros((2, ROWS))
        for key, slope in SLOPES.items():
            number = self.ship.parameter(key)
            rows += slope * (number.read(plant) - number.read(own))
        level: dict[str, Any] = {
            "propeller_torque": 2e5,
            "brake_torque": 3e4,
            "resistance": 1.5e5,
            "ship_speed": 7.0,
            "motor_current": 0.0,
            "pitch_ratio": 1.2,
            "shaft_speed": SPEED,
            "drive": 20.0 + steps(5),
            "thrust": 2e5,
        }
        samples = {name: np.zeros(ROWS) + value for name, value in level.items()}
        return samples | dict(zip(self.names, rows, strict=True))

    def simulate_signals(self, plant: Any, signals: Sequence[str]) -> dict[str, Array]:
        samples = self.simulate(plant)
        return {name: samples[name] for name in signals}

    def simulated(self, samples: dict[str, Array]) -> dict[str, Array]:
        return {name: samples[name] for name in self.names}

    def simulate_channels(self, plant: Any, shift: Any = (0.0, 0.0, 0.0)) -> dict[str, Array]:
        return self.simulated(self.simulate(plant, shift))

    def simulate_ships(self, plants: Sequence[Any], shifts: Any = ()) -> list[dict[str, Array]]:
        return list(map(self.simulate_channels, plants))

    def residuals(self, channels: dict[str, Array]) -> Array:
        return np.array([channels[name] for name in self.names])

    def residuals_against(self, simulated: dict[str, Array]) -> Array:
        return self.residuals(self.measured) - self.residuals(simulated)


def bands(last: int = ROWS) -> Bands:
    return make_bands([(0, last)], 1.0, 2, 0.4)


def fitter(
    truth: dict[str, float],
    seed: int = 0,
    rms: tuple[float, float] = (0.5, 2.0),
    known: float = 0.0,
) -> Fitter:
    """Fits the toy, with white noise of its own on either balance."""
    return Fitter(Toy(truth, white(seed, *rms), known), bands())  # type: ignore[arg-type]
