"""Parameters of a ship that act while it changes its state, and not at an equilibrium."""

from __future__ import annotations

from ...plant.ship import Ship

_WORDS = ("inertia_", "mass_kg", "rate_limit", "dead_band", "backlash", "added_mass")


def is_transient(ship: Ship, key: str) -> bool:
    """Return whether a parameter acts in transients only, or through the history of the ship.

    Time constants, delays, inertias and rate limits do; so do play and dead band of the pitch actuator,
    which depend on the way by which it has come.

    Args:
        ship: that has the parameter.
        key: dotted key.
    """
    name = key.rpartition(".")[2]
    if any(word in name for word in _WORDS):
        return True
    timed = not key.startswith("term.") and ship.has_key(key)
    return timed and ship.number(key).info.unit == "s"
