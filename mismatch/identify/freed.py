"""The numbers of a ship that a method is to find: named, checked, and put into a ship."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import KeyInfo, Section, info_of
from ...plant.ship import Ship
from ...plant.ship_errors import ShipError

RATIO = ("propeller.torque_coefficient", "propeller.relative_rotative_efficiency")
"""KQ and eta_R: torque on the shaft tells their ratio and nothing else."""

INDISTINCT = 1e-5
"""Least singular value, over the largest, of numbers that act each in its own way."""


@dataclass(frozen=True)
class Freed:
    """Numbers of a ship that may change.

    Args:
        ship: as its file has it.
        keys: dotted, n of them.
        start: their values in the file, each in its key's unit.
        infos: unit and allowed range of each.
    """

    ship: Ship
    keys: tuple[str, ...]
    start: NDArray[np.float64]
    infos: tuple[KeyInfo, ...]

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
        low = np.array([info.low for info in self.infos])
        high = np.array([info.high for info in self.infos])
        wide = 50.0 * np.abs(self.start)
        bottom = np.where((low >= 0.0) & sized, np.abs(self.start) / 50.0, -np.inf)
        top = np.where(sized, np.maximum(wide, np.abs(self.start)), np.inf)
        return np.maximum(low, bottom), np.minimum(high, top)

    def __contains__(self, key: str) -> bool:
        """Whether a number is among them."""
        return key in self.keys


def freed(ship: Ship, free: Sequence[str] | None, default: Sequence[str]) -> Freed:
    """The numbers that are to be found, checked.

    Args:
        ship: the ship.
        free: dotted keys; None for ``default``.
        default: what the method finds where nothing is named.

    Raises:
        ValueError: no key, one that stands twice, does not exist or is no number, or two of which only
            the ratio acts.
    """
    keys = tuple(default if free is None else free)
    if not keys:
        raise ValueError(f"{ship.name}: name the keys that are to be found")
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise ValueError(f"{ship.name}: {twice[0]} is named twice")
    if set(RATIO) <= set(keys):
        raise ValueError(
            f"{ship.name}: only the ratio of {RATIO[0]} and {RATIO[1]} acts on the shaft; free one of "
            "the two"
        )
    numbers = [number_of(ship, key) for key in keys]
    start = np.array([value for value, _ in numbers])
    return Freed(ship, keys, start, tuple(info for _, info in numbers))


def number_of(ship: Ship, key: str) -> tuple[float, KeyInfo]:
    """Value and description of any number of a ship's file, a curve's coefficient among them.

    Raises:
        ShipError: unknown key, or no number.
    """
    section, _, name = key.partition(".")
    table = getattr(ship, section, None) if section in type(ship).model_fields else None
    fields = type(table).model_fields if isinstance(table, Section) else {}
    value = getattr(table, name, None) if name in fields else None
    if section == "term" or name not in fields:
        number = ship.number(key)
        return number.value, number.info
    if not isinstance(value, float):
        raise ShipError(f"{ship.name}: {key} is no number that can be found")
    return value, info_of(fields[name])


def refuse_indistinct(keys: Sequence[str], jacobian: NDArray[np.float64], method: str) -> None:
    """Refuse numbers of which the recording tells a sum, a ratio or a product only.

    Args:
        keys: of the numbers, n of them.
        jacobian: of what the method compares, by number, shape (rows, n); each column in units of the
            number's own size.
        method: named in the error.

    Raises:
        ValueError: names the numbers that can change together without any change of what is compared.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    silent = [key for key, norm in zip(keys, norms, strict=True) if norm <= 1e-12 * norms.max()]
    if silent:
        raise ValueError(f"{method}: nothing that it compares depends on {', '.join(silent)}")
    _, sizes, directions = np.linalg.svd(jacobian / norms, full_matrices=True)
    if len(sizes) == len(keys) and sizes[-1] > INDISTINCT * sizes[0]:
        return
    together = np.abs(directions[-1])
    named = [key for key, part in zip(keys, together, strict=True) if part > 0.05 * together.max()]
    raise ValueError(
        f"{method}: the recording does not tell {', '.join(named)} apart; leave out one of them"
    )
