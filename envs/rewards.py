"""The terms of the reward: each declared once, with its unit and meaning, and worked out below.

A new term is a field of :class:`Weights` and its line in :func:`add_terms`; tasks may then weigh it, and
``info``, evaluation and documentation know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from ..core.compiled import Record, compiled, spelled_out
from ..core.models import FileModel
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import rack_torque, torque_limit
from ..plant.fuel import fuel_rate
from ..plant.state import Outputs


class Weights(FileModel):
    """Weight of each reward term, per its physical unit and control interval."""

    speed_error_m_s: float = Field(ge=0, description="|ship speed - order|")
    fuel_kg_s: float = Field(ge=0, description="fuel flow of all engines")
    overload: float = Field(
        ge=0, description="engine torque asked for beyond the envelope, as share"
    )
    torque_rate_kN_m_s: float = Field(ge=0, description="mean |d M_m / dt| at the gauge")
    rack_travel_mm: float = Field(ge=0, description="|change of the rack command|")
    cavitation: float = Field(ge=0, description="thrust loading beyond Burrill's limit, as share")
    overspeed: float = Field(ge=0, description="engine speed beyond its highest, as share")
    speed_error_squared_m2_s2: float = Field(
        0.0, ge=0, description="(ship speed - order)^2, which forgives the small"
    )
    torque_swing_kN_m: float = Field(
        0.0,
        ge=0,
        description="|M_m - its mean over the last 20 s|: what a standard deviation counts",
    )
    engine_swing_kN_m: float = Field(
        0.0,
        ge=0,
        description="the same of the engine's torque: |M_b - its mean over the last 20 s|",
    )
    attack_swing_deg: float = Field(
        0.0, ge=0, description="the same of the blades' effective angle of attack"
    )
    outside_bucket_deg: float = Field(
        0.0, ge=0, description="angle of attack beyond the cavitation bucket"
    )
    near_limit: float = Field(
        0.0,
        ge=0,
        description="engine torque in the last 5 % below the envelope, as share of these",
    )
    heading_error_deg: float = Field(0.0, ge=0, description="|heading - order|, by the shorter way")
    track_error_m: float = Field(0.0, ge=0, description="|cross track - order|")
    rudder_rate_deg_s: float = Field(0.0, ge=0, description="mean |d delta / dt| of the rudder")


NEAR_LIMIT = 0.05
"""Share of the engine's envelope, from above, in which its torque is near the limit."""

TERMS = tuple(Weights.model_fields)
"""Names of the reward terms."""

REWARD_TERMS = np.dtype([(name, np.float64) for name in TERMS])
"""One value a term, in its unit: of an interval, or its weight."""


class Instant(NamedTuple):
    """What the terms are made of at one step of the plant."""

    order: float  # ship speed [m/s]
    ship_speed: float  # [m/s]
    shaft_speed: float  # [rad/s]
    rack: float  # position of the fuel rack [mm]
    drive: float  # rack command [mm]
    drive_before: float  # at the last step [mm]
    torque_before: float  # at the gauge, at the last step [N m]
    mean_torque: float  # at the gauge over the last 20 s [N m]
    mean_brake_torque: float  # likewise of one engine [N m]
    attack: float  # effective angle of attack of the blades [deg]
    mean_attack: float  # likewise over the last 20 s [deg]
    outside_bucket: float  # how far it lies outside the cavitation bucket [deg]
    heading_error: float  # by the shorter way [rad]
    track_error: float  # [m]
    rudder_turn: float  # of the rudder over the step [rad]
    dt: float  # [s]


@compiled
def add_terms(
    terms: Record, plant: Record, outputs: Outputs, now: Instant, share: float, fuel: float
) -> None:
    """Add one plant step's part of each term of a control interval.

    Args:
        terms: REWARD_TERMS record, changed in place.
        plant: ship record.
        outputs: of the plant at this step.
        now: what else is known of it.
        share: of the step in the interval [-].
        fuel: flow of all engines [kg/s], from :func:`shaftline.plant.fuel.fuel_rate`.
    """
    engine_speed = plant.gear_ratio * now.shaft_speed
    limit = torque_limit(plant, engine_speed)
    asked = rack_torque(plant, engine_speed, now.rack)
    burrill = burrill_ratio(
        plant, outputs.thrust, outputs.advance_velocity, now.shaft_speed, outputs.pitch_ratio,
        outputs.submergence,
    )  # fmt: skip
    rate = abs(outputs.shaft_torque - now.torque_before) / now.dt
    error = now.ship_speed - now.order
    terms.speed_error_m_s += share * abs(error)
    terms.fuel_kg_s += share * fuel
    terms.overload += share * max(asked / limit - 1.0, 0.0)
    terms.torque_rate_kN_m_s += share * rate * 1e-3
    terms.rack_travel_mm += abs(now.drive - now.drive_before)
    terms.cavitation += share * max(burrill - 1.0, 0.0)
    terms.overspeed += share * max(engine_speed / plant.engine_speed_max - 1.0, 0.0)
    terms.speed_error_squared_m2_s2 += share * error**2
    terms.torque_swing_kN_m += share * 1e-3 * abs(outputs.shaft_torque - now.mean_torque)
    terms.engine_swing_kN_m += share * 1e-3 * abs(outputs.brake_torque - now.mean_brake_torque)
    terms.attack_swing_deg += share * abs(now.attack - now.mean_attack)
    terms.outside_bucket_deg += share * now.outside_bucket
    terms.heading_error_deg += share * math.degrees(abs(now.heading_error))
    terms.track_error_m += share * abs(now.track_error)
    terms.rudder_rate_deg_s += share * math.degrees(abs(now.rudder_turn)) / now.dt
    terms.near_limit += share * min(max((asked / limit - 1.0) / NEAR_LIMIT + 1.0, 0.0), 1.0)


@compiled
def fuel_of_all(plant: Record, shaft_speed: float, brake_torque: float) -> float:
    """Fuel flow of all engines [kg/s]."""
    rate = fuel_rate(plant, plant.gear_ratio * shaft_speed, brake_torque)
    return float(plant.propellers * rate)


clear_terms: Callable[[Any], None] = spelled_out(
    """
def clear_terms(terms):
    terms.{field} = 0.0
""",
    TERMS,
    globals(),
)
"""Begin an interval."""

running_cost: Callable[[Any, Any], float] = spelled_out(
    """
def running_cost(weights, terms):
    cost = 0.0
    cost += weights.{field} * terms.{field}
    return cost
""",
    TERMS,
    globals(),
)
"""Return the weighted sum of the terms of a control interval."""


@compiled
def reward_of(cost: float, failed: bool, worst_cost: float, intervals: int, elapsed: int) -> float:
    """Return the reward of a control interval.

    A running interval costs from 0 to ``worst_cost``. The interval in which the ship fails costs
    ``worst_cost`` for every interval of a whole episode, and once more for each that is not completed.
    So an episode that fails in interval k of N (from 0) returns at most -(2 N - k) worst_cost, and one
    that does not fail returns at least -N worst_cost, which is higher by worst_cost or more. Surviving
    another interval never lowers the return of an episode that fails later.

    Args:
        cost: of :func:`running_cost`; not a number counts as the worst.
        failed: whether the engine stalled or tripped in this interval.
        worst_cost: bound of an interval's cost.
        intervals: control intervals N of a whole episode.
        elapsed: intervals k completed before this one.
    """
    if failed:
        return -worst_cost * (2.0 * intervals - elapsed)
    if not cost < worst_cost:
        cost = worst_cost
    return 0.0 - max(cost, 0.0)
