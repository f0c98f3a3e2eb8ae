"""Covariances and intervals of estimates, and probabilities.

The distributions are those of scipy.special, because scipy.stats takes half a second to load.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

HALF_95 = 1.96  # Half-width of a 95 % interval of the normal distribution, in standard errors


def half_95(freedom: float) -> float:
    """Return the half-width of a 95 % interval, in standard errors (Student's t).

    The degrees of freedom are infinite if the standard error is known exactly.

    >>> round(half_95(10.0), 3), half_95(math.inf)
    (2.228, 1.96)
    """
    if math.isinf(freedom):
        return HALF_95
    return float(scipy.special.stdtrit(max(freedom, 1.0), 0.975))


def wilson_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a probability from the hits in a number of trials (Wilson 1927).

    It is also valid for a share of 0 or 1. Without trials it is the whole range.

    >>> low, high = wilson_interval(1, 8)
    >>> round(low, 3), round(high, 3)
    (0.022, 0.471)
    """
    if count == 0:
        return 0.0, 1.0
    share, z = hits / count, HALF_95
    middle = share + z**2 / (2 * count)
    half = z * math.sqrt(share * (1.0 - share) / count + (z / (2 * count)) ** 2)
    scale = 1.0 + z**2 / count
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def chi_squared_limit(chance: float, freedom: Any) -> Any:
    """Return the value that a chi-squared number of some degrees of freedom exceeds with a probability.

    >>> round(float(chi_squared_limit(0.05, 1)), 3)
    3.841
    """
    return scipy.special.chdtri(freedom, chance)


def log_chance_above(value: float, freedom: float) -> float:
    """Return the logarithm of the probability that a chi-squared number exceeds a value.

    >>> round(log_chance_above(3.841, 1.0) - math.log(0.05), 4)
    0.0003
    """
    chance = float(scipy.special.chdtrc(freedom, value))
    return math.log(chance) if chance > 0.0 else -math.inf


def covariance_of(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of estimates from their information matrix, in any units.

    It is the pseudo-inverse of the matrix scaled to a unit diagonal. A plain pseudo-inverse compares the
    singular values of all parameters, and takes a torque in N m beside a ratio for exactly known.

    >>> covariance_of(np.diag([1e-10, 1e8, 0.0]))
    array([[1.e+10, 0.e+00, 0.e+00],
           [0.e+00, 1.e-08, 0.e+00],
           [0.e+00, 0.e+00, 0.e+00]])
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scales = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(information / scales, hermitian=True) / scales)
