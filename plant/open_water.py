"""Open-water curves of the Wageningen B-series.

KT and KQ are polynomials in advance ratio J, pitch ratio P/D, expanded area ratio and blade count
(Oosterveld & van Oossanen 1975; coefficients as in Bernitsas, Ray & Kinley 1981, Re 2e6). For one
propeller the last two are constants, so each curve collapses to a 5 x 4 matrix in P/D and J.
"""

from __future__ import annotations

import functools
import math
from importlib import resources

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Real, compiled, compiled_polynomial
from ..core.numeric import begun_between, newton_step

PITCH_POWERS = (0, 1, 2, 3, 6)  # the only ones that the B-series has
J_POWERS = 4
CURVE_SHAPE = (len(PITCH_POWERS), J_POWERS)

MIN_ADVANCE_RATIO, MAX_ADVANCE_RATIO = -0.25, 1.6
"""Outside this range the polynomials run away; the curves are held at its edges.

KQ falls monotonically with J over the whole range for B5-90 at P/D 0.8 to 1.4 (to J 1.43 at P/D 0.6).
"""

REVOLUTIONS_PER_RADIAN = 0.5 / math.pi
MIN_REVOLUTIONS = 1e-3  # 1/s; keeps J finite at standstill, where thrust and torque vanish anyway


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
    revolutions = shaft_speed * REVOLUTIONS_PER_RADIAN
    if abs(revolutions.real) < MIN_REVOLUTIONS:
        revolutions = MIN_REVOLUTIONS
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
    j = begun_between(guess, low, high)
    for _ in range(60):
        error = ((c3 * j + c2) * j + c1) * j + c0 - torque_coefficient
        slope = (3.0 * c3 * j + 2.0 * c2) * j + c1
        following, low, high = newton_step(j, error, slope, low, high)
        if abs(following - j) <= 1e-14:
            return following, True
        j = following
    return j, True
