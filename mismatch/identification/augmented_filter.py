"""Estimate parameters with the ship's states, row by row, by a state-augmented extended Kalman filter.

The filter is :class:`shaftline.observers.ship_filter.ShipFilter`. Its noises are estimated from the
recording, so that the user needs no tuning; ``noise_memory_s`` lets them change along it. The parameters
are constant; ``parameter_walk`` lets them drift, for example to track growing fouling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...observers.augmented_plant import CHANNELS
from ...observers.ship_filter import DISTURBANCE, FilterResult, ShipFilter
from ...plant.columns import MEASURED
from ...plant.derivatives import as_words, parameter_slope
from ...plant.ship import Ship
from ...plant.state import active_states
from ..estimate import Tick, ignore_progress
from ..simulate.balances import NO_SHIFT, tolerance_records
from ..simulate.joint_replay import JointReplay
from .free_parameters import refuse_unidentifiable
from .parameters import MethodResult

Array = NDArray[np.float64]

DOUBT = 0.5  # initial standard deviation of a parameter that is not 0, as a share of its value
LEAST_NOISE = 3e-4
"""Smallest standard deviation of an instrument's noise, as a share of the channel's size. Without noise,
an extended filter takes its linearisation error for information and its estimates diverge."""
LEAST_WHITE = 1.0 / 3.0
"""Smallest adaptive noise of an instrument over the white part of its recording. Without it the filter,
whose model of the inflow is rougher than waves, takes smooth waves for a torque meter without noise."""
FELT = 0.1  # relative change of a channel by the initial deviation of a parameter that is 0
STATE_SPREAD = 0.05  # initial standard deviation of each state, as a share of its size
WALKS = (1e-3, 1e-2, 0.1, 0.5)
"""Square roots of the densities of process noise that are tried [1/s^0.5]: shares of a state's size, or
m/s of the inflow."""
WORTH = 20.0  # least gain of a process noise in 2 log L
MOST_TURNS = 12  # of the search for the process noise
SAMPLE_ROWS = 6000  # number of rows from which the process noise is estimated
FEWEST_ROWS = 20
MOST_PASSES = 6
SETTLED = 0.1  # change of the estimates in standard errors below which no further pass follows
SLOPE_STEP = 1e-4  # finite difference of a parameter, as a share of its initial standard deviation
COLOURED = 0.1  # correlation of innovations, and deviation of their rms from 1, that give a remark
CHANCE = 4.0  # standard deviations of either by chance up to which no remark is given
UNSETTLED = 3.5  # standard deviations by which an estimate may change over the last quarter
LITTLE = 0.3  # largest standard error of an identifiable parameter, as a share of its initial value
LAGS = 20  # largest lag of the correlation of innovations [rows]
SHOWN_ROWS = 2000


def ekf(
    ship: Ship,
    tables: Sequence[pd.DataFrame],
    free: Sequence[str],
    tick: Tick = ignore_progress,
    *,
    spread: Mapping[str, float] | None = None,
    parameter_walk: Mapping[str, float] | None = None,
    noise_memory_s: float | None = None,
    tolerance: float = 1.0,
) -> MethodResult:
    """Estimate parameters by the augmented filter, over one recording after the other.

    The first pass starts from the values of the ship file; the table ``estimates`` shows this pass.
    Further passes start from the estimates of the pass before, until these converge.

    - The instruments' noise is the white part of each channel, as in a diagnosis.
    - The process noise of each state, and of the inflow in waves, is the most likely one; it is 0 where
      it gains less than :data:`WORTH`.
    - The initial standard deviation of a parameter is :data:`DOUBT` of its value, or, at 0, the change
      that changes a channel by :data:`FELT` of its size.

    Args:
        ship: nominal ship.
        tables: recordings in canonical columns with equal columns and an equal, even sampling interval.
        free: dotted keys of the parameters.
        tick: progress callback ``tick(stage, done, total)``.
        spread: initial standard deviations of parameters by key, in the keys' units.
        parameter_walk: square roots of the densities of the numbers' drift [unit/s^0.5], by key. With
            any, the last value is the one at the end of the last recording.
        noise_memory_s: time constant [s] with which the noises are adapted along the recordings, such as
            :data:`shaftline.observers.ship_filter.NOISE_MEMORY_S`; None keeps them constant. The table
            ``noise`` has the noises of the last pass.
        tolerance: factor on the tolerances of the parameters that are not free [-].

    Raises:
        ValueError: parameters that are not identifiable, or of which only a combination is; recordings
            that do not go together.
        ObserverError: an instrument with a delay, or a memory of too few rows.
        ShipError: a key that is no parameter with a derivative.
    """
    replay = JointReplay(ship, *tables)
    runs = tune_filter(
        replay,
        free,
        tick,
        spread=spread,
        parameter_walk=parameter_walk,
        noise_memory_s=noise_memory_s,
    )
    first, own = runs.run(runs.start)
    values, last = own.parameters, first
    for count in range(0 if parameter_walk else MOST_PASSES):
        tick("passes of the filter", count, MOST_PASSES)
        last, own = runs.run(values)
        moved = np.abs(own.parameters - values) / np.sqrt(np.diag(own.covariance))
        values = own.parameters
        if moved.max() < SETTLED:
            break
    covariance = own.covariance + _tolerance_covariance(runs, values, tolerance, tick)
    _refuse_diverged(runs, first, covariance)
    whiteness = _innovations(runs, last)
    remarks = [
        *(
            f"{k} is at the end of its range in the filter, and is not identified"
            for k in own.at_bounds
        ),
        *_convergence_remarks(runs, last),
        *_information_remarks(runs, own),
        *_whiteness_remarks(whiteness),
    ]
    kept = {"estimates": _estimates_over_time(runs, first), "innovations": whiteness}
    if noise_memory_s is not None:
        kept["noise"] = _noises_over_time(runs, last)
    return MethodResult(tuple(free), tuple(map(float, values)), covariance, kept, tuple(remarks))


class _Noises(NamedTuple):
    """Standard deviations that the filter needs beforehand."""

    readings: dict[str, float]  # rms by column
    least: dict[str, float]  # smallest adaptive rms by column
    states: dict[str, float]  # at the start, by name
    numbers: dict[str, float]  # at the start, by key
    state_walk: dict[str, float]  # [unit/s^0.5]
    parameter_walk: Mapping[str, float]


class FilterRuns:
    """Runs of the filter over the recordings, one after the other."""

    def __init__(
        self,
        replay: JointReplay,
        keys: tuple[str, ...],
        noises: _Noises,
        noise_memory_s: float | None = None,
    ) -> None:
        self.replay, self.keys, self.noises = replay, keys, noises
        self.noise_memory_s = noise_memory_s
        self.start = np.array([parameter_slope(replay.ship, key).value for key in keys])

    def filter(
        self,
        state_walk: Mapping[str, float],
        record: Any = None,
        noise_memory_s: float | None = None,
    ) -> ShipFilter:
        """Return a filter without measurements yet, with constant noise by default."""
        noises = self.noises
        return ShipFilter(
            self.replay.ship,
            self.keys,
            parameter_spread=noises.numbers,
            noise=noises.readings,
            state_spread=noises.states,
            state_walk=state_walk,
            parameter_walk=noises.parameter_walk,
            record=record,
            noise_memory_s=noise_memory_s,
            least_noise=noises.least,
        )

    def run(self, values: Array, record: Any = None) -> tuple[list[FilterResult], ShipFilter]:
        """Run the filter over all recordings once, from these parameters."""
        own = self.filter(self.noises.state_walk, record, self.noise_memory_s)
        own.restart(values)
        return [own.follow(run) for run in self.replay.runs], own


def tune_filter(
    replay: JointReplay,
    free: Sequence[str],
    tick: Tick = ignore_progress,
    *,
    spread: Mapping[str, float] | None = None,
    parameter_walk: Mapping[str, float] | None = None,
    noise_memory_s: float | None = None,
) -> FilterRuns:
    """Return the filter of :func:`ekf` with the noises that it estimates from the recordings.

    Arguments and errors are those of :func:`ekf`.
    """
    noises = _estimate_noises(replay, free, dict(spread or {}), dict(parameter_walk or {}))
    runs = FilterRuns(replay, tuple(free), noises, noise_memory_s)
    refuse_unidentifiable(free, _information(runs))
    noises.state_walk.update(_likeliest_process_noise(runs, tick))
    return runs


def _estimate_noises(
    replay: JointReplay,
    free: Sequence[str],
    spread: dict[str, float],
    parameter_walk: dict[str, float],
) -> _Noises:
    """Return the standard deviations of noise, initial states and initial parameters."""
    ship = replay.ship
    nominal = replay.simulate(ship.record())
    fixed = () if ship.has_variable_pitch else ("pitch_ratio",)
    noises = {
        c: rms
        for c, rms in replay.noise_rms.items()
        if c in CHANNELS and c not in fixed and rms > 0.0
    }
    least = {c: LEAST_NOISE * _size(nominal[MEASURED[c]]) for c in noises}
    readings = {c: max(rms, least[c]) for c, rms in noises.items()}
    if not readings:
        raise ValueError(f"ekf: {ship.name}: no measured channel of the recordings moves")
    states = {name: STATE_SPREAD * own for name, own in state_sizes(replay, free).items()}
    for key in (key for key in free if key not in spread):
        value = parameter_slope(ship, key).value
        spread[key] = DOUBT * abs(value) or smallest_change(replay, key, nominal)
    least = {c: max(own, LEAST_WHITE * readings[c]) for c, own in least.items()}
    return _Noises(readings, least, states, spread, dict.fromkeys(states, 0.0), parameter_walk)


def state_sizes(replay: JointReplay, free: Sequence[str]) -> dict[str, float]:
    """Return the rms of each state of the ship along the recordings, by name.

    The filter itself simulates them without measurements, so that all states are included.
    """
    states = active_states(replay.ship.record())
    still, doubts = dict.fromkeys(states, 0.0), dict.fromkeys(free, 1.0)
    alone = ShipFilter(replay.ship, free, parameter_spread=doubts, noise={}, state_spread=still)
    simulated = np.concatenate([alone.follow(run).estimates for run in replay.runs])
    return {name: _size(simulated[:, i]) for i, name in enumerate(states)}


def _size(values: Array) -> float:
    """Return the rms of a signal."""
    return float(np.sqrt(np.mean(np.square(values))))


def smallest_change(replay: JointReplay, key: str, nominal: Any) -> float:
    """Return the value of a parameter that is 0 at which some channel changes by :data:`FELT`."""
    info, before = parameter_slope(replay.ship, key).info, replay.simulated(nominal)
    side = 1.0 if info.high > 0.0 else -1.0
    step = reach = min(abs(info.high if side > 0.0 else info.low), 1e9)
    for _ in range(60):
        with np.errstate(over="ignore", invalid="ignore"):
            after = _simulated_with(replay, key, side * step)
            felt = float(
                np.max([_size(after[c] - b) / (_size(b) or 1.0) for c, b in before.items()])
            )
        if np.isfinite(felt) and felt <= FELT:
            return min(step * FELT / felt, DOUBT * reach) if felt > 0.0 else DOUBT * step
        step *= 0.3
    return step


def _simulated_with(replay: JointReplay, key: str, change: float) -> dict[str, Array]:
    """Return the simulated channels by column after a change of a parameter, in the key's unit."""
    number, record = parameter_slope(replay.ship, key), replay.ship.record()
    as_words(record)[number.words] += change * number.slopes
    return replay.simulate_channels(record)


def _likeliest_process_noise(runs: FilterRuns, tick: Tick) -> dict[str, float]:
    """Return the process noises with the largest likelihood of the measurements, by greedy search."""
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

    def trials_of(name: str) -> list[float]:
        here = walk[name]
        return [0.0, here / 2.0, 2.0 * here] if here > 0.0 else [w * sizes[name] for w in WALKS]

    walk = dict.fromkeys(sizes, 0.0)
    best = likelihood(walk)
    for turn in range(MOST_TURNS):
        tick("noise of the states", turn, MOST_TURNS)
        # The noise of the inflow comes first, because waves would otherwise count as noise of a state.
        names = [DISTURBANCE] if turn == 0 and DISTURBANCE in sizes else [*sizes]
        trials = [walk | {name: value} for name in names for value in trials_of(name)]
        scores = [likelihood(trial) for trial in trials]
        if max(scores) > best + WORTH:
            walk, best = trials[int(np.argmax(scores))], max(scores)
        elif turn > 0:
            break
    return walk


def _information(runs: FilterRuns) -> Array:
    """Return the information about the parameters at the file's values, in units of their spreads.

    It comes from simulations, because an extended filter, which linearises anew at every row, gains
    false information about combinations that are not identifiable (Huang et al. 2010).
    """
    slopes = []
    for key in runs.keys:
        ends = []
        for side in (SLOPE_STEP, -SLOPE_STEP):
            after = _simulated_with(runs.replay, key, side * runs.noises.numbers[key])
            ends.append(np.concatenate([after[c] / r for c, r in runs.noises.readings.items()]))
        slopes.append((ends[0] - ends[1]) / (2.0 * SLOPE_STEP))
    found = np.array(slopes)
    return np.asarray(found @ found.T)


def _tolerance_covariance(runs: FilterRuns, values: Array, tolerance: float, tick: Tick) -> Array:
    """Return the covariance from the tolerances of the parameters that are not free."""
    found = np.zeros((len(values), len(values)))
    records = tolerance_records(runs.replay, tolerance, runs.keys)
    moved = [record for record, start in records if start == NO_SHIFT]
    for done, record in enumerate(moved):
        tick("tolerances of the other numbers", done, len(moved))
        _, own = runs.run(values, record)
        found += np.outer(own.parameters - values, own.parameters - values)
    return found


def _refuse_diverged(runs: FilterRuns, followed: list[FilterResult], covariance: Array) -> None:
    """Refuse estimates that are not finite, with the time from which they are not."""
    lost = ~np.isfinite(np.concatenate([one.estimates for one in followed])).all(axis=1)
    if lost.any() or not np.isfinite(covariance).all():
        when = f"from {runs.replay.time_s[int(np.argmax(lost))]:.4g} s on " if lost.any() else ""
        raise ValueError(
            f"ekf: {when}the filter's estimates of {', '.join(runs.keys)} diverge. Possible causes "
            "are a recording almost without noise and parameters far from the ship file; free fewer "
            "parameters or use --method output-error"
        )


def _join(runs: FilterRuns, followed: list[FilterResult]) -> tuple[Any, Any]:
    """Return the estimates over all rows and their standard errors, each of shape (rows, parameters)."""
    count = len(runs.keys)
    values = np.concatenate([one.estimates[:, -count:] for one in followed])
    return values, np.concatenate([one.standard_errors[:, -count:] for one in followed])


def _estimates_over_time(runs: FilterRuns, followed: list[FilterResult]) -> pd.DataFrame:
    """Return a table of the estimates and their standard errors over time."""
    values, errors = _join(runs, followed)
    columns = {"time_s": runs.replay.time_s}
    for i, key in enumerate(runs.keys):
        columns |= {key: values[:, i], f"{key} se": errors[:, i]}
    return _thin(pd.DataFrame(columns))


def _noises_over_time(runs: FilterRuns, followed: list[FilterResult]) -> pd.DataFrame:
    """Return a table of the noise of each channel and of the process noise of each state over time."""
    walks = [name for name, own in runs.noises.state_walk.items() if own > 0.0]
    names = [*active_states(runs.replay.ship.record()), DISTURBANCE]
    found = [
        np.hstack([one.noise, one.walk[:, [names.index(name) for name in walks]]])
        for one in followed
    ]
    columns = [*runs.noises.readings, *(f"{name} walk" for name in walks)]
    table = pd.DataFrame(np.concatenate(found), columns=columns)
    table.insert(0, "time_s", runs.replay.time_s)
    return _thin(table)


def _thin(table: pd.DataFrame) -> pd.DataFrame:
    """Return every nth row of a table, about :data:`SHOWN_ROWS` in all."""
    return table.iloc[:: max(1, len(table) // SHOWN_ROWS)].reset_index(drop=True)


def _innovations(runs: FilterRuns, followed: list[FilterResult]) -> pd.DataFrame:
    """Return a table of noise, rms of the innovations and their largest correlation by channel."""
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
        lag_s = (1 + worst) * runs.replay.interval_s
        rows.append((column, noise, _size(found), correlations[worst], lag_s, len(found)))
    return pd.DataFrame(rows, columns=["channel", "noise", "rms", "correlation", "lag_s", "rows"])


def _whiteness_remarks(innovations: pd.DataFrame) -> list[str]:
    """Return remarks on channels with coloured innovations, for which standard errors may be wrong."""
    return [
        f"the innovations of {row.channel} are not white: their rms is {row.rms:.2g} times the expected "
        f"one, and their correlation at a lag of {row.lag_s:.3g} s is {row.correlation:.2f}. Possible "
        "causes are waves and missing physics; the standard errors may be wrong"
        for row in innovations.itertuples()
        if abs(row.rms - 1.0) > max(COLOURED, CHANCE / np.sqrt(2.0 * row.rows))
        or abs(row.correlation) > max(COLOURED, CHANCE / np.sqrt(row.rows))
    ]


def _convergence_remarks(runs: FilterRuns, followed: list[FilterResult]) -> list[str]:
    """Return remarks on estimates that changed over the last quarter by more than their errors allow.

    The change of the estimate of a constant between two times has the variance P(first) - P(second).
    """
    values, errors = _join(runs, followed)
    then = 3 * len(values) // 4
    allowed = np.sqrt(np.maximum(errors[then] ** 2 - errors[-1] ** 2, 1e-300))
    moved = values[-1] - values[then]
    return [
        f"the estimate of {key} has not converged: it changed by {moved[i]:.3g} over the last quarter, "
        f"{abs(moved[i]) / allowed[i]:.1f} times its expected standard deviation"
        for i, key in enumerate(runs.keys)
        if key not in runs.noises.parameter_walk and abs(moved[i]) > UNSETTLED * allowed[i]
    ]


def _information_remarks(runs: FilterRuns, own: ShipFilter) -> list[str]:
    """Return remarks on parameters about which the recordings contain little information."""
    errors, spreads = np.sqrt(np.diag(own.covariance)), runs.noises.numbers
    return [
        f"the recordings contain little information about {key}: its standard error decreased only from "
        f"{spreads[key]:.3g} to {error:.3g}"
        for key, error in zip(runs.keys, errors, strict=True)
        if error > LITTLE * spreads[key]
    ]
