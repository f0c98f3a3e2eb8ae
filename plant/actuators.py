"""Actuators: pitch mechanism and fuel rack, with the imperfections that a real one may have."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from ..core.numeric import clip
from .keys import INF, Section, effect, number


class PitchActuator(Section):
    """Hydraulic pitch mechanism, first order."""

    needs = "has_variable_pitch"

    time_constant_s: float = number(
        "tau_p", "s", record="pitch_time_constant", ge=0.05, le=100, default=2.0
    )
    dead_band: float = effect(
        0.0, "P/D error that does not move it (half width)", record="pitch_dead_band", ge=0, le=0.5
    )
    backlash: float = effect(
        0.0, "play between actuator and blade (full width)", record="pitch_backlash", ge=0, le=0.5
    )
    rate_limit_per_s: float = effect(
        INF, "fastest change of P/D", "1/s", record="pitch_rate_limit", gt=0
    )
    offset: float = effect(
        0.0, "P/D reached minus P/D commanded", record="pitch_actuator_offset", ge=-0.5, le=0.5
    )


@compiled
def pitch_rate(plant: Record, command: Real, pitch_ratio: Real) -> Real:
    """d(P/D)/dt [1/s] of the pitch actuator.

    First order (thesis eq. 2-9) towards the command plus ``pitch_actuator_offset``; errors inside
    ``pitch_dead_band`` do not move it and ``pitch_rate_limit`` bounds its rate.
    """
    demand = clip(command, plant.pitch_ratio_min, plant.pitch_ratio_max)
    error = demand + plant.pitch_actuator_offset - pitch_ratio
    if plant.pitch_dead_band != 0.0:
        error = error - clip(error, -plant.pitch_dead_band, plant.pitch_dead_band)
    rate = error * (1.0 / plant.pitch_time_constant)
    return clip(rate, -plant.pitch_rate_limit, plant.pitch_rate_limit)


@compiled
def blade_pitch(plant: Record, actuator_pitch: Real, blade_before: float) -> Real:
    """Pitch ratio of the blades [-]: the play operator of ``pitch_backlash`` [-] (full width)."""
    if plant.pitch_backlash == 0.0:
        return actuator_pitch
    half = 0.5 * plant.pitch_backlash
    if blade_before < actuator_pitch.real - half.real:
        return actuator_pitch - half
    if blade_before > actuator_pitch.real + half.real:
        return actuator_pitch + half
    return blade_before


@compiled
def rack_position(plant: Record, demand: float, rack_before: float, dt: float) -> float:
    """Fuel rack [mm] after ``dt`` seconds of a demand, with its rate limit and end stops."""
    travel = plant.rack_rate_limit * dt
    moved = min(max(demand, rack_before - travel), rack_before + travel)
    return float(min(max(moved, plant.drive_min), plant.drive_max))
