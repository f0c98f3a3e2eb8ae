"""What the augmented filter is told beforehand, taken from the recording.

- The instruments' noise is the white part of each channel, as the diagnosis tells it.
- The process noise of each state, and of the inflow that a sea disturbs, is the one under which the
  readings are most likely; 0 stays where it gains less than :data:`WORTH`.
- A number that is free is doubted by :data:`DOUBT` of itself; one that is 0, by as much as moves a
  channel by :data:`FELT` of its size.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...observers.augmented_plant import CHANNELS
from ...observers.ship_filter import DISTURBANCE, ShipFilter
from ...plant.columns import MEASURED
from ...plant.derivatives import acting, words
from ...plant.state import active_states
from ..progress import Tick
from ..simulate.joint_replay import JointReplay
from .filter_runs import FilterRuns, Noises

DOUBT = 0.5
"""Standard deviation at the start of a number that is not 0, as a share of it."""

LEAST_NOISE = 3e-4
"""Smallest standard deviation of an instrument's noise, as a share of the channel's size. A filter that
is linear about its estimate cannot go by a recording without noise: it takes what the linear model
lacks for information, and drives the parameters away."""

FELT = 0.1
"""Share of its size by which some channel moves where a number that is 0 is off by its spread."""

STATE_SPREAD = 0.05
"""Standard deviation of each state at the start, as a share of its size."""

WALKS = (1e-3, 1e-2, 0.1, 0.5)
"""Square roots of densities of process noise that are tried [1/s^0.5]: shares of a state's size, or m/s
of the inflow."""

WORTH = 20.0
"""Gain in 2 log L that a process noise must bring."""

MOST_TURNS = 12

SAMPLE_ROWS = 6000
"""Rows over which the process noise is sought."""

FEWEST_ROWS = 20


def noises_told(
    replay: JointReplay,
    free: Sequence[str],
    spread: dict[str, float],
    number_walk: dict[str, float],
) -> Noises:
    """Standard deviations as the module says."""
    ship = replay.ship
    nominal = replay.simulate(ship.record())
    fixed = () if ship.has_variable_pitch else ("pitch_ratio",)
    readings = {
        c: max(rms, LEAST_NOISE * size(nominal[MEASURED[c]]))
        for c, rms in replay.noise_rms.items()
        if c in CHANNELS and c not in fixed and rms > 0.0
    }
    if not readings:
        raise ValueError(f"ekf: {ship.name}: no measured channel of the recordings moves")
    states = {name: STATE_SPREAD * own for name, own in state_sizes(replay, free).items()}
    for key in free:
        if key not in spread:
            value = acting(ship, key).value
            spread[key] = DOUBT * abs(value) if value != 0.0 else felt_at(replay, key, nominal)
    return Noises(readings, states, spread, dict.fromkeys(states, 0.0), number_walk)


def state_sizes(replay: JointReplay, free: Sequence[str]) -> dict[str, float]:
    """Return the rms of each state that the ship has along the recordings, by name.

    They are simulated by the filter itself without measurements, so that a state counts whether or not
    it is among the signals of a simulation.
    """
    ship = replay.ship
    states = active_states(ship.record())
    doubts = dict.fromkeys(free, 1.0)
    alone = ShipFilter(
        ship, free, number_spread=doubts, noise={}, state_spread=dict.fromkeys(states, 0.0)
    )
    followed = [alone.follow(run).estimates for run in replay.runs]
    simulated = np.concatenate(followed)
    return {name: size(simulated[:, i]) for i, name in enumerate(states)}


def size(values: NDArray[np.float64]) -> float:
    """Rms of a signal."""
    return float(np.sqrt(np.mean(np.square(values))))


def felt_at(replay: JointReplay, key: str, nominal: Any) -> float:
    """How far a number must leave 0 to be felt."""
    number, before = acting(replay.ship, key), replay.simulated(nominal)
    side = 1.0 if number.info.high > 0.0 else -1.0
    reach = min(abs(number.info.high if side > 0.0 else number.info.low), 1e9)
    step = reach
    for _ in range(60):
        record = replay.ship.record()
        words(record)[number.words] += side * step * number.slopes
        with np.errstate(over="ignore", invalid="ignore"):
            after = replay.simulated(replay.simulate(record))
            shares = [size(after[c] - b) / (size(b) or 1.0) for c, b in before.items()]
        felt = float(np.max(shares))
        if np.isfinite(felt) and felt <= FELT:
            return min(step * FELT / felt, DOUBT * reach) if felt > 0.0 else DOUBT * step
        step *= 0.3
    return step


def likeliest_walk(runs: FilterRuns, tick: Tick) -> dict[str, float]:
    """Process noises under which the readings are most likely, sought by the largest gain each time."""
    sizes = {name: spread / STATE_SPREAD for name, spread in runs.noises.states.items()}
    sizes[DISTURBANCE] = 1.0 if runs.replay.ship.moves else 0.0
    sizes = {name: own for name, own in sizes.items() if own > 0.0}

    def likelihood(walk: Mapping[str, float]) -> float:
        own, total, rows = runs.filter(walk), 0.0, SAMPLE_ROWS
        for run in runs.replay.runs:
            if rows > FEWEST_ROWS:
                total += own.follow(run, rows).likelihood
            rows -= run.rows
        return total if np.isfinite(total) else -np.inf

    walk = dict.fromkeys(sizes, 0.0)
    best = likelihood(walk)
    for turn in range(MOST_TURNS):
        tick("noise of the states", turn, MOST_TURNS)
        # the sea's first: it would pass for noise of whatever else may move
        names = [DISTURBANCE] if turn == 0 and DISTURBANCE in sizes else [*sizes]
        trials = [
            walk | {name: value}
            for name in names
            for value in (
                (0.0, walk[name] / 2.0, 2.0 * walk[name])
                if walk[name] > 0.0
                else [share * sizes[name] for share in WALKS]
            )
        ]
        scores = [likelihood(trial) for trial in trials]
        if max(scores) > best + WORTH:
            walk, best = trials[int(np.argmax(scores))], max(scores)
        elif turn > 0:
            break
    return walk
