"""The catalogue: every physical effect that the tool knows by name.

An effect is some keys of the ship's file with values that are not neutral, so its equation stands where
the plant's equations live and a corrected ship is an ordinary ship. The entry adds what an engineer must
be told: equation, balance, what excites it, what it can be mistaken for, what would tell them apart.
"""

from __future__ import annotations

import functools
import importlib.resources
from collections.abc import Iterable

from ...plant.columns import SHAFT_POWER
from ...plant.ship import Ship
from .effect import Effect
from .entries import entries_of
from .transients import acts_at_rest


@functools.cache
def catalogue() -> tuple[Effect, ...]:
    """Every entry, as ``catalogue.toml`` states them."""
    folder = importlib.resources.files("shaftline.mismatch.search")
    return entries_of(folder.joinpath("catalogue.toml").read_text("utf-8"))


def mistaken_for(effect: Effect, ship: Ship) -> tuple[str, ...]:
    """Ids that a recording of a ship may not be able to tell from an effect; only what it can have."""
    own = {entry.id for entry in catalogue() if entry.acts_on(ship)}
    return tuple(name for name in effect.confused_with if name in own)


def applicable(
    ship: Ship,
    columns: Iterable[str],
    exclude: Iterable[str] = (),
    own: Iterable[Effect] = (),
    turned: bool = False,
    one_way: bool = False,
    steady: bool = False,
) -> list[Effect]:
    """Entries that a ship can have and a recording could show.

    Args:
        ship: the nominal ship; a term is heard where the ship hears its signals.
        columns: of the recording.
        exclude: ids to leave out.
        own: entries besides the catalogue's.
        turned: whether the recording turns.
        one_way: whether the shaft turns and is driven one way only.
        steady: whether each row is an equilibrium, where effects of transients do not show.

    Raises:
        ValueError: an id to leave out is unknown.
    """
    known, left_out = set(columns), set(exclude)
    if SHAFT_POWER in known:  # it is measured torque times shaft speed
        known.add("shaft_torque_N_m")
    everything = [*catalogue(), *own]
    unknown = left_out - {effect.id for effect in everything}
    if unknown:
        names = ", ".join(sorted({effect.id for effect in everything}))
        raise ValueError(f"unknown effect {sorted(unknown)[0]!r}; known: {names}")
    return [
        effect
        for effect in everything
        if effect.id not in left_out
        and set(effect.needs) <= known
        and effect.acts_on(ship)
        and not (effect.straight and turned and not ship.turns)
        and not (effect.both_ways and one_way)
        and (acts_at_rest(ship, effect) or not steady)
    ]
