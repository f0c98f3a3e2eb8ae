"""Cavitation: thrust loading relative to Burrill's line, and angle of attack relative to the bucket.

Burrill & Emerson (1963) plot the thrust loading tau_c of the projected blade area at which a given
share of the back of the blades cavitates, over the cavitation number sigma at 0.7 R. Their chart has no
printed formula; the power curve below is the one that designers commonly use for its 5 % line.

A propeller in waves or during acceleration can cavitate well below this loading. Vrijdag, de Jong and
van Nuland (2013) therefore keep the effective angle of attack of the section at 0.7 R inside the
cavitation bucket: the range of angles without sheet cavitation, which narrows as the cavitation number
falls.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.compiled import Real, Record, compiled
from ..core.numeric import clip
from .keys import INF, Section, parameter
from .open_water import REVOLUTIONS_PER_RADIAN
from .propeller import cavitation_number
from .surroundings import static_pressure

LINE_FACTOR, LINE_OFFSET, LINE_EXPONENT = 0.28, 0.03, 0.57
"""tau_limit = 0.28 (sigma - 0.03)^0.57 for 5 % back cavitation."""

LOWEST_SIGMA, HIGHEST_SIGMA = 0.1, 2.0
"""Range of sigma in the chart; outside it, the line is held constant."""

_AT_REST = 1e-6  # m2/s2; below it the flow is too slow for cavitation


@compiled
def burrill_limit(sigma: Real) -> Real:
    """Return the thrust loading tau_c [-] of 5 % back cavitation at a number sigma_0.7R [-]."""
    held = clip(sigma, LOWEST_SIGMA, HIGHEST_SIGMA)
    return LINE_FACTOR * (held - LINE_OFFSET) ** LINE_EXPONENT


@compiled
def burrill_ratio(
    plant: Record,
    thrust: Real,
    advance_velocity: Real,
    shaft_speed: Real,
    pitch_ratio: Real,
    submergence: Real,
) -> Real:
    """Return the thrust loading over Burrill's 5 % limit, tau_c / tau_limit [-]; 0 for a thrust below 0.

    Above 1, more than 5 % of the back of the blades cavitates. ``thrust`` [N] is that of one propeller
    at v_a [m/s], omega [rad/s] and the depth [m] of its centre; P/D gives the projected area A_P = A_E
    (1.067 - 0.229 P/D).
    """
    around = 0.35 * plant.diameter * shaft_speed  # 0.7 pi n D
    square = advance_velocity * advance_velocity + around * around
    if square.real < _AT_REST or thrust.real <= 0.0:
        return 0.0
    dynamic = 0.5 * plant.density * square
    pressure = static_pressure(plant, submergence)
    expanded = plant.expanded_area_ratio * (0.25 * math.pi) * plant.diameter * plant.diameter
    projected = expanded * (1.067 - 0.229 * pitch_ratio)
    return thrust / (dynamic * projected) / burrill_limit(pressure / dynamic)


class CavitationBucket(Section):
    """Cavitation bucket: angles of attack without sheet cavitation; infinitely wide by default."""

    needs = "has_propeller in_water"

    # fmt: off
    pitch_factor: float = parameter("c1: effective pitch angle / geometric pitch angle",
        record="attack_pitch_factor", gt=0, le=2, default=1.0)
    inflow_factor: float = parameter("c2: inflow at the section / v_a", record="attack_inflow_factor",
        gt=0, le=2, default=1.0)
    centre_deg: float = parameter("centre of the bucket: angle of attack to which it narrows", "deg",
        record="bucket_centre", ge=-10, le=20, default=0.0)
    suction_deg: float = parameter("width to the suction side per unit of sigma_n", "deg",
        record="bucket_suction", gt=0, default=INF)
    pressure_deg: float = parameter("width to the pressure side per unit of sigma_n", "deg",
        record="bucket_pressure", gt=0, default=INF)
    # fmt: on


@compiled
def effective_attack(
    plant: Record, advance_velocity: Real, shaft_speed: Real, pitch_ratio: Real
) -> Real:
    """Return the effective angle of attack [deg] of the section at 0.7 R (Vrijdag et al. 2013, eq. 1).

    alpha = c1 arctan(P/D / (0.7 pi)) - arctan(c2 v_a / (0.7 pi n D)); 0 unless the shaft turns ahead.
    """
    if shaft_speed.real <= 0.0:
        return 0.0
    around = 0.35 * plant.diameter * shaft_speed  # 0.7 pi n D
    pitch_angle = np.arctan(pitch_ratio / (0.7 * math.pi))
    inflow_angle = np.arctan(plant.attack_inflow_factor * advance_velocity / around)
    return (plant.attack_pitch_factor * pitch_angle - inflow_angle) * (180.0 / math.pi)


@compiled
def outside_bucket(plant: Record, attack: Real, shaft_speed: Real, submergence: Real) -> Real:
    """Return the distance [deg] of an angle of attack from the cavitation bucket; 0 inside it.

    ``attack`` [deg] is :func:`effective_attack`; shaft speed in rad/s, depth of the propeller's centre
    in m.
    """
    revolutions = shaft_speed * REVOLUTIONS_PER_RADIAN
    turns = (revolutions * plant.diameter) ** 2 >= _AT_REST
    if min(plant.bucket_suction, plant.bucket_pressure) == math.inf or not turns:
        return 0.0
    sigma = max(cavitation_number(plant, revolutions, submergence), 0.0)
    beyond = attack - plant.bucket_centre
    return max(beyond - plant.bucket_suction * sigma, -beyond - plant.bucket_pressure * sigma, 0.0)
