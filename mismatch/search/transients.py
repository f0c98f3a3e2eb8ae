"""Effects and parameters that rows which are equilibria can show."""

from __future__ import annotations

from collections.abc import Collection

from ...plant.ship import Ship
from ..simulate.transients import is_transient
from .effect import Effect

_OF_A_TURN = ("sway", "yaw")


def acts_at_rest(ship: Ship, effect: Effect) -> bool:
    """Return whether an effect changes equilibria of a ship that runs straight ahead.

    An effect with a state of its own, or on the rate of the pitch actuator, acts in transients.
    """
    if effect.balance in _OF_A_TURN:
        return False
    if effect.term is not None:
        return effect.term.state is None and effect.term.acts_on != "pitch_rate"
    host = effect.on(ship)
    keys = [parameter.key for parameter in effect.parameters]
    return not any(is_transient(host, key) for key in keys if ".episode_" not in key)


def refuse_transient(ship: Ship, keys: Collection[str]) -> None:
    """Refuse parameters that equilibria do not depend on.

    Raises:
        ValueError: names the parameter.
    """
    for key in keys:
        if is_transient(ship, key):
            raise ValueError(
                f"{key} acts in transients only, and each row of the recording is taken as an "
                "equilibrium; leave it out of --free, or give a recording of 1 row a second or faster"
            )
