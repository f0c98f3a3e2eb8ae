"""Actuators: pitch mechanism and fuel rack, with the imperfections that a real one may have."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from .propeller import clip


@compiled
def pitch_rate(plant: Record, command: Real, pitch_ratio: Real) -> Real:
    """d(P/D)/dt [1/s] of the pitch actuator.

    First order (thesis eq. 2-9) towards the command plus ``pitch_actuator_offset``; errors inside
    ``pitch_dead_band`` do not move it and ``pitch_rate_limit`` bounds its rate.
    """
    demand = clip(command, plant.pitch_ratio_min, plant.pitch_ratio_max)
    error = demand + plant.pitch_actuator_offset - pitch_ratio
    if plant.pitch_dead_band > 0.0:
        error = error - clip(error, -plant.pitch_dead_band, plant.pitch_dead_band)
    rate = error * (1.0 / plant.pitch_time_constant)
    return clip(rate, -plant.pitch_rate_limit, plant.pitch_rate_limit)


@compiled
def blade_pitch(plant: Record, actuator_pitch: Real, blade_before: float) -> Real:
    """Pitch ratio of the blades [-]: the play operator of ``pitch_backlash`` [-] (full width)."""
    if plant.pitch_backlash == 0.0:
        return actuator_pitch
    half = 0.5 * plant.pitch_backlash
    if blade_before < actuator_pitch.real - half:
        return actuator_pitch - half
    if blade_before > actuator_pitch.real + half:
        return actuator_pitch + half
    return blade_before


@compiled
def rack_position(plant: Record, demand: float, rack_before: float, dt: float) -> float:
    """Fuel rack [mm] after ``dt`` seconds of a demand, with its rate limit and end stops."""
    travel = plant.rack_rate_limit * dt
    moved = min(max(demand, rack_before - travel), rack_before + travel)
    return float(min(max(moved, plant.drive_min), plant.drive_max))
