"""Rival method: a Gaussian process on the residual of the simulation, for its predictions only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from ..simulator.parameters import Floats
from .residual import residual_data
from .rival import ChallengeCase, Rival

BLOCKS, TUNED_BLOCKS = 500, 200
"""Blocks of the fitted part for the predictions, and for the hyperparameters."""


def _kernel(a: Floats, b: Floats, length: float) -> Floats:
    return np.asarray(np.exp(-0.5 * scipy.spatial.distance.cdist(a, b, "sqeuclidean") / length**2))


def _evidence(log_values: Floats, x: Floats, y: Floats) -> float:
    """Return the negative log marginal likelihood of length, signal and noise."""
    length, signal, noise = np.exp(log_values)
    matrix = signal**2 * _kernel(x, x, length) + (noise**2 + 1e-6) * np.eye(len(x))
    factor = np.linalg.cholesky(matrix)
    white = scipy.linalg.solve_triangular(factor, y, lower=True)
    return float(0.5 * white @ white + np.log(np.diag(factor)).sum())


def fit_and_predict(x: Floats, y: Floats, at: Floats) -> Floats:
    """Return the posterior mean of a Gaussian process with a squared-exponential kernel.

    Args:
        x: features, shape (samples, features).
        y: values of unit scale, shape (samples,).
        at: features of the predictions, shape (rows, features).
    """
    thinned = slice(None, None, max(-(-len(x) // TUNED_BLOCKS), 1))
    start = np.log([math.sqrt(x.shape[1]), 1.0, 0.5])
    found = scipy.optimize.minimize(
        _evidence,
        start,
        (x[thinned], y[thinned]),
        "L-BFGS-B",
        bounds=[(-2.0, 5.0)] * 2 + [(-4.0, 1.0)],
    )
    length, signal, noise = np.exp(found.x)
    matrix = signal**2 * _kernel(x, x, length) + (noise**2 + 1e-6) * np.eye(len(x))
    weights = scipy.linalg.solve(matrix, y, assume_a="pos")
    return np.asarray(signal**2 * _kernel(at, x, length) @ weights)


class GaussianProcess(Rival):
    """Gaussian process of the residual over commands and simulated channels, one for each channel."""

    name = "gaussian-process"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the predictions of the held-out part; no verdict."""
        data = residual_data(case, BLOCKS)
        columns = [fit_and_predict(data.fitted, y, data.held_out) for y in data.residual.T]
        return {"predictions": data.predictions(case, np.column_stack(columns))}
