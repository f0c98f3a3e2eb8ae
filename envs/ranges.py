"""Range of each observed signal on a ship, by which observations are normalised."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import PREVIEW
from ..plant import Ship

_TORQUE_DEVIATION = 0.2  # torque deviation as share of the highest torque
_TORQUE_N_M = 1e5  # assumed highest torque where the ship file gives no limit


def observed_ranges(ship: Ship, top: float, observed: Sequence[str]) -> NDArray[np.float32]:
    """Return the middle and the half width of the range of each signal, shape (2, len(observed)).

    ``top`` is the highest ship speed in calm water [m/s].

    Examples:
        >>> from shaftline.plant import load_ship
        >>> middle, half = observed_ranges(load_ship("frigate"), 10.0, ("speed_order", "fuel_rack"))
        >>> middle.tolist(), half.tolist()
        ([5.0, 20.0], [5.0, 20.0])
    """
    plant = ship.record()
    torque = float(plant["torque_limit"])
    if not math.isfinite(torque):
        torque = _TORQUE_N_M
    gear, drive = float(plant["gear_ratio"]), (float(plant["drive_min"]), float(plant["drive_max"]))
    slowest, turns = (float(plant[f"engine_speed_{end}"]) / gear for end in ("min", "max"))
    length, stop = max(float(plant["length"]), 1.0), float(plant["rudder_max"]) or 1.0
    ends = {
        "speed_order": (0.0, top),
        "measured_ship_speed": (0.0, top),
        "estimated_advance_velocity": (0.0, top),
        "shaft_speed": (0.0, turns),
        "measured_shaft_torque": (0.0, torque * gear),
        "fuel_rack": drive,
        "measured_pitch_ratio": (float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])),
        "estimate_valid": (0.0, 1.0),
        "estimated_angle_of_attack": (0.0, 10.0),
        "shaft_speed_command": (slowest, turns),
    }
    both_ways = {
        "heading_order": math.pi,
        "heading": math.pi,
        "yaw_rate": top / length,
        "rudder_angle": stop,
        "cross_track_order": length,
        "cross_track": length,
        "speed_error": 2.0,
        "shaft_torque_deviation": _TORQUE_DEVIATION * torque * gear,
        "engine_torque_deviation": _TORQUE_DEVIATION * torque,
        "angle_of_attack_deviation": 4.0,
        "heading_error": math.radians(30.0),
        "track_error": 0.5 * length,
        **dict.fromkeys(PREVIEW, 2.0),
    }
    ends |= {name: (-half, half) for name, half in both_ways.items()}
    ends["pitch_command"] = ends["base_pitch_ratio"] = ends["measured_pitch_ratio"]
    ends["fuel_rack_command"] = ends["base_fuel_rack"] = ends["fuel_rack"]
    ends["base_rudder_angle"] = ends["rudder_angle"]
    low, high = np.array([ends[name] for name in observed], dtype=np.float32).T
    half = 0.5 * (high - low)
    half[half == 0.0] = 1.0  # A fixed-pitch propeller has a pitch range of zero width.
    return np.array([0.5 * (low + high), half])
