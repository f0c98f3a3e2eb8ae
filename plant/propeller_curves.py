"""KT and KQ of a ship's propeller, whatever they come from, and the way back from KQ to J.

KT and KQ over J are those of a shaft that turns ahead with the inflow. A four-quadrant propeller has
curves for all else too; of a shaft that turns astern J and KQ are those in the direction of rotation.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.numeric import begun_between, newton_step
from .four_quadrant import PITCH_NODES, between_nodes, four_quadrant_coefficients
from .open_water import (
    MIN_REVOLUTIONS,
    REVOLUTIONS_PER_RADIAN,
    invert_torque_coefficient,
    open_water,
    open_water_slope,
)
from .open_water_table import invert_table, table_curve
from .validity import Validity

POLYNOMIALS, FOUR_QUADRANT, NO_PROPELLER, TABLE = 0, 1, 2, 3
"""Codes of ``plant.propeller_model``. The polynomials are those of the B-series, or constants at bollard
pull; without a propeller they are 0.
"""


_UNUSED = (-math.inf, math.inf)


def _is_bollard(plant: Any) -> bool:
    """Return whether KT and KQ are constants, which were measured at rest in both directions."""
    curves = np.stack([plant["kt"], plant["kq"]])
    curves[:, 0, 0] = 0.0
    return bool(plant["propeller_model"] == POLYNOMIALS and not curves.any())


def _advance_ratio(plant: Any, samples: NDArray[Any]) -> NDArray[np.float64]:
    turns = samples["shaft_speed"] * REVOLUTIONS_PER_RADIAN
    apart = np.where(turns < 0.0, np.nan, np.maximum(turns, MIN_REVOLUTIONS))
    return np.asarray(samples["advance_velocity"] / (apart * plant["diameter"]))


def _advance_ratios(plant: Any) -> tuple[float, float]:
    if plant["propeller_model"] in (FOUR_QUADRANT, NO_PROPELLER):
        return _UNUSED
    if _is_bollard(plant):
        return 0.0, 0.0
    return float(plant["advance_ratio_min"]), float(plant["advance_ratio_max"])


def _shaft_speeds(plant: Any) -> tuple[float, float]:
    any_way = plant["propeller_model"] in (FOUR_QUADRANT, NO_PROPELLER) or _is_bollard(plant)
    return _UNUSED if any_way else (0.0, math.inf)


def _pitch_ratios(plant: Any) -> tuple[float, float]:
    series = plant["propeller_model"] == FOUR_QUADRANT or (
        plant["propeller_model"] == POLYNOMIALS and not _is_bollard(plant)
    )
    return (PITCH_NODES[0], PITCH_NODES[-1]) if series else _UNUSED


VALIDITY = (
    Validity(
        "the propeller's advance ratio J", "-", _advance_ratio, _advance_ratios,
        "KT and KQ are held at the edges of the range, so a shaft at rest in the flow meets no force",
    ),
    Validity(
        "the propeller's shaft speed", "rad/s", lambda _, samples: samples["shaft_speed"],
        _shaft_speeds, "astern the curves of ahead rotation act with n |n|, no measured ones",
    ),
    Validity(
        "the blades' pitch ratio P/D", "-", lambda _, samples: samples["pitch_ratio"], _pitch_ratios,
        "the B-series was tested in the range; outside its polynomials are continued, its "
        "four-quadrant curves held",
    ),
)  # fmt: skip
"""Ranges of the open-water curves. The series' pitch is that of Oosterveld & van Oossanen (1975)."""


@compiled
def thrust_coefficient(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """KT [-] at advance ratio J and pitch ratio P/D, ahead."""
    if plant.propeller_model == TABLE:
        value = table_curve(plant, plant.table_kt, advance_ratio, pitch_ratio)[0]
    else:
        value = open_water(plant.kt, advance_ratio, pitch_ratio)
    return value


@compiled
def torque_coefficient(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """KQ [-] at advance ratio J and pitch ratio P/D, ahead."""
    if plant.propeller_model == TABLE:
        value = table_curve(plant, plant.table_kq, advance_ratio, pitch_ratio)[0]
    else:
        value = open_water(plant.kq, advance_ratio, pitch_ratio)
    return value


@compiled
def torque_coefficient_slope(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """D KQ / d J [-]."""
    if plant.propeller_model == TABLE:
        slope = table_curve(plant, plant.table_kq, advance_ratio, pitch_ratio)[1]
    else:
        slope = open_water_slope(plant.kq, advance_ratio, pitch_ratio)
    return slope


_STEP = 1e-30  # of the complex step

FOLD_MARGIN = 0.05
"""Share of KQ by which it must differ from the ends of the ring vortex's fold to be told from them."""


@compiled_apart
def torque_in_any_quadrant(
    plant: Record, velocity_per_diameter: Real, revolutions: Real, pitch_ratio: Real
) -> Real:
    """KQ n |n| [1/s2] by the ship's four-quadrant curves, with ``astern_load_fraction``.

    Args:
        plant: ship record.
        velocity_per_diameter: v_a / D [1/s].
        revolutions: n [1/s], either sign.
        pitch_ratio: P/D [-].
    """
    _, torque = four_quadrant_coefficients(
        plant.four_quadrant,
        plant.four_quadrant_pitch,
        velocity_per_diameter,
        revolutions,
        pitch_ratio,
    )
    return torque if revolutions.real >= 0.0 else torque * plant.astern_load_fraction


@compiled_apart
def coefficients_along(
    plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float
) -> tuple[Real, Real]:
    """KT = T / (rho n |n| D^4) and KQ = Q / (rho n |n| D^5) [-], turning ahead (1) or astern (-1).

    Args:
        plant: ship record; four-quadrant curves alone know a shaft that turns astern.
        advance_ratio: J = v_a / (n D) [-].
        pitch_ratio: P/D [-].
        direction: of rotation.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        thrust, torque = four_quadrant_coefficients(
            plant.four_quadrant,
            plant.four_quadrant_pitch,
            direction * advance_ratio,
            direction,
            pitch_ratio,
        )
        share = 1.0 if direction > 0.0 else plant.astern_load_fraction
        return direction * share * thrust, direction * share * torque
    kt = thrust_coefficient(plant, advance_ratio, pitch_ratio)
    return kt, torque_coefficient(plant, advance_ratio, pitch_ratio)


@compiled
def _along(plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float) -> Real:
    return coefficients_along(plant, advance_ratio, pitch_ratio, direction)[1]


@compiled
def _fold(plant: Record, pitch_ratio: float, direction: float) -> tuple[float, float]:
    """J [-] of the ring vortex's dip and peak."""
    i, weight = between_nodes(plant.four_quadrant_pitch, pitch_ratio)
    ends = plant.ring_vortex[0 if direction > 0.0 else 1]
    low, high = ends[i], ends[i + 1]
    return low[0] + weight * (high[0] - low[0]), low[1] + weight * (high[1] - low[1])


@compiled_apart
def outside_ring_vortex(
    plant: Record, advance_ratio: float, pitch_ratio: float, direction: float, known: bool
) -> bool:
    """Whether a shaft that turns with the inflow can be told from one that turns against it.

    Args:
        plant: ship record, of a four-quadrant propeller.
        advance_ratio: J = v_a / (n D) [-], as estimated.
        pitch_ratio: P/D [-].
        direction: 1 where the shaft turns ahead, -1 astern.
        known: whether it could be told shortly before.

    Against the inflow (J < 0) the flow is a ring vortex, unsteady and of no use for an estimate:
    zone 1 of Pivano et al. 2008, section 4.1. The torques of its fold are those of moderate J too: who
    comes from there may trust them up to the fold's peak, who does not must wait for one below its dip.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    if not advance_ratio >= max(peak, 0.0):
        return False
    end = _along(plant, peak if known else dip, pitch_ratio, direction)
    here = _along(plant, advance_ratio, pitch_ratio, direction)
    return bool(here < (1.0 - FOLD_MARGIN) * end)


@compiled_apart
def _invert_four_quadrants(
    plant: Record, torque_coefficient: float, pitch_ratio: float, guess: float, direction: float
) -> tuple[float, bool]:
    """J at which the four-quadrant curve has a KQ, on the falling branch nearest to the guess.

    A KQ beyond those of the fold lies on one branch alone, which is then taken, whatever the guess. In
    between, it is held at the branch's end where the branch does not reach it.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    least = _along(plant, dip, pitch_ratio, direction)
    most = _along(plant, peak, pitch_ratio, direction)
    if not (math.isfinite(torque_coefficient) and math.isfinite(most)):
        return guess, False
    if not math.isfinite(guess):
        guess = 0.0
    with_inflow = guess > 0.5 * (dip + peak)
    if torque_coefficient > (1.0 + FOLD_MARGIN) * most:
        with_inflow = False
    if torque_coefficient < (1.0 - FOLD_MARGIN) * least:
        with_inflow = True
    if with_inflow and torque_coefficient >= most:
        return peak, False
    if not with_inflow and torque_coefficient <= least:
        return dip, False
    # the branches have no other end: double the bound until it lies beyond
    low, high = peak, max(guess, 1.0)
    if not with_inflow:
        low, high = min(guess, -1.0), dip
    for _ in range(60):
        if with_inflow and _along(plant, high, pitch_ratio, direction) > torque_coefficient:
            low, high = high, 2.0 * high
        elif not with_inflow and _along(plant, low, pitch_ratio, direction) < torque_coefficient:
            low, high = 2.0 * low, low
        else:
            break
    j = begun_between(guess, low, high)
    for _ in range(60):
        value = _along(plant, j + 1j * _STEP, pitch_ratio, direction)
        error, slope = value.real - torque_coefficient, value.imag / _STEP
        following, low, high = newton_step(j, error, slope, low, high)
        if abs(following - j) <= 1e-14 * max(1.0, abs(j)):
            break
        j = following
    return following, following >= 0.0


@compiled
def advance_ratio_of(
    plant: Record,
    torque_coefficient: float,
    pitch_ratio: float,
    guess: float,
    direction: float = 1.0,
) -> tuple[float, bool]:
    """Advance ratio J = v_a / (n D) at which the propeller has a KQ [-], and whether to trust it.

    Args:
        plant: ship record.
        torque_coefficient: KQ = Q / (rho n |n| D^5) [-] to be met.
        pitch_ratio: P/D [-].
        guess: start, for example the previous J; of a four-quadrant curve it also chooses the branch.
        direction: 1 where the shaft turns ahead; -1 astern, which four-quadrant curves alone know.

    To be trusted it must lie on the falling branch from J = 0 on.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        j, valid = _invert_four_quadrants(plant, torque_coefficient, pitch_ratio, guess, direction)
    elif plant.propeller_model == TABLE:
        j, valid = invert_table(plant, torque_coefficient, pitch_ratio, guess)
    else:
        j, valid = invert_torque_coefficient(plant.kq, torque_coefficient, pitch_ratio, guess)
    return j, valid
