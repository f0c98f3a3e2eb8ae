"""Replay recordings of one ship by its linear model about their mean (Vrijdag & Martelli 2021, eq. 9).

    x' = f(x0, u0) + A (x - x0) + B (u - u0),    y = y0 + C (x - x0) + D (u - u0)

The model is linearised about the mean of the measured channels, which need not be a steady state. Its
inputs are drive command, pitch command and inflow. Delays and errors of instruments and the water
surface are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...core.compiled import compiled
from ...plant.columns import MEASURED
from ...plant.dynamics import settle_lags
from ...plant.linear import INPUTS, tangent
from ...plant.replay import Replay
from ...plant.signals import SAMPLE
from ...plant.state import Inputs, State, active_states
from .joint_replay import JointReplay

Floats = NDArray[np.float64]


@compiled
def _march(carry: Floats, forced: Floats, states: Floats) -> None:
    """Write x[k + 1] = carry x[k] + forced[k] to ``states``, from its first row."""
    for k in range(len(forced)):
        for i in range(len(carry)):
            total = forced[k, i]
            for j in range(len(carry)):
                total += carry[i, j] * states[k, j]
            states[k + 1, i] = total


class LinearReplay(JointReplay):
    """Replay as :class:`.joint_replay.JointReplay` with the linearised equations of the ship.

    Raises:
        ValueError: the recordings have different columns or intervals, their rows are equilibria, the
            ship turns, or its drive prescribes the shaft speed.
    """

    def __init__(
        self, ship: Any, *tables: Any, line: bool = False, every: int = 1, steady: bool = False
    ) -> None:
        if steady:
            raise ValueError(
                f"{ship.name}: rows that are equilibria have no linear dynamic model; use the nonlinear "
                "replay"
            )
        if ship.turns:
            raise ValueError(
                f"{ship.name}: the linear replay has no equations of turning; use the nonlinear replay"
            )
        if not ship.turns_freely:
            raise ValueError(
                f"{ship.name}: the drive prescribes the shaft speed, which the linear replay does not "
                "model; use the nonlinear replay"
            )
        super().__init__(ship, *tables, line=line, every=every)

    def simulate_run(self, run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
        """Return the samples at the rows of one recording by the linear model of a ship record.

        Args:
            run: one of ``runs``.
            plant: ship record.
            start: pitch ratio [-], shaft speed [rad/s] and ship speed [m/s] at the first row.
        """
        return _simulate(run, plant, start)

    simulate_into = simulate_run


def _simulate(run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
    inflow = run.inflow(plant)
    at_middles = inflow[1::2]
    acting = np.column_stack([run.pitch, run.drive, np.ones(len(run.drive)), at_middles])
    mean = dict(zip(INPUTS.values(), acting.mean(axis=0), strict=True))
    inputs = Inputs(
        mean["drive"], mean["pitch_command"], mean["inflow"],
        resistance_factor=mean["resistance_factor"],
    )  # fmt: skip
    middle = settle_lags(plant, State(*_means(run)), inputs)
    first = settle_lags(plant, run.first_state(start), run.first_inputs(inflow))
    states = [*active_states(plant), "shaft_angle"]
    outputs = [name.removeprefix("measured_") for name in MEASURED.values()]
    model = tangent(plant, middle, inputs, middle.pitch_ratio, states, outputs)
    n = len(states)
    # The system x' = A x + B u + f is integrated exactly over a step by a matrix exponential.
    whole = np.zeros((n + 5, n + 5))
    whole[:n] = np.column_stack([model.a, model.b, model.rates])
    step = scipy.linalg.expm(whole * run.dt)
    moved = acting - np.array(list(mean.values()))
    deviations = np.zeros((len(acting) + 1, n))
    deviations[0] = [getattr(first, name) - getattr(middle, name) for name in states]
    _march(step[:n, :n].copy(), moved @ step[:n, n:-1].T + step[:n, -1], deviations)
    rows = slice(None, None, run.per_row)
    at_rows = np.vstack([moved, moved[-1:]])[rows]
    found = model.values + deviations[rows] @ model.c.T + at_rows @ model.d.T
    samples = np.zeros(len(found), SAMPLE)
    for own, signal, column in zip(outputs, MEASURED.values(), found.T, strict=True):
        samples[own] = samples[signal] = column
    return samples


def _means(run: Replay) -> tuple[float, float, float]:
    """Return the mean pitch ratio, shaft speed and ship speed; the first value of a missing channel."""
    columns = ("pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s")
    pitch, shaft, speed = (
        float(np.mean(run.table[c])) if c in run.table else start
        for c, start in zip(columns, run.start, strict=True)
    )
    return pitch, shaft, speed if run.ship.moves else 0.0
