"""The range in which a ship has each signal that is observed, for observations without units."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..plant import Ship


def observed_ranges(ship: Ship, top: float, observed: Sequence[str]) -> NDArray[np.float32]:
    """Middle and half width of the range in which a ship has each signal, shape (2, len(observed)).

    Args:
        ship: that is sailed.
        top: her highest speed in calm water [m/s].
        observed: signals, in their units.
    """
    plant = ship.record()
    turns = float(plant["engine_speed_max"] / plant["gear_ratio"])
    ends = {
        "speed_order": (0.0, top), "measured_ship_speed": (0.0, top),
        "estimated_advance_velocity": (0.0, top), "shaft_speed": (0.0, turns),
        "measured_shaft_torque": (0.0, float(plant["torque_limit"] * plant["gear_ratio"])),
        "measured_pitch_ratio": (float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])),
        "fuel_rack": (float(plant["drive_min"]), float(plant["drive_max"])),
        "estimate_valid": (0.0, 1.0),
    }  # fmt: skip
    length = max(float(plant["length"]), 1.0)
    stop = float(plant["rudder_max"]) or 1.0
    ends |= {
        "heading_order": (-math.pi, math.pi), "heading": (-math.pi, math.pi),
        "yaw_rate": (-top / length, top / length), "rudder_angle": (-stop, stop),
        "cross_track_order": (-length, length), "cross_track": (-length, length),
    }  # fmt: skip
    low, high = np.array([ends[name] for name in observed], dtype=np.float32).T
    return np.array([0.5 * (low + high), 0.5 * (high - low)])
