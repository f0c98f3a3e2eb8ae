"""Kinematics in the horizontal plane: heading and track, over ground and through the water.

The position lies along the initial course, the cross track to starboard of it. Heading and rate of turn
are positive to starboard. A ship without sway and yaw keeps heading 0.
"""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from ..core.numeric import sine_cosine
from .state import State


@compiled
def over_ground(state: State) -> tuple[Real, Real]:
    """Return the rates of position and cross track [m/s]."""
    sine, cosine = sine_cosine(state.heading)
    ahead, across = state.ship_speed, state.sway_speed
    return ahead * cosine - across * sine, ahead * sine + across * cosine


@compiled
def current_met(plant: Record, heading: Real) -> tuple[Real, Real]:
    """Return the velocity of the current [m/s] ahead and to starboard, for a ship on a heading [rad]."""
    sine, cosine = sine_cosine(heading)
    return (
        plant.current * cosine + plant.cross_current * sine,
        plant.cross_current * cosine - plant.current * sine,
    )
