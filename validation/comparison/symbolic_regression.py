"""Rival method: symbolic regression by gplearn on the residual of the simulation.

Genetic programming evolves one formula for the residual of each channel. The formulas use commands and
simulated channels, also after low-pass filters (:mod:`.residual`), so that they can describe dynamics.
gplearn is an optional dependency.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..simulator.parameters import Floats
from .residual import residual_data
from .rival import ChallengeCase, Rival

BLOCKS = 500
POPULATION, GENERATIONS = 500, 15
"""Formulas of a generation, and generations: about five seconds for a channel on one core."""

PARSIMONY = 0.001  # gplearn's default: loss of correlation that one more node must pay
FUNCTIONS = ("add", "sub", "mul", "div", "sqrt", "abs")
BEST, CANDIDATES = 50, 10
"""Best formulas of the last generation, and those among them that differ most from each other."""

_SEED = 20


def evolve(x: Floats, y: Floats) -> Any:
    """Return formulas whose values correlate with the residual, as a fitted transformer of gplearn.

    Args:
        x: features, shape (samples, features).
        y: residual, shape (samples,).
    """
    genetic: Any = importlib.import_module("gplearn.genetic")
    return genetic.SymbolicTransformer(
        population_size=POPULATION,
        generations=GENERATIONS,
        hall_of_fame=BEST,
        n_components=CANDIDATES,
        function_set=FUNCTIONS,
        parsimony_coefficient=PARSIMONY,
        random_state=_SEED,
        n_jobs=1,
    ).fit(x, y)


def _line(formula: Floats, y: Floats) -> tuple[float, float]:
    """Return slope and offset of the least-squares line from a formula to the residual."""
    matrix = np.column_stack([formula, np.ones(len(formula))])
    slope, offset = np.linalg.lstsq(matrix, y, rcond=None)[0]
    return float(slope), float(offset)


def fit_and_predict(x: Floats, y: Floats, at: Floats) -> Floats:
    """Return the predictions of the formula that is best on the last quarter of the samples.

    The formulas evolve on the first three quarters. If none is better than zero on the last quarter,
    the prediction is zero. Predictions stay within the range of the residual, because a formula can
    grow without limit outside the range of its features.

    Args:
        x: features, shape (samples, features).
        y: residual of unit scale, shape (samples,).
        at: features of the predictions, shape (rows, features).
    """
    cut = 3 * len(x) // 4
    found = evolve(x[:cut], y[:cut])
    fitted, predicted = found.transform(x).T, found.transform(at).T
    low, high = float(y.min()), float(y.max())
    best, least = np.zeros(len(at)), float(np.mean(y[cut:] ** 2))
    for formula, values in zip(fitted, predicted, strict=True):
        slope, offset = _line(formula[:cut], y[:cut])
        missed = np.clip(slope * formula[cut:] + offset, low, high) - y[cut:]
        if float(np.mean(missed**2)) < least:
            least = float(np.mean(missed**2))
            slope, offset = _line(formula, y)
            best = np.clip(slope * values + offset, low, high)
    return np.asarray(best)


class SymbolicRegression(Rival):
    """Symbolic regression by gplearn of the residual of each channel."""

    name = "gplearn"
    requires = "gplearn"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the predictions of the held-out part; no verdict."""
        data = residual_data(case, BLOCKS)
        columns = [fit_and_predict(data.fitted, y, data.held_out) for y in data.residual.T]
        return {"predictions": data.predictions(case, np.column_stack(columns))}
