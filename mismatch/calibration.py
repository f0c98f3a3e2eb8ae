"""Calibrate a ship on a reference period, before missing physics is searched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..plant.ship import Ship
from .estimate import Tick, ignore_progress
from .identification.free_parameters import AUTO, LEAST_CERTAIN, UnidentifiableError
from .identification.parameters import Start, widen_tolerances
from .identify import identify
from .recordings.joint import Recorded


def calibrate(
    ship: Ship,
    recordings: Sequence[Recorded],
    keys: Sequence[str] = (),
    columns: str | Path | None = None,
    tolerance: float = 1.0,
    tick: Tick = ignore_progress,
) -> Start:
    """Return the start of a diagnosis with parameters estimated from a reference period.

    The method is output error (:func:`~.identify.identify`). A parameter that is not identifiable keeps
    its value, and the others are estimated without it. Where only a combination of parameters is
    identifiable, the one that was given last keeps its value.

    Args:
        ship: nominal ship.
        recordings: recordings of the reference period, at least one.
        keys: dotted keys of the parameters; without any, all identifiable ones.
        columns: column map of the files; None without one.
        tolerance: factor on the tolerances of the parameters that are not estimated [-].
        tick: progress callback ``tick(stage, done, total)``.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: recordings that do not go together, or a ship whose simulation diverges under the
            recorded commands.
    """

    def progress(stage: str, done: int, total: int) -> None:
        tick(f"calibrating, {stage}", done, total)

    left_out: dict[str, str] = {}
    wanted: list[str] = list(keys)
    while True:
        try:
            found = identify(
                ship,
                *recordings,
                free=wanted or AUTO,
                columns=columns,
                tolerance=tolerance,
                tick=progress,
            )
        except UnidentifiableError as error:
            left_out |= error.worst
            wanted = error.rest
            if not wanted:
                remark = (
                    "calibration: no parameter is identifiable from the reference period; all keep the "
                    "values of the ship file"
                )
                return Start(ship, ship, left_out=left_out, remarks=(remark,))
            continue
        left_out |= found.left_out
        remarks = [f"calibration: {note}" for note in (*found.limits, *found.warnings)]
        if keys:  # parameters that the user did not choose need no remark
            remarks += [
                f"calibration: {key} keeps the ship file's value: {why}"
                for key, why in left_out.items()
            ]
        # A user who calibrates does not trust the ship file. A parameter that is not identifiable may be
        # off by as much as the limit of identifiability, and would otherwise appear as missing physics.
        own = found.identified
        fixed = (own.parameter(key) for key in left_out if own.has_key(key))
        start = widen_tolerances(own, fixed, LEAST_CERTAIN)
        estimated = tuple(estimate.key for estimate in found.estimates)
        return Start(ship, start, calibrated=estimated, left_out=left_out, remarks=tuple(remarks))
