"""Open-water curves of the Wageningen B-series, and the loads of a propeller.

KT and KQ are polynomials in advance ratio J, pitch ratio P/D, expanded area ratio and blade count
(Oosterveld & van Oossanen 1975; coefficients as in Bernitsas, Ray & Kinley 1981, Re 2e6). For one
propeller the last two are constants, so each curve collapses to a 5 x 4 matrix in P/D and J.
"""

from __future__ import annotations

import functools
import math
from importlib import resources
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled, compiled_polynomial
from .four_quadrant import four_quadrant_coefficients

PITCH_POWERS = (0, 1, 2, 3, 6)  # the only ones that the B-series has
J_POWERS = 4
CURVE_SHAPE = (len(PITCH_POWERS), J_POWERS)

B_SERIES, FOUR_QUADRANT = 0, 1
"""Codes of ``plant.propeller_model``."""

MIN_ADVANCE_RATIO, MAX_ADVANCE_RATIO = -0.25, 1.6
"""Outside this range the polynomials run away; the curves are held at its edges.

KQ falls monotonically with J over the whole range for B5-90 at P/D 0.8 to 1.4 (to J 1.43 at P/D 0.6).
"""

_REVOLUTIONS_PER_RADIAN = 0.5 / math.pi
_MIN_REVOLUTIONS = 1e-3  # 1/s; keeps J finite at standstill, where thrust and torque vanish anyway
ATMOSPHERE, VAPOUR_PRESSURE, GRAVITY = 101325.0, 1671.0, 9.81  # Pa, Pa (15 degC), m/s2


@functools.cache
def _polynomials() -> pd.DataFrame:
    with resources.files("shaftline.plant").joinpath("data/b_series_polynomials.csv").open() as f:
        return pd.read_csv(f)


def b_series(curve: str, expanded_area_ratio: float, blades: int) -> NDArray[np.float64]:
    """Collapse a B-series polynomial for one propeller.

    Args:
        curve: ``"KT"`` or ``"KQ"``.
        expanded_area_ratio: EAR [-], 0.3 to 1.05.
        blades: number of blades Z [-], 2 to 7.

    Returns:
        Matrix of shape (5, 4): entry [k, i] multiplies (P/D)**PITCH_POWERS[k] J**i.

    Source: Bernitsas, Ray & Kinley 1981, eqs. (1) and (2).
    """
    matrix = np.zeros(CURVE_SHAPE)
    terms = _polynomials()
    for term in terms[terms["curve"] == curve].itertuples():
        matrix[PITCH_POWERS.index(term.pitch_ratio_power), term.j_power] += (
            term.coefficient
            * expanded_area_ratio**term.expanded_area_ratio_power
            * blades**term.blades_power
        )
    return matrix


def constant_coefficient(value: float) -> NDArray[np.float64]:
    """Matrix of a curve that depends on neither J nor P/D (a propeller at bollard pull)."""
    matrix = np.zeros(CURVE_SHAPE)
    matrix[0, 0] = value
    return matrix


@compiled
def clip(value: Real, low: float, high: float) -> Real:
    """Limit ``value`` to [low, high] by its real part, so that complex steps pass."""
    if value.real < low.real:
        return low
    if value.real > high.real:
        return high
    return value


@compiled_polynomial
def collapse_pitch(curve: NDArray[np.float64], pitch_ratio: Real) -> tuple[Real, Real, Real, Real]:
    """Coefficients of J**0 .. J**3 at one pitch ratio, by Horner in P/D."""
    p = pitch_ratio
    cube = p * p * p
    c0 = curve[4, 0] * cube + curve[3, 0]
    c1 = curve[4, 1] * cube + curve[3, 1]
    c2 = curve[4, 2] * cube + curve[3, 2]
    c3 = curve[4, 3] * cube + curve[3, 3]
    for k in range(2, -1, -1):
        c0 = c0 * p + curve[k, 0]
        c1 = c1 * p + curve[k, 1]
        c2 = c2 * p + curve[k, 2]
        c3 = c3 * p + curve[k, 3]
    return c0, c1, c2, c3


@compiled_polynomial
def open_water(curve: NDArray[np.float64], advance_ratio: Real, pitch_ratio: Real) -> Real:
    """KT or KQ [-] at advance ratio J and pitch ratio P/D."""
    c0, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    return ((c3 * advance_ratio + c2) * advance_ratio + c1) * advance_ratio + c0


@compiled_polynomial
def open_water_slope(curve: NDArray[np.float64], advance_ratio: Real, pitch_ratio: Real) -> Real:
    """D KT / d J or d KQ / d J [-]."""
    _, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    return (3.0 * c3 * advance_ratio + 2.0 * c2) * advance_ratio + c1


@compiled
def advance_ratio(advance_velocity: Real, shaft_speed: Real, diameter: float) -> Real:
    """J = 2 pi v_a / (omega D) [-] (thesis eq. 2-7), finite at standstill."""
    revolutions = shaft_speed * _REVOLUTIONS_PER_RADIAN
    if abs(revolutions.real) < _MIN_REVOLUTIONS:
        revolutions = _MIN_REVOLUTIONS
    return advance_velocity / (revolutions * diameter)


@compiled
def invert_torque_coefficient(
    curve: NDArray[np.float64], torque_coefficient: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Advance ratio J at which KQ(J, P/D) has a given value, by safeguarded Newton.

    Args:
        curve: KQ matrix of shape (5, 4).
        torque_coefficient: KQ [-] to be met.
        pitch_ratio: P/D [-].
        guess: start, for example the previous J.

    Returns:
        J [-] and whether it lies inside the curve's falling branch between J = 0 and the largest
        usable J. Outside, J is held at the edge; where the input is not finite, at the guess.
    """
    c0, c1, c2, c3 = collapse_pitch(curve, pitch_ratio)
    if not (math.isfinite(torque_coefficient) and math.isfinite(c0)):
        return guess, False
    # KQ falls until its derivative c1 + 2 c2 J + 3 c3 J^2 vanishes
    high = MAX_ADVANCE_RATIO
    discriminant = c2 * c2 - 3.0 * c3 * c1
    if c3 > 0.0 and discriminant > 0.0:
        high = min(high, (-c2 + math.sqrt(discriminant)) / (3.0 * c3))
    low = 0.0
    if torque_coefficient >= c0:
        return low, torque_coefficient == c0
    if torque_coefficient <= ((c3 * high + c2) * high + c1) * high + c0:
        return high, False
    j = min(max(guess, low), high)
    if not math.isfinite(j):
        j = 0.5 * (low + high)
    for _ in range(60):
        error = ((c3 * j + c2) * j + c1) * j + c0 - torque_coefficient
        if error > 0.0:
            low = j
        else:
            high = j
        slope = (3.0 * c3 * j + 2.0 * c2) * j + c1
        following = j - error / slope
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - j) <= 1e-14:
            return following, True
        j = following
    return j, True


@compiled
def cavitation_number(plant: Record, revolutions: Real, submergence: Real) -> Real:
    """Cavitation number by shaft speed, sigma_n = (p0 + rho g h - p_v) / (rho n^2 D^2 / 2) [-]."""
    pressure = ATMOSPHERE - VAPOUR_PRESSURE + plant.density * GRAVITY * submergence
    tip = 0.5 * plant.density * revolutions * revolutions * plant.diameter * plant.diameter
    return pressure / tip


@compiled
def cavitation_loss(plant: Record, revolutions: Real, submergence: Real) -> Real:
    """Fraction of thrust lost to cavitation breakdown [-], 0 where ``cavitation_breakdown`` is 0.

    Grows linearly as the cavitation number falls below the onset.
    """
    number = cavitation_number(plant, revolutions, submergence)
    deficit = 1.0 - number / plant.cavitation_onset_number
    return plant.cavitation_breakdown * clip(deficit, 0.0, 1.0)


class PropellerLoad(NamedTuple):
    """Open-water thrust T [N] and torque Q [N m] of one propeller; KT [-] before ventilation."""

    thrust: Real
    torque: Real
    thrust_coefficient: Real


@compiled
def propeller_load(
    plant: Record,
    advance_velocity: Real,
    shaft_speed: Real,
    pitch_ratio: Real,
    submergence: Real,
    ventilation: Real,
) -> PropellerLoad:
    """Thrust and torque of one propeller (thesis eqs. 2-3 and 2-4), with its optional losses.

    Args:
        plant: ship record.
        advance_velocity: v_a [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        submergence: depth of the propeller's centre below the surface [m].
        ventilation: degree of ventilation, 0 (none) to 1 (full).

    The polynomials know ahead rotation only; astern their coefficients act with n |n|, so thrust and
    torque turn round with the shaft (four quadrants have curves of their own), times
    ``astern_load_fraction``: blades whose sections are made for one direction load less in the other.

    Roughness uses the ITTC-1978 scale corrections with the added blade drag Delta C_D:
    Delta KT = -0.3 (P/D) (c Z / D) Delta C_D and Delta KQ = 0.25 (c Z / D) Delta C_D.
    """
    n = shaft_speed * _REVOLUTIONS_PER_RADIAN
    n2 = n * n if n.real >= 0.0 else -n * n
    if plant.propeller_model == FOUR_QUADRANT:
        kt_n2, kq_n2 = four_quadrant_coefficients(
            plant.four_quadrant,
            plant.four_quadrant_pitch,
            advance_velocity / plant.diameter,
            n,
            pitch_ratio,
        )
    else:
        j = clip(
            advance_ratio(advance_velocity, shaft_speed, plant.diameter),
            MIN_ADVANCE_RATIO,
            MAX_ADVANCE_RATIO,
        )
        kt_n2 = open_water(plant.kt, j, pitch_ratio) * n2
        kq_n2 = open_water(plant.kq, j, pitch_ratio) * n2
    if plant.propeller_roughness > 0.0:
        drag = plant.propeller_roughness * plant.blade_solidity * n2
        kt_n2 = kt_n2 - 0.3 * pitch_ratio * drag
        kq_n2 = kq_n2 + 0.25 * drag
    deep_kt = kt_n2 / (n * n + _MIN_REVOLUTIONS * _MIN_REVOLUTIONS)
    if plant.cavitation_breakdown > 0.0:
        loss = cavitation_loss(plant, n, submergence)
        kt_n2 = kt_n2 * (1.0 - loss)
        kq_n2 = kq_n2 * (1.0 - loss * plant.cavitation_torque_share)
    if n.real < 0.0:
        kt_n2 = kt_n2 * plant.astern_load_fraction
        kq_n2 = kq_n2 * plant.astern_load_fraction
    kt_n2 = kt_n2 * (1.0 - ventilation * plant.ventilation_thrust_loss)
    kq_n2 = kq_n2 * (1.0 - ventilation * plant.ventilation_torque_loss)
    force = plant.density * plant.diameter**4
    return PropellerLoad(force * kt_n2, force * plant.diameter * kq_n2, deep_kt)
