"""KT and KQ of a ship's propeller, whatever they come from, and the way back from KQ to J."""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled
from .open_water import invert_torque_coefficient, open_water, open_water_slope
from .open_water_table import invert_table, table_curve

POLYNOMIALS, FOUR_QUADRANT, NO_PROPELLER, TABLE = 0, 1, 2, 3
"""Codes of ``plant.propeller_model``. The polynomials are those of the B-series, or constants at bollard
pull; without a propeller they are 0.
"""


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


@compiled
def advance_ratio_of(
    plant: Record, torque_coefficient: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Advance ratio J at which the propeller has a KQ [-], and whether it lies on the falling branch.

    Args:
        plant: ship record.
        torque_coefficient: KQ [-] to be met.
        pitch_ratio: P/D [-].
        guess: start, for example the previous J.
    """
    if plant.propeller_model == TABLE:
        j, valid = invert_table(plant, torque_coefficient, pitch_ratio, guess)
    else:
        j, valid = invert_torque_coefficient(plant.kq, torque_coefficient, pitch_ratio, guess)
    return j, valid
