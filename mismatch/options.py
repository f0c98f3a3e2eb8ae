"""Options of a diagnosis that hold for any recording."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..plant.ship import Ship, ShipError
from .identification.parameters import check_free_parameters
from .recordings.joint import Recorded
from .recordings.load import EXTRA_SIGNALS
from .search.catalogue import Effect, applicable_effects, catalogue, read_entries


@dataclass(frozen=True)
class Options:
    """Options of a diagnosis.

    Args:
        columns: column map of the recordings' files (:mod:`.recordings.columns`); None without one.
        exclude: ids of effects of the catalogue that are not tried.
        tolerance: factor on the tolerances of the ship's parameters [-].
        effects: TOML files with additional effects (:mod:`.search.entries`).
        most_effects: largest number of reported effects; None for the default of the search.
        calibrate: recordings of a reference period, on which parameters are estimated first.
        quick: whether to skip the joint estimation of effects and parameters
            (:mod:`shaftline.mismatch.structure`), which takes up to two minutes if a residual remains.
        steady: whether each row is an equilibrium of the ship at the inputs of that row. Rows slower
            than the ship are treated as equilibria in any case.
        free: dotted keys of the parameters that are estimated: on the reference period, or without one
            together with the effects. With a reference period and no keys, all identifiable parameters
            are estimated.

    >>> options = Options(exclude=("hull-fouling",), tolerance=0.5)
    >>> options.tolerance, options.calibrate
    (0.5, ())
    >>> from shaftline.plant import load_ship
    >>> Options(tolerance=-1.0).check(load_ship("frigate"))
    Traceback (most recent call last):
        ...
    ValueError: tolerance = -1: the factor on the tolerances must be finite and at least 0, such as 0.5
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
        """Effects of the files in ``effects``.

        Raises:
            ValueError: a file or an entry cannot be used, or two effects have the same id and form;
                names file, entry and key.
        """
        found: list[Effect] = []
        known = dict.fromkeys([effect.label for effect in catalogue()], "the catalogue")
        for path in self.effects:
            for effect in read_entries(Path(path)):
                if effect.label in known:
                    raise ValueError(
                        f"{path}: {effect.label} is already defined in {known[effect.label]}; give your "
                        "effect another id or form"
                    )
                known[effect.label] = str(path)
                found.append(effect)
        return tuple(found)

    @property
    def signals(self) -> dict[str, str]:
        """Units of the external signals of the effects, by name; ``-`` where no unit is known."""
        terms = [effect.term for effect in self.own_effects if effect.term is not None]
        names = [name for term in terms for name in term.external_signals]
        return dict.fromkeys(names, "-") | EXTRA_SIGNALS

    def with_recorded_signals(self, ship: Ship, signals: Mapping[str, str]) -> Ship:
        """Return the ship with the external signals of its recordings.

        Args:
            ship: nominal ship.
            signals: units of the recorded signals by name.

        Raises:
            ValueError: an additional effect needs a signal that the recordings do not have.
        """
        ship = ship.with_signals({**ship.signals, **signals}) if signals else ship
        for effect in self.own_effects:
            for name in ship.external_signals_of(effect.term) if effect.term is not None else ():
                if name not in ship.signals:
                    raise ValueError(
                        f"{effect.label} needs the signal {name}, which the recordings do not have; "
                        "give its column under [signals] in the column map"
                    )
        return ship

    def _refuse_inapplicable(self, ship: Ship) -> None:
        """Raise a ValueError for an additional effect that the ship cannot have with any recording."""
        for effect in self.own_effects:
            names = ship.external_signals_of(effect.term) if effect.term is not None else ()
            host = ship.with_signals(dict.fromkeys(names, "-") | ship.signals) if names else ship
            if effect.balance not in ship.balances:
                why = f"the ship has the balances {', '.join(ship.balances)}"
            elif lacking := [what for what in effect.applies_to if not getattr(ship, what)]:
                why = f"it applies to a ship that {lacking[0].replace('_', ' ')}"
            elif not effect.acts_on(host):
                why = _refused(effect, host)
            else:
                continue
            raise ValueError(f"{effect.label} cannot act on {ship.name}: {why}")

    def check(self, ship: Ship) -> None:
        """Refuse options that the ship does not allow with any recording.

        Args:
            ship: nominal ship.

        Raises:
            ValueError: an unknown id, an additional effect that cannot be read or that the ship cannot
                have, a key that is no parameter of this ship or cannot be free, or an invalid factor.
            FileNotFoundError: a recording of the reference period does not exist.
        """
        applicable_effects(ship, (), self.exclude, self.own_effects)
        self._refuse_inapplicable(ship)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(
                f"tolerance = {self.tolerance:g}: the factor on the tolerances must be finite and at "
                "least 0, such as 0.5"
            )
        if self.most_effects is not None and self.most_effects < 1:
            raise ValueError(
                f"most_effects = {self.most_effects}: the largest number of effects must be at least 1"
            )
        check_free_parameters(ship, self.free, bool(self.calibrate))
        for source in self.calibrate:
            if isinstance(source, str | Path) and not Path(source).is_file():
                raise FileNotFoundError(f"{source}: recording of the reference period not found")


def _refused(effect: Effect, ship: Ship) -> str:
    """Return why a ship that has an effect's balance cannot have the effect."""
    try:
        host = effect.on(ship)
    except ShipError as error:
        return str(error)
    keys = [parameter.key for parameter in effect.parameters]
    return f"the ship has no {next(key for key in keys if not host.has_key(key))}"
