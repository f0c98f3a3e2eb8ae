"""Cavitation: thrust loading against Burrill's line of 5 % back cavitation.

Burrill & Emerson (1963) draw the thrust loading tau_c of the projected blade area at which a given
share of the blades' backs cavitates, over the cavitation number sigma at 0.7 R. Their chart has no
printed formula; the power curve below is the one that designers commonly use for its 5 % line.
"""

from __future__ import annotations

import math

from ..core.compiled import Real, Record, compiled
from ..core.numeric import clip
from .surroundings import ATMOSPHERE, GRAVITY, VAPOUR_PRESSURE

LINE_FACTOR, LINE_OFFSET, LINE_EXPONENT = 0.28, 0.03, 0.57
"""tau_limit = 0.28 (sigma - 0.03)^0.57 for 5 % back cavitation."""

LOWEST_SIGMA, HIGHEST_SIGMA = 0.1, 2.0
"""Range of the chart's sigma; outside, the line is held at its ends."""

_AT_REST = 1e-6  # m2/s2; below it, nothing moves that could cavitate


@compiled
def burrill_limit(sigma: Real) -> Real:
    """Thrust loading tau_c [-] of 5 % back cavitation at a cavitation number sigma_0.7R [-]."""
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
    """Thrust loading over Burrill's 5 % limit, tau_c / tau_limit [-]; above 1 more than 5 % cavitates.

    Args:
        plant: ship record.
        thrust: T of one propeller [N]; astern or windmilling thrust counts as none.
        advance_velocity: v_a [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-], for the projected area A_P = A_E (1.067 - 0.229 P/D).
        submergence: depth of the propeller's centre [m].
    """
    around = 0.35 * plant.diameter * shaft_speed  # 0.7 pi n D
    square = advance_velocity * advance_velocity + around * around
    if square.real < _AT_REST or thrust.real <= 0.0:
        return 0.0
    dynamic = 0.5 * plant.density * square
    pressure = ATMOSPHERE - VAPOUR_PRESSURE + plant.density * GRAVITY * submergence
    expanded = plant.expanded_area_ratio * (0.25 * math.pi) * plant.diameter * plant.diameter
    projected = expanded * (1.067 - 0.229 * pitch_ratio)
    return thrust / (dynamic * projected) / burrill_limit(pressure / dynamic)
