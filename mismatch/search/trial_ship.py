"""Coordinates in which the values of effects are searched.

The ship on which effects are tried: where each is first tried, how its values reach the record.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import SHAFT_ANGLE
from ...plant.keys import Number
from ...plant.memory import HISTORY
from ...plant.propeller import NO_PROPELLER, cavitation_number
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship, ShipError
from ...plant.terms import OF_A_TURN
from ..simulate.balances import Balances
from .catalogue import Effect, Parameter, Placed, Window

EDGE_S = 30.0
"""Unit of a window's edges in the search [s]."""


class JointSearch:
    """Coordinates of some effects of a model, the others held."""

    def __init__(
        self, trial_ship: TrialShip, effects: tuple[Placed, ...], which: list[int] | None = None
    ) -> None:
        self._effects = effects
        self._which = list(range(len(effects))) if which is None else which
        self._searches = [Search(trial_ship, effects[i]) for i in self._which]
        points = [search.point() for search in self._searches]
        self._cuts = np.cumsum([len(point) for point in points])[:-1]
        self.start = np.concatenate(points)

    def placed(self, point: Any) -> tuple[Placed, ...]:
        """All effects of the model, those that are searched at coordinates."""
        trial = list(self._effects)
        parts = np.split(np.atleast_1d(point), self._cuts)
        for i, search, part in zip(self._which, self._searches, parts, strict=True):
            trial[i] = search.placed(part)
        return tuple(trial)


class Search:
    """Coordinates in which an effect is searched: logarithms of its values' distances from neutral,
    and its window's edges in units of :data:`EDGE_S`.
    """

    def __init__(self, trial_ship: TrialShip, placed: Placed) -> None:
        self._placed = placed
        self._neutral, self._sign, self._least, self._ranges = [], [], [], []
        for parameter, value in placed.pairs:
            self._ranges.append(trial_ship.range_of(parameter))
            base = trial_ship.origin(parameter)
            self._neutral.append(base)
            self._sign.append(1.0 if value >= base else -1.0)
            self._least.append(trial_ship.least(parameter))

    def point(self) -> NDArray[np.float64]:
        """Coordinates of the effect as it was placed."""
        distance = [abs(v - n) for v, n in zip(self._placed.values, self._neutral, strict=True)]
        edges = [t / EDGE_S for t in self._placed.window or ()]
        return np.concatenate([np.log(np.maximum(distance, 1e-12)), edges])

    def placed(self, point: Any) -> Placed:
        """The effect at coordinates."""
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
        return Placed(self._placed.effect, tuple(values), window)


PITCH_GAPS = ("pitch_actuator.dead_band", "pitch_actuator.backlash")
"""Numbers that hide in the steps of a coarse reading of the pitch."""

PITCH_OFFSETS = ("sensors.pitch_offset", "pitch_actuator.offset")
"""Keys of numbers by which all readings of the pitch are shifted."""


class TrialShip:
    """One ship as it sails in one recording, with any effects put onto it.

    Args:
        balances: of the ship and the recording; their nominal simulation scales the probes.

    Attributes:
        ship: nominal.
        nominal: its record.
    """

    def __init__(self, balances: Balances) -> None:
        self.ship: Ship = balances.replay.ship
        self._replay = balances.replay
        self.nominal = self.ship.record()
        self._scales = scales(balances)
        self._longest_s = (HISTORY - 2) * min(run.dt for run in balances.replay.runs)
        self._numbers: dict[tuple[str, ...], Number] = {}

    def settings(self, placed: Placed) -> dict[str, float]:
        """Dotted keys of the ship's file and their values."""
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

    def _number(self, effects: tuple[Placed, ...], key: str) -> Number:
        """Return a number of the ship with the terms of some effects on it; worked out once."""
        place = (*(placed.effect.label for placed in effects), key)
        if place not in self._numbers:
            self._numbers[place] = self.host(effects).number(key)
        return self._numbers[place]

    def _inside(self, number: Number, value: float) -> float:
        """Return the nearest value that a number can have on this ship and in this recording."""
        return float(number.info.inside(np.clip(value, *self._range(number))))

    def _scale(self, of: str) -> float:
        """What a probe of 1 is worth: a scale by name, or the size of a number of the ship's file."""
        return self._scales[of] if of in self._scales else abs(self._number((), of).value)

    def _fixed(self, of: float | str) -> float:
        """A number as it stands, by a scale, or another key's."""
        if isinstance(of, str):
            return self._scales[of] if of in self._scales else self._number((), of).value
        return of

    def range_of(self, parameter: Parameter) -> tuple[float, float]:
        """Return the lowest and the highest value of a parameter that a ship's file allows."""
        return self._range(parameter.number(self.ship))

    def _range(self, number: Number) -> tuple[float, float]:
        """A delay is no longer than the plant looks back at the recording's time step."""
        low, high = number.searched
        late = number.key in self.ship.sensors.delays | self.ship.prime_mover.delays
        return low, min(high, self._longest_s) if late else high

    def plausible_range(self, parameter: Parameter) -> tuple[float, float]:
        """Return the lowest and the highest plausible value of a parameter, infinite without a limit."""
        if parameter.plausible is None:
            return -math.inf, math.inf
        low, high = (end * self._scale(parameter.plausible_of) for end in parameter.plausible)
        return low, high

    def host(self, effects: tuple[Placed, ...]) -> Ship:
        """The ship with the terms of some effects on it, at values that change nothing."""
        ship = self.ship
        for placed in effects:
            ship = placed.effect.on(ship)
        return ship

    def record(self, effects: tuple[Placed, ...]) -> Any:
        """The kernels' record of the ship with some effects on it."""
        host = self.host(effects)
        plant = self.nominal.copy() if host is self.ship else host.record()
        self.write(plant, effects)
        return plant

    def write(self, plant: Any, effects: tuple[Placed, ...]) -> None:
        """Put the values of some effects into the record of a ship that carries their terms."""
        for placed in effects:
            for key, value in self.settings(placed).items():
                self._number(effects, key).write(plant, value)

    def corrected(self, effects: tuple[Placed, ...]) -> Ship:
        """The ship with some effects on it, and a shorter time step where they ask for one."""
        values: dict[str, Any] = {}
        for placed in effects:
            values |= self.settings(placed)
        host, step_s = self.host(effects), self.ship.time_step_s
        try:
            return host.with_values(values)
        except ShipError:  # physics together that is faster than the ship's time step
            for parts in (2, 4, 8):
                with contextlib.suppress(ShipError):
                    return host.with_values({**values, "integration.time_step_s": step_s / parts})
            raise

    def least(self, parameter: Parameter) -> float:
        """Distance from the neutral value below which something else looks the same.

        Of a delay that is half an interval of the recording, and a whole one where nobody knows when
        between two rows a demand moved; of a play or a dead band of the pitch, the steps in which it is
        read, where they are coarse, and of an offset half of them.
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
        """Size that an effect must exceed to have been measured: the least one, and of a delay an
        interval, by which a demand and what answers to it may be shifted in the log.
        """
        least = self.least(parameter)
        return max(least, self._interval_s) if self._in_seconds(parameter) else least

    def _in_seconds(self, parameter: Parameter) -> bool:
        return parameter.number(self.ship).info.unit == "s"

    def neutral(self, parameter: Parameter) -> float:
        """Value at which the effect is absent: the ship file's own."""
        if parameter.absolute:
            return 0.0
        return parameter.number(self.ship).value

    def origin(self, parameter: Parameter) -> float:
        """Value from which a size is measured: the neutral one; 0 for limits, absent at infinity."""
        neutral = self.neutral(parameter)
        return 0.0 if math.isinf(neutral) else neutral

    def probes(self, parameter: Parameter) -> list[float]:
        """Values at which a parameter is first tried, inside its bounds."""
        low, high = self.range_of(parameter)
        start = self.origin(parameter)
        steps = [p * self._scale(parameter.of) for p in parameter.probes]
        if parameter.signed:
            steps = [-s for s in reversed(steps)] + steps
        least = self.least(parameter)
        return [start + s for s in steps if low <= start + s <= high and abs(s) >= least and s]

    def smallest(self, effect: Effect, windows: list[Window]) -> Iterator[Placed]:
        """The trials in which the effect's first value is as near to neutral as it is probed."""
        start = self.origin(effect.parameters[0])
        probes = self.probes(effect.parameters[0])
        nearest = min(probes, key=lambda value: (abs(value - start), -value), default=None)
        for placed in self.trials(effect, windows):
            if placed.values[0] == nearest:
                yield placed

    def trials(self, effect: Effect, windows: list[Window]) -> Iterator[Placed]:
        """The effect at every combination of its probes, and of windows where it acts for a time."""
        grids = [self.probes(p) for p in effect.parameters]
        whole: list[Window | None] = [None]
        for window in windows if effect.windowed else whole:
            for values in itertools.product(*grids):
                yield Placed(effect, values, window)


def scales(balances: Balances) -> Mapping[str, float]:
    """What the catalogue's probes are counted in, by name: rms, mean or top of a nominal simulation.

    Torque [N m] is that of the propeller, or of the drive where there is none, force [N] the resistance,
    side force [N] of a ship that turns the centripetal one. ``drive`` is in the unit of the prime
    mover's demand. ``interval`` [s] is that from one recorded row to the next. ``sigma_top`` is the
    cavitation number at the highest shaft speed. ``shaft_time`` [s] is how long that torque takes to
    bring the shaft to its speed. ``torque_top`` [N m] is the drive's largest torque under these
    commands, at the propeller shaft, and ``record`` [s] the length of the shortest recording.
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
        f"force/{name}/{name}": typical(samples["resistance"]) / typical(heard) ** 2
        for name, heard in balances.replay.outside.items()
    }
    heard: Mapping[str, Any] = balances.replay.outside
    if plant["turns"]:
        heard = {**heard, **{name: samples[name] for name in OF_A_TURN}}
        across = float(plant["mass"]) * typical(samples["ship_speed"] * samples["yaw_rate"])
        outside |= {f"side_force/{n}/{n}": across / typical(heard[n]) ** 2 for n in heard}
        rudder = typical(heard["rudder_angle"])
        outside["force/rudder_angle/rudder_angle"] = typical(samples["resistance"]) / rudder**2
    if "sway_speed" in heard and "yaw_rate" in heard:
        turning = typical(heard["sway_speed"]) * typical(heard["yaw_rate"])
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
    """Return the largest torque [N m] of the drive under the recorded commands, at the propeller shaft.

    A motor under a voltage gives its largest torque at rest, whether the nominal ship rests or not.
    """
    plant, gear = balances.plant, float(balances.plant["gear_ratio"])
    torque = float(np.abs(balances.nominal_samples["brake_torque"]).max())
    if balances.replay.ship.has_voltage:
        top = float(np.abs(balances.replay.drive_rows).max())
        stalled = float(plant["motor_constant"]) * top / float(plant["armature_resistance"])
        torque = max(torque, stalled)
    return max(gear * torque, 1e-9)
