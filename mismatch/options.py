"""How to diagnose, whatever the recording."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..plant.ship import Ship, ShipError
from .identification.start import check_free
from .recordings.joint import Recorded
from .recordings.load import OUTSIDE
from .search.catalogue import Effect, applicable, catalogue, read_entries


@dataclass(frozen=True)
class Options:
    """How to diagnose, whatever the recording.

    Args:
        columns: column map of the recordings' files (:mod:`.recordings.columns`), or none.
        exclude: ids of the catalogue to leave out.
        tolerance: factor on the tolerances of the ship's numbers [-].
        effects: files with effects of one's own (:mod:`.search.entries`), tried with the catalogue's.
        most_effects: how many are named at most; the search's own number by default.
        calibrate: recordings of a healthy period, on which the ship's numbers are found first.
        quick: whether effects and parameters are not estimated together
            (:mod:`shaftline.mismatch.structure`) where the first search leaves a residual, which takes
            up to two minutes.
        steady: whether each row is an equilibrium of the ship at the inputs of that row; where rows are
            slower than the ship they are taken so in any case.
        free: dotted keys of the numbers that are found on them, or, without any such recording, that
            move widely beside the effects; without any key, a healthy period tells what it can.
    """

    columns: str | Path | None = None
    exclude: tuple[str, ...] = ()
    tolerance: float = 1.0
    calibrate: tuple[Recorded, ...] = ()
    free: tuple[str, ...] = ()
    effects: tuple[str | Path, ...] = ()
    most_effects: int | None = None
    quick: bool = False
    steady: bool = False

    @functools.cached_property
    def own_effects(self) -> tuple[Effect, ...]:
        """What the files of ``effects`` hold.

        Raises:
            ValueError: one of them cannot be read or used, or has the name of another; names file,
                entry and key.
        """
        found: list[Effect] = []
        known = dict.fromkeys([effect.label for effect in catalogue()], "the catalogue")
        for path in self.effects:
            for effect in read_entries(Path(path)):
                if effect.label in known:
                    raise ValueError(
                        f"{path}: {effect.label} stands in {known[effect.label]} already; give yours "
                        "an id or a form of its own"
                    )
                known[effect.label] = str(path)
                found.append(effect)
        return tuple(found)

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
            for name in ship.heard_by(effect.term) if effect.term is not None else ():
                if name not in ship.signals:
                    raise ValueError(
                        f"{effect.label} hears {name}, which the recordings do not have; name the "
                        "column under [signals] in the column map"
                    )
        return ship

    def _refuse_idle(self, ship: Ship) -> None:
        """Refuse an effect of one's own that the ship cannot have, whatever its recordings hold.

        Raises:
            ValueError: names it, and why.
        """
        for effect in self.own_effects:
            heard = ship.heard_by(effect.term) if effect.term is not None else ()
            host = ship.with_signals(dict.fromkeys(heard, "-") | ship.signals) if heard else ship
            if effect.balance not in ship.balances:
                why = f"its balances are {', '.join(ship.balances)}"
            elif lacking := [what for what in effect.applies_to if not getattr(ship, what)]:
                why = f"it applies to a ship that {lacking[0].replace('_', ' ')}"
            elif not effect.acts_on(host):
                why = _refused(effect, host)
            else:
                continue
            raise ValueError(f"{effect.label} cannot act on {ship.name}: {why}")

    def check(self, ship: Ship) -> None:
        """Refuse what no recording could mend, before any is read.

        Args:
            ship: the nominal ship.

        Raises:
            ValueError: an unknown id, an effect of one's own that cannot be read or that the ship
                cannot have, a key that is no number of this ship or cannot move, or a tolerance that
                is no factor.
            FileNotFoundError: a recording of the healthy period that is not there.
        """
        applicable(ship, (), self.exclude, self.own_effects)
        self._refuse_idle(ship)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance {self.tolerance:g}: a factor of at least 0 is needed")
        if self.most_effects is not None and self.most_effects < 1:
            raise ValueError(f"most_effects = {self.most_effects}: at least 1 is needed")
        check_free(ship, self.free, bool(self.calibrate))
        for source in self.calibrate:
            if isinstance(source, str | Path) and not Path(source).is_file():
                raise FileNotFoundError(f"{source}: no such recording to calibrate on")


def _refused(effect: Effect, ship: Ship) -> str:
    """Why a ship with an effect's balance cannot have it."""
    try:
        host = effect.on(ship)
    except ShipError as error:
        return str(error)
    keys = [parameter.key for parameter in effect.parameters]
    return f"it has no {next(key for key in keys if not host.has_key(key))}"
