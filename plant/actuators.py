"""Actuators: pitch mechanism and fuel rack, with dead band, backlash, rate limits, lag and offset."""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from ..core.compiled import Real, Record, compiled
from ..core.lanes import where
from ..core.numeric import clip
from .keys import INF, Section, effect, parameter
from .validity import Validity


class PitchActuator(Section):
    """Hydraulic pitch actuator, a first-order lag."""

    needs = "has_variable_pitch"
    validity: ClassVar[tuple[Validity, ...]] = (
        Validity(
            "pitch command",
            "-",
            lambda plant, samples: np.where(
                plant["pitch_ratio_min"] < plant["pitch_ratio_max"],
                samples["pitch_command"],
                np.nan,
            ),
            lambda plant: (float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])),
            "outside it the pitch stays at its end stop",
        ),
    )

    # fmt: off
    time_constant_s: float = parameter("time constant tau_p of the pitch", "s",
        record="pitch_time_constant", lag=True, ge=0.05, le=100, default=2.0)
    dead_band: float = effect(0.0, "P/D error that does not move it (half width)",
        record="pitch_dead_band", ge=0, le=0.5)
    backlash: float = effect(0.0, "play between actuator and blade (full width)",
        record="pitch_backlash", ge=0, le=0.5)
    rate_limit_per_s: float = effect(INF, "fastest change of P/D", "1/s", record="pitch_rate_limit",
        gt=0)
    offset: float = effect(0.0, "P/D reached minus P/D commanded", record="pitch_actuator_offset",
        ge=-0.5, le=0.5)
    # fmt: on


@compiled
def pitch_rate(plant: Record, command: Real, pitch_ratio: Real) -> Real:
    """Return the rate d(P/D)/dt [1/s] of the first-order pitch actuator (thesis eq. 2-9).

    It moves towards the command plus ``pitch_actuator_offset``, not for errors inside
    ``pitch_dead_band``, and no faster than ``pitch_rate_limit``.
    """
    demand = clip(command, plant.pitch_ratio_min, plant.pitch_ratio_max)
    error = demand + plant.pitch_actuator_offset - pitch_ratio
    if plant.pitch_dead_band != 0.0:
        error = error - clip(error, -plant.pitch_dead_band, plant.pitch_dead_band)
    rate = error * (1.0 / plant.pitch_time_constant)
    return clip(rate, -plant.pitch_rate_limit, plant.pitch_rate_limit)


@compiled
def blade_pitch(plant: Record, actuator_pitch: Real, blade_before: float) -> Real:
    """Return the pitch ratio of the blades [-] behind the backlash ``pitch_backlash`` [-]."""
    if plant.pitch_backlash == 0.0:
        return actuator_pitch
    half = 0.5 * plant.pitch_backlash
    low, high = actuator_pitch - half, actuator_pitch + half
    pushed = where(blade_before > high.real, high, blade_before)
    return where(blade_before < low.real, low, pushed)


class RackTravel(NamedTuple):
    """Fuel rack [mm] at the start, the middle and the end of a time step."""

    start: float
    middle: float
    end: float


@compiled
def rack_travel(plant: Record, demand: float, rack_before: float, dt: float) -> RackTravel:
    """Return the fuel rack [mm] over a step of ``dt`` seconds, with its rate limit and end stops.

    The rack moves at its limit until it reaches the command. ``end`` is its position at the end of the
    step. ``start`` and ``middle`` are chosen so that Simpson's rule, which a Runge-Kutta step applies to
    them, gives the exact mean and first moment of the travel.
    """
    low, high = plant.drive_min, plant.drive_max
    demand = min(max(demand, low), high)
    before = min(max(rack_before, low), high)
    reach = plant.rack_rate_limit * dt
    way = demand - before
    if math.isinf(reach) or way == 0.0:
        return RackTravel(demand, demand, demand)
    if abs(way) >= reach:
        end = before + math.copysign(reach, way)
        return RackTravel(before, 0.5 * (before + end), end)
    moves = abs(way) / reach  # share of the step during which the rack moves
    start = before + way * (1.0 - moves) * (1.0 - 2.0 * moves)
    return RackTravel(min(max(start, low), high), demand - 0.5 * way * moves * moves, demand)


@compiled
def lagged_travel(plant: Record, demand: float, before: float, dt: float) -> RackTravel:
    """Return the command of an electric drive behind its first-order lag, over a step of ``dt`` seconds.

    The values at start, middle and end are exact for a command that is constant over the step.
    """
    demand = min(max(demand, plant.drive_min), plant.drive_max)
    way = before - demand
    half = math.exp(-0.5 * dt / plant.command_lag)
    return RackTravel(before, demand + half * way, demand + half * half * way)
