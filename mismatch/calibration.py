"""Calibrate a ship on a reference period, before missing physics is searched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..plant.keys import ShipParameter
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

    The method is output error; arguments and errors are those of :func:`~.identify.identify`. Without
    keys, all identifiable parameters are estimated. A parameter that is not identifiable keeps its
    value, and the others are estimated without it. Where only a combination of parameters is
    identifiable, the one that was given last keeps its value.
    """

    def progress(stage: str, done: int, total: int) -> None:
        tick(f"calibrating, {stage}", done, total)

    left_out: dict[str, str] = {}
    wanted: list[str] = list(keys)
    while True:
        try:
            found = identify(
                ship, *recordings, free=wanted or AUTO, columns=columns, tolerance=tolerance,
                tick=progress,
            )  # fmt: skip
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
        own, estimated = found.identified, tuple(one.key for one in found.estimates)
        fixed = [own.parameter(key) for key in left_out if own.has_key(key)]
        start = _calibrate_jointly(own, estimated, fixed, recordings, columns, tolerance, progress)
        if start is None:
            start = widen_tolerances(found.joint or own, fixed, LEAST_CERTAIN)
        return Start(ship, start, calibrated=estimated, left_out=left_out, remarks=tuple(remarks))


def _calibrate_jointly(
    ship: Ship,
    estimated: tuple[str, ...],
    fixed: Sequence[ShipParameter],
    recordings: Sequence[Recorded],
    columns: str | Path | None,
    tolerance: float,
    tick: Tick,
) -> Ship | None:
    """Return the ship calibrated again while the parameters that are not identifiable are uncertain.

    A reference period may determine a combination of two parameters, such as resistance and thrust
    deduction, far better than either. The correlation of their errors keeps this knowledge: without it,
    one of them would be free to explain a later change. None without such parameters, or if the
    estimates are then not identifiable.
    """
    if not fixed:
        return None
    wide = widen_tolerances(ship, fixed, LEAST_CERTAIN)
    try:
        again = identify(
            wide, *recordings, free=estimated, columns=columns, tolerance=tolerance, tick=tick
        )
    except UnidentifiableError:
        return None
    return again.joint
