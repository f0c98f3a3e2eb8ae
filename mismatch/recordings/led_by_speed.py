"""A ship whose shaft turns at the recorded speed, for steady rows without the prime mover's command.

Logs of ships in service have the revolutions, seldom the fuel rack. Each row is then the equilibrium of
hull and propeller at the measured shaft speed; the prime mover is not judged.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from ...plant.columns import SHAFT_SPEED, drive_column
from ...plant.drives.speed_source import speed_held
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .slips import top_speed

REMARK = (
    "the recording has no {column}: the shaft is taken to turn at {speed}, and the prime mover is not "
    "judged"
)
"""Remark on a recording whose shaft speed stands for the command of the prime mover."""


class NoDriveCommandError(RecordingError):
    """Steady rows with a shaft speed and without the command of the ship's prime mover."""


def refuse_without_drive(path: Path, table: pd.DataFrame, ship: Ship) -> None:
    """Refuse steady rows that have the shaft speed and not the command of the prime mover.

    Raises:
        NoDriveCommandError: they have; a diagnosis then goes on with :func:`led_by_speed`.
    """
    column = drive_column(ship)
    if column not in table and SHAFT_SPEED in table and ship.turns_freely and ship.has_propeller:
        raise NoDriveCommandError(
            f"{path}: column {column!r} is missing; found: {', '.join(map(str, table.columns))}"
        )


def led_by_speed(ship: Ship) -> Ship:
    """Return a ship whose drive holds the shaft at the speed that it is given.

    Args:
        ship: the ship; tolerances of its prime mover and terms that act on it are left out.
    """
    # half as much again as the engine's rated speed: noise on a measured speed must meet no end stop
    mover = speed_held(min(top_speed(ship) / 2.0, 1e4))
    known = ship.tolerances
    numbers = {k: v for k, v in known.numbers.items() if not k.startswith("prime_mover.")}
    terms = tuple(term for term in ship.term if term.acts_on not in ("drive", "drive_torque"))
    return ship.model_copy(
        update={
            "prime_mover": mover,
            "tolerances": known.model_copy(update={"numbers": numbers}),
            "term": terms if isinstance(ship.term, tuple) else list(terms),
        }
    )


def with_drive_of(corrected: Ship, ship: Ship) -> Ship:
    """Return a corrected ship with the prime mover, the tolerances and all terms of another.

    Args:
        corrected: of :func:`led_by_speed`, with effects.
        ship: as its file has it.
    """
    own = {term.id for term in ship.term}
    terms = [*ship.term, *(term for term in corrected.term if term.id not in own)]
    return corrected.model_copy(
        update={
            "prime_mover": ship.prime_mover,
            "tolerances": ship.tolerances,
            "term": tuple(terms) if isinstance(ship.term, tuple) else terms,
        }
    )


def remark_on(ship: Ship) -> str:
    """Return the remark for a ship as its file has it."""
    return REMARK.format(column=drive_column(ship), speed=SHAFT_SPEED)
