"""Emissions of a diesel engine: NOx by a map over speed and torque, CO2 by the carbon in the fuel.

The specific emission of NOx is a polynomial in relative torque m = M_b / M_r and relative speed
s = omega_e / omega_r, with the rated torque M_r = N_r / omega_r:

    NOx / (base P) = m0_s0 + m1_s0 m + m0_s1 s + m2_s0 m^2 + m1_s1 m s + m0_s2 s^2

P is the brake power, omega_r the highest speed and N_r the reference power of the fuel surface. An
engine that delivers no power emits no NOx here. CO2 is the fuel flow times a factor of the fuel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.compiled import Real, Record, compiled
from .fuel import fuel_rate
from .keys import Section, parameter

CO2_FACTORS = {"MDO": 3.206, "MGO": 3.206, "LFO": 3.151, "HFO": 3.114}
"""CO2 over fuel by mass, the factor C_F of IMO resolutions MEPC.308(73) and MEPC.364(79) [kg/kg]."""

_G_PER_J = 1.0 / 3.6e6  # 1 g/kWh


def _coefficient(record: str, term: str, default: float = 0.0) -> Any:
    about = f"coefficient of {term} in the NOx map"
    return parameter(about, record=record, ge=-1e3, le=1e3, default=default)


class Emissions(Section):
    """Emissions of a diesel: NOx map and CO2 factor; none of them by default."""

    needs = "has_diesel"

    # fmt: off
    nox_base_g_kWh: float = parameter("specific emission of NOx that scales the map; 0: no NOx map",
        "g/kWh", record="nox_base", ge=0, le=100, default=0.0)
    nox_m0_s0: float = _coefficient("nox_m0_s0", "1", 1.0)
    nox_m1_s0: float = _coefficient("nox_m1_s0", "m")
    nox_m0_s1: float = _coefficient("nox_m0_s1", "s")
    nox_m2_s0: float = _coefficient("nox_m2_s0", "m^2")
    nox_m1_s1: float = _coefficient("nox_m1_s1", "m s")
    nox_m0_s2: float = _coefficient("nox_m0_s2", "s^2")
    co2_factor: float = parameter("CO2 / fuel by mass, such as 3.206 for MDO and MGO; 0: no CO2",
        "kg/kg", record="co2_factor", ge=0, le=4, default=0.0)
    # fmt: on

    def check(self, fuel_base: float) -> None:
        """Refuse a CO2 factor for an engine without a fuel model, with a ValueError.

        The base consumption ``fuel_base`` is in g/kWh.
        """
        if self.co2_factor > 0.0 and fuel_base <= 0.0:
            raise ValueError(
                f"co2_factor = {self.co2_factor:g} multiplies the fuel flow, but the ship file has no "
                "fuel model: give prime_mover.fuel_base_g_kWh (unit g/kWh) or leave the factor out"
            )


@compiled
def specific_nox(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Return the NOx map [g/kWh] at omega_e [rad/s] and M_b [N m], never negative."""
    s = engine_speed / plant.engine_speed_max
    m = brake_torque * plant.engine_speed_max / plant.fuel_rated_power
    value = plant.nox_m0_s0 + (plant.nox_m1_s0 + plant.nox_m2_s0 * m) * m
    value = value + (plant.nox_m0_s1 + plant.nox_m1_s1 * m + plant.nox_m0_s2 * s) * s
    if value.real < 0.0:
        return 0.0 * value
    return plant.nox_base * value


@compiled
def nox_rate(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Return the NOx flow of one engine [g/s]; 0 without a NOx map, or without power."""
    power = brake_torque * engine_speed
    if plant.nox_base <= 0.0 or engine_speed.real <= 0.0 or power.real <= 0.0:
        return 0.0 * power
    return specific_nox(plant, engine_speed, brake_torque) * power * _G_PER_J


@compiled
def co2_rate(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Return the CO2 flow of one engine [kg/s]; 0 without a factor or a fuel model."""
    if plant.co2_factor <= 0.0:
        return 0.0 * brake_torque
    return plant.co2_factor * fuel_rate(plant, engine_speed, brake_torque)


_LIMITS = {1: (17.0, 45.0, -0.2, 9.8), 2: (14.4, 44.0, -0.23, 7.7), 3: (3.4, 9.0, -0.2, 2.0)}
"""By tier: limit below 130 rpm, factor and exponent of the rated speed, limit from 2000 rpm on."""


def nox_limit(rated_speed_rpm: float, tier: int) -> float:
    """Return the NOx limit [g/kWh] of MARPOL Annex VI, regulation 13, for an engine.

    The limit applies to the weighted mean of a test cycle, not to each working point.

    Args:
        rated_speed_rpm: rated engine speed [rpm].
        tier: 1, 2 or 3.

    Raises:
        ValueError: the tier is not 1, 2 or 3, or the speed is not above 0.

    Example:
        >>> [round(nox_limit(1000.0, tier), 2) for tier in (1, 2, 3)]
        [11.3, 8.98, 2.26]
    """
    if tier not in _LIMITS:
        raise ValueError(f"tier = {tier!r}: must be 1, 2 or 3")
    if not rated_speed_rpm > 0.0:
        raise ValueError(f"rated_speed_rpm = {rated_speed_rpm!r} rpm: must be above 0")
    slow, factor, exponent, fast = _LIMITS[tier]
    if rated_speed_rpm < 130.0:
        return slow
    return fast if rated_speed_rpm >= 2000.0 else factor * rated_speed_rpm**exponent


_TERMS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # exponents of m and s
_SIZES = (6, 3, 2, 1)  # numbers of leading terms that a fit may have


def fit_nox_map(
    speed: Sequence[float], power: Sequence[float], nox_g_kWh: Sequence[float]
) -> dict[str, float]:
    """Return the keys of a NOx map by least squares, for :meth:`shaftline.plant.Ship.with_values`.

    The map has as many of its terms (constant; m; s; all six) as the points determine, with at least
    two points for each: a constant for up to three points, m for the four points of cycle E2 or E3, m
    and s for the seven of both.

    Args:
        speed: engine speeds over the highest one [-].
        power: brake powers over the reference power of the fuel surface [-].
        nox_g_kWh: measured specific emissions [g/kWh].

    Raises:
        ValueError: the columns have different lengths or values that are not above 0.

    Example:
        >>> keys = fit_nox_map([1.0, 0.91, 0.8, 0.63], [1.0, 0.75, 0.5, 0.25], [9.0, 9.2, 9.5, 10.0])
        >>> {key: round(value, 2) for key, value in keys.items()}
        {'emissions.nox_base_g_kWh': 10.6, 'emissions.nox_m1_s0': -0.16}
    """
    columns = [np.asarray(column, dtype=np.float64) for column in (speed, power, nox_g_kWh)]
    if len({column.shape for column in columns}) > 1 or columns[0].ndim != 1 or not len(columns[0]):
        raise ValueError("speed, power and nox_g_kWh must be lists of equal length, at least 1")
    for name, column in zip(("speed", "power", "nox_g_kWh"), columns, strict=True):
        if not (np.isfinite(column).all() and (column > 0.0).all()):
            raise ValueError(f"{name} must have finite values above 0")
    s, p, nox = columns
    basis = np.column_stack([(p / s) ** i * s**j for i, j in _TERMS])
    for size in _SIZES:
        part = basis[:, :size]
        if size == 1 or (2 * size <= len(s) and np.linalg.matrix_rank(part, tol=1e-6) == size):
            break
    fit = np.linalg.lstsq(part, nox, rcond=None)[0]
    base = float(fit[0])
    if not base > 0.0:  # The base must be above 0; the constant is then a coefficient of its own.
        base = float(nox.mean())
    keys = {"emissions.nox_base_g_kWh": base}
    for (i, j), value in zip(_TERMS, fit, strict=False):
        if (i, j) != (0, 0) or value != base:
            keys[f"emissions.nox_m{i}_s{j}"] = float(value) / base
    return keys
