"""The numbers of a ship's file that an identification may move."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import Number, Section, info_of
from ...plant.ship import Ship
from ...plant.ship_errors import ShipError
from ...plant.tolerances import TOLERATED

AUTO = "auto"
"""In place of keys: those that the recording tells, of all that a ship's file may be wrong about."""

RATIO = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
"""KQ and eta_R: torque on the shaft tells their ratio and nothing else."""


RESISTANCE = "hull.resistance_coefficient_N_s2_m2"

DOUBTED = {*TOLERATED, "hull.thrust_deduction"}
"""Keys of numbers that a file may be wrong about. A tolerance speaks of each but the thrust deduction:
of mass, resistance and 1 - t the hull's balance tells but ratios."""


class Free:
    """Some numbers of a ship, and the ship at other values of them.

    Args:
        ship: nominal.
        keys: dotted keys of its file.

    Raises:
        ValueError: a key that is no number of this ship, or one that is given twice; names it.
    """

    def __init__(self, ship: Ship, keys: Sequence[str]) -> None:
        self.ship = ship
        self.keys = tuple(keys)
        if not self.keys:
            raise ValueError(f"{ship.name}: no number is free: name at least one key of its file")
        if twice := [key for i, key in enumerate(self.keys) if key in self.keys[:i]]:
            raise ValueError(f"{ship.name}: {twice[0]} is given twice")
        self.numbers = tuple(number_of(ship, key) for key in self.keys)
        self.start = np.array(self.values)

    @property
    def values(self) -> tuple[float, ...]:
        """As the ship's file has them."""
        return tuple(number.value for number in self.numbers)

    def at(self, values: Sequence[float]) -> Ship:
        """The ship with other values, validated like a file.

        Raises:
            ShipError: a value out of range.
        """
        return self.ship.with_values(dict(zip(self.keys, self._resolved(values), strict=True)))

    def _resolved(self, values: Sequence[float]) -> list[float]:
        """Return the values, each time constant at what the time step resolves, or at 0."""
        found = []
        for number, value in zip(self.numbers, map(float, values), strict=True):
            short = 0.0 < value < number.info.gap
            found.append(number.info.inside(value) if short else value)
        return found

    def record(self, values: Sequence[float]) -> Any:
        """Its record for the kernels."""
        if not all(number.field for number in self.numbers):
            return self.at(values).record()
        plant = self.ship.record()
        for number, value in zip(self.numbers, self._resolved(values), strict=True):
            number.write(plant, value)
        return plant

    def on(self, values: Any) -> Ship:
        """A ship with other values of these numbers, shape (n,).

        For the equations alone: values inside their ranges are not checked against each other, so
        that a search may pass where an armature is faster than the ship's time step.
        """
        ship = self.ship
        for key, value in zip(self.keys, values, strict=True):
            section, _, name = key.partition(".")
            if section == "term":
                ship = ship.with_values({key: float(value)})
                continue
            table = getattr(ship, section).model_copy(update={name: float(value)})
            ship = ship.model_copy(update={section: table})
        return ship

    @property
    def scale(self) -> NDArray[np.float64]:
        """Size by which each number is varied: its own value, or 1e-3 of its unit where that is 0."""
        return np.where(self.start != 0.0, np.abs(self.start), 1e-3)

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest values that a search may try: within the file's, and within a factor of
        50 of a number that has a size.
        """
        sized = self.start != 0.0
        low, high = np.array([number.searched for number in self.numbers]).T
        wide = 50.0 * np.abs(self.start)
        bottom = np.where((low >= 0.0) & sized, np.abs(self.start) / 50.0, -np.inf)
        top = np.where(sized, np.maximum(wide, np.abs(self.start)), np.inf)
        return np.maximum(low, bottom), np.minimum(high, top)

    def __contains__(self, key: str) -> bool:
        """Whether a number is among them."""
        return key in self.keys

    def towards(self, values: Sequence[float], wanted: Sequence[float]) -> list[float]:
        """From values to others, but at most nine tenths of the way to a bound that is beyond."""
        found = []
        for number, here, there in zip(self.numbers, values, wanted, strict=True):
            low, high = number.searched
            if there <= low:
                there = low + 0.1 * (here - low)
            elif there >= high:
                there = high - 0.1 * (high - here)
            found.append(float(there))
        return found


def usual_keys(ship: Ship, *, response: bool = False) -> tuple[str, ...]:
    """Return the keys of the parameters that a method frees where the user names none.

    The ship's drive lists them. A hull that moves adds its resistance, and to a frequency response its
    mass. An optional number that the file leaves at 0 is left out. The torque of a propeller that has
    no constant KQ is scaled by eta_R.

    Args:
        ship: nominal ship.
        response: whether a frequency response is to identify them, instead of steady states.
    """
    drive = ship.prime_mover
    keys = [*(drive.response_keys if response else drive.steady_keys)]
    if not ship.has_constant_coefficients:
        kept = [RATIO[1]] if ship.has_propeller else []
        keys = [own for key in keys for own in (kept if key == RATIO[0] else [key])]
    if ship.moves:
        keys += ["hull.mass_kg", RESISTANCE] if response else [RESISTANCE]
    return tuple(key for key in keys if not _is_absent(ship, key))


def _is_absent(ship: Ship, key: str) -> bool:
    """Whether a key is optional and the file leaves it at 0."""
    section, _, name = key.partition(".")
    table = getattr(ship, section)
    default: object = type(table).model_fields[name].default
    return bool(getattr(table, name) == 0.0 == default)


def freed(ship: Ship, free: Sequence[str] | None, default: Sequence[str]) -> Free:
    """The numbers that a method finds on a shaft.

    Args:
        ship: the ship.
        free: dotted keys; None for ``default``.
        default: what the method finds where nothing is named.

    Raises:
        ValueError: as of :class:`Free`, or two keys of which only the ratio acts.
    """
    found = Free(ship, default if free is None else free)
    if set(RATIO) <= set(found.keys):
        raise ValueError(
            f"{ship.name}: only the ratio of {RATIO[0]} and {RATIO[1]} acts on the shaft; free one of "
            "the two"
        )
    return found


def number_of(ship: Ship, key: str) -> Number:
    """A number of a ship's file; its ``field`` is empty where the record holds it in another form.

    Raises:
        ValueError: no such key, or one that is not a number.
    """
    try:
        return ship.number(key)
    except ShipError:
        section, _, name = key.partition(".")
        table = getattr(ship, section, None)
        value = getattr(table, name, None)
        if not isinstance(table, Section) or not isinstance(value, float):
            known = ", ".join(k for k in _numbers(ship) if k.startswith(f"{section}."))
            raise ValueError(
                f"{ship.name}: {key} is no number of this ship that can be free"
                + (f"; of [{section}]: {known}" if known else "")
            ) from None
        return Number(key, value, info_of(type(table).model_fields[name]), "")


@functools.lru_cache(maxsize=32)
def _numbers(ship: Ship) -> tuple[str, ...]:
    """Dotted keys of every number that stands in the ship's file."""
    found = []
    for section in type(ship).model_fields:
        table = getattr(ship, section)
        if isinstance(table, Section) and section != "tolerances":
            found += [
                f"{section}.{key}"
                for key in type(table).model_fields
                if isinstance(getattr(table, key), float)
            ]
    return tuple(found)


def doubtful(ship: Ship) -> list[str]:
    """Keys that a ship's file may be wrong about: those of :data:`DOUBTED`, and effects in force."""
    found = []
    for key in _numbers(ship):
        number = number_of(ship, key)
        in_force = number.info.neutral is not None and number.value != number.info.neutral
        section, _, name = key.partition(".")
        stated = name in getattr(ship, section).model_fields_set
        if stated and (in_force or (key in DOUBTED and number.value != 0.0)):
            found.append(key)
    return found
