"""The fluid around the propeller, and the time step of the simulation."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from .keys import Section, parameter

ATMOSPHERE, VAPOUR_PRESSURE, GRAVITY = 101325.0, 1671.0, 9.81  # Pa, Pa (15 degC), m/s2

KNOT = 1852.0 / 3600.0
"""Knot [m/s]."""

THINNEST_LIQUID = 100.0
"""Density [kg/m3] below which a fluid is a gas: every liquid at 20 degC exceeds 500."""

WATER = (950.0, 1100.0)
"""Density [kg/m3] of water, hot or salt: the only fluid whose vapour pressure is known here."""


class Water(Section):
    """The fluid around the propeller and the hull: water, or air or oil on a test rig."""

    needs = "has_propeller"

    density_kg_m3: float = parameter(
        "density of the fluid: about 1.2 for air, 1000 for water",
        "kg/m3",
        record="density",
        required="with a propeller",
        ge=0.5,
        le=14e3,
        default=1000.0,
    )


class Integration(Section):
    """Integration with a fixed time step."""

    time_step_s: float = parameter("RK4 step", "s", record="time_step", gt=0, le=0.5, default=0.05)


@compiled
def static_pressure(plant: Record, submergence: Real) -> Real:
    """Return the pressure margin p0 + rho g h - p_v [Pa] against cavitation at a depth [m]."""
    return ATMOSPHERE - VAPOUR_PRESSURE + plant.density * GRAVITY * submergence
