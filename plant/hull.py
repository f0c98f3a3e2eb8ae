"""Hull: resistance, wake, and what a current does to both."""

from __future__ import annotations

from .compiled import Real, Record, compiled


@compiled
def water_speed(plant: Record, ship_speed: Real) -> Real:
    """Speed through the water [m/s]; ``current`` is positive where it carries the ship along."""
    return ship_speed - plant.current


@compiled
def resistance(plant: Record, speed_through_water: Real, resistance_factor: Real) -> Real:
    """Resistance R [N] (thesis eq. 2-10), opposing the motion, with the fouling's share.

    Args:
        plant: ship record.
        speed_through_water: [m/s].
        resistance_factor: disturbance d_c1 [-], 1 in calm water.
    """
    sign = 1.0 if speed_through_water.real >= 0.0 else -1.0
    factor = resistance_factor * (1.0 + plant.hull_fouling)
    return sign * factor * plant.resistance_coefficient * speed_through_water * speed_through_water


@compiled
def wake_inflow(plant: Record, speed_through_water: Real) -> Real:
    """Advance velocity (1 - w) v [m/s] without disturbances (thesis eq. 2-8).

    ``wake_slope`` lets the wake fraction change with speed about ``wake_reference_speed``.
    """
    wake = plant.wake_fraction + plant.wake_slope * (
        speed_through_water - plant.wake_reference_speed
    )
    return (1.0 - wake) * speed_through_water
