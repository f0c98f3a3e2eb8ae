"""Put effects on a ship: probes, search coordinates and records with the values of effects."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import SHAFT_ANGLE
from ...plant.keys import ShipParameter
from ...plant.memory import HISTORY
from ...plant.propeller import NO_PROPELLER, cavitation_number
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship, ShipError
from ...plant.terms import TURNING_SIGNALS
from ..simulate.balances import Balances
from .catalogue import Effect, Parameter, SizedEffect, Window

EDGE_S = 30.0
"""Unit of the edges of a time window in the search [s]."""


class JointSearch:
    """Search coordinates of some effects of a model, with the others fixed."""

    def __init__(
        self,
        trial_ship: TrialShip,
        effects: tuple[SizedEffect, ...],
        which: list[int] | None = None,
    ) -> None:
        self._effects = effects
        self._which = list(range(len(effects))) if which is None else which
        self._searches = [EffectSearch(trial_ship, effects[i]) for i in self._which]
        points = [search.point() for search in self._searches]
        self._cuts = np.cumsum([len(point) for point in points])[:-1]
        self.start = np.concatenate(points)

    def effects_at(self, point: Any) -> tuple[SizedEffect, ...]:
        """Return all effects of the model, with the searched ones at given coordinates."""
        trial = list(self._effects)
        parts = np.split(np.atleast_1d(point), self._cuts)
        for i, search, part in zip(self._which, self._searches, parts, strict=True):
            trial[i] = search.effects_at(part)
        return tuple(trial)


class EffectSearch:
    """Search coordinates of an effect.

    They are the logarithms of the distances of its values from neutral, and the edges of its time window
    in units of :data:`EDGE_S`.
    """

    def __init__(self, trial_ship: TrialShip, placed: SizedEffect) -> None:
        self._placed = placed
        self._neutral, self._sign, self._least, self._ranges = [], [], [], []
        for parameter, value in placed.pairs:
            self._ranges.append(trial_ship.range_of(parameter))
            base = trial_ship.origin(parameter)
            self._neutral.append(base)
            self._sign.append(1.0 if value >= base else -1.0)
            self._least.append(trial_ship.smallest_size(parameter))

    def point(self) -> NDArray[np.float64]:
        """Return the coordinates of the effect at its given values."""
        distance = [abs(v - n) for v, n in zip(self._placed.values, self._neutral, strict=True)]
        edges = [t / EDGE_S for t in self._placed.window or ()]
        return np.concatenate([np.log(np.maximum(distance, 1e-12)), edges])

    def effects_at(self, point: Any) -> SizedEffect:
        """Return the effect at given coordinates."""
        point = np.atleast_1d(point)
        count = len(self._neutral)
        values = [
            float(np.clip(n + s * max(math.exp(min(x, 60.0)), least), *ends))
            for n, s, least, ends, x in zip(
                self._neutral, self._sign, self._least, self._ranges, point[:count], strict=True
            )
        ]
        window = self._placed.window
        if window is not None:
            start, end = sorted(float(x) * EDGE_S for x in point[count:])
            window = (max(start, 0.0), max(end, 0.0))
        return SizedEffect(self._placed.effect, tuple(values), window)


PITCH_GAPS = ("pitch_actuator.dead_band", "pitch_actuator.backlash")
"""Keys of parameters that are not identifiable below the quantisation step of the pitch."""

PITCH_OFFSETS = ("sensors.pitch_offset", "pitch_actuator.offset")
"""Keys of constant offsets of the measured pitch."""


class TrialShip:
    """Ship of a set of recordings, to which effects can be added.

    Args:
        balances: balances of ship and recordings; their nominal simulation scales the probes.

    Attributes:
        ship: the nominal ship.
        nominal: record of the nominal ship.
    """

    def __init__(self, balances: Balances) -> None:
        self.ship: Ship = balances.replay.ship
        self._replay = balances.replay
        self.nominal = self.ship.record()
        self._scales = probe_scales(balances)
        self._longest_s = (HISTORY - 2) * min(run.dt for run in balances.replay.runs)
        self._numbers: dict[tuple[str, ...], ShipParameter] = {}

    def settings(self, placed: SizedEffect) -> dict[str, float]:
        """Return the values of an effect by dotted key of the ship file."""
        found = {parameter.key: value for parameter, value in placed.pairs}
        for key, of in placed.effect.fixed:
            found[key] = self._fixed(of)
        for key, of, factor in placed.effect.ties:
            found[key] = found[of] * factor
        if placed.window is not None:
            section = placed.effect.parameters[0].key.split(".")[0]
            start, end = placed.window
            found[f"{section}.episode_start_s"] = start
            found[f"{section}.episode_end_s"] = end
        return {
            key: self._inside(self._number((placed,), key), value) for key, value in found.items()
        }

    def _number(self, effects: tuple[SizedEffect, ...], key: str) -> ShipParameter:
        """Return a parameter of the ship with the terms of some effects, from a cache if possible."""
        place = (*(placed.effect.label for placed in effects), key)
        if place not in self._numbers:
            self._numbers[place] = self.with_terms(effects).parameter(key)
        return self._numbers[place]

    def _inside(self, number: ShipParameter, value: float) -> float:
        """Return the nearest value that a parameter can have on this ship and in this recording."""
        return float(number.info.inside(np.clip(value, *self._range(number))))

    def _scale(self, of: str) -> float:
        """Return the value of a probe of 1: a scale by name, or the magnitude of a ship parameter."""
        return self._scales[of] if of in self._scales else abs(self._number((), of).value)

    def _fixed(self, of: float | str) -> float:
        """Return a fixed value: a number, a scale by name, or the value of another key."""
        if isinstance(of, str):
            return self._scales[of] if of in self._scales else self._number((), of).value
        return of

    def range_of(self, parameter: Parameter) -> tuple[float, float]:
        """Return the lowest and the highest value of a parameter that the ship file allows."""
        return self._range(parameter.in_ship(self.ship))

    def _range(self, number: ShipParameter) -> tuple[float, float]:
        """Return the range of a parameter; the memory of the simulation limits a delay."""
        low, high = number.search_range
        late = number.key in self.ship.sensors.delays | self.ship.prime_mover.delays
        return low, min(high, self._longest_s) if late else high

    def plausible_range(self, parameter: Parameter) -> tuple[float, float]:
        """Return the lowest and the highest plausible value of a parameter, infinite without a limit."""
        if parameter.plausible is None:
            return -math.inf, math.inf
        low, high = (end * self._scale(parameter.plausible_of) for end in parameter.plausible)
        return low, high

    def with_terms(self, effects: tuple[SizedEffect, ...]) -> Ship:
        """Return the ship with the terms of some effects at neutral values."""
        ship = self.ship
        for placed in effects:
            ship = placed.effect.on(ship)
        return ship

    def record(self, effects: tuple[SizedEffect, ...]) -> Any:
        """Return the record of the ship with some effects."""
        host = self.with_terms(effects)
        plant = self.nominal.copy() if host is self.ship else host.record()
        self.write(plant, effects)
        return plant

    def write(self, plant: Any, effects: tuple[SizedEffect, ...]) -> None:
        """Write the values of some effects to the record of a ship that has their terms."""
        for placed in effects:
            for key, value in self.settings(placed).items():
                self._number(effects, key).write(plant, value)

    def corrected(self, effects: tuple[SizedEffect, ...]) -> Ship:
        """Return the ship with some effects, and with a shorter time step if they need one."""
        values: dict[str, Any] = {}
        for placed in effects:
            values |= self.settings(placed)
        host, step_s = self.with_terms(effects), self.ship.time_step_s
        try:
            return host.with_values(values)
        except ShipError:  # The effects together are faster than the time step resolves.
            for parts in (2, 4, 8):
                with contextlib.suppress(ShipError):
                    return host.with_values({**values, "integration.time_step_s": step_s / parts})
            raise

    def smallest_size(self, parameter: Parameter) -> float:
        """Return the distance from the neutral value below which a parameter is not identifiable.

        It is half a sampling interval for a delay, and a whole one if the times of command steps
        between rows are uncertain. For a coarsely quantised pitch it is the quantisation step for
        backlash or dead band, and half the step for an offset.
        """
        least = parameter.least
        if self._in_seconds(parameter):
            least = max(least, self._interval_s if self._replay.line else 0.5 * self._interval_s)
        step = self._replay.quantisation.get("pitch_ratio", 0.0)
        if parameter.key in PITCH_GAPS:
            least = max(least, step)
        if parameter.key in PITCH_OFFSETS:
            least = max(least, 0.5 * step)
        return least

    @property
    def _interval_s(self) -> float:
        return self._replay.interval_s / self._replay.every

    def resolution(self, parameter: Parameter) -> float:
        """Return the size that an identified effect must exceed.

        It is the smallest size, and for a delay at least a sampling interval, by which a command and the
        response may be shifted in the log.
        """
        least = self.smallest_size(parameter)
        return max(least, self._interval_s) if self._in_seconds(parameter) else least

    def _in_seconds(self, parameter: Parameter) -> bool:
        return parameter.in_ship(self.ship).info.unit == "s"

    def neutral(self, parameter: Parameter) -> float:
        """Return the value at which the effect is absent: that of the ship file."""
        if parameter.absolute:
            return 0.0
        return parameter.in_ship(self.ship).value

    def origin(self, parameter: Parameter) -> float:
        """Return the value from which a size counts: the neutral one, or 0 for an infinite limit."""
        neutral = self.neutral(parameter)
        return 0.0 if math.isinf(neutral) else neutral

    def probes(self, parameter: Parameter) -> list[float]:
        """Return the values at which a parameter is first tried, within its bounds."""
        low, high = self.range_of(parameter)
        start = self.origin(parameter)
        steps = [p * self._scale(parameter.of) for p in parameter.probes]
        if parameter.signed:
            steps = [-s for s in reversed(steps)] + steps
        least = self.smallest_size(parameter)
        return [start + s for s in steps if low <= start + s <= high and abs(s) >= least and s]

    def smallest_trials(self, effect: Effect, windows: list[Window]) -> Iterator[SizedEffect]:
        """Yield the trials with the probe of the first value that is closest to neutral."""
        start = self.origin(effect.parameters[0])
        probes = self.probes(effect.parameters[0])
        nearest = min(probes, key=lambda value: (abs(value - start), -value), default=None)
        for placed in self.trials(effect, windows):
            if placed.values[0] == nearest:
                yield placed

    def trials(self, effect: Effect, windows: list[Window]) -> Iterator[SizedEffect]:
        """Yield the effect at every combination of its probes and, if windowed, of time windows."""
        grids = [self.probes(p) for p in effect.parameters]
        whole: list[Window | None] = [None]
        for window in windows if effect.windowed else whole:
            for values in itertools.product(*grids):
                yield SizedEffect(effect, values, window)


def probe_scales(balances: Balances) -> Mapping[str, float]:
    """Return the scales of the probes by name: rms, mean or largest values of the nominal simulation.

    ``torque`` [N m] is the propeller torque, or the drive torque without a propeller; ``force`` [N] the
    resistance; ``side_force`` [N] the centripetal force of a ship that turns. ``drive`` has the unit of
    the drive command. ``interval`` [s] is the sampling interval of the recording. ``sigma_top`` [-] is
    the cavitation number at the highest shaft speed. ``shaft_time`` [s] is the time in which the torque
    accelerates the shaft to its speed. ``torque_top`` [N m] is the largest torque of the drive with the
    recorded commands, at the propeller shaft. ``record`` [s] is the duration of the shortest recording.
    """
    samples, plant = balances.nominal_samples, balances.plant
    omega = np.abs(samples["shaft_speed"])
    gear = float(plant["gear_ratio"])

    def typical(values: Any) -> float:
        return float(max(np.sqrt(np.mean(np.square(values))), 1e-9))

    torque, shaft = typical(samples["propeller_torque"]), typical(omega)
    if plant["propeller_model"] == NO_PROPELLER:
        torque = typical(gear * samples["brake_torque"])
    drive = balances.replay.drive_rows
    angle = typical(balances.replay.recorded.get(SHAFT_ANGLE, 1.0))
    number = cavitation_number(plant, float(omega.max()) / (2.0 * math.pi), float(plant["depth"]))
    outside = {
        f"force/{name}/{name}": typical(samples["resistance"]) / typical(signals) ** 2
        for name, signals in balances.replay.outside.items()
    }
    signals: Mapping[str, Any] = balances.replay.outside
    if plant["turns"]:
        signals = {**signals, **{name: samples[name] for name in TURNING_SIGNALS}}
        across = float(plant["mass"]) * typical(samples["ship_speed"] * samples["yaw_rate"])
        outside |= {f"side_force/{n}/{n}": across / typical(signals[n]) ** 2 for n in signals}
        rudder = typical(signals["rudder_angle"])
        outside["force/rudder_angle/rudder_angle"] = typical(samples["resistance"]) / rudder**2
    if "sway_speed" in signals and "yaw_rate" in signals:
        turning = typical(signals["sway_speed"]) * typical(signals["yaw_rate"])
        outside["force/sway_speed/yaw_rate"] = typical(samples["resistance"]) / turning
    return outside | {
        "unit": 1.0,
        "time_step": float(plant["time_step"]),
        "torque/drive": torque / typical(drive),
        "interval": balances.replay.interval_s / balances.replay.every,
        "torque": torque,
        "torque/shaft_angle": torque / angle,
        "torque_top": _largest_torque(balances),
        "record": min(float(run.time_s[-1]) for run in balances.replay.runs),
        "shaft_angle": angle,
        "thrust": typical(samples["thrust"]),
        "current": typical(samples["motor_current"]),
        "torque/shaft_speed": torque / shaft,
        "torque/shaft_speed/shaft_speed": torque / shaft**2,
        "brake_torque/engine_speed/engine_speed": typical(samples["brake_torque"])
        / (gear * shaft) ** 2,
        "force": typical(samples["resistance"]),
        "shaft_speed": shaft,
        "engine_speed": gear * float(np.mean(omega)),
        "ship_speed": float(np.mean(samples["ship_speed"])),
        "drive": typical(drive),
        "drive_top": float(np.abs(drive).max()),
        "current_top": float(np.abs(samples["motor_current"]).max()),
        "inertia": max(
            float(plant["inertia_propeller_side"]) + 0.1 * float(plant["inertia_engine_side"]), 1e-9
        ),
        "shaft_time": shaft_inertia(plant) * shaft / torque,
        "sigma_top": float(number),
    }


def _largest_torque(balances: Balances) -> float:
    """Return the largest torque [N m] of the drive with the recorded commands, at the propeller shaft.

    A motor with a voltage command has its largest torque at standstill, which the nominal simulation may
    not reach.
    """
    plant, gear = balances.plant, float(balances.plant["gear_ratio"])
    torque = float(np.abs(balances.nominal_samples["brake_torque"]).max())
    if balances.replay.ship.has_voltage:
        top = float(np.abs(balances.replay.drive_rows).max())
        stalled = float(plant["motor_constant"]) * top / float(plant["armature_resistance"])
        torque = max(torque, stalled)
    return max(gear * torque, 1e-9)
