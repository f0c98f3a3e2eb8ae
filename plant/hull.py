"""Hull: resistance, wake, and what a current does to both."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled


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
def episode_factor(plant: Record, time: float, dt: float) -> float:
    """Factor [-] on the resistance over the step from ``time`` to ``time + dt`` [s].

    1 + ``episode_resistance`` inside the window, 1 outside it; a step that an edge of the window cuts
    has the mean of both, held over the step. So a voyage depends continuously on the window's edges.
    """
    if plant.episode_resistance == 0.0:
        return 1.0
    inside = min(time + dt, plant.episode_end) - max(time, plant.episode_start)
    return float(1.0 + plant.episode_resistance * max(inside, 0.0) / dt)


@compiled
def wake_inflow(plant: Record, speed_through_water: Real) -> Real:
    """Advance velocity (1 - w) v [m/s] without disturbances (thesis eq. 2-8).

    ``wake_slope`` lets the wake fraction change with speed about ``wake_reference_speed``.
    """
    wake = plant.wake_fraction + plant.wake_slope * (
        speed_through_water - plant.wake_reference_speed
    )
    return (1.0 - wake) * speed_through_water
