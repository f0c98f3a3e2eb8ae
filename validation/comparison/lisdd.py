"""Rival method: localised discovery of missing terms, after the description in arXiv 2606.23215.

The five steps follow the description of LISDD by Wang (2026): a clean regime, localisation by residual
energy, exhaustive hold-out over sets of terms, an F test on a split sample, and control of the false
discovery rate. They are applied to the equation errors and terms of :mod:`.stepwise_bic`. The details
are choices of this package, and no result of the paper is reproduced.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ..simulator.parameters import Floats
from .rival import ChallengeCase, Rival
from .stepwise_bic import Terms, bench_errors, frigate_errors

Rows: TypeAlias = NDArray[np.bool_]

WINDOW_S, BLOCK_S = 20.0, 1.0
"""Windows of the residual energy, and blocks whose means count as independent samples [s]."""

CLEAN_QUANTILES = (0.05, 0.25)
"""Quantiles of the residual energy that are taken as those of the clean regime."""

SIGMAS = 4.0  # energy above the mean of the clean regime
MOST_TERMS = 2
FALSE_DISCOVERY_RATE = 0.05


@dataclass(frozen=True)
class _Discovery:
    """Terms of one balance with the p-value of their F test."""

    balance: str
    p_value: float
    terms: dict[str, tuple[float, float]]  # coefficient and standard error
    windows: list[list[float]]


def active_windows(error: Floats, rows: int) -> Rows:
    """Return the windows whose residual energy exceeds that of the clean regime.

    Args:
        error: equation error.
        rows: rows of a window.
    """
    count = len(error) // rows
    energy = np.mean(error[: count * rows].reshape(count, rows) ** 2, axis=1)
    lower, upper = (float(np.quantile(energy, share)) for share in CLEAN_QUANTILES)
    low, high = (float(scipy.stats.norm.ppf(share)) for share in CLEAN_QUANTILES)
    spread = (upper - lower) / (high - low)
    return np.asarray(energy > upper + (SIGMAS - high) * spread)


def _rss(matrix: Floats, error: Floats, at: Floats, target: Floats) -> float:
    fit = np.linalg.lstsq(matrix, error, rcond=None)[0]
    return float(np.sum((target - at @ fit) ** 2))


def _discover(balance: str, error: Floats, terms: Terms, period: float) -> _Discovery | None:
    block = max(round(BLOCK_S / period), 1)
    count = len(error) // block
    means = {
        name: values[: count * block].reshape(count, block).mean(axis=1)
        for name, values in {"": error, **terms}.items()
    }
    rows = max(round(WINDOW_S / BLOCK_S), 1)
    active = np.flatnonzero(active_windows(means[""], rows))
    if len(active) < 6:
        return None
    of_window = np.arange(count) // rows
    parts = [np.isin(of_window, active[k::4]) for k in range(4)]
    fitted, held, tested = parts[0], parts[2], parts[1] | parts[3]
    sets = [s for k in range(1, MOST_TERMS + 1) for s in itertools.combinations(sorted(terms), k)]

    def design(names: tuple[str, ...], at: Rows) -> Floats:
        return np.column_stack([means[name][at] for name in names])

    best = min(
        sets,
        key=lambda s: _rss(design(s, fitted), means[""][fitted], design(s, held), means[""][held]),
    )
    matrix, target = design(best, tested), means[""][tested]
    after, free = _rss(matrix, target, matrix, target), len(target) - len(best)
    statistic = (float(target @ target) - after) / len(best) / (after / free)
    fit = np.linalg.lstsq(matrix, target, rcond=None)[0]
    spread = np.sqrt(np.diag(after / free * np.linalg.pinv(matrix.T @ matrix)))
    order = np.argsort(-np.abs(fit) * matrix.std(axis=0))
    found = {best[k]: (float(fit[k]), float(spread[k])) for k in order}
    edges = np.flatnonzero(np.diff(np.isin(np.arange(of_window[-1] + 3), active + 1)))
    windows = [[WINDOW_S * a, WINDOW_S * b] for a, b in edges.reshape(-1, 2).tolist()]
    p_value = float(scipy.stats.f.sf(statistic, len(best), free))
    return _Discovery(balance.strip(), p_value, found, windows)


def benjamini_hochberg(p_values: list[float], tests: int) -> float:
    """Return the largest p-value that is a discovery at :data:`FALSE_DISCOVERY_RATE`; -1 if none is.

    Args:
        p_values: p-values of the tests that were made.
        tests: number of tests, those without a p-value included.
    """
    passed = [p for k, p in enumerate(sorted(p_values), 1) if p <= FALSE_DISCOVERY_RATE * k / tests]
    return passed[-1] if passed else -1.0


class Lisdd(Rival):
    """Five steps after the description of LISDD, on the equation error of each balance."""

    name = "lisdd"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the discovered terms; no predictions."""
        table = case.recording
        errors = (frigate_errors if "fuel_rack_mm" in table else bench_errors)(table)
        period = float(table["time_s"].iloc[1] - table["time_s"].iloc[0])
        tried = [_discover(name, *pair, period) for name, pair in errors.items()]
        made = [one for one in tried if one is not None]
        limit = benjamini_hochberg([one.p_value for one in made], len(tried))
        found = sorted((one for one in made if one.p_value <= limit), key=lambda one: one.p_value)
        return {
            "verdict": "explained" if found else "nothing-missing",
            "balances": list(dict.fromkeys(one.balance for one in found)),
            "windows_s": found[0].windows if found else [],
            "effects": [
                {
                    "id": name,
                    "parameters": {
                        "coefficient": {
                            "value": value,
                            "ci95": [value - 1.96 * sd, value + 1.96 * sd],
                        }
                    },
                }
                for one in found
                for name, (value, sd) in one.terms.items()
            ],
        }
