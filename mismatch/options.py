"""How to diagnose, whatever the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from ..plant.ship import Ship
from .search.catalogue import applicable


@dataclass(frozen=True)
class Options:
    """How to diagnose, whatever the recording.

    Args:
        columns: column map of the recordings' files (:mod:`.recordings.columns`), or none.
        exclude: ids of the catalogue to leave out.
        tolerance: factor on the tolerances of the ship's numbers [-].
    """

    columns: Path | None = None
    exclude: tuple[str, ...] = ()
    tolerance: float = 1.0

    def check(self, ship: Ship) -> None:
        """Refuse what no recording could mend, before any is read.

        Args:
            ship: the nominal ship.

        Raises:
            ValueError: an unknown id, or a tolerance that is no factor.
        """
        applicable(ship, (), self.exclude)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance {self.tolerance:g}: a factor of at least 0 is needed")
