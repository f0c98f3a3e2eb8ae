"""Small numerical kernels that accept complex numbers, so that derivatives by complex steps pass."""

from __future__ import annotations

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
def piecewise_linear(
    knots: NDArray[np.float64], values: NDArray[np.float64], count: int, x: Real
) -> Real:
    """Straight lines between the first ``count`` knots, held outside them."""
    last = count - 1
    if x.real < knots[0]:
        return values[0]
    for k in range(last):
        if x.real < knots[k + 1]:
            slope = (values[k + 1] - values[k]) / (knots[k + 1] - knots[k])
            return values[k] + slope * (x - knots[k])
    return values[last]
