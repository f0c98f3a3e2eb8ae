"""Data for rivals that learn the residual of the simulation, without physics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..simulator.parameters import Floats
from .rival import COMMANDS, ChallengeCase

LAGS_S = (5.0, 30.0)
"""Time constants of the low-pass filters of the features [s]."""


@dataclass(frozen=True)
class ResidualData:
    """Features and residuals of a case.

    Features are the commands, the simulated channels, and both after low-pass filters; residuals are
    measurement minus simulation. All are divided by their standard deviation on the fitted part.
    """

    fitted: Floats  # features of blocks of the fitted part, shape (blocks, features)
    residual: Floats  # residuals of these blocks, shape (blocks, channels)
    held_out: Floats  # features of the held-out rows, shape (rows, features)
    scale: Floats  # standard deviation of each residual, shape (channels,)

    def predictions(self, case: ChallengeCase, residual: Floats) -> dict[str, list[float]]:
        """Return simulation plus predicted scaled residuals, shape (rows, channels), as an entry."""
        held_out = case.simulated_held_out[case.channels].to_numpy()
        found = held_out + residual * self.scale
        return {name: found[:, k].tolist() for k, name in enumerate(case.channels)}


def _low_pass(values: Floats, share: float) -> Floats:
    """Return columns after a first-order filter that starts at their first row."""
    found, state = np.empty_like(values), values[0]
    for k, row in enumerate(values):
        state = state + share * (row - state)
        found[k] = state
    return found


def _blocks(values: Floats, rows: int) -> Floats:
    count = len(values) // rows
    return np.asarray(values[: count * rows].reshape(count, rows, -1).mean(axis=1))


def residual_data(case: ChallengeCase, most_blocks: int) -> ResidualData:
    """Return features and residuals of a case, the fitted part as the means of equal blocks.

    Args:
        case: the case.
        most_blocks: largest number of blocks.
    """
    names = [name for name in COMMANDS if name in case.recording]
    commands = np.concatenate([case.recording[names], case.inputs[names]])
    raw = np.column_stack([commands, case.simulation[case.channels]])
    period = float(case.recording["time_s"].iloc[1] - case.recording["time_s"].iloc[0])
    lagged = [_low_pass(raw, -np.expm1(-period / lag)) for lag in LAGS_S]
    features, count = np.column_stack([raw, *lagged]), len(case.recording)
    features = (features - features[:count].mean(axis=0)) / (features[:count].std(axis=0) + 1e-9)
    measured = case.recording[case.channels].to_numpy()
    residual = measured - case.simulation[case.channels].to_numpy()[:count]
    scale = residual.std(axis=0) + 1e-12
    rows = max(-(-count // most_blocks), 1)
    return ResidualData(
        _blocks(features[:count], rows), _blocks(residual / scale, rows), features[count:], scale
    )
