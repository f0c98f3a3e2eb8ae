"""Linear least squares with linear inequalities."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_MOST_STEPS = 10_000


def bounded_least_squares(rows: Floats, aims: Floats, limits: Floats, least: Floats) -> Floats:
    """Return the x that minimises ``|rows x - aims|`` with ``limits x >= least``.

    The problem becomes one of least distance, and that one of non-negative variables (Lawson & Hanson,
    Solving Least Squares Problems, 1974, chapter 23).

    Raises:
        ValueError: no x satisfies the inequalities.
    """
    orthogonal, triangle = np.linalg.qr(rows)
    free = orthogonal.T @ aims
    across = np.linalg.solve(triangle.T, limits.T).T
    lacking = least - across @ free
    scale = max(1.0, float(np.abs(lacking).max()))
    matrix = np.vstack([across.T, lacking / scale])
    target = np.zeros(len(matrix))
    target[-1] = 1.0
    multipliers, _ = scipy.optimize.nnls(matrix, target, maxiter=_MOST_STEPS)
    residual = matrix @ multipliers - target
    if abs(residual[-1]) < 1e-9:
        raise ValueError("no coefficients satisfy the inequalities")
    return np.asarray(np.linalg.solve(triangle, free - scale * residual[:-1] / residual[-1]))
