"""Reward of a control interval: goals with tolerances in physical units, combined to a value in [0, 1].

Each term of :class:`Goals` is a physical quantity of the interval, such as a speed error in m/s. A task
gives some of the terms a tolerance ``within`` and a ``margin``. The value of a goal is 1 up to the
tolerance and falls beyond it, to 0.1 one margin further (the long tail of the dm_control suite, Tassa et
al. 2018, section 3.2):

    g(x) = 1 / (1 + 9 z^2),   z = max(x - within, 0) / margin

Goals without a weight are factors of the reward, so a loss in one of them cannot be made up for by
another. Goals with a weight share the rest. The reward is

    r = product of the factors g_i * (1 - sum of w_j (1 - g_j))

An interval in which the engine stalls or trips has the reward 0, and the episode ends there, so all
later rewards are lost.

To add a term, add a field to :class:`Goals` and a line to :func:`add_terms`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Record, compiled, generate_kernel
from ..core.models import FileModel
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import rack_torque, torque_limit
from ..plant.emissions import nox_rate
from ..plant.fuel import fuel_rate
from ..plant.state import Outputs


class Goal(FileModel):
    """Tolerance of one reward term, in the unit of the term.

    Examples:
        >>> goal_value(0.1, within=0.1, margin=2.0)
        1.0
        >>> round(goal_value(2.1, within=0.1, margin=2.0), 3)
        0.1
    """

    within: float = Field(description="value of the term up to which the goal is fully reached")
    margin: float = Field(
        gt=0, description="distance beyond ``within`` at which the goal has the value 0.1"
    )
    weight: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="share of the weighted part of the reward; None: the goal is a factor",
    )
    reason: str = Field(default="", description="reason for the tolerance")


def _term(description: str) -> Any:
    """Declare a reward term; a task that does not name it has no goal for it."""
    return Field(default=None, description=description)


class Goals(FileModel):
    """Goals of a task, by reward term.

    Examples:
        >>> goals = Goals(speed_error_m_s=Goal(within=0.1, margin=2.0))
        >>> list(goals.used)
        ['speed_error_m_s']
    """

    speed_error_m_s: Goal | None = _term("|ship speed - ordered speed|")
    fuel_kg_s: Goal | None = _term("fuel flow of all engines")
    fuel_excess: Goal | None = _term(
        "fuel flow over that of the steady state at the ordered speed, three quarters of "
        "the pitch range and the mean resistance of the episode, less 1; kinetic energy that the "
        "ship gains or loses counts as fuel, as the state of charge of a hybrid's battery (SAE J1711)"
    )
    nox_g_s: Goal | None = _term("NOx flow of all engines; 0 without a NOx map in the ship file")
    overload: Goal | None = _term(
        "engine torque demanded beyond the envelope, as share of the envelope"
    )
    near_limit: Goal | None = _term(
        "engine torque in the top 5 % of the envelope, as share of that band"
    )
    overspeed: Goal | None = _term("engine speed beyond its highest speed, as share of that speed")
    torque_fluctuation: Goal | None = _term(
        "|shaft torque - its mean over 20 s|, as share of the shaft's highest torque"
    )
    engine_fluctuation: Goal | None = _term(
        "|engine torque - its mean over 20 s|, as share of the engine's highest torque"
    )
    attack_fluctuation_deg: Goal | None = _term(
        "|effective angle of attack of the blades - its mean over 20 s|"
    )
    outside_bucket_deg: Goal | None = _term("angle of attack beyond the cavitation bucket")
    cavitation: Goal | None = _term(
        "thrust loading beyond Burrill's 5 % limit, as share of the limit"
    )
    rack_travel_mm: Goal | None = _term("travel of the fuel rack command, summed over the interval")
    pitch_travel: Goal | None = _term("travel of the blades' P/D, summed over the interval")
    heading_error_deg: Goal | None = _term("|heading - ordered heading|, at most half a turn")
    track_error_m: Goal | None = _term("|cross-track position - ordered cross-track position|")
    rudder_rate_deg_s: Goal | None = _term("mean |rate of the rudder angle|")

    @model_validator(mode="after")
    def _check_weights(self) -> Goals:
        """Refuse goals whose reward would be constant or negative."""
        goals = self.used
        if not goals:
            raise ValueError("a task needs at least one goal, such as speed_error_m_s = {}")
        total = sum(goal.weight or 0.0 for goal in goals.values())
        if total > 1.0 + 1e-9:
            raise ValueError(f"the weights of the goals add up to {total:g}; at most 1 is allowed")
        return self

    @property
    def used(self) -> dict[str, Goal]:
        """Goals of the task, by reward term."""
        return {name: goal for name in TERMS if (goal := getattr(self, name)) is not None}


MEAN_S = 20.0  # time constant of the running means of torque, angle of attack and ship speed [s]
NEAR_LIMIT = 0.05  # top share of the engine envelope in which the torque is near the limit
TERMS = tuple(Goals.model_fields)
"""Names of the reward terms."""

REWARD_TERMS = np.dtype([(name, np.float64) for name in TERMS])  # one value for each term
GOALS = np.dtype([("within", REWARD_TERMS), ("margin", REWARD_TERMS), ("weight", REWARD_TERMS)])
"""Record of goals: a margin of 0 marks a term without a goal, a weight of 0 marks a factor."""


def goals_record(goals: Goals) -> Any:
    """Return the goals of a task as a GOALS record."""
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
    mean_torque: float  # mean shaft torque over the last 20 s [N m]
    mean_brake_torque: float  # mean torque of one engine over the last 20 s [N m]
    attack: float  # effective angle of attack of the blades [deg]
    mean_attack: float  # mean angle of attack over the last 20 s [deg]
    outside_bucket: float  # angle of attack beyond the cavitation bucket [deg]
    pitch_before: float  # P/D of the last step [-]
    mean_speed: float  # mean ship speed over the last 20 s [m/s]
    reference_fuel: float  # fuel flow of the reference steady state, all engines [kg/s]
    reference_power: float  # towing power in that state [W]
    heading_error: float  # within half a turn [rad]
    track_error: float  # [m]
    rudder_turn: float  # change of the rudder angle over the step [rad]
    dt: float  # [s]


@compiled
def add_terms(
    terms: Record, plant: Record, outputs: Outputs, now: Instant, share: float, fuel: float
) -> None:
    """Add the contribution of one plant step to each reward term of a control interval.

    ``share`` is that of the step in the interval [-], ``fuel`` that of all engines [kg/s].
    """
    engine_speed = plant.gear_ratio * now.shaft_speed
    limit = torque_limit(plant, engine_speed)
    asked = rack_torque(plant, engine_speed, now.rack)
    burrill = burrill_ratio(
        plant,
        outputs.thrust,
        outputs.advance_velocity,
        now.shaft_speed,
        outputs.pitch_ratio,
        outputs.submergence,
    )
    shaft_torque = abs(outputs.shaft_torque - now.mean_torque)
    engine_torque = abs(outputs.brake_torque - now.mean_brake_torque)
    terms.speed_error_m_s += share * abs(now.ship_speed - now.order)
    terms.fuel_kg_s += share * fuel
    nox = nox_rate(plant, engine_speed, outputs.brake_torque)
    terms.nox_g_s += share * plant.propellers * nox
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
def total_fuel_flow(plant: Record, shaft_speed: float, brake_torque: float) -> float:
    """Return the fuel flow of all engines [kg/s]."""
    rate = fuel_rate(plant, plant.gear_ratio * shaft_speed, brake_torque)
    return float(plant.propellers * rate)


clear_terms: Callable[[Any], None] = generate_kernel(
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
    """Return the value of a goal in [0, 1] at a term x; a term that is not a number has the value 0.

    Examples:
        >>> goal_value(0.5, 1.0, 2.0)
        1.0
    """
    if x <= within:
        return 1.0
    z = (x - within) / margin
    value = 1.0 / (1.0 + 9.0 * z * z)
    return value if value > 0.0 else 0.0


@compiled
def _add_goal(
    reward: tuple[float, float], x: float, within: float, margin: float, weight: float
) -> tuple[float, float]:
    """Return the product of factors and the sum of shortfalls with those of one more term."""
    if not margin > 0.0:
        return reward
    value = goal_value(x, within, margin)
    if weight == 0.0:
        return reward[0] * value, reward[1]
    return reward[0], reward[1] + weight * (1.0 - value)


reward_of: Callable[[Any, Any], float] = generate_kernel(
    """
def reward_of(goals, terms):
    r = 1.0, 0.0
    r = _add_goal(r, terms.{field}, goals.within.{field}, goals.margin.{field}, goals.weight.{field})
    return r[0] * max(1.0 - r[1], 0.0)
""",
    TERMS,
    globals(),
)
"""Return the reward in [0, 1] of a control interval in which the engine runs.

Args: a GOALS record and a REWARD_TERMS record.
"""
