"""The reward of a control interval: goals with tolerances in physical units, combined to [0, 1].

Each term of :class:`Goals` is a physical quantity of the interval, such as a speed error in m/s. A task
gives some of the terms a tolerance ``within`` and a ``margin``. The value of a goal is 1 up to the
tolerance and falls beyond it, to 0.1 one margin further (the long tail of the dm_control suite, Tassa et
al. 2018, section 3.2):

    g(x) = 1 / (1 + 9 z^2),   z = max(x - within, 0) / margin

Goals without a weight are factors: none of them can be bought with another. Goals with a weight share
the rest. The reward is

    r = product of the factors g_i * (1 - sum of w_j (1 - g_j))

An interval in which the engine stalls or trips has the reward 0, and the episode ends there, so it loses
all rewards that would have followed.

A new term is a field of :class:`Goals` and its line in :func:`add_terms`. Tasks may then use it, and
``info``, evaluation and documentation know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Record, compiled, spelled_out
from ..core.models import FileModel
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import rack_torque, torque_limit
from ..plant.fuel import fuel_rate
from ..plant.state import Outputs


class Goal(FileModel):
    """Tolerance of one reward term, in the term's unit."""

    within: float = Field(description="value up to which the goal is fully reached")
    margin: float = Field(gt=0, description="distance beyond it at which the value is 0.1")
    weight: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="share of the weighted part; a factor without one",
    )
    reason: str = Field(default="", description="why the tolerance is what it is")


class Goals(FileModel):
    """Goals of a task, by reward term."""

    speed_error_m_s: Goal | None = Field(default=None, description="|ship speed - ordered speed|")
    fuel_kg_s: Goal | None = Field(default=None, description="fuel flow of all engines")
    fuel_excess: Goal | None = Field(
        default=None,
        description="fuel flow over that of the steady state at the ordered speed, three quarters of "
        "the pitch range and the mean resistance of the episode, less 1; kinetic energy that the "
        "ship gains or loses counts as fuel, as the state of charge of a hybrid's battery (SAE J1711)",
    )
    overload: Goal | None = Field(
        default=None,
        description="engine torque demanded beyond the envelope, as share of the envelope",
    )
    near_limit: Goal | None = Field(
        default=None,
        description="engine torque in the last 5 % below the envelope, as share of these",
    )
    overspeed: Goal | None = Field(
        default=None, description="engine speed beyond its highest speed, as share of that speed"
    )
    torque_fluctuation: Goal | None = Field(
        default=None,
        description="|shaft torque - its mean over 20 s|, as share of the shaft's highest torque",
    )
    engine_fluctuation: Goal | None = Field(
        default=None,
        description="|engine torque - its mean over 20 s|, as share of the engine's highest torque",
    )
    attack_fluctuation_deg: Goal | None = Field(
        default=None, description="|effective angle of attack of the blades - its mean over 20 s|"
    )
    outside_bucket_deg: Goal | None = Field(
        default=None, description="angle of attack beyond the cavitation bucket"
    )
    cavitation: Goal | None = Field(
        default=None, description="thrust loading beyond Burrill's 5 % limit, as share of the limit"
    )
    rack_travel_mm: Goal | None = Field(
        default=None, description="travel of the fuel rack command, summed over the interval"
    )
    pitch_travel: Goal | None = Field(
        default=None, description="travel of the blades' P/D, summed over the interval"
    )
    heading_error_deg: Goal | None = Field(
        default=None, description="|heading - ordered heading|, by the shorter way"
    )
    track_error_m: Goal | None = Field(
        default=None, description="|cross-track position - ordered cross-track position|"
    )
    rudder_rate_deg_s: Goal | None = Field(
        default=None, description="mean |rate of the rudder angle|"
    )

    @model_validator(mode="after")
    def _check_weights(self) -> Goals:
        """Refuse goals whose reward would be constant or negative."""
        goals = self.used
        if not goals:
            raise ValueError("at least one goal is needed")
        total = sum(goal.weight or 0.0 for goal in goals.values())
        if total > 1.0 + 1e-9:
            raise ValueError(f"the weights of the goals add up to {total:g}; at most 1 is allowed")
        return self

    @property
    def used(self) -> dict[str, Goal]:
        """Goals that the task has, by term."""
        return {name: goal for name in TERMS if (goal := getattr(self, name)) is not None}


MEAN_S = 20.0
"""Time over which the means of torques, angle of attack and ship speed are taken [s]."""

NEAR_LIMIT = 0.05
"""Share of the engine's envelope, from above, in which its torque is near the limit."""

TERMS = tuple(Goals.model_fields)
"""Names of the reward terms."""

REWARD_TERMS = np.dtype([(name, np.float64) for name in TERMS])
"""One value for each term."""

GOALS = np.dtype([("within", REWARD_TERMS), ("margin", REWARD_TERMS), ("weight", REWARD_TERMS)])
"""Goals as a record: a margin of 0 marks a term without a goal, a weight of 0 a factor."""


def goals_record(goals: Goals) -> Any:
    """Return a GOALS record of a task's goals."""
    record = np.zeros(1, GOALS)[0]
    for name, goal in goals.used.items():
        record["within"][name], record["margin"][name] = goal.within, goal.margin
        record["weight"][name] = goal.weight or 0.0
    return record


class Instant(NamedTuple):
    """Quantities of one plant step from which the reward terms are computed."""

    order: float  # ordered ship speed [m/s]
    ship_speed: float  # [m/s]
    shaft_speed: float  # [rad/s]
    rack: float  # position of the fuel rack [mm]
    drive: float  # fuel rack command [mm]
    drive_before: float  # fuel rack command of the last step [mm]
    mean_torque: float  # shaft torque over the last 20 s [N m]
    mean_brake_torque: float  # torque of one engine over the last 20 s [N m]
    attack: float  # effective angle of attack of the blades [deg]
    mean_attack: float  # angle of attack over the last 20 s [deg]
    outside_bucket: float  # angle of attack beyond the cavitation bucket [deg]
    pitch_before: float  # P/D of the last step [-]
    mean_speed: float  # of the ship over the last 20 s [m/s]
    reference_fuel: float  # fuel flow of the reference steady state, all engines [kg/s]
    reference_power: float  # power to tow the ship in that state [W]
    heading_error: float  # by the shorter way [rad]
    track_error: float  # [m]
    rudder_turn: float  # change of the rudder angle over the step [rad]
    dt: float  # [s]


@compiled
def add_terms(
    terms: Record, plant: Record, outputs: Outputs, now: Instant, share: float, fuel: float
) -> None:
    """Add the part of one plant step to each reward term of a control interval.

    Args:
        terms: REWARD_TERMS record, changed in place.
        plant: ship record.
        outputs: of the plant at this step.
        now: further quantities of this step.
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
    shaft_torque = abs(outputs.shaft_torque - now.mean_torque)
    engine_torque = abs(outputs.brake_torque - now.mean_brake_torque)
    terms.speed_error_m_s += share * abs(now.ship_speed - now.order)
    terms.fuel_kg_s += share * fuel
    if now.reference_fuel > 0.0:
        way = plant.mass * now.mean_speed * (now.ship_speed - now.mean_speed) / MEAN_S
        terms.fuel_excess += share * (fuel / now.reference_fuel - way / now.reference_power - 1.0)
    terms.overload += share * max(asked / limit - 1.0, 0.0)
    terms.near_limit += share * min(max((asked / limit - 1.0) / NEAR_LIMIT + 1.0, 0.0), 1.0)
    terms.overspeed += share * max(engine_speed / plant.engine_speed_max - 1.0, 0.0)
    if plant.torque_limit < math.inf:
        terms.torque_fluctuation += share * shaft_torque / (plant.torque_limit * plant.gear_ratio)
        terms.engine_fluctuation += share * engine_torque / plant.torque_limit
    terms.attack_fluctuation_deg += share * abs(now.attack - now.mean_attack)
    terms.outside_bucket_deg += share * now.outside_bucket
    terms.cavitation += share * max(burrill - 1.0, 0.0)
    terms.rack_travel_mm += abs(now.drive - now.drive_before)
    terms.pitch_travel += abs(outputs.pitch_ratio - now.pitch_before)
    terms.heading_error_deg += share * math.degrees(abs(now.heading_error))
    terms.track_error_m += share * abs(now.track_error)
    terms.rudder_rate_deg_s += share * math.degrees(abs(now.rudder_turn)) / now.dt


@compiled
def fuel_of_all(plant: Record, shaft_speed: float, brake_torque: float) -> float:
    """Return the fuel flow of all engines [kg/s]."""
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
"""Set all reward terms to zero."""


@compiled
def goal_value(x: float, within: float, margin: float) -> float:
    """Return the value of a goal in [0, 1] at a term x; a term that is not a number has the value 0."""
    if x <= within:
        return 1.0
    z = (x - within) / margin
    value = 1.0 / (1.0 + 9.0 * z * z)
    return value if value > 0.0 else 0.0


@compiled
def _missed(x: float, within: float, margin: float, weight: float) -> float:
    """Return the weighted shortfall of a goal; 0 where the term has no weighted goal."""
    if margin > 0.0 and weight > 0.0:
        return weight * (1.0 - goal_value(x, within, margin))
    return 0.0


@compiled
def _factor(x: float, within: float, margin: float, weight: float) -> float:
    """Return the factor of a goal; 1 where the term is not a factor."""
    if margin > 0.0 and weight == 0.0:
        return goal_value(x, within, margin)
    return 1.0


reward_of: Callable[[Any, Any], float] = spelled_out(
    """
def reward_of(goals, terms):
    factors = 1.0
    missed = 0.0
    factors *= _factor(terms.{field}, goals.within.{field}, goals.margin.{field}, goals.weight.{field})
    missed += _missed(terms.{field}, goals.within.{field}, goals.margin.{field}, goals.weight.{field})
    return factors * max(1.0 - missed, 0.0)
""",
    TERMS,
    globals(),
)
"""Return the reward in [0, 1] of a control interval in which the engine runs.

Args: a GOALS record and a REWARD_TERMS record.
"""
