"""How to diagnose, whatever the recording."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..plant.ship import Ship
from .numbers.start import check_free
from .recordings.joint import Recorded
from .search.catalogue import OUTSIDE, Effect, applicable
from .search.entries import read_entries


@dataclass(frozen=True)
class Options:
    """How to diagnose, whatever the recording.

    Args:
        columns: column map of the recordings' files (:mod:`.recordings.columns`), or none.
        exclude: ids of the catalogue to leave out.
        tolerance: factor on the tolerances of the ship's numbers [-].
        effects: files with effects of one's own (:mod:`.search.entries`), tried with the catalogue's.
        calibrate: recordings of a healthy period, on which the ship's numbers are found first.
        free: dotted keys of the numbers that are found on them, or, without any such recording, that
            move widely beside the effects; without any key, a healthy period tells what it can.
    """

    columns: Path | None = None
    exclude: tuple[str, ...] = ()
    tolerance: float = 1.0
    calibrate: tuple[Recorded, ...] = ()
    free: tuple[str, ...] = ()
    effects: tuple[Path, ...] = ()

    @functools.cached_property
    def own_effects(self) -> tuple[Effect, ...]:
        """What the files of ``effects`` hold.

        Raises:
            ValueError: one of them cannot be read or used; names file, entry and key.
        """
        return tuple(effect for path in self.effects for effect in read_entries(path))

    @property
    def signals(self) -> dict[str, str]:
        """Units of the signals from outside that effects hear, by name; "-" where nobody says."""
        heard = [name for e in self.own_effects if e.term is not None for name in e.term.hears]
        return dict.fromkeys(heard, "-") | OUTSIDE

    def hearing(self, ship: Ship, signals: Mapping[str, str]) -> Ship:
        """The ship with the signals that its recordings have.

        Args:
            ship: nominal.
            signals: units by name.

        Raises:
            ValueError: an effect of one's own hears what the recordings do not have.
        """
        ship = ship.with_signals({**ship.signals, **signals}) if signals else ship
        for effect in self.own_effects:
            for name in effect.term.hears if effect.term is not None else ():
                if name not in ship.signals:
                    raise ValueError(
                        f"{effect.label} hears {name}, which the recordings do not have; name the "
                        "column under [signals] in the column map"
                    )
            if not effect.acts_on(ship):
                raise ValueError(
                    f"{effect.label} cannot act on {ship.name}: its balances are "
                    f"{', '.join(ship.balances)}"
                )
        return ship

    def check(self, ship: Ship) -> None:
        """Refuse what no recording could mend, before any is read.

        Args:
            ship: the nominal ship.

        Raises:
            ValueError: an unknown id, a key that is no number of this ship or cannot move, or a
                tolerance that is no factor.
            FileNotFoundError: a recording of the healthy period that is not there.
        """
        applicable(ship, (), self.exclude, self.own_effects)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance {self.tolerance:g}: a factor of at least 0 is needed")
        check_free(ship, self.free, bool(self.calibrate))
        for source in self.calibrate:
            if isinstance(source, str | Path) and not Path(source).is_file():
                raise FileNotFoundError(f"{source}: no such recording to calibrate on")
