"""The water that a ship sails in, and the time step in which it is simulated."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from .keys import Section, number

ATMOSPHERE, VAPOUR_PRESSURE, GRAVITY = 101325.0, 1671.0, 9.81  # Pa, Pa (15 degC), m/s2


class Water(Section):
    """The water that the ship sails in."""

    needs = "has_propeller"

    density_kg_m3: float = number(
        "density", "kg/m3", record="density", required="with a propeller", ge=990, le=1035,
        default=1000.0,
    )  # fmt: skip


class Integration(Section):
    """Fixed-step integration."""

    time_step_s: float = number("RK4 step", "s", record="time_step", gt=0, le=0.5, default=0.05)


@compiled
def static_pressure(plant: Record, submergence: Real) -> Real:
    """Pressure p0 + rho g h - p_v [Pa] that keeps the water from cavitating, at a depth [m]."""
    return ATMOSPHERE - VAPOUR_PRESSURE + plant.density * GRAVITY * submergence
