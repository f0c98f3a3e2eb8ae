"""Range of each observed signal on a ship, by which observations are normalised."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import PREVIEW
from ..plant import Ship

_SPEED_ERROR_M_S = 2.0
_WAVE_INFLOW_M_S = 2.0
_TORQUE_DEVIATION = 0.2  # torque deviation as share of the highest torque
_HEADING_ERROR = math.radians(30.0)
_ATTACK_DEG, _ATTACK_DEVIATION_DEG = 10.0, 4.0
_TORQUE_N_M = 1e5  # assumed highest torque where the ship file gives no limit


def observed_ranges(ship: Ship, top: float, observed: Sequence[str]) -> NDArray[np.float32]:
    """Return the middle and the half width of the range of each signal, shape (2, len(observed)).

    Args:
        ship: ship with a diesel engine.
        top: highest ship speed in calm water [m/s].
        observed: names of the signals.

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
    turns = float(plant["engine_speed_max"] / plant["gear_ratio"])
    ends = {
        "speed_order": (0.0, top), "measured_ship_speed": (0.0, top),
        "estimated_advance_velocity": (0.0, top), "shaft_speed": (0.0, turns),
        "measured_shaft_torque": (0.0, torque * float(plant["gear_ratio"])),
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
    ends |= dict.fromkeys(PREVIEW, (-_WAVE_INFLOW_M_S, _WAVE_INFLOW_M_S))
    shaft_torque = _TORQUE_DEVIATION * torque * float(plant["gear_ratio"])
    engine_torque = _TORQUE_DEVIATION * torque
    ends |= {
        "speed_error": (-_SPEED_ERROR_M_S, _SPEED_ERROR_M_S),
        "shaft_torque_deviation": (-shaft_torque, shaft_torque),
        "engine_torque_deviation": (-engine_torque, engine_torque),
        "estimated_angle_of_attack": (0.0, _ATTACK_DEG),
        "angle_of_attack_deviation": (-_ATTACK_DEVIATION_DEG, _ATTACK_DEVIATION_DEG),
        "shaft_speed_command": (float(plant["engine_speed_min"] / plant["gear_ratio"]), turns),
    }  # fmt: skip
    ends |= {
        "heading_error": (-_HEADING_ERROR, _HEADING_ERROR),
        "track_error": (-0.5 * length, 0.5 * length),
    }
    ends["pitch_command"] = ends["base_pitch_ratio"] = ends["measured_pitch_ratio"]
    ends["fuel_rack_command"] = ends["base_fuel_rack"] = ends["fuel_rack"]
    ends["base_rudder_angle"] = ends["rudder_angle"]
    low, high = np.array([ends[name] for name in observed], dtype=np.float32).T
    half = 0.5 * (high - low)
    half[half == 0.0] = 1.0  # A fixed-pitch propeller has a pitch range of zero width.
    return np.array([0.5 * (low + high), half])
