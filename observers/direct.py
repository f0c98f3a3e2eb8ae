"""`none` and `oracle`: the two ends of every comparison."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import NONE, ORACLE, Measurement, blank_observer


@dataclass(frozen=True)
class NoObserver:
    """No estimate at all: 0 m/s, never valid."""

    name: ClassVar[str] = "none"
    kind: ClassVar[int] = NONE
    tunings: ClassVar[dict[str, NoObserver]] = {}

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        return blank_observer(self.kind, ship.record(), dt)


@dataclass(frozen=True)
class Oracle:
    """The true advance velocity, which no ship can measure."""

    name: ClassVar[str] = "oracle"
    kind: ClassVar[int] = ORACLE
    tunings: ClassVar[dict[str, Oracle]] = {}

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        return blank_observer(self.kind, ship.record(), dt)


@compiled
def update_none(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    """No estimate."""
    return 0.0, False


@compiled
def update_oracle(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    """The truth, where there is one."""
    if not math.isfinite(m.advance_velocity):
        return estimate.advance_velocity, False
    return m.advance_velocity, True
