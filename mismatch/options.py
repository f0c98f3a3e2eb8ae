"""How to diagnose, whatever the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from ..plant.ship import Ship
from .numbers.start import check_free
from .recordings.joint import Recorded
from .search.catalogue import applicable


@dataclass(frozen=True)
class Options:
    """How to diagnose, whatever the recording.

    Args:
        columns: column map of the recordings' files (:mod:`.recordings.columns`), or none.
        exclude: ids of the catalogue to leave out.
        tolerance: factor on the tolerances of the ship's numbers [-].
        calibrate: recordings of a healthy period, on which the ship's numbers are found first.
        free: dotted keys of the numbers that are found on them, or, without any such recording, that
            move widely beside the effects; without any key, a healthy period tells what it can.
    """

    columns: Path | None = None
    exclude: tuple[str, ...] = ()
    tolerance: float = 1.0
    calibrate: tuple[Recorded, ...] = ()
    free: tuple[str, ...] = ()

    def check(self, ship: Ship) -> None:
        """Refuse what no recording could mend, before any is read.

        Args:
            ship: the nominal ship.

        Raises:
            ValueError: an unknown id, a key that is no number of this ship or cannot move, or a
                tolerance that is no factor.
            FileNotFoundError: a recording of the healthy period that is not there.
        """
        applicable(ship, (), self.exclude)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance {self.tolerance:g}: a factor of at least 0 is needed")
        check_free(ship, self.free, bool(self.calibrate))
        for source in self.calibrate:
            if isinstance(source, str | Path) and not Path(source).is_file():
                raise FileNotFoundError(f"{source}: no such recording to calibrate on")
