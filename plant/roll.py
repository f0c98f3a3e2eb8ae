"""Roll, an optional fourth degree of freedom: heel in turns, free decay, and the effect of waves.

Roll angle phi and rate p are positive with starboard down. The equation is that of moments about the
centre of gravity G, divided by the moment of inertia (models of roll: Fossen 2011, chapter 7; Perez
2005):

    dp/dt = w^2 (K / (m g GM) - sin phi + kappa alpha) - 2 zeta w p - beta p |p|
    K = -h_H (m a_G - Y_R) - h_R Y_R
    w = 2 pi / T,  zeta = zeta_0 + zeta_U |u| / sqrt(g L)

The side forces on the ship add up to m a_G, mass times lateral acceleration of G. All but the rudder's
own, Y_R, act at the depth h_H below G. In a steady turn a_G is u r, so that without a rudder
GM sin phi = -h_H u r / g. The displacement m, L and x_G are those of ``[manoeuvring]``.

The linear derivatives Y_phi and N_phi act back on sway and yaw (Son & Nomoto 1982); with 0 the
horizontal motion is that of the ship without roll. A ship without a ``metacentric_height_m`` here does
not roll.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from ..core.compiled import Real, Record, compiled
from ..core.numeric import modulus, sine_cosine
from .keys import Section, effect, parameter, require
from .manoeuvring import hull_area
from .surroundings import GRAVITY
from .validity import Validity

WITH = "with a roll.metacentric_height_m"

LARGEST_ANGLE = math.radians(20.0)
"""Largest roll angle [rad] at which the righting lever is taken as GM sin phi."""

FASTEST_FROUDE = 0.5
"""Froude number at which the time step must resolve the damping of the roll."""


def _angle(plant: Any, samples: NDArray[Any]) -> NDArray[np.float64]:
    angle: NDArray[np.float64] = np.asarray(samples["roll_angle"], dtype=np.float64)
    return angle if plant["rolls"] != 0 else np.full(len(angle), math.nan)


class Roll(Section):
    """Roll: stability, damping and the depths at which side forces act."""

    needs = "turns"
    derived = (("rolls", np.int64),)
    validity = (
        Validity(
            "the roll angle",
            "rad",
            _angle,
            lambda plant: (-LARGEST_ANGLE, LARGEST_ANGLE),
            "the righting lever is GM sin phi, without the shape of the hull and its deck",
        ),
    )

    # fmt: off
    metacentric_height_m: float = parameter(
        "GM, transverse, with the free surfaces of the tanks; 0: no roll", "m",
        record="metacentric_height", ge=0, le=20, default=0.0)
    period_s: float = parameter("T, natural period of small roll angles", "s", record="roll_period",
        needs="rolls", required=WITH, gt=0, le=120, default=10.0)
    damping_ratio: float = parameter("zeta_0, linear damping / critical damping, at rest",
        record="roll_damping", needs="rolls", required=WITH, ge=0, lt=1, default=0.0)
    lift_damping_ratio: float = effect(0.0,
        "zeta_U, increase of the damping ratio per Froude number, by lift on hull and fins",
        record="roll_lift_damping", needs="rolls", ge=0, le=5)
    quadratic_damping_per_rad: float = effect(0.0, "beta in dp/dt = -beta p |p|", "1/rad",
        record="roll_quadratic_damping", needs="rolls", ge=0, le=20)
    hull_force_depth_m: float = parameter(
        "h_H, depth of the side force on the hull below the centre of gravity", "m",
        record="roll_hull_depth", needs="rolls", required=WITH, ge=-30, le=30, default=0.0)
    rudder_force_depth_m: float = parameter(
        "h_R, depth of the rudder's side force below the centre of gravity", "m",
        record="roll_rudder_depth", needs="rolls", required=f"{WITH} and a rudder", ge=-30, le=30,
        default=0.0)
    wave_slope_coefficient: float = effect(0.0,
        "kappa, effective wave slope / slope of the surface across the ship",
        record="wave_slope_coefficient", needs="rolls", ge=0, le=1.5)
    Y_phi: float = effect(0.0, "Y by the roll angle, dimensionless as in manoeuvring", record="Y_phi",
        needs="rolls", ge=-0.1, le=0.1)
    N_phi: float = effect(0.0, "N by the roll angle", record="N_phi", needs="rolls", ge=-0.1, le=0.1)
    # fmt: on

    @model_validator(mode="after")
    def _complete(self) -> Roll:
        if self.metacentric_height_m > 0.0:
            require(self, ("period_s", "damping_ratio", "hull_force_depth_m"), WITH)
        return self

    def fill(self, record: Any) -> None:
        """Write the parameters, and the flag of a ship that rolls."""
        super().fill(record)
        record["rolls"] = self.metacentric_height_m > 0.0

    @property
    def time_constants(self) -> dict[str, float]:
        """Return the time constant [s] of the faster mode at a Froude number of 0.5, by name."""
        if self.metacentric_height_m == 0.0:
            return {}
        return {"period_s / (2 pi) with its damping": 1.0 / fastest_rate(self)}


def fastest_rate(roll: Roll) -> float:
    """Return the modulus [1/s] of the faster eigenvalue of small roll angles at the largest speed."""
    damping = roll.damping_ratio + FASTEST_FROUDE * roll.lift_damping_ratio
    over = math.sqrt(max(damping * damping - 1.0, 0.0))
    rate = 2.0 * math.pi * (1.0 if over == 0.0 else damping + over)
    return rate / roll.period_s if roll.period_s > 0.0 else sys.float_info.max


@compiled
def heeled_hull_forces(plant: Record, speed: Real, roll_angle: Real) -> tuple[Real, Real]:
    """Return Y [N] and N [N m] of the hull by its roll angle [rad], at the reference speed [m/s]."""
    force = 0.5 * plant.density * hull_area(plant) * speed * speed * roll_angle
    return force * plant.Y_phi, force * plant.length * plant.N_phi


@compiled
def slope_across(slope: Real, wave_along: Real, wave_across: Real, heading: Real) -> Real:
    """Return the slope of the surface to starboard of a ship [-], positive if it rises to starboard.

    ``slope`` is that along the wave travel, whose direction has the cosine ``wave_along`` and the sine
    ``wave_across`` to heading 0; the heading is in rad.
    """
    sine, cosine = sine_cosine(heading)
    return slope * (wave_across * cosine - wave_along * sine)


@compiled
def roll_acceleration(
    plant: Record,
    roll_angle: Real,
    roll_rate: Real,
    ahead: Real,
    lateral: Real,
    rudder_force: Real,
    slope: Real,
) -> Real:
    """Return the acceleration of the roll [rad/s2].

    Roll angle [rad] and rate [rad/s]; speed ahead through the water u [m/s]; lateral acceleration of the
    centre of gravity over ground [m/s2]; own side force of the rudder [N]; slope of the surface to
    starboard [-], which rolls the ship to port.
    """
    frequency = 2.0 * math.pi / plant.roll_period
    damping = plant.roll_damping
    damping = damping + plant.roll_lift_damping * modulus(ahead) / np.sqrt(GRAVITY * plant.length)
    deeper = plant.roll_rudder_depth - plant.roll_hull_depth
    lever = plant.roll_hull_depth * lateral + deeper * rudder_force / plant.displacement
    righting, _ = sine_cosine(roll_angle)
    moment = -lever / (GRAVITY * plant.metacentric_height) - righting
    moment = moment - plant.wave_slope_coefficient * slope
    damped = 2.0 * damping * frequency * roll_rate
    damped = damped + plant.roll_quadratic_damping * roll_rate * modulus(roll_rate)
    return frequency * frequency * moment - damped
