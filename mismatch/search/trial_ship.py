"""Put effects on a ship: probes, search coordinates and records with the values of effects."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from ...plant.columns import SHAFT_ANGLE
from ...plant.keys import ShipParameter
from ...plant.memory import HISTORY
from ...plant.propeller import NO_PROPELLER, cavitation_number
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship, ShipError
from ...plant.terms import TURNING_SIGNALS
from ..simulate.balances import Balances
from ..simulate.joint_replay import Floats
from .catalogue import Effect, Parameter, SizedEffect, Window

EDGE_S = 30.0
"""Unit of the edges of a time window in the search [s]."""


class JointSearch:
    """Search coordinates of some effects of a model, all by default, with the others fixed."""

    def __init__(
        self,
        trial_ship: TrialShip,
        effects: tuple[SizedEffect, ...],
        which: Iterable[int] | None = None,
    ) -> None:
        which = range(len(effects)) if which is None else which
        self._effects = effects
        self._searches = {i: EffectSearch(trial_ship, effects[i]) for i in which}
        points = [search.point() for search in self._searches.values()]
        self._cuts = np.cumsum([len(point) for point in points])[:-1]
        self.start = np.concatenate(points)

    def effects_at(self, point: Any) -> tuple[SizedEffect, ...]:
        """Return all effects of the model, with the searched ones at given coordinates."""
        trial = list(self._effects)
        parts = np.split(np.atleast_1d(point), self._cuts)
        for (i, search), part in zip(self._searches.items(), parts, strict=True):
            trial[i] = search.effects_at(part)
        return tuple(trial)


class EffectSearch:
    """Search coordinates of an effect.

    They are the logarithms of the distances of its values from neutral, and the edges of its time window
    in units of :data:`EDGE_S`.
    """

    def __init__(self, trial_ship: TrialShip, effect: SizedEffect) -> None:
        self._effect = effect
        parameters = effect.effect.parameters
        self._origins = [trial_ship.origin(parameter) for parameter in parameters]
        self._limits = [(trial_ship.smallest_size(p), trial_ship.range_of(p)) for p in parameters]

    def point(self) -> Floats:
        """Return the coordinates of the effect at its given values."""
        distance = np.abs(np.subtract(self._effect.values, self._origins))
        edges = [t / EDGE_S for t in self._effect.window or ()]
        return np.concatenate([np.log(np.maximum(distance, 1e-12)), edges])

    def effects_at(self, point: Any) -> SizedEffect:
        """Return the effect at given coordinates."""
        point, values = np.atleast_1d(point), []
        zipped = zip(self._effect.values, self._origins, self._limits, strict=True)
        for x, (given, origin, (least, ends)) in zip(point, zipped, strict=False):
            size = max(math.exp(min(x, 60.0)), least)
            values.append(float(np.clip(origin + (size if given >= origin else -size), *ends)))
        window = self._effect.window
        if window is not None:
            start, end = sorted(float(x) * EDGE_S for x in point[len(values) :])
            window = (max(start, 0.0), max(end, 0.0))
        return SizedEffect(self._effect.effect, tuple(values), window)


PITCH_GAPS = ("pitch_actuator.dead_band", "pitch_actuator.backlash")
"""Keys of parameters that are not identifiable below the quantisation step of the pitch."""

PITCH_OFFSETS = ("sensors.pitch_offset", "pitch_actuator.offset")
"""Keys of constant offsets of the measured pitch."""


class TrialShip:
    """Ship of a set of recordings, to which effects can be added.

    The nominal simulation of the balances scales the probes.

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

    def settings(self, effect: SizedEffect) -> dict[str, float]:
        """Return the values of an effect by dotted key of the ship file, inside their ranges."""
        values = {parameter.key: value for parameter, value in effect.pairs}
        for key, of in effect.effect.fixed:
            values[key] = self._value_of(of) if isinstance(of, str) else of
        for key, of, factor in effect.effect.ties:
            values[key] = values[of] * factor
        if effect.window is not None:
            section = effect.effect.parameters[0].key.split(".")[0]
            for edge, time_s in zip(("start", "end"), effect.window, strict=True):
                values[f"{section}.episode_{edge}_s"] = time_s
        numbers = {key: self._number((effect,), key) for key in values}
        return {
            key: float(numbers[key].info.inside(np.clip(value, *self._range(numbers[key]))))
            for key, value in values.items()
        }

    def _number(self, effects: tuple[SizedEffect, ...], key: str) -> ShipParameter:
        """Return a parameter of the ship with the terms of some effects, from a cache if possible."""
        place = (*(sized.effect.label for sized in effects), key)
        if place not in self._numbers:
            self._numbers[place] = self.with_terms(effects).parameter(key)
        return self._numbers[place]

    def _value_of(self, name: str) -> float:
        """Return a scale by its name, or the value of a key of the ship file."""
        return self._scales[name] if name in self._scales else self._number((), name).value

    def _scale(self, of: str) -> float:
        """Return the value of a probe of 1: a scale by name, or the magnitude of a ship parameter."""
        value = self._value_of(of)
        return value if of in self._scales else abs(value)

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
        for sized in effects:
            ship = sized.effect.on(ship)
        return ship

    def record(self, effects: tuple[SizedEffect, ...]) -> Any:
        """Return the record of the ship with some effects."""
        host = self.with_terms(effects)
        plant = self.nominal.copy() if host is self.ship else host.record()
        self.write(plant, effects)
        return plant

    def write(self, plant: Any, effects: tuple[SizedEffect, ...]) -> None:
        """Write the values of some effects to the record of a ship that has their terms."""
        for sized in effects:
            for key, value in self.settings(sized).items():
                self._number(effects, key).write(plant, value)

    def corrected(self, effects: tuple[SizedEffect, ...]) -> Ship:
        """Return the ship with some effects, and with a shorter time step if they need one."""
        values: dict[str, Any] = {}
        for sized in effects:
            values |= self.settings(sized)
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
        return 0.0 if parameter.absolute else parameter.in_ship(self.ship).value

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
        yield from (trial for trial in self.trials(effect, windows) if trial.values[0] == nearest)

    def trials(self, effect: Effect, windows: list[Window]) -> Iterator[SizedEffect]:
        """Yield the effect at every combination of its probes and, if windowed, of time windows."""
        probes = [self.probes(parameter) for parameter in effect.parameters]
        for window in windows if effect.windowed else [None]:
            for values in itertools.product(*probes):
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
    samples, plant, replay = balances.nominal_samples, balances.plant, balances.replay

    def typical(values: Any) -> float:
        return float(max(np.sqrt(np.mean(np.square(values))), 1e-9))

    omega, gear = np.abs(samples["shaft_speed"]), float(plant["gear_ratio"])
    brake, force = typical(samples["brake_torque"]), typical(samples["resistance"])
    torque, shaft = typical(samples["propeller_torque"]), typical(omega)
    if plant["propeller_model"] == NO_PROPELLER:
        torque = typical(gear * samples["brake_torque"])
    drive, angle = replay.drive_rows, typical(replay.recorded.get(SHAFT_ANGLE, 1.0))
    sigma = cavitation_number(plant, float(omega.max()) / (2.0 * math.pi), float(plant["depth"]))
    inertia = float(plant["inertia_propeller_side"]) + 0.1 * float(plant["inertia_engine_side"])
    scales = {f"force/{n}/{n}": force / typical(x) ** 2 for n, x in replay.outside.items()}
    signals: Mapping[str, Any] = replay.outside
    if plant["turns"]:
        signals = {**signals, **{name: samples[name] for name in TURNING_SIGNALS}}
        across = float(plant["mass"]) * typical(samples["ship_speed"] * samples["yaw_rate"])
        scales |= {f"side_force/{n}/{n}": across / typical(x) ** 2 for n, x in signals.items()}
        scales["force/rudder_angle/rudder_angle"] = force / typical(signals["rudder_angle"]) ** 2
    if "sway_speed" in signals and "yaw_rate" in signals:
        turning = typical(signals["sway_speed"]) * typical(signals["yaw_rate"])
        scales["force/sway_speed/yaw_rate"] = force / turning
    return scales | {
        "unit": 1.0,
        "time_step": float(plant["time_step"]),
        "interval": replay.interval_s / replay.every,
        "record": min(float(run.time_s[-1]) for run in replay.runs),
        "torque": torque,
        "torque/drive": torque / typical(drive),
        "torque/shaft_angle": torque / angle,
        "torque/shaft_speed": torque / shaft,
        "torque/shaft_speed/shaft_speed": torque / shaft**2,
        "torque_top": _largest_torque(balances),
        "brake_torque/engine_speed/engine_speed": brake / (gear * shaft) ** 2,
        "thrust": typical(samples["thrust"]),
        "force": force,
        "current": typical(samples["motor_current"]),
        "current_top": float(np.abs(samples["motor_current"]).max()),
        "drive": typical(drive),
        "drive_top": float(np.abs(drive).max()),
        "shaft_angle": angle,
        "shaft_speed": shaft,
        "engine_speed": gear * float(np.mean(omega)),
        "ship_speed": float(np.mean(samples["ship_speed"])),
        "inertia": max(inertia, 1e-9),
        "shaft_time": shaft_inertia(plant) * shaft / torque,
        "sigma_top": float(sigma),
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
