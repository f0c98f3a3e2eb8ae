"""`none` and `oracle`: the two ends of every comparison."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.compiled import Record, compiled
from .base import Observer
from .records import Measurement


@dataclass(frozen=True)
class NoObserver(Observer):
    """No estimate at all: 0 m/s, never valid."""

    name = "none"
    reads_torque = False

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """No estimate."""
        return 0.0, False


@dataclass(frozen=True)
class Oracle(Observer):
    """The true advance velocity, which no ship can measure."""

    name = "oracle"
    reads_instruments = False
    reads_torque = False

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """The truth, where there is one."""
        if not math.isfinite(m.advance_velocity):
            return estimate.advance_velocity, False
        return m.advance_velocity, True
