"""Manoeuvring: surge, sway and yaw of the hull, and the effect of drift and yaw on the wake.

Equations of the MMG (Yasukawa & Yoshimura 2015, eqs. 3 to 14), origin at midship, x ahead, y and rate
of turn r positive to starboard:

    (m + m_x) du/dt - (m + m_y) v r - m x_G r^2 = X
    (m + m_y) dv/dt + (m x_G - Y_rdot) dr/dt + (m + m_x) u r = Y
    (I_z + J_z) dr/dt + (m x_G - N_vdot) dv/dt + m x_G u r = N

with u, v through the water. Taylor (2000, Table 3.2) and Abkowitz include the centripetal force in Y_r:
their Y_r equals this Y_r minus m_x. A ship without a ``length_m`` here moves in surge only.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled
from ..core.numeric import modulus
from .keys import Section, effect, parameter, require
from .kinematics import current_met

WITH = "with a manoeuvring.length_m"

LARGEST_RATE = 1.5
"""Largest r L / U for which U is the speed of the ship. Beyond it U is raised so that r L / U keeps this
value, so that the rate of turn damps a ship that turns on the spot."""


def derivative(name: str, meaning: str, default: float = 0.0, **limits: Any) -> Any:
    """Declare a dimensionless hydrodynamic derivative."""
    return parameter(meaning, record=name, needs="turns", default=default, **limits)


def _needed(name: str, meaning: str, **limits: Any) -> Any:
    return derivative(name, meaning, required=WITH, **limits)


class Manoeuvring(Section):
    """Sway and yaw: hydrodynamic derivatives of the hull without rudder."""

    derived = (("turns", np.int64), ("by_length_squared", np.int64))

    # fmt: off
    length_m: float = parameter("length L between perpendiculars; 0: no sway and yaw", "m",
        record="length", ge=0, le=500, default=0.0)
    draught_m: float = parameter("draught d", "m", record="draught", needs="turns", required=WITH, gt=0,
        le=40, default=1.0)
    normalised_by: Literal["length-draught", "length-squared"] = Field(default="length-draught",
        description="reference area of the derivatives: L d (MMG) or L^2 (SNAME's first prime system)")
    displacement_kg: float = parameter("displacement m, without added mass", "kg", record="displacement",
        needs="turns", required=WITH, gt=0, le=1e9, default=1.0)
    centre_of_gravity_m: float = parameter("x_G, position of the centre of gravity, forward of midship",
        "m", record="centre_of_gravity", needs="turns", ge=-250, le=250, default=0.0)
    radius_of_gyration_m: float = parameter("radius of gyration in yaw, about the centre of gravity",
        "m", record="radius_of_gyration", needs="turns", required=WITH, gt=0, le=250, default=1.0)
    Y_vdot: float = _needed("Y_vdot", "Y by dv/dt, the added mass -m_y", le=0)
    Y_rdot: float = derivative("Y_rdot", "Y by dr/dt")
    N_vdot: float = derivative("N_vdot", "N by dv/dt")
    N_rdot: float = _needed("N_rdot", "N by dr/dt, the added moment of inertia -J_z", le=0)
    Y_v: float = _needed("Y_v", "Y by v", lt=0, default=-1.0)
    Y_r: float = _needed("Y_r", "Y by r, without the centripetal force")
    N_v: float = _needed("N_v", "N by v")
    N_r: float = _needed("N_r", "N by r, without the centripetal force", lt=0, default=-1.0)
    X_vv: float = derivative("X_vv", "X by v^2")
    X_vr: float = derivative("X_vr", "X by v r, without the centripetal force")
    X_rr: float = derivative("X_rr", "X by r^2")
    X_vvvv: float = derivative("X_vvvv", "X by v^4")
    Y_vv: float = derivative("Y_vv", "Y by v |v|")
    Y_rr: float = derivative("Y_rr", "Y by r |r|")
    Y_vvv: float = derivative("Y_vvv", "Y by v^3")
    Y_vvr: float = derivative("Y_vvr", "Y by v^2 r")
    Y_vrr: float = derivative("Y_vrr", "Y by v r^2")
    Y_rrr: float = derivative("Y_rrr", "Y by r^3")
    N_vv: float = derivative("N_vv", "N by v |v|")
    N_rr: float = derivative("N_rr", "N by r |r|")
    N_vvv: float = derivative("N_vvv", "N by v^3")
    N_vvr: float = derivative("N_vvr", "N by v^2 r")
    N_vrr: float = derivative("N_vrr", "N by v r^2")
    N_rrr: float = derivative("N_rrr", "N by r^3")
    propeller_position_m: float = parameter("x_P, position of the propeller, forward of midship", "m",
        record="propeller_position", needs="turns has_propeller", ge=-250, le=0, default=0.0)
    wake_drift_rate: float = effect(0.0, "C_1: rate at which the wake fades with drift at the propeller",
        record="wake_drift_rate", needs="turns has_propeller", ge=0, le=50)
    wake_drift_gain_port: float = effect(1.0,
        "C_2: inflow at large drift to port / inflow on a straight course",
        record="wake_drift_gain_port", needs="turns has_propeller", ge=0.2, le=4)
    wake_drift_gain_starboard: float = effect(1.0, "C_2 at large drift to starboard",
        record="wake_drift_gain_starboard", needs="turns has_propeller", ge=0.2, le=4)
    cross_current_m_s: float = effect(0.0, "current across the initial course, positive to starboard",
        "m/s", record="cross_current", needs="turns", ge=-5, le=5)
    # fmt: on

    @model_validator(mode="after")
    def _complete(self) -> Manoeuvring:
        if self.length_m > 0.0:
            needed = (
                "draught_m",
                "displacement_kg",
                "radius_of_gyration_m",
                "Y_vdot",
                "N_rdot",
                "Y_v",
                "Y_r",
                "N_v",
                "N_r",
            )
            require(self, needed, WITH)
        return self

    def fill(self, record: Any) -> None:
        """Write the parameters, the flag of a ship with sway and yaw, and the reference area."""
        super().fill(record)
        record["turns"] = self.length_m > 0.0
        record["by_length_squared"] = self.normalised_by == "length-squared"


@compiled
def through_water(plant: Record, ahead: Real, across: Real, heading: Real) -> tuple[Real, Real]:
    """Return the velocity through the water [m/s] ahead and to starboard, from that over ground."""
    current_ahead, current_across = current_met(plant, heading)
    return ahead - current_ahead, across - current_across


@compiled
def reference_speed(plant: Record, ahead: Real, across: Real, yaw_rate: Real) -> Real:
    """Return the reference speed U [m/s] of the derivatives; see :data:`LARGEST_RATE`."""
    speed = np.sqrt(ahead * ahead + across * across + 1e-12)
    turning = modulus(yaw_rate) * plant.length * (1.0 / LARGEST_RATE)
    return turning if turning.real > speed.real else speed


@compiled
def hull_area(plant: Record) -> Real:
    """Return the reference area [m2] of the derivatives."""
    return plant.length * (plant.length if plant.by_length_squared != 0 else plant.draught)


@compiled
def hull_forces(
    plant: Record, speed: Real, across: Real, yaw_rate: Real
) -> tuple[Real, Real, Real]:
    """Return X [N], Y [N] and N [N m] of the hull in drift and yaw (eqs. 8 and 9), without resistance.

    ``speed`` [m/s] is :func:`reference_speed`; v [m/s] is through the water, r in rad/s.
    """
    slowness = 1.0 / speed
    v, r = across * slowness, yaw_rate * plant.length * slowness
    vv, vr, rr = v * v, v * r, r * r
    v_v, r_r = v * modulus(v), r * modulus(r)
    force = 0.5 * plant.density * hull_area(plant) * speed * speed
    surge = plant.X_vv * vv + plant.X_vr * vr + plant.X_rr * rr + plant.X_vvvv * vv * vv
    side = plant.Y_v * v + plant.Y_r * r + plant.Y_vv * v_v + plant.Y_rr * r_r
    side = side + (plant.Y_vvv * vv + plant.Y_vvr * vr + plant.Y_vrr * rr) * v
    side = side + plant.Y_rrr * rr * r
    turn = plant.N_v * v + plant.N_r * r + plant.N_vv * v_v + plant.N_rr * r_r
    turn = turn + (plant.N_vvv * vv + plant.N_vvr * vr + plant.N_vrr * rr) * v
    turn = turn + plant.N_rrr * rr * r
    return force * surge, force * side, force * plant.length * turn


@compiled
def drift_inflow(plant: Record, speed: Real, across: Real, yaw_rate: Real) -> Real:
    """Return the inflow of the propeller in drift and yaw over that on a straight course [-] (eq. 20).

    The drift angle at the propeller is approximated by its sine, the cross flow there over the speed.
    The arguments are those of :func:`hull_forces`.
    """
    if plant.wake_drift_rate == 0.0:
        return 1.0
    cross_flow = across + plant.propeller_position * yaw_rate
    drift = -cross_flow / speed
    gain = plant.wake_drift_gain_starboard
    if drift.real > 0.0:
        gain = plant.wake_drift_gain_port
    return 1.0 + (1.0 - np.exp(-plant.wake_drift_rate * modulus(drift))) * (gain - 1.0)


@compiled
def planar_inertia(plant: Record) -> tuple[Real, Real, Real, Real]:
    """Return the inertia matrix of sway and yaw: sway [kg], two coupling terms [kg m], yaw [kg m2]."""
    scale = 0.5 * plant.density * hull_area(plant) * plant.length
    off_centre = plant.displacement * plant.centre_of_gravity
    gyration = plant.radius_of_gyration**2 + plant.centre_of_gravity**2
    return (
        plant.displacement - plant.Y_vdot * scale,
        off_centre - plant.Y_rdot * scale * plant.length,
        off_centre - plant.N_vdot * scale * plant.length,
        plant.displacement * gyration - plant.N_rdot * scale * plant.length**2,
    )


@compiled
def planar_acceleration(
    plant: Record,
    ahead: Real,
    across: Real,
    yaw_rate: Real,
    heading: Real,
    surge: Real,
    side: Real,
    moment: Real,
) -> tuple[Real, Real, Real]:
    """Return the accelerations over ground in surge and sway [m/s2] and in yaw [rad/s2].

    u and v [m/s] are through the water, r in rad/s, the heading in rad; X [N] includes thrust and
    resistance, with Y [N] and N [N m]. The record's ``mass`` is m + m_x.
    """
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(plant)
    off_centre = plant.displacement * plant.centre_of_gravity
    surge = surge + (sway * across + off_centre * yaw_rate) * yaw_rate
    side = side - plant.mass * ahead * yaw_rate
    moment = moment - off_centre * ahead * yaw_rate
    share = 1.0 / (sway * yaw - sway_yaw * yaw_sway)
    current_ahead, current_across = current_met(plant, heading)
    # The current is constant over ground, not relative to the turning ship.
    return (
        surge * (1.0 / plant.mass) + yaw_rate * current_across,
        (yaw * side - sway_yaw * moment) * share - yaw_rate * current_ahead,
        (sway * moment - yaw_sway * side) * share,
    )
