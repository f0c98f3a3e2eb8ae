"""The steady straight course at a given speed, from which a manoeuvre begins."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import scipy

from .ship import Ship, ShipError
from .steady_state import Equilibrium, equilibrium

_DRIVES = 40  # number of drive commands among which the speed is bracketed


def approach(ship: Ship, speed_m_s: float, pitch_ratio: float | None = None) -> Equilibrium:
    """Return the steady straight course at a speed, from which a manoeuvre begins.

    Args:
        ship: ship whose hull moves.
        speed_m_s: speed through the water [m/s].
        pitch_ratio: commanded P/D [-]; the highest by default.

    Returns:
        The steady state, with the drive command that holds the speed.

    Raises:
        ShipError: the hull is fixed, or no drive command gives this speed.

    >>> from shaftline.plant import approach, load_ship
    >>> point = approach(load_ship("frigate"), speed_m_s=8.0)
    >>> round(point.state.ship_speed, 3), round(point.inputs.drive, 2)  # [m/s], fuel rack [mm]
    (8.0, 19.55)
    """
    if not ship.moves:
        raise ShipError(f"{ship.name}: hull.fixed = true, but an approach needs a hull that moves")
    ship.require_external_signals({})
    pitch = ship.propeller.pitch_ratio_max if pitch_ratio is None else pitch_ratio

    def speed_at(drive: float) -> float:
        try:
            speed = float(equilibrium(ship, drive, pitch).state.ship_speed)
        except ValueError:  # The torque is too small to turn the shaft.
            return math.nan
        return speed - ship.hull.current_m_s

    demands = np.linspace(0.0, float(ship.record()["drive_max"]), _DRIVES + 1)
    points = [(drive, speed_at(drive)) for drive in demands[1:]]
    ahead = [(drive, speed) for drive, speed in points if speed > 0.0]
    if ahead and speed_m_s < ahead[0][1]:
        least = _least_demand(speed_at, ahead[0][0] - demands[1], ahead[0][0])
        ahead.insert(0, (least, speed_at(least)))
    for (low, slower), (high, faster) in pairwise(ahead):
        if min(slower, faster) <= speed_m_s <= max(slower, faster):
            drive = scipy.optimize.brentq(
                lambda d: speed_at(d) - speed_m_s, low, high, xtol=1e-13, rtol=1e-13
            )
            return equilibrium(ship, float(drive), pitch)
    speeds = [speed for _, speed in ahead]
    allowed = f">= {min(speeds):.3g} and <= {max(speeds):.4g}" if speeds else "none"
    raise ShipError(
        f"{ship.name}: no drive command holds a speed of {speed_m_s:g} m/s (unit m/s; "
        f"allowed: {allowed}, at a pitch ratio of {pitch:g})"
    )


def _least_demand(speed_at: Callable[[float], float], idle: float, moving: float) -> float:
    """Return the least drive command that moves the ship ahead, by bisection."""
    for _ in range(20):
        middle = 0.5 * (idle + moving)
        if speed_at(middle) > 0.0:
            moving = middle
        else:
            idle = middle
    return moving
