"""A ship's numbers from a healthy period, before its physics is looked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..plant.ship import Ship
from .estimate import Tick, silent
from .identification.free_parameters import AUTO, TELLING, UntoldError
from .identification.start import Start, loosened
from .identify import identify
from .recordings.joint import Recorded


def calibrated(
    ship: Ship,
    recordings: Sequence[Recorded],
    keys: Sequence[str] = (),
    columns: str | Path | None = None,
    tolerance: float = 1.0,
    tick: Tick = silent,
) -> Start:
    """The ship with the numbers that recordings of a healthy period tell.

    By output error (:func:`~.pipeline.identify`). A number that they do not tell stays as it is, and
    the others are found without it; of numbers of which they tell but a combination, the one that was
    named last.

    Args:
        ship: nominal.
        recordings: of the healthy period, at least one.
        keys: dotted keys of the numbers; without any, those that the recordings tell.
        columns: column map of the files, or none.
        tolerance: factor on how far the numbers that are not found may be off.
        tick: told the stage, how much is done, and how much there is.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: recordings that do not go together, or a ship that runs away under their demands.
    """

    def said(stage: str, done: int, total: int) -> None:
        tick(f"calibrating, {stage}", done, total)

    left: dict[str, str] = {}
    wanted: list[str] = list(keys)
    while True:
        try:
            found = identify(
                ship,
                *recordings,
                free=wanted or AUTO,
                columns=columns,
                tolerance=tolerance,
                tick=said,
            )
        except UntoldError as error:
            left |= error.worst
            wanted = error.rest
            if not wanted:
                remark = (
                    "calibration: the healthy period tells no number; all stay as the file has them"
                )
                return Start(ship, ship, left=left, remarks=(remark,))
            continue
        left |= found.left_out
        remarks = [f"calibration: {note}" for note in (*found.limits, *found.warnings)]
        if keys:  # of its own choice, what was left out is no surprise
            remarks += [f"calibration: {key} stays as it is: {why}" for key, why in left.items()]
        told = tuple(estimate.key for estimate in found.estimates)
        # whoever calibrates does not trust the file: what is not told may be off by as much as what was
        # found, and would else come back as missing physics
        own = found.identified
        untold = (own.number(key) for key in left if own.has_key(key))
        start = loosened(own, untold, TELLING)
        return Start(ship, start, calibrated=told, left=left, remarks=tuple(remarks))
