"""Rival method: sparse identification by PySINDy's sequentially thresholded least squares.

It selects terms for the same equation errors as :mod:`.stepwise_bic`, all scaled to unit rms. PySINDy is
an optional dependency; without it :func:`diagnose` raises ImportError.
"""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..simulator.parameters import Floats
from .rival import RECORDING, ChallengeCase, Rival, entry_of
from .stepwise_bic import MOST_EFFECTS, Chosen, Terms, report_by

THRESHOLD = 0.1  # PySINDy's own default: a tenth of the error's rms


def _sparse(error: Floats, terms: Terms) -> list[Chosen]:
    """Return the terms above the threshold, the largest first, scored by the share that they explain."""
    optimizer = importlib.import_module("pysindy").STLSQ(threshold=THRESHOLD)
    names = list(terms)
    matrix = np.column_stack([terms[name] for name in names])
    scale = np.sqrt(np.mean(matrix**2, axis=0)) + 1e-12
    size = math.sqrt(float(np.mean(error**2))) + 1e-12
    with warnings.catch_warnings():  # No term above the threshold is a result here.
        warnings.filterwarnings("ignore", "Sparsity parameter is too big")
        optimizer.fit(matrix / scale, (error / size)[:, None])
    weights = np.asarray(optimizer.coef_)[0]
    explained = 1.0 - float(np.mean((error / size - matrix / scale @ weights) ** 2))
    shares = explained * np.abs(weights) / (np.abs(weights).sum() + 1e-12)
    order = np.argsort(-np.abs(weights))[:MOST_EFFECTS]
    return [
        (float(shares[k]), names[k], float(weights[k] * size / scale[k]), 0.0)
        for k in order
        if weights[k] != 0.0
    ]


def diagnose(recording: Path, ship: str, out: Path, exclude: tuple[str, ...]) -> dict[str, Any]:
    """Return a report like ``report.json``; arguments as for :func:`.stepwise_bic.diagnose`.

    Raises:
        ImportError: PySINDy is not installed.
    """
    return report_by(_sparse, recording, ship, exclude)


class PySindy(Rival):
    """Sparse identification by PySINDy; it makes no predictions."""

    name = "pysindy"
    requires = "pysindy"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the selected terms."""
        return entry_of(report_by(_sparse, case.folder / RECORDING, str(case.ship), ()))
