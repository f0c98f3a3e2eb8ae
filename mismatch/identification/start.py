"""The ship with which a diagnosis begins: what of its numbers was calibrated, and what is let move."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ...plant.keys import Number
from ...plant.ship import Ship
from ..recordings.steady_rows import led_by_speed
from .free_parameters import Free

WIDE = 0.3
"""Standard deviation of a number that is let move widely, as a share of it."""


@dataclass(frozen=True)
class Start:
    """A ship as a diagnosis begins with it.

    Args:
        file: as its file has it.
        ship: with the numbers that were calibrated, and with the tolerances of all.
        calibrated: keys of the numbers that a healthy period has told.
        free: keys of the numbers that move widely in the diagnosis itself.
        left: why a number that was to be calibrated stays as it is, by key.
        remarks: what a reader must know of it, a sentence each.
    """

    file: Ship
    ship: Ship
    calibrated: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    left: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def led_start(start: Start) -> Start:
    """Return a start whose ships turn their shaft at the recorded speed.

    Args:
        start: with the prime mover of the ship's file.
    """
    calibrated = tuple(key for key in start.calibrated if not key.startswith("prime_mover."))
    file, ship = led_by_speed(start.file), led_by_speed(start.ship)
    return replace(start, file=file, ship=ship, calibrated=calibrated)


def check_free(ship: Ship, keys: Sequence[str], calibrated: bool) -> None:
    """Refuse numbers that cannot be moved.

    Args:
        ship: nominal.
        keys: dotted keys; none is fine.
        calibrated: whether a healthy period is to tell them.

    Raises:
        ValueError: a key that is no number of this ship, or is given twice; or a number to be moved
            widely that is 0 or that the kernels hold in another form; names it.
    """
    if not keys:
        return
    free = Free(ship, keys)
    if calibrated:
        return
    for number in free.numbers:
        if not number.field:
            raise ValueError(
                f"{ship.name}: {number.key} cannot move beside effects; calibrate it on a healthy period"
            )
        if number.value == 0.0 and not ship.tolerances.numbers.get(number.key):
            raise ValueError(
                f"{ship.name}: {number.key} is 0, of which no share is a tolerance: say how far it may "
                f"be off [{number.info.unit}] under [tolerances.numbers]"
            )


def widened(ship: Ship, keys: Sequence[str]) -> Start:
    """A ship some of whose numbers move by :data:`WIDE`, or by what its file says where that is more.

    Args:
        ship: nominal.
        keys: dotted keys of the numbers, as :func:`check_free` lets pass.
    """
    if not keys:
        return Start(ship, ship)
    return Start(ship, loosened(ship, Free(ship, keys).numbers, WIDE), free=tuple(keys))


def loosened(ship: Ship, numbers: Iterable[Number], share: float) -> Ship:
    """A ship some of whose numbers may be off by a share of them, or by what its file says if more.

    Args:
        ship: nominal.
        numbers: of it.
        share: one standard deviation, of each number.
    """
    known = ship.tolerances.numbers
    wide = {n.key: max(share * abs(n.value), known.get(n.key, 0.0)) for n in numbers}
    return ship.with_values({"tolerances.numbers": known | wide}) if wide else ship
