"""Rival method: a small neural network on the residual of the simulation, for its predictions only."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import scipy

from ..simulator.parameters import Floats
from .residual import residual_data
from .rival import ChallengeCase, Rival

HIDDEN = 12
DECAYS = (1e-3, 1e-2, 1e-1)
"""Candidates of the weight decay; the last quarter of the fitted part decides."""

STEPS = 150
BLOCKS = 1000
_SEED = 20


def _split(weights: Floats, inputs: int, outputs: int) -> tuple[Floats, Floats]:
    middle = (inputs + 1) * HIDDEN
    return weights[:middle].reshape(inputs + 1, HIDDEN), weights[middle:].reshape(-1, outputs)


def _with_one(values: Floats) -> Floats:
    return np.column_stack([values, np.ones(len(values))])


def _loss(weights: Floats, x: Floats, y: Floats, decay: float) -> tuple[float, Floats]:
    """Return half the mean squared error with weight decay, and its gradient."""
    first, second = _split(weights, x.shape[1] - 1, y.shape[1])
    hidden = np.tanh(x @ first)
    tail = _with_one(hidden)
    error = (tail @ second - y) / len(x)
    back = (error @ second[:-1].T) * (1.0 - hidden**2)
    gradient = np.concatenate([(x.T @ back).ravel(), (tail.T @ error).ravel()])
    value = 0.5 * len(x) * float(np.sum(error**2)) + 0.5 * decay * float(weights @ weights)
    return value, gradient + decay * weights


def train(x: Floats, y: Floats, decay: float) -> Floats:
    """Return the weights of a network with one hidden layer, trained by L-BFGS.

    Args:
        x: features, shape (samples, features).
        y: targets, shape (samples, outputs).
        decay: weight decay [-].
    """
    count = (x.shape[1] + 1) * HIDDEN + (HIDDEN + 1) * y.shape[1]
    start: Any = 0.3 * np.random.default_rng(_SEED).standard_normal(count)
    x = _with_one(x)
    loss: Any = partial(_loss, x=x, y=y, decay=decay)
    options: Any = {"maxiter": STEPS}
    found = scipy.optimize.minimize(loss, start, method="L-BFGS-B", jac=True, options=options)
    return np.asarray(found.x)


def predict(weights: Floats, x: Floats, outputs: int) -> Floats:
    """Return the outputs of a trained network, shape (samples, outputs)."""
    first, second = _split(weights, x.shape[1], outputs)
    return np.asarray(_with_one(np.tanh(_with_one(x) @ first)) @ second)


class NeuralNetwork(Rival):
    """Network with one hidden layer for the residuals of all channels."""

    name = "neural-network"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the predictions of the held-out part; no verdict."""
        data = residual_data(case, BLOCKS)
        x, y = data.fitted, data.residual
        cut, outputs = 3 * len(x) // 4, y.shape[1]

        def error(decay: float) -> float:
            weights = train(x[:cut], y[:cut], decay)
            return float(np.mean((predict(weights, x[cut:], outputs) - y[cut:]) ** 2))

        weights = train(x, y, min(DECAYS, key=error))
        return {"predictions": data.predictions(case, predict(weights, data.held_out, outputs))}
