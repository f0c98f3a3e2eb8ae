"""The straight course at a speed, from which a manoeuvre begins."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import scipy

from .ship import Ship, ShipError
from .steady_state import Equilibrium, equilibrium

_DRIVES = 40  # demands among which the one that sails a speed is looked for


def approach(ship: Ship, speed_m_s: float, pitch_ratio: float | None = None) -> Equilibrium:
    """The straight course at a speed, from which a manoeuvre begins.

    Args:
        ship: whose hull is free.
        speed_m_s: through the water [m/s].
        pitch_ratio: commanded P/D [-]; the highest by default.

    Returns:
        The steady state, with the demand of the drive that sails it.

    Raises:
        ShipError: a hull that is fixed, or a speed that no demand of the drive sails.
    """
    if not ship.moves:
        raise ShipError(f"{ship.name}: hull.fixed = true, so it sails at no speed")
    ship.refuse_unheard({})
    pitch = ship.propeller.pitch_ratio_max if pitch_ratio is None else pitch_ratio

    def speed_at(drive: float) -> float:
        try:
            speed = float(equilibrium(ship, drive, pitch).state.ship_speed)
        except ValueError:  # too little to turn the shaft
            return math.nan
        return speed - ship.hull.current_m_s

    demands = np.linspace(0.0, float(ship.record()["drive_max"]), _DRIVES + 1)
    found = [(drive, speed_at(drive)) for drive in demands[1:]]
    sailed = [(drive, speed) for drive, speed in found if speed > 0.0]
    if sailed and speed_m_s < sailed[0][1]:
        least = _least(speed_at, sailed[0][0] - demands[1], sailed[0][0])
        sailed.insert(0, (least, speed_at(least)))
    for (low, slower), (high, faster) in pairwise(sailed):
        if min(slower, faster) <= speed_m_s <= max(slower, faster):
            drive = scipy.optimize.brentq(
                lambda d: speed_at(d) - speed_m_s, low, high, xtol=1e-13, rtol=1e-13
            )
            return equilibrium(ship, float(drive), pitch)
    speeds = [speed for _, speed in sailed]
    sails = f">= {min(speeds):.3g} and <= {max(speeds):.4g}" if speeds else "none"
    raise ShipError(
        f"{ship.name}: a speed of {speed_m_s:g} is sailed by no demand of the drive (unit m/s; "
        f"allowed: {sails}, at a pitch ratio of {pitch:g})"
    )


def _least(speed_at: Callable[[float], float], idle: float, sails: float) -> float:
    """Least demand that sails the ship ahead, between one that does not and one that does."""
    for _ in range(20):
        middle = 0.5 * (idle + sails)
        if speed_at(middle) > 0.0:
            sails = middle
        else:
            idle = middle
    return sails
