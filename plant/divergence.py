"""Simulations that diverge: the first sample in which a signal leaves every bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ship import Ship
from .signals import SAMPLE, SIGNALS

_BEYOND = 1e3
"""Times the registry's range of a signal, beyond which its simulation has diverged."""

_LIMITS = np.array(
    [
        math.inf if signal.source == "demand" else _BEYOND * max(abs(signal.low), abs(signal.high))
        for signal in SIGNALS
    ]
)
"""Demands are the user's, and of a drive in whatever unit it takes; each of them is finite."""


class DivergenceError(ValueError):
    """A simulation that diverges; the message names the signal, its value and the time."""


def refuse_divergence(ship: Ship, samples: NDArray[Any]) -> None:
    """Refuse samples that hold a number that is not finite, or one far beyond its signal's range.

    Args:
        ship: that was simulated, for the message.
        samples: SAMPLE array of shape (n,), contiguous.

    Raises:
        DivergenceError: names the signal, its value and the time.
    """
    values = samples.view(np.float64).reshape(-1, len(SAMPLE.names or ()))
    good = np.abs(values) <= _LIMITS  # false for nan as well
    good &= np.isfinite(values)
    if good.all():
        return
    row = int(np.argmin(good.all(axis=1)))
    signal = SIGNALS[int(np.argmin(good[row]))]
    value, time = float(samples[signal.name][row]), float(samples["time"][row])
    raise DivergenceError(
        f"{ship.name}: the simulation diverges: {signal.column} = {value:.3g} {signal.unit} at "
        f"{time:.4g} s. The initial state, an input or a parameter of the ship is many orders too "
        f"large, or too fast for the time step of {ship.time_step_s:g} s"
    )
