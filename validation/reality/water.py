"""A long-crested JONSWAP head sea of its own: components of equal energy with random phases."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81
COMPONENTS = 48

Waves = NDArray[np.float64]
"""Shape (n, 5), one component a row: elevation amplitude [m], inflow amplitude at the propeller [m/s],
circular frequency [rad/s], wave number along the track [rad/m], phase [rad]."""


def calm() -> Waves:
    """No waves at all."""
    return np.zeros((0, 5))


def head_sea(
    height: float, period: float, depth: float, seed: int, peakedness: float = 3.3,
    angle: float = 0.0,
) -> Waves:  # fmt: skip
    """Draw a sea that meets the ship.

    Args:
        height: significant wave height [m].
        period: peak period [s].
        depth: of the propeller's centre [m].
        seed: of the phases and frequencies.
        peakedness: gamma [-].
        angle: off the bow [rad].

    Returns:
        Components, each carrying the same share of the energy height^2 / 16.
    """
    rng = np.random.default_rng(seed)
    grid = np.linspace(0.5, 3.5, 4000) * 2.0 * math.pi / period
    ratio = grid * period / (2.0 * math.pi)
    sigma = np.where(ratio < 1.0, 0.07, 0.09)
    density = ratio**-5 * np.exp(-1.25 / ratio**4)
    density *= peakedness ** np.exp(-((ratio - 1.0) ** 2) / (2.0 * sigma**2))
    share = np.cumsum(density)
    wanted = (np.arange(COMPONENTS) + rng.random(COMPONENTS)) / COMPONENTS
    frequency = np.interp(wanted, share / share[-1], grid)
    number = frequency**2 / GRAVITY
    waves = np.zeros((COMPONENTS, 5))
    waves[:, 0] = height / 4.0 * math.sqrt(2.0 / COMPONENTS)
    # in a head sea's crest the water runs against the ship: it adds to the inflow
    waves[:, 1] = waves[:, 0] * frequency * np.exp(-number * depth) * math.cos(angle)
    waves[:, 2] = frequency
    waves[:, 3] = number * math.cos(angle)
    waves[:, 4] = rng.uniform(0.0, 2.0 * math.pi, COMPONENTS)
    return waves
