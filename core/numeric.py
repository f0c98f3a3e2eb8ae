"""Small numerical kernels; those of :data:`Real` accept complex numbers, so that derivatives by complex
steps pass.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .compiled import Real, compiled


@compiled
def clip(value: Real, low: Real, high: Real) -> Real:
    """Limit ``value`` to [low, high] by its real part."""
    if value.real < low.real:
        return low
    if value.real > high.real:
        return high
    return value


@compiled
def modulus(value: Real) -> Real:
    """``value`` or its negative, whichever has a real part that is not negative."""
    return value if value.real >= 0.0 else -value


@compiled
def piecewise_linear(
    knots: NDArray[np.float64], values: NDArray[np.float64], count: int, x: Real
) -> Real:
    """Straight lines between the first ``count`` knots, held outside them."""
    last = count - 1
    if x.real < knots[0].real:
        return values[0]
    for k in range(last):
        if x.real < knots[k + 1].real:
            slope = (values[k + 1] - values[k]) / (knots[k + 1] - knots[k])
            return values[k] + slope * (x - knots[k])
    return values[last]


@compiled
def begun_between(guess: float, low: float, high: float) -> float:
    """Where a search between two bounds begins: at the guess, or in the middle if that is no number."""
    x = min(max(guess, low), high)
    return x if math.isfinite(x) else 0.5 * (low + high)


@compiled
def newton_step(
    x: float, value: float, slope: float, low: float, high: float
) -> tuple[float, float, float]:
    """One step of a safeguarded Newton search for the zero of a falling function.

    Args:
        x: where the search stands.
        value: of the function there.
        slope: of the function there.
        low: lower bound of the zero.
        high: upper bound.

    Returns:
        Where to go next, and the bounds as ``value`` narrows them. Where Newton's step leaves them, it
        goes to their middle.
    """
    if value > 0.0:
        low = x
    else:
        high = x
    following = x - value / slope
    if not low < following < high:
        following = 0.5 * (low + high)
    return following, low, high
