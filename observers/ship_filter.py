"""The augmented filter of a ship: its own plant as the model, any numbers of its file as unknowns.

The prediction is the plant's own step, with its dead time, rack, backlash and ventilation; the slopes
are exact, to states and numbers alike (:mod:`shaftline.plant.derivatives`). At sea the inflow of the
propeller is disturbed; the disturbance may be estimated too, as a Gauss-Markov process.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..plant.derivatives import COMPLEX_PLANT, COMPLEX_WORD, acting, complex_record, words
from ..plant.dynamics import evaluate, settled
from ..plant.memory import MEMORY, settle
from ..plant.record import PLANT
from ..plant.replay import Replay
from ..plant.ship import Ship
from ..plant.state import STATE, State, active_states
from .augmented_plant import CHANNELS, Course, Model, follow_course
from .base import ObserverError

Floats = NDArray[np.float64]

_LATE = (
    "torque_delay_s", "torque_lag_s", "speed_delay_s", "speed_lag_s", "thrust_lag_s",
    "current_lag_s", "power_lag_s", "speed_log_lag_s",
)  # fmt: skip
"""Keys of ``[sensors]`` that make an instrument late."""

_OF_THE_INFLOW = (
    "hull.wake_fraction", "hull.wake_slope_s_m", "hull.wake_reference_speed_m_s", "hull.current_m_s",
)  # fmt: skip

_OF_THE_GEAR = ("rudder.time_constant_s", "rudder.rate_limit_rad_s")

DISTURBANCE = "disturbance"
"""Name by which the disturbance of the inflow [m/s] is spoken of among the states."""

DISTURBANCE_TIME_S = 3.0
"""Its correlation time by default: about a radian of a sea's encounter period."""

_INSIDE = 1e-6
"""Share of the way to a bound, from the file's number, at which an estimate is held."""

_FACTOR = 50.0
"""Most by which an estimate may be larger or smaller than the file's number, where that has one sign: an
inertia near 0 has time constants that no time step resolves."""


@dataclass(frozen=True)
class Followed:
    """What a filter makes of one recording of n rows.

    Args:
        estimates: of states, the inflow's disturbance and numbers, just after each row's readings,
            shape (n, states + 1 + numbers).
        standard_errors: likewise.
        innovations: over their standard deviations, shape (n, channels); NaN where nothing was read.
        likelihood: 2 log L of the readings.
    """

    estimates: Floats
    standard_errors: Floats
    innovations: Floats
    likelihood: float


class ShipFilter:
    """A filter of one ship; it takes its numbers along from one recording to the next.

    Args:
        ship: as its file has it.
        free: dotted keys of the numbers that are estimated.
        number_spread: standard deviation of each number at the start, by key, in its unit.
        noise: standard deviation of each measured column that it goes by, in its unit; without any the
            ship is simulated.
        state_spread: of each state at the start of a recording, by name; those of
            :func:`shaftline.plant.state.active_states`.
        state_walk: square root of the density of each state's process noise [unit/s^0.5], by name, the
            inflow's disturbance (:data:`DISTURBANCE`) among them; 0 for one that is not named.
        number_walk: likewise of the numbers, by key.
        record: of the ship where another number than the free ones differs from the file's.
        disturbance_time_s: correlation time of the inflow's disturbance.

    Attributes:
        states: names of its states.
        keys: of its numbers.
        z: estimate of states, the inflow's disturbance and numbers.
        p: its covariance.

    Raises:
        ObserverError: no key, an instrument that answers late, a column that cannot be compared with,
            or a spread that is none.
        ShipError: a key that is no number with a derivative.
    """

    def __init__(
        self,
        ship: Ship,
        free: Sequence[str],
        *,
        number_spread: Mapping[str, float],
        noise: Mapping[str, float],
        state_spread: Mapping[str, float],
        state_walk: Mapping[str, float] | None = None,
        number_walk: Mapping[str, float] | None = None,
        record: Any = None,
        disturbance_time_s: float = DISTURBANCE_TIME_S,
    ) -> None:
        if not free:
            raise ObserverError(f"{ship.name}: name at least one key that is to be estimated")
        if late := [key for key in _LATE if getattr(ship.sensors, key) > 0.0]:
            raise ObserverError(
                f"{ship.name}: the filter serves no instrument with sensors.{late[0]} above 0"
            )
        if unknown := [column for column in noise if column not in CHANNELS]:
            raise ObserverError(f"{unknown[0]}: the filter goes by {', '.join(CHANNELS)} only")
        for name, spread in {**noise, **number_spread}.items():
            if not 0.0 < spread < np.inf:
                raise ObserverError(
                    f"{name}: a standard deviation above 0 is needed, not {spread:g}"
                )
        self.ship, self.keys, self.columns = ship, tuple(free), tuple(noise)
        record = ship.record() if record is None else record
        self._rudder_lag = float(record["rudder_lag"])
        self.states = tuple(active_states(record))
        self._before = len(self.states) + 1
        walk = [(state_walk or {}).get(name, 0.0) for name in (*self.states, DISTURBANCE)]
        # as it is when it has been there for ever
        ever = walk[-1] * np.sqrt(0.5 * disturbance_time_s)
        walk += [(number_walk or {}).get(key, 0.0) for key in self.keys]
        self._model = _model(
            ship, record, self.keys, self.states, np.array(walk), noise, 1.0 / disturbance_time_s
        )
        spreads = [state_spread[name] for name in self.states]
        self._state_variances = np.array([*spreads, ever]) ** 2
        self._number_variances = np.array([number_spread[key] for key in self.keys]) ** 2
        self.z = np.zeros(self._before + len(free))
        self.p = np.zeros((len(self.z),) * 2)
        self.restart(self._model.start)

    @property
    def numbers(self) -> Floats:
        """Estimate of the numbers."""
        return self.z[self._before :].copy()

    @property
    def covariance(self) -> Floats:
        """Of the numbers, shape (numbers, numbers)."""
        return self.p[self._before :, self._before :].copy()

    @property
    def at_bounds(self) -> list[str]:
        """Keys of the parameters whose estimate is held at the end of its range."""
        held = (self.numbers <= self._model.low) | (self.numbers >= self._model.high)
        return [key for key, own in zip(self.keys, held, strict=True) if own]

    def restart(self, values: Sequence[float] | Floats) -> None:
        """Begin anew, as unsure as at first, with these values of the numbers."""
        self.z[self._before :] = values
        self.p[:] = np.diag(np.concatenate([self._state_variances, self._number_variances]))

    def follow(self, replay: Replay, rows: int | None = None) -> Followed:
        """Follow one recording from its start, with the numbers as they are known by now.

        Args:
            replay: of this ship along the recording; a reading that is NaN is left out.
            rows: how many of its rows; all by default.

        Raises:
            ObserverError: a number that the recording's measured inflow stands for.
        """
        table, model, count = replay.table, self._model, self._before
        replaced = [key for key in self.keys if key in _OF_THE_INFLOW]
        if replaced and "inflow_velocity_m_s" in table:
            raise ObserverError(
                f"{replaced[0]} cannot be found where inflow_velocity_m_s is measured: the inflow is "
                "then the measured one"
            )
        if replay.helm_measured and (own := [key for key in self.keys if key in _OF_THE_GEAR]):
            raise ObserverError(
                f"{own[0]} cannot be found where rudder_rad is measured and no command is: the rudder "
                "does then what was measured"
            )
        plant = model.plant[0]
        lag = 0.0 if replay.helm_measured else self._rudder_lag
        plant["rudder_lag"], model.twin[0]["rudder_lag"] = lag, lag
        inflow = replay.inflow(plant)
        begin = replay.first_inputs(inflow)
        first = settled(plant, replay.first_state(plant=plant), begin)
        if not self.ship.turns_freely:
            begin = begin._replace(drive=first.shaft_speed)
        _, outputs = evaluate(plant, first, begin, first.pitch_ratio)
        memory = np.zeros(1, MEMORY)
        settle(plant, memory[0], first, outputs, begin.drive, replay.dt)
        model.state[0] = tuple(first)
        self.z[:count] = [*model.state_words[model.slots], 0.0]
        self.p[:count, :] = 0.0
        self.p[:, :count] = 0.0
        self.p[range(count), range(count)] = self._state_variances
        columns = [table[c].to_numpy(dtype=np.float64)[:rows] for c in self.columns]
        count_rows = replay.rows if rows is None else min(rows, replay.rows)
        readings = np.ascontiguousarray(np.array(columns).reshape(-1, count_rows).T)
        course = Course(
            replay.drive, replay.pitch, replay.rudder, inflow, replay.elevation, replay.signals,
            replay.per_row, replay.dt,
        )  # fmt: skip
        shape = (len(readings), len(self.z))
        estimates, variances = np.empty(shape), np.empty(shape)
        innovations = np.empty(readings.shape)
        likelihood = follow_course(
            model, self.z, self.p, course, memory, readings, estimates,
            variances, innovations,
        )  # fmt: skip
        return Followed(estimates, np.sqrt(np.maximum(variances, 0.0)), innovations, likelihood)


def _model(
    ship: Ship, record: Any, keys: Sequence[str], states: Sequence[str], walk: Floats,
    noise: Mapping[str, float], forgetting: float,
) -> Model:  # fmt: skip
    """Records and places of a ship and its numbers."""
    numbers = [acting(ship, key) for key in keys]
    plant, twin = np.zeros(1, PLANT), np.zeros(1, COMPLEX_PLANT)
    state, rate = np.zeros(1, STATE), np.zeros(1, STATE)
    plant[0], twin[0] = record, complex_record(record)
    units = np.zeros(len(states) + 1 + len(keys), STATE)
    for i, name in enumerate(states):
        units[name][i] = 1.0
    start = np.array([number.value for number in numbers])
    low, high = (
        np.array([getattr(number.info, end) for number in numbers]) for end in ("low", "high")
    )
    with np.errstate(invalid="ignore"):
        low, high = (
            np.where(np.isfinite(end), end + _INSIDE * (start - end), end) for end in (low, high)
        )
    one_sign = (low >= 0.0) & (start > 0.0)
    low = np.where(one_sign, np.maximum(low, start / _FACTOR), low)
    high = np.where(one_sign, np.minimum(high, start * _FACTOR), high)
    word = np.concatenate([number.words for number in numbers])
    return Model(
        plant, words(plant), twin, words(twin), state, words(state), rate, words(rate),
        np.array([State._fields.index(name) for name in states]), units,
        np.concatenate([np.full(len(number.words), i) for i, number in enumerate(numbers)]),
        word, COMPLEX_WORD[word],
        np.concatenate([number.slopes for number in numbers]), words(plant)[word].copy(), start,
        low, high, np.array([CHANNELS.index(column) for column in noise]),
        np.array([*noise.values()]) ** 2, walk**2, forgetting,
    )  # fmt: skip
