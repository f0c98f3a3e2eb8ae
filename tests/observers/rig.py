"""Rig with a four-quadrant propeller, an electric drive and no torque meter, and a reversal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftline.plant import Schedule, Ship, State, simulate

DIAMETER, DENSITY, PITCH, EFFICIENCY = 0.25, 1000.0, 1.0, 0.97
RIG = Ship.model_validate(
    {
        "name": "rig",
        "water": {"density_kg_m3": DENSITY},
        "hull": {"fixed": True},
        "propeller": {
            "model": "four-quadrant",
            "diameter_m": DIAMETER,
            "blades": 4,
            "expanded_area_ratio": 0.6,
            "pitch_ratio_min": PITCH,
            "pitch_ratio_max": PITCH,
            "relative_rotative_efficiency": EFFICIENCY,
            "astern_load_fraction": 0.95,
            "depth_m": 0.3,
        },
        "prime_mover": {"type": "torque-command", "torque_max_N_m": 15.0},
        "transmission": {
            "gear_ratio": 1.0,
            "efficiency": 0.98,
            "inertia_engine_side_kg_m2": 0.05,
            "inertia_propeller_side_kg_m2": 0.0,
            "coulomb_friction_engine_side_N_m": 0.9,
            "viscous_friction_propeller_side_N_m_s_rad": 0.008,
        },
        "integration": {"time_step_s": 0.002},
    }
)
INERTIA = 0.05


def reversal(t: NDArray[np.float64]) -> Any:
    """Return the time history 0 to 1, from 4 s to -1 in 2 s, and from 10 s back to 1."""
    return np.interp(
        t, [0.0, 1.0, 4.0, 6.0, 10.0, 12.0, 15.0], [0.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0]
    )


def reversed_run() -> Any:
    """Simulate a reversal with a torque of 5 N m and a carriage speed of 1 m/s for 15 s."""
    schedule = Schedule(lambda t: 5.0 * reversal(t), PITCH, inflow=reversal)
    return simulate(RIG, schedule, 15.0, initial=State(PITCH, 0.0, 0.0))


def against_inflow(run: Any) -> Any:
    """Return the samples in which the shaft turns against the inflow (zone 1)."""
    return run["shaft_speed"] * run["advance_velocity"] < 0.0


def advance_ratio(velocity: float, shaft_speed: float) -> float:
    """Return J [-]."""
    return velocity * 2.0 * math.pi / (shaft_speed * DIAMETER)
