"""Small numerical kernels.

Those of :data:`Real` accept complex numbers, for derivatives by complex steps.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .compiled import Real, compiled, compiled_polynomial
from .lanes import where


@compiled
def clip(value: Real, low: Real, high: Real) -> Real:
    """Return ``value`` limited to [low, high] by its real part."""
    return where(value.real < low.real, low, where(value.real > high.real, high, value))


@compiled
def modulus(value: Real) -> Real:
    """Return ``value`` or its negative, so that the real part is not negative."""
    return where(value.real >= 0.0, value, -value)


@compiled
def piecewise_linear(
    knots: NDArray[np.float64], values: NDArray[np.float64], count: int, x: Real
) -> Real:
    """Return a linear interpolation between the first ``count`` knots, constant outside them."""
    last = count - 1
    if x.real < knots[0].real:
        return values[0]
    for k in range(last):
        if x.real < knots[k + 1].real:
            slope = (values[k + 1] - values[k]) / (knots[k + 1] - knots[k])
            return values[k] + slope * (x - knots[k])
    return values[last]


@compiled
def start_between(guess: float, low: float, high: float) -> float:
    """Return the start of a search between two bounds: the guess, or the middle if it is not finite."""
    x = min(max(guess, low), high)
    return x if math.isfinite(x) else 0.5 * (low + high)


@compiled
def newton_step(
    x: float, value: float, slope: float, low: float, high: float
) -> tuple[float, float, float]:
    """Return one step of a safeguarded Newton search for the zero of a falling function.

    From a point with the function's value and slope, and the bounds of the zero, follow the next point,
    and the bounds narrowed by the value. If Newton's step leaves the bounds, the next point is their
    middle.
    """
    if value > 0.0:
        low = x
    else:
        high = x
    following = x - value / slope
    if not low < following < high:
        following = 0.5 * (low + high)
    return following, low, high


_HALF_PI_HIGH = 1.5707963267341256  # pi/2 in two parts (Cody & Waite)
_HALF_PI_LOW = 6.077100506506192e-11


@compiled_polynomial
def sine_cosine(angle: Real) -> tuple[Real, Real]:
    """Return sine and cosine of an angle [rad], without branches and library calls.

    Taylor series after reduction to +-pi/4; error below 2.1e-14 for |angle| < 1e5 rad.
    """
    quadrant = np.floor(angle.real * (2.0 / math.pi) + 0.5)
    r = (angle - quadrant * _HALF_PI_HIGH) - quadrant * _HALF_PI_LOW
    r2 = r * r
    s = r * (1.0 + r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 * (
        1.0 / 362880.0 + r2 * (-1.0 / 39916800.0 + r2 * (1.0 / 6227020800.0)))))))  # fmt: skip
    c = 1.0 + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 * (1.0 / 40320.0 + r2 * (
        -1.0 / 3628800.0 + r2 * (1.0 / 479001600.0 - r2 * (1.0 / 87178291200.0)))))))  # fmt: skip
    # Quadrant modulo 4 as floats: 0 -> (c, s), 1 -> (-s, c), 2 -> (-c, -s), 3 -> (s, -c).
    quarter = quadrant - 4.0 * np.floor(quadrant * 0.25)
    odd = quarter - 2.0 * np.floor(quarter * 0.5)
    half = 1.0 - 2.0 * np.floor(quarter * 0.5)
    return half * where(odd == 0.0, s, c), half * where(odd == 0.0, c, -s)
