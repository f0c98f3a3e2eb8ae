"""Augmented Kalman filter of a ship: the plant is its model, any keys of the ship file are its unknowns.

The prediction is one step of the plant, with dead time, fuel rack, backlash and ventilation. The
derivatives by states and parameters are exact (:mod:`shaftline.plant.derivatives`). Waves disturb the
inflow of the propeller; the disturbance may be estimated as a Gauss-Markov process. The noises may be
estimated from the innovations (:mod:`.adaptive_noise`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..plant.derivatives import (
    COMPLEX_PLANT,
    COMPLEX_WORD,
    as_words,
    complex_record,
    parameter_slope,
)
from ..plant.dynamics import evaluate, settle_lags
from ..plant.memory import MEMORY, settle_memory
from ..plant.record import PLANT
from ..plant.replay import Replay
from ..plant.ship import Ship
from ..plant.state import STATE, State, active_states
from .adaptive_noise import start_adaptive_noise
from .augmented_plant import CHANNELS, Model, RecordedInputs, follow_course
from .base import ObserverError
from .records import Floats

_DELAY_KEYS = (
    "torque_delay_s",
    "torque_lag_s",
    "speed_delay_s",
    "speed_lag_s",
    "thrust_lag_s",
    "current_lag_s",
    "power_lag_s",
    "speed_log_lag_s",
)
"""Keys of ``[sensors]`` that delay a measurement."""

_INFLOW_KEYS = (
    "hull.wake_fraction",
    "hull.wake_slope_s_m",
    "hull.wake_reference_speed_m_s",
    "hull.current_m_s",
)

_STEERING_GEAR_KEYS = ("rudder.time_constant_s", "rudder.rate_limit_rad_s")
DISTURBANCE = "disturbance"  # name of the disturbance of the inflow [m/s] among the states
DISTURBANCE_TIME_S = 3.0  # correlation time: about one radian of the wave encounter period
_BOUND_MARGIN = 1e-6  # margin to a bound over its distance from the value in the ship file [-]
_LARGEST_FACTOR = 50.0
"""Largest ratio of an estimate and the value in the ship file, in either direction, for a parameter of
one sign. An inertia near 0, for example, has time constants that no time step resolves."""

NOISE_MEMORY_S = 30.0
"""Default memory of adaptive noise: about four wave periods. At 10 Hz the standard error of an estimated
standard deviation is then about 3 %: a log variance has g / (2 J), with J at most 1/2."""
LEAST_ROWS = 20.0  # fewest rows in the memory of adaptive noise: a standard error of about 11 %
_LEAST_SHARE = 0.01  # smallest adaptive noise over the given one


@dataclass(frozen=True)
class FilterResult:
    """Estimates of a filter along one recording of n rows.

    The columns of the estimates are states, disturbance of the inflow and parameters.
    """

    estimates: Floats  # after the measurements of each row, shape (n, states + 1 + parameters)
    standard_errors: Floats  # of the estimates, same shape
    innovations: Floats  # over their standard deviations, shape (n, channels); NaN where missing
    likelihood: float  # 2 log L of the measurements
    noise: Floats  # standard deviation of each channel's noise after each row, shape (n, channels)
    walk: Floats  # root of the density of the process noise [unit/s^0.5], shape (n, states + 1)


class ShipFilter:
    """Estimate states and parameters of a ship along recordings by an augmented Kalman filter.

    The estimates of the parameters, and of adaptive noise, are kept from one recording to the next.

    Args:
        ship: nominal ship.
        free: dotted keys of the parameters to estimate.
        parameter_spread: initial standard deviation of each parameter, by key, in its unit.
        noise: standard deviation of each measured column that the filter uses, in its unit; without any
            column the ship is simulated.
        state_spread: standard deviation of each state at the start of a recording, by name
            (:func:`shaftline.plant.state.active_states`).
        state_walk: root of the density of the process noise of each state [unit/s^0.5], by name, the
            disturbance of the inflow (:data:`DISTURBANCE`) included; 0 by default.
        parameter_walk: root of the density of the drift of each parameter, by key; 0 by default.
        record: PLANT record of the ship, if fixed parameters differ from those of ``ship``.
        disturbance_time_s: correlation time of the disturbance of the inflow [s].
        noise_memory_s: time constant [s] with which the noise of the channels and the process noise of
            states and inflow are estimated from the innovations (:mod:`.adaptive_noise`), such as
            :data:`NOISE_MEMORY_S`; None keeps the given ones. A process noise of 0 stays 0.
        least_noise: smallest standard deviation of adaptive noise, by column; a hundredth of ``noise``
            by default. Process noise stays above a hundredth of ``state_walk``.

    Attributes:
        states: names of the states.
        keys: keys of the parameters.
        z: estimate of states, disturbance of the inflow and parameters.
        p: covariance of the estimate.

    Raises:
        ObserverError: ``free`` is empty, a measurement of the ship is delayed, a column cannot be used,
            or a standard deviation or the memory of the noise is not positive.
        ShipError: a key is no parameter with a derivative.
    """

    def __init__(
        self,
        ship: Ship,
        free: Sequence[str],
        *,
        parameter_spread: Mapping[str, float],
        noise: Mapping[str, float],
        state_spread: Mapping[str, float],
        state_walk: Mapping[str, float] | None = None,
        parameter_walk: Mapping[str, float] | None = None,
        record: Any = None,
        disturbance_time_s: float = DISTURBANCE_TIME_S,
        noise_memory_s: float | None = None,
        least_noise: Mapping[str, float] | None = None,
    ) -> None:
        if not free:
            raise ObserverError(f"{ship.name}: name at least one key to estimate")
        if late := [key for key in _DELAY_KEYS if getattr(ship.sensors, key) > 0.0]:
            raise ObserverError(
                f"{ship.name}: the filter needs measurements without delay, but sensors.{late[0]} is "
                "above 0; set it to 0 or choose another method"
            )
        if unknown := [column for column in noise if column not in CHANNELS]:
            raise ObserverError(f"{unknown[0]}: the filter can use {', '.join(CHANNELS)} only")
        for name, spread in {**noise, **parameter_spread}.items():
            if not 0.0 < spread < np.inf:
                raise ObserverError(
                    f"{name}: the standard deviation must be above 0, not {spread:g}"
                )
        if noise_memory_s is not None and not 0.0 < noise_memory_s < np.inf:
            raise ObserverError(
                f"noise_memory_s = {noise_memory_s:g}: the memory of adaptive noise must be above 0 s, "
                f"such as {NOISE_MEMORY_S:g}; None keeps the noise constant"
            )
        self.ship, self.keys, self.columns = ship, tuple(free), tuple(noise)
        record = ship.record() if record is None else record
        self._rudder_lag = float(record["rudder_lag"])
        self.states = tuple(active_states(record))
        self._before = len(self.states) + 1
        walk = [(state_walk or {}).get(name, 0.0) for name in (*self.states, DISTURBANCE)]
        stationary = walk[-1] * np.sqrt(0.5 * disturbance_time_s)
        walk += [(parameter_walk or {}).get(key, 0.0) for key in self.keys]
        self._model = _model(
            ship, record, self.keys, self.states, np.array(walk), noise, 1.0 / disturbance_time_s
        )
        self._memory_s = noise_memory_s
        adapted = [i for i in range(self._before) if walk[i] > 0.0]
        least = {c: _LEAST_SHARE * own for c, own in noise.items()} | dict(least_noise or {})
        floors = [*(least[c] for c in noise), *(_LEAST_SHARE * walk[i] for i in adapted)]
        self._adapted = np.array(adapted, dtype=np.int64), np.array(floors) ** 2
        self._given = self._model.noise.copy(), self._model.process.copy()
        spreads = [state_spread[name] for name in self.states]
        self._state_variances = np.array([*spreads, stationary]) ** 2
        self._parameter_variances = np.array([parameter_spread[key] for key in self.keys]) ** 2
        self.z = np.zeros(self._before + len(free))
        self.p = np.zeros((len(self.z),) * 2)
        self.restart(self._model.start)

    @property
    def parameters(self) -> Floats:
        """Return the estimate of the parameters."""
        return self.z[self._before :].copy()

    @property
    def covariance(self) -> Floats:
        """Return the covariance of the parameters, shape (parameters, parameters)."""
        return self.p[self._before :, self._before :].copy()

    @property
    def at_bounds(self) -> list[str]:
        """Return the keys of the parameters whose estimate is at the end of its range."""
        held = (self.parameters <= self._model.low) | (self.parameters >= self._model.high)
        return [key for key, own in zip(self.keys, held, strict=True) if own]

    def restart(self, values: Sequence[float] | Floats) -> None:
        """Restart with given values of the parameters, the initial covariance and the given noises."""
        self._model.noise[:], self._model.process[:] = self._given
        self.z[self._before :] = values
        self.p[:] = np.diag(np.concatenate([self._state_variances, self._parameter_variances]))

    def follow(self, replay: Replay, rows: int | None = None) -> FilterResult:
        """Run the filter along one recording, starting with the present estimate of the parameters.

        Args:
            replay: replay of the recording with this ship; a measurement that is NaN is not used.
            rows: number of rows to use; all by default.

        Raises:
            ObserverError: a parameter has no effect, because the recording contains its result, the
                inflow or the rudder angle; or the memory of adaptive noise has too few rows.
        """
        table, model, count = replay.table, self._model, self._before
        given, gear = "inflow_velocity_m_s", "rudder_rad and no rudder command"
        for measured, keys, source, what in (
            (given in table, _INFLOW_KEYS, given, "inflow"),
            (replay.helm_measured, _STEERING_GEAR_KEYS, gear, "angle"),
        ):
            if measured and (replaced := [key for key in self.keys if key in keys]):
                raise ObserverError(
                    f"{replaced[0]} is not identifiable from a recording with {source}, because the "
                    f"measured {what} replaces the computed one"
                )
        gain = self._adaptive_gain(replay.per_row * replay.dt)
        plant = model.plant[0]
        lag = 0.0 if replay.helm_measured else self._rudder_lag
        plant["rudder_lag"], model.twin[0]["rudder_lag"] = lag, lag
        inflow = replay.inflow(plant)
        begin = replay.first_inputs(inflow)
        first = settle_lags(plant, replay.first_state(plant=plant), begin)
        if not self.ship.turns_freely:
            begin = begin._replace(drive=first.shaft_speed)
        _, outputs = evaluate(plant, first, begin, first.pitch_ratio)
        memory = np.zeros(1, MEMORY)
        settle_memory(plant, memory[0], first, outputs, begin.drive, replay.dt)
        model.state[0] = tuple(first)
        self.z[:count] = [*model.state_words[model.slots], 0.0]
        self.p[:count, :] = 0.0
        self.p[:, :count] = 0.0
        self.p[range(count), range(count)] = self._state_variances
        columns = [table[c].to_numpy(dtype=np.float64)[:rows] for c in self.columns]
        count_rows = replay.rows if rows is None else min(rows, replay.rows)
        measurements = np.ascontiguousarray(np.array(columns).reshape(-1, count_rows).T)
        recorded = RecordedInputs(
            replay.drive,
            replay.pitch,
            replay.rudder,
            inflow,
            replay.elevation,
            replay.signals,
            replay.per_row,
            replay.dt,
        )
        shape = (len(measurements), len(self.z))
        estimates, variances = np.empty(shape), np.empty(shape)
        innovations = np.empty(measurements.shape)
        noises = np.concatenate([model.noise, model.process[:count]])
        noises = np.tile(noises, (len(measurements) if gain else 1, 1))
        likelihood = follow_course(
            model,
            self.z,
            self.p,
            recorded,
            memory,
            measurements,
            estimates,
            variances,
            innovations,
            start_adaptive_noise(gain, *self._adapted, len(self.z)),
            noises,
        )
        noises = np.broadcast_to(np.sqrt(noises), (len(measurements), noises.shape[1]))
        return FilterResult(
            estimates,
            np.sqrt(np.maximum(variances, 0.0)),
            innovations,
            likelihood,
            *np.split(noises, [len(self.columns)], axis=1),
        )

    def _adaptive_gain(self, seconds: float) -> float:
        """Return the weight of a row ``seconds`` long in adaptive noise; 0 if the noise is constant."""
        if self._memory_s is None:
            return 0.0
        if self._memory_s < LEAST_ROWS * seconds:
            raise ObserverError(
                f"noise_memory_s = {self._memory_s:g}: the rows are {seconds:.4g} s apart, so adaptive "
                f"noise needs a memory of at least {LEAST_ROWS * seconds:.4g} s ({LEAST_ROWS:g} rows)"
            )
        return float(-np.expm1(-seconds / self._memory_s))


def _model(
    ship: Ship,
    record: Any,
    keys: Sequence[str],
    states: Sequence[str],
    walk: Floats,
    noise: Mapping[str, float],
    forgetting: float,
) -> Model:
    """Return the model of a ship with its free parameters."""
    parameters = [parameter_slope(ship, key) for key in keys]
    plant, twin = np.zeros(1, PLANT), np.zeros(1, COMPLEX_PLANT)
    state, rate = np.zeros(1, STATE), np.zeros(1, STATE)
    plant[0], twin[0] = record, complex_record(record)
    units = np.zeros(len(states) + 1 + len(keys), STATE)
    for i, name in enumerate(states):
        units[name][i] = 1.0
    start = np.array([parameter.value for parameter in parameters], dtype=np.float64)
    ends = np.array([(parameter.info.low, parameter.info.high) for parameter in parameters]).T
    with np.errstate(invalid="ignore"):
        inside = ends + _BOUND_MARGIN * (start - ends)
    low, high = np.where(np.isfinite(ends), inside, ends)
    one_sign = (low >= 0.0) & (start > 0.0)
    low = np.where(one_sign, np.maximum(low, start / _LARGEST_FACTOR), low)
    high = np.where(one_sign, np.minimum(high, start * _LARGEST_FACTOR), high)
    word = np.concatenate([parameter.words for parameter in parameters])
    # Also without a channel these are integers: for another type the kernel is compiled again.
    channels = np.array([CHANNELS.index(column) for column in noise], dtype=np.int64)
    return Model(
        plant, as_words(plant), twin, as_words(twin), state, as_words(state), rate, as_words(rate),
        np.array([State._fields.index(name) for name in states]), units,
        np.concatenate([np.full(len(parameter.words), i) for i, parameter in enumerate(parameters)]),
        word, COMPLEX_WORD[word], np.concatenate([parameter.slopes for parameter in parameters]),
        as_words(plant)[word].copy(), start, low, high, channels,
        np.array([*noise.values()], dtype=np.float64) ** 2, walk**2, forgetting,
    )  # fmt: skip
