"""The linear model along a run (thesis, end of section 2-7-2): fixed, and kept up to date."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.plant import Ship, along
from shaftline.plant.linear import Local
from shaftline.plant.load_cases import CASES

STEP_S = 0.05
"""Between two linearisations: the plant's own step."""


def _inputs(models: list[Local], samples: NDArray[np.void], ship: Ship) -> NDArray[np.float64]:
    """Pitch command, drive, factor on the resistance and inflow at each instant, shape (n, 4)."""
    calm = samples["ship_speed"] * (1.0 - ship.hull.wake_fraction)
    factor = samples["resistance"] / samples["ship_speed"] ** 2
    return np.column_stack(
        [samples["pitch_command"], samples["drive"], factor / factor[0],
         samples["advance_velocity"] - calm]
    )  # fmt: skip


def fixed(models: list[Local], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """States over the run by the first model alone, its inputs linear between instants, shape (n, k).

    Args:
        models: along the run.
        inputs: at their instants, shape (n, 4).
    """
    first = models[0].tangent
    moved = inputs - inputs[0]
    state = np.zeros((len(models), len(models[0].state)))
    half = 0.5 * STEP_S * first.a
    one = np.eye(len(half))
    for k in range(len(models) - 1):  # the trapezoidal rule, exact for what is linear in time
        push = STEP_S * (first.rates + 0.5 * first.b @ (moved[k] + moved[k + 1]))
        state[k + 1] = np.linalg.solve(one - half, (one + half) @ state[k] + push)
    return models[0].state + state


def compared(ship: Ship) -> pd.DataFrame:
    """How far either model is off in each load case.

    Args:
        ship: the thesis's frigate.

    Returns:
        By case and state: rms error of the next step by the model of each instant, as a share of the
        state's mean and of its standard deviation; and of the run by the model of the first instant
        alone, as a share of that deviation.
    """
    rows = []
    for name, case in CASES.items():
        if case.noisy:
            continue
        samples = case.run(ship)
        models = along(ship, samples, STEP_S)
        states = np.array([one.state for one in models])
        ahead = np.array([one.ahead(STEP_S) for one in models[:-1]])
        run = fixed(models, _inputs(models, samples, ship))
        for k, state in enumerate(models[0].states):
            spread = float(states[:, k].std())
            if spread < 1e-9:
                continue
            step = float(np.sqrt(np.mean((ahead[:, k] - states[1:, k]) ** 2)))
            whole = float(np.sqrt(np.mean((run[:, k] - states[:, k]) ** 2)))
            rows.append(
                {"load case": name, "state": state,
                 "next step, of the state": step / float(states[:, k].mean()),
                 "next step, of its deviation": step / spread,
                 "fixed model, whole run, of its deviation": whole / spread}
            )  # fmt: skip
    return pd.DataFrame(rows)
