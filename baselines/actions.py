"""A command in physical units as an action in [-1, 1], and back."""

from __future__ import annotations

from ..core.compiled import compiled


@compiled
def decode(value: float, low: float, high: float) -> float:
    """Command in physical units of an action in [-1, 1] over a range."""
    return low + 0.5 * (value + 1.0) * (high - low)
