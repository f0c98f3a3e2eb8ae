"""Fuel consumption of a diesel engine, as a polynomial in power and speed.

The paper on the CPP optimiser (section 2.2) gives the specific consumption as a polynomial in power N
and speed, C_s = N' C n. This module uses its product with the power and adds terms without power, so
that an idling engine burns fuel and no division by zero occurs:

    fuel / (C_base N_r) = sum of c_ij (N / N_r)^i (omega_e / omega_r)^j

The value 1 is the fuel flow at rated power and base consumption. There is no term with i = j = 0,
because an engine at rest burns nothing. The paper's own form, C_s with i up to 2 and j up to 3, has the
twelve coefficients with i from 1 to 3 and j from 0 to 3.
"""

from __future__ import annotations

import math

from ..core.compiled import Real, Record, compiled

_KG_PER_J = 1e-3 / 3.6e6  # 1 g/kWh


@compiled
def fuel_rate(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Return the fuel flow of one engine [kg/s], never negative; 0 if ``fuel_base`` is 0 (no model).

    An engine that rests or turns astern (omega_e [rad/s]) burns nothing. At M_b [N m] below 0 the
    surface continues along its slope in power, down to no fuel.
    """
    if plant.fuel_base <= 0.0 or engine_speed.real <= 0.0:
        return 0.0
    speed = engine_speed / plant.engine_speed_max
    power = brake_torque * engine_speed / plant.fuel_rated_power
    share = speed * (plant.fuel_p0_s1 + plant.fuel_p0_s2 * speed)
    bent = plant.fuel_p1_s1 + speed * (plant.fuel_p1_s2 + speed * plant.fuel_p1_s3)
    slope = plant.fuel_p1_s0 + speed * bent
    if power.real > 0.0:  # For an overrun engine only the linear terms in power apply.
        square = plant.fuel_p2_s1 + speed * (plant.fuel_p2_s2 + speed * plant.fuel_p2_s3)
        cube = plant.fuel_p3_s1 + speed * (plant.fuel_p3_s2 + speed * plant.fuel_p3_s3)
        bend = plant.fuel_p2_s0 + square * speed + (plant.fuel_p3_s0 + speed * cube) * power
        slope = slope + bend * power
    share = share + slope * power
    if share.real < 0.0:
        return 0.0
    return plant.fuel_base * _KG_PER_J * plant.fuel_rated_power * share


@compiled
def specific_consumption(plant: Record, engine_speed: float, brake_torque: float) -> float:
    """Return the specific consumption [g/kWh] at omega_e [rad/s] and M_b [N m]; NaN without power."""
    power = brake_torque * engine_speed
    if power <= 0.0:
        return math.nan
    return float(fuel_rate(plant, engine_speed, brake_torque) / (power * _KG_PER_J))
