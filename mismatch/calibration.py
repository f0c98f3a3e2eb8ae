"""Calibrate a ship on a reference period, before missing physics is searched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..plant.ship import Ship
from .estimate import Tick, ignore_progress
from .identification.free_parameters import AUTO, LEAST_CERTAIN, UnidentifiableError
from .identification.parameters import Start, widen_tolerances
from .identify import Identification, identify
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

    The method is output error; arguments and errors are those of :func:`~.identify.identify`. Without
    keys, all identifiable parameters are estimated. A parameter that is not identifiable keeps its
    value, and the others are estimated without it. Where only a combination of parameters is
    identifiable, the one that was given last keeps its value.
    """

    def progress(stage: str, done: int, total: int) -> None:
        tick(f"calibrating, {stage}", done, total)

    def estimate(nominal: Ship, free: Sequence[str]) -> Identification:
        return identify(
            nominal, *recordings, free=free, columns=columns, tolerance=tolerance, tick=progress
        )

    left_out: dict[str, str] = {}
    wanted: list[str] = list(keys)
    while True:
        try:
            found = estimate(ship, wanted or AUTO)
        except UnidentifiableError as error:
            left_out |= error.worst
            wanted = error.rest
            if not wanted:
                remark = (
                    "calibration: no parameter is identifiable from the reference period; all keep the "
                    "values of the ship file"
                )
                return Start(ship, ship, left_out=left_out, remarks=(remark,))
        else:
            break
    left_out |= found.left_out
    remarks = [f"calibration: {note}" for note in (*found.limits, *found.warnings)]
    if keys:  # parameters that the user did not choose need no remark
        remarks += [
            f"calibration: {key} keeps the ship file's value: {why}"
            for key, why in left_out.items()
        ]
    # A user who calibrates does not trust the ship file. A parameter that is not identifiable may be off
    # by as much as the limit of identifiability, and would otherwise appear as missing physics. The
    # reference period may still determine its combination with another parameter far better than either,
    # such as that of resistance and thrust deduction. The estimates are therefore repeated while it is
    # uncertain: the correlation of the errors keeps one of both from explaining a later change.
    own, start = found.identified, found.joint or found.identified
    estimated = tuple(one.key for one in found.estimates)
    fixed = [own.parameter(key) for key in left_out if own.has_key(key)]
    if fixed:
        try:
            again = estimate(widen_tolerances(own, fixed, LEAST_CERTAIN), estimated)
            start = again.joint or again.identified
        except UnidentifiableError:
            start = widen_tolerances(start, fixed, LEAST_CERTAIN)
    return Start(ship, start, calibrated=estimated, left_out=left_out, remarks=tuple(remarks))
