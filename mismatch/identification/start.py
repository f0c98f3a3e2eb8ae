"""The ship at the start of a diagnosis, with its calibrated and its free parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ...plant.keys import ShipParameter
from ...plant.ship import Ship
from ..recordings.steady_rows import drive_by_shaft_speed
from .free_parameters import Free

WIDE = 0.3
"""Standard deviation of a free parameter, as a share of its value."""


@dataclass(frozen=True)
class Start:
    """A ship at the start of a diagnosis.

    Args:
        file: ship with the values of its file.
        ship: ship with the calibrated parameters and with all tolerances.
        calibrated: keys of the parameters that were estimated from a reference period.
        free: keys of the parameters that are free in the diagnosis itself.
        left_out: why a parameter was not calibrated, by key.
        remarks: remarks on the calibration, a sentence each.
    """

    file: Ship
    ship: Ship
    calibrated: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def start_at_recorded_speed(start: Start) -> Start:
    """Return the start with the recorded shaft speed in place of the prime mover.

    Args:
        start: start with the prime mover of the ship file.
    """
    calibrated = tuple(key for key in start.calibrated if not key.startswith("prime_mover."))
    file, ship = drive_by_shaft_speed(start.file), drive_by_shaft_speed(start.ship)
    return replace(start, file=file, ship=ship, calibrated=calibrated)


def check_free_parameters(ship: Ship, keys: Sequence[str], calibrated: bool) -> None:
    """Refuse parameters that cannot be estimated.

    Args:
        ship: nominal ship.
        keys: dotted keys of the free parameters, possibly none.
        calibrated: whether they are estimated from a reference period.

    Raises:
        ValueError: a key that is no parameter of this ship or is given twice; without a reference
            period also a parameter that is 0, or that the ship record holds in another form.
    """
    if not keys:
        return
    free = Free(ship, keys)
    if calibrated:
        return
    for number in free.numbers:
        if not number.field:
            raise ValueError(
                f"{ship.name}: {number.key} cannot be estimated together with effects; estimate it from "
                "a reference period (--calibrate)"
            )
        if number.value == 0.0 and not ship.tolerances.numbers.get(number.key):
            raise ValueError(
                f"{ship.name}: {number.key} is 0, so a relative tolerance is not possible; give its "
                f"standard deviation [{number.info.unit}] under [tolerances.numbers]"
            )


def start_with_free_parameters(ship: Ship, keys: Sequence[str]) -> Start:
    """Return a start whose free parameters have a tolerance of at least :data:`WIDE`.

    Args:
        ship: nominal ship.
        keys: dotted keys of the free parameters, checked by :func:`check_free_parameters`.
    """
    if not keys:
        return Start(ship, ship)
    return Start(ship, widen_tolerances(ship, Free(ship, keys).numbers, WIDE), free=tuple(keys))


def widen_tolerances(ship: Ship, numbers: Iterable[ShipParameter], share: float) -> Ship:
    """Return a ship whose parameters have at least a given relative tolerance.

    Args:
        ship: nominal ship.
        numbers: parameters of the ship.
        share: standard deviation as a share of each value [-].
    """
    known = ship.tolerances.numbers
    wide = {n.key: max(share * abs(n.value), known.get(n.key, 0.0)) for n in numbers}
    return ship.with_values({"tolerances.numbers": known | wide}) if wide else ship
