"""What the augmented filter is told beforehand, taken from the recording.

- The instruments' noise is the white part of each channel, as the diagnosis tells it.
- The process noise of each state, and of the inflow that a sea disturbs, is the one under which the
  readings are most likely; 0 stays where it gains less than :data:`WORTH`.
- A number that is free is doubted by :data:`DOUBT` of itself; one that is 0, by as much as moves a
  channel by :data:`FELT` of its size.

The augmented filter over one recording after the other, as it is told beforehand.

What the augmented filter shows over time, and what its innovations say against what it found.

State-augmented extended Kalman filter: the numbers are estimated with the ship's states, row by row.

The filter is :class:`shaftline.observers.ship_filter.ShipFilter`; its noises are told from the recording
(:mod:`.filter_noises`), so nothing but the recording is asked of the user. The numbers are constant;
``number_walk`` lets them drift, to follow fouling as it grows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...observers.augmented_plant import CHANNELS
from ...observers.ship_filter import DISTURBANCE, Followed, ShipFilter
from ...plant.columns import MEASURED
from ...plant.derivatives import acting, words
from ...plant.ship import Ship
from ...plant.state import active_states
from ..estimate import Tick, silent
from ..simulate.joint_replay import JointReplay
from ..simulate.tolerances import UNMOVED, tolerance_records
from .free_parameters import refuse_unidentifiable
from .results import Found

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


class Noises(NamedTuple):
    """What the filter is told beforehand."""

    readings: dict[str, float]  # rms by column
    states: dict[str, float]  # at the start, by name
    numbers: dict[str, float]  # at the start, by key
    state_walk: dict[str, float]  # [unit/s^0.5]
    number_walk: Mapping[str, float]


class FilterRuns:
    """Filters over the recordings."""

    def __init__(self, replay: JointReplay, keys: tuple[str, ...], noises: Noises) -> None:
        self.replay, self.keys, self.noises = replay, keys, noises
        self.start = np.array([acting(replay.ship, key).value for key in keys])

    def filter(self, state_walk: Mapping[str, float], record: Any = None) -> ShipFilter:
        """One that has seen nothing."""
        noises = self.noises
        return ShipFilter(
            self.replay.ship, self.keys, number_spread=noises.numbers, noise=noises.readings,
            state_spread=noises.states, state_walk=state_walk, number_walk=noises.number_walk,
            record=record,
        )  # fmt: skip

    def passed(
        self, values: NDArray[np.float64], record: Any = None
    ) -> tuple[list[Followed], ShipFilter]:
        """All recordings once, from these numbers on."""
        own = self.filter(self.noises.state_walk, record)
        own.restart(values)
        return [own.follow(run) for run in self.replay.runs], own


UNWHITE = 0.1
"""Correlation of innovations, and share by which their rms may differ from 1, that is told."""

CHANCE = 4.0
"""Standard deviations that either may differ by chance."""

UNSETTLED = 3.5
"""Standard deviations by which a number may move over the last quarter."""

LITTLE = 0.3
"""Share of its first standard error to which that of a number falls where something is told of it."""

LAGS = 20
"""Rows up to which innovations are correlated with those before."""

SHOWN_ROWS = 2000


def _joined(runs: FilterRuns, followed: list[Followed]) -> tuple[Any, Any]:
    """Estimates of the numbers over all rows and their standard errors, each (rows, numbers)."""
    count = len(runs.keys)
    values = np.concatenate([one.estimates[:, -count:] for one in followed])
    return values, np.concatenate([one.standard_errors[:, -count:] for one in followed])


def estimates_over_time(runs: FilterRuns, followed: list[Followed]) -> pd.DataFrame:
    """The numbers and their standard errors over time."""
    values, errors = _joined(runs, followed)
    columns = {"time_s": runs.replay.time_s}
    for i, key in enumerate(runs.keys):
        columns |= {key: values[:, i], f"{key} se": errors[:, i]}
    every = max(1, len(values) // SHOWN_ROWS)
    return pd.DataFrame(columns).iloc[::every].reset_index(drop=True)


def innovations(runs: FilterRuns, followed: list[Followed]) -> pd.DataFrame:
    """Of each channel: noise, rms of the innovations, and where they go together most."""
    rows = []
    for c, (column, noise) in enumerate(runs.noises.readings.items()):
        own = [one.innovations[len(one.innovations) // 20 :, c] for one in followed]
        found = np.concatenate(own)
        found = found[np.isfinite(found)]
        correlations = [
            float(np.mean(found[lag:] * found[:-lag]) / np.mean(found**2))
            for lag in range(1, 1 + min(LAGS, len(found) // 4))
        ]
        worst = int(np.argmax(np.abs(correlations)))
        rows.append(
            {
                "channel": column,
                "noise": noise,
                "rms": size(found),
                "correlation": correlations[worst],
                "lag_s": (1 + worst) * runs.replay.interval_s,
                "rows": len(found),
            }
        )
    return pd.DataFrame(rows)


def unwhite(runs: FilterRuns, followed: list[Followed]) -> list[str]:
    """What the innovations say against the standard errors."""
    return [
        f"the innovations of {row.channel} are not white: their rms is {row.rms:.2g} times the expected "
        f"one, and {row.lag_s:.3g} s apart they have a correlation of {row.correlation:.2f}. A sea that "
        "is no white noise does this, or physics that is missing; the standard errors may be wrong"
        for row in innovations(runs, followed).itertuples()
        if abs(row.rms - 1.0) > max(UNWHITE, CHANCE / np.sqrt(2.0 * row.rows))
        or abs(row.correlation) > max(UNWHITE, CHANCE / np.sqrt(row.rows))
    ]


def unsettled(runs: FilterRuns, followed: list[Followed]) -> list[str]:
    """Numbers that moved over the last quarter by more than their standard errors allow.

    An estimate of a constant moves from one time to a later one with the variance P(then) - P(later).
    """
    values, errors = _joined(runs, followed)
    then = 3 * len(values) // 4
    allowed = np.sqrt(np.maximum(errors[then] ** 2 - errors[-1] ** 2, 1e-300))
    moved = values[-1] - values[then]
    return [
        f"{key} had not settled: over the last quarter it moved by {moved[i]:.3g}, "
        f"{abs(moved[i]) / allowed[i]:.1f} times what its standard errors allow"
        for i, key in enumerate(runs.keys)
        if key not in runs.noises.number_walk and abs(moved[i]) > UNSETTLED * allowed[i]
    ]


def untold(runs: FilterRuns, own: ShipFilter) -> list[str]:
    """Numbers of which the recordings tell little."""
    errors = np.sqrt(np.diag(own.covariance))
    return [
        f"the recordings tell little of {key}: its standard error fell from {spread:.3g} to "
        f"{error:.3g} only"
        for key, spread, error in zip(
            runs.keys, (runs.noises.numbers[key] for key in runs.keys), errors, strict=True
        )
        if error > LITTLE * spread
    ]


MOST_PASSES = 6

SETTLED = 0.1
"""Standard errors by which the numbers may still move from one pass to the next."""

SLOPE_STEP = 1e-4
"""Share of a number's spread over which simulations are compared."""


def ekf(
    ship: Ship,
    tables: Sequence[pd.DataFrame],
    free: Sequence[str],
    tick: Tick = silent,
    *,
    spread: Mapping[str, float] | None = None,
    number_walk: Mapping[str, float] | None = None,
    tolerance: float = 1.0,
) -> Found:
    """Numbers by the augmented filter, over one recording after the other.

    The first pass starts from the file's numbers and is the one that the table ``estimates`` shows; it
    is repeated from what it found until that no longer moves.

    Args:
        ship: nominal.
        tables: canonical columns at an even interval; equal columns and intervals.
        free: dotted keys.
        tick: told how far the work is.
        spread: standard deviation of numbers at the start, by key, in its unit; see the module.
        number_walk: square roots of the densities of the numbers' drift [unit/s^0.5], by key. With any,
            the last value is the one at the end of the last recording.
        tolerance: factor on how far the numbers that are not free may be off.

    Raises:
        ValueError: a number of which the recordings tell nothing, or several of which they tell only a
            combination; recordings that do not go together; names them.
        ObserverError: an instrument that answers late.
        ShipError: a key that is no number with a derivative.
    """
    replay = JointReplay(ship, *tables)
    noises = noises_told(replay, free, dict(spread or {}), dict(number_walk or {}))
    runs = FilterRuns(replay, tuple(free), noises)
    refuse_unidentifiable(free, _information(runs))
    noises.state_walk.update(likeliest_walk(runs, tick))
    first, own = runs.passed(runs.start)
    values, last = own.numbers, first
    for count in range(0 if number_walk else MOST_PASSES):
        tick("passes of the filter", count, MOST_PASSES)
        last, own = runs.passed(values)
        moved = np.abs(own.numbers - values) / np.sqrt(np.diag(own.covariance))
        values = own.numbers
        if moved.max() < SETTLED:
            break
    covariance = own.covariance + _unsure(runs, values, tolerance, tick)
    _refuse_diverged(runs, first, covariance)
    held = [
        f"{key} ended at the end of the range that the filter allows, and is not identified"
        for key in own.at_bounds
    ]
    return Found(
        tuple(free), tuple(map(float, values)), covariance,
        {"estimates": estimates_over_time(runs, first), "innovations": innovations(runs, last)},
        (*held, *unsettled(runs, last), *untold(runs, own), *unwhite(runs, last)),
    )  # fmt: skip


def _refuse_diverged(
    runs: FilterRuns, followed: list[Followed], covariance: NDArray[np.float64]
) -> None:
    """Refuse estimates that are not finite numbers.

    Raises:
        ValueError: says from which time on.
    """
    estimates = np.concatenate([one.estimates for one in followed])
    lost = ~np.isfinite(estimates).all(axis=1)
    if lost.any() or not np.isfinite(covariance).all():
        when = f"from {runs.replay.time_s[int(np.argmax(lost))]:.4g} s on " if lost.any() else ""
        raise ValueError(
            f"ekf: {when}the filter's estimates of {', '.join(runs.keys)} are not finite numbers; a "
            "recording almost without noise, or numbers far from the file's, do this. Free fewer of "
            "them, or use --method output-error"
        )


def _information(runs: FilterRuns) -> NDArray[np.float64]:
    """What the recordings tell of the numbers, in units of their spreads, about the file's values.

    From simulations, not from the filter's own covariance: an extended filter that linearises anew at
    every row takes a combination that nothing tells for known (Huang et al. 2010).
    """
    replay, noises = runs.replay, runs.noises
    slopes = []
    for key in runs.keys:
        number, ends = acting(replay.ship, key), []
        for side in (SLOPE_STEP, -SLOPE_STEP):
            record = replay.ship.record()
            words(record)[number.words] += side * noises.numbers[key] * number.slopes
            after = replay.simulated(replay.simulate(record))
            ends.append(np.concatenate([after[c] / rms for c, rms in noises.readings.items()]))
        slopes.append((ends[0] - ends[1]) / (2.0 * SLOPE_STEP))
    found = np.array(slopes)
    return np.asarray(found @ found.T)


def _unsure(
    runs: FilterRuns, values: NDArray[np.float64], tolerance: float, tick: Tick
) -> NDArray[np.float64]:
    """Covariance that numbers which are not free add, each of them off by its tolerance."""
    found = np.zeros((len(values), len(values)))
    moved = [
        record
        for record, start in tolerance_records(runs.replay, tolerance, runs.keys)
        if start == UNMOVED
    ]
    for done, record in enumerate(moved):
        tick("tolerances of the other numbers", done, len(moved))
        _, own = runs.passed(values, record)
        found += np.outer(own.numbers - values, own.numbers - values)
    return found
