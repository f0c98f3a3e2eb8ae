"""An effect at some size: an entry of the catalogue with values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .effect import Effect, Parameter

Window = tuple[float, float]
"""Start and end [s]."""


@dataclass(frozen=True)
class Placed:
    """An effect with values.

    Args:
        effect: the catalogue's entry.
        values: of its parameters, in its order, in the ship file's units.
        window: in which it acts, where it acts for a time.
    """

    effect: Effect
    values: tuple[float, ...]
    window: Window | None = None

    @property
    def pairs(self) -> tuple[tuple[Parameter, float], ...]:
        """Each parameter with its value."""
        return tuple(zip(self.effect.parameters, self.values, strict=True))

    def in_place_of(self, effects: tuple[Placed, ...], which: int) -> tuple[Placed, ...]:
        """Some effects with this one where another stood."""
        return (*effects[:which], self, *effects[which + 1 :])

    def with_values(self, values: Any) -> Placed:
        """The same effect with other values."""
        return Placed(self.effect, tuple(float(v) for v in values), self.window)
