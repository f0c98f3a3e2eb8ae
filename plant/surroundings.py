"""The fluid in which a propeller turns, and the time step of the simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..core.compiled import Real, Record, compiled
from .keys import Section, number

ATMOSPHERE, VAPOUR_PRESSURE, GRAVITY = 101325.0, 1671.0, 9.81  # Pa, Pa (15 degC), m/s2

THINNEST_LIQUID = 100.0
"""Density [kg/m3] below which the fluid is a gas: no liquid at room temperature is below 500."""

WATER = (950.0, 1100.0)
"""Density [kg/m3] of water, hot or salt: the only fluid of which the vapour pressure is known here."""


class Water(Section):
    """The fluid in which the propeller turns and the ship sails: water, or air or oil on a rig."""

    needs = "has_propeller"

    density_kg_m3: float = number(
        "density of the fluid: about 1.2 of air, 1000 of water", "kg/m3", record="density",
        required="with a propeller", ge=0.5, le=14e3, default=1000.0,
    )  # fmt: skip


class InFluid:
    """What the density of a ship's fluid says of its kind."""

    if TYPE_CHECKING:
        water: Any

    @property
    def in_liquid(self) -> bool:
        """Whether the fluid is a liquid, which has a surface and carries a hull."""
        return bool(self.water.density_kg_m3 >= THINNEST_LIQUID)

    @property
    def in_water(self) -> bool:
        """Whether the fluid is water, which cavitates at a vapour pressure that is known."""
        return bool(WATER[0] <= self.water.density_kg_m3 <= WATER[1])


class Integration(Section):
    """Fixed-step integration."""

    time_step_s: float = number("RK4 step", "s", record="time_step", gt=0, le=0.5, default=0.05)


@compiled
def static_pressure(plant: Record, submergence: Real) -> Real:
    """Pressure p0 + rho g h - p_v [Pa] that keeps the water from cavitating, at a depth [m]."""
    return ATMOSPHERE - VAPOUR_PRESSURE + plant.density * GRAVITY * submergence
