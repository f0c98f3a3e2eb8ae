"""Observers `none` and `oracle`: the lower and upper bound of every comparison."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.compiled import Record, compiled
from .base import Observer
from .records import Measurement


@dataclass(frozen=True)
class NoObserver(Observer):
    """Give no estimate (0 m/s, never valid)."""

    name = "none"
    uses_torque = False

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Return 0 m/s, not valid."""
        return 0.0, False


@dataclass(frozen=True)
class Oracle(Observer):
    """Give the true advance velocity, which only a simulation has."""

    name = "oracle"
    uses_instruments = False
    uses_torque = False

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Return the true advance velocity; not valid where it is not finite."""
        if not math.isfinite(m.advance_velocity):
            return estimate.advance_velocity, False
        return m.advance_velocity, True
