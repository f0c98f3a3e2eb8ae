"""Rudders: steering gear, inflow in the propeller race, and forces on the ship.

Normal force and inflow follow the MMG (Yasukawa & Yoshimura 2015, eqs. 15 to 19 and 23 to 26). Taylor's
model (2000, eqs. 3.25 to 3.33) agrees to first order in the angle if race, straightening and hull
interaction are absent and the rudder has a profile drag.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator

from ..core.compiled import Real, Record, compiled
from ..core.numeric import clip, modulus, sine_cosine
from .keys import INF, Section, effect, parameter, require

WITH = "with a rudder.area_m2"


class Rudder(Section):
    """Rudder and steering gear; several rudders act as one with their total area."""

    needs = "turns"

    # fmt: off
    area_m2: float = parameter("A_R, total area; 0: no rudder", "m2", record="rudder_area", ge=0, le=500,
        default=0.0)
    normal_force_slope: float = parameter(
        "f_alpha: normal force coefficient / sine of the angle of attack", "1/rad",
        record="rudder_slope", required=WITH, gt=0, le=2.0 * math.pi, default=1.0)
    position_m: float = parameter("x_R, forward of midship", "m", record="rudder_position",
        required=WITH, ge=-250, le=250, default=0.0)
    yaw_lever_m: float = parameter(
        "l_R: lever of the yaw's cross flow at the rudder, forward of midship", "m",
        record="rudder_yaw_lever", required=WITH, ge=-500, le=500, default=0.0)
    profile_drag: float = effect(0.0, "drag coefficient at no angle of attack", record="rudder_drag",
        ge=0, le=0.1)
    steering_deduction: float = effect(0.0, "t_R: share of the rudder's drag that the hull compensates",
        record="steering_deduction", ge=-0.5, lt=1)
    hull_force_share: float = effect(0.0, "a_H: side force on the hull / side force of the rudder",
        record="rudder_hull_share", ge=-0.5, le=2)
    hull_force_position_m: float = parameter("x_H: position of that side force, forward of midship", "m",
        record="rudder_hull_position", ge=-250, le=250, default=0.0)
    wake_ratio: float = effect(1.0, "epsilon: (1 - w) at the rudder / (1 - w) at the propeller",
        record="rudder_wake_ratio", gt=0, le=3)
    race_gain: float = effect(0.0, "kappa: share of the speed increase in the race at the rudder",
        record="race_gain", ge=0, le=2)
    race_share: float = effect(1.0, "eta: share of the rudder inside the race", record="race_share",
        ge=0, le=1)
    straightening_port: float = effect(1.0, "gamma_R for cross flow from port",
        record="straightening_port", ge=0, le=2)
    straightening_starboard: float = effect(1.0, "gamma_R for cross flow from starboard",
        record="straightening_starboard", ge=0, le=2)
    angle_max_rad: float = parameter("end stop, to either side", "rad", record="rudder_max", gt=0,
        le=1.6, default=math.radians(35.0))
    time_constant_s: float = effect(0.0, "time constant of the steering gear; 0: no lag", "s",
        record="rudder_lag", lag=True, ge=0, le=100)
    rate_limit_rad_s: float = effect(INF, "rate limit of the steering gear", "rad/s",
        record="rudder_rate_limit", gt=0)
    # fmt: on

    @model_validator(mode="after")
    def _complete(self) -> Rudder:
        if self.area_m2 > 0.0:
            require(self, ("normal_force_slope", "position_m", "yaw_lever_m"), WITH)
        if self.rate_limit_rad_s < INF and self.time_constant_s == 0.0:
            raise ValueError("time_constant_s must be above 0 s if rate_limit_rad_s is given")
        return self


@compiled
def rudder_demand(plant: Record, command: Real) -> Real:
    """Return the rudder command [rad] inside the end stops."""
    return clip(command, -plant.rudder_max, plant.rudder_max)


@compiled
def rudder_angle(plant: Record, angle: Real, command: Real) -> Real:
    """Return the rudder angle [rad]: the state, or the command if the steering gear has no lag."""
    return rudder_demand(plant, command) if plant.rudder_lag.real == 0.0 else angle


@compiled
def rudder_rate(plant: Record, command: Real, angle: Real) -> Real:
    """Return the rate [rad/s] of a steering gear with a lag."""
    rate = (rudder_demand(plant, command) - angle) * (1.0 / plant.rudder_lag)
    return clip(rate, -plant.rudder_rate_limit, plant.rudder_rate_limit)


@compiled
def race_inflow(plant: Record, inflow: Real, thrust: Real) -> Real:
    """Return the speed u_R [m/s] at the rudder behind a working propeller (eq. 25).

    Momentum theory gives the speed in the race from the inflow [m/s] and the thrust [N] of one
    propeller. So it is also valid at rest and astern, unlike a formula in the advance ratio; a propeller
    that brakes or pushes astern reduces the flow.
    """
    # Compare the complex value as a whole: it is not 0 if a derivative with respect to it is computed.
    if plant.race_gain == 0.0:
        return plant.rudder_wake_ratio * inflow
    loading = 8.0 / math.pi * thrust / (plant.density * plant.diameter * plant.diameter)
    square = inflow * modulus(inflow) + loading
    race = square / np.sqrt(np.sqrt(square * square + 1e-8))  # signed root
    met = inflow + plant.race_gain * (race - inflow)
    share = plant.race_share
    mean = np.sqrt(share * met * met + (1.0 - share) * inflow * inflow + 1e-24)
    if met.real < 0.0:
        mean = -mean
    return plant.rudder_wake_ratio * mean


@compiled
def rudder_forces(
    plant: Record, angle: Real, inflow: Real, thrust: Real, across: Real, yaw_rate: Real
) -> tuple[Real, Real, Real, Real]:
    """Return X [N], Y [N] and N [N m] of the rudder and its interaction with the hull (eqs. 15 to 19).

    The fourth result is the part of Y [N] that acts on the rudder itself.

    delta is in rad, the inflow at the propeller and v through the water in m/s, the thrust of one
    propeller in N, r in rad/s.
    """
    along = race_inflow(plant, inflow, thrust)
    cross_flow = across + plant.rudder_yaw_lever * yaw_rate
    straightening = plant.straightening_starboard
    if cross_flow.real < 0.0:
        straightening = plant.straightening_port
    cross_flow = cross_flow * straightening
    sine, cosine = sine_cosine(angle)
    pressure = 0.5 * plant.density * plant.rudder_area
    speed = np.sqrt(along * along + cross_flow * cross_flow + 1e-12)
    # U_R sin(delta + psi), where the flow angle psi is given by its sine and cosine
    attack = along * sine + cross_flow * cosine
    normal = pressure * plant.rudder_slope * speed * attack
    drag = pressure * plant.rudder_drag * speed
    surge = -(1.0 - plant.steering_deduction) * normal * sine - drag * along
    across_ship = -normal * cosine
    side = (1.0 + plant.rudder_hull_share) * across_ship - drag * cross_flow
    own = across_ship - drag * cross_flow
    lever = plant.rudder_position + plant.rudder_hull_share * plant.rudder_hull_position
    moment = lever * across_ship - plant.rudder_position * drag * cross_flow
    return surge, side, moment, own
