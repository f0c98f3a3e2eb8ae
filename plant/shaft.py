"""Shaft line: gearbox, friction on either side of the torque gauge, and the gauge itself."""

from __future__ import annotations

import math

import numpy as np

from ..core.compiled import Real, Record, compiled

_STICTION_SPEED = 0.05  # rad/s; Coulomb friction changes sign over this speed instead of at once


@compiled
def friction_torque(coulomb: float, viscous: float, shaft_speed: Real) -> Real:
    """Coulomb and viscous friction [N m] that oppose the rotation.

    Args:
        coulomb: torque independent of speed [N m]; tanh(omega / 0.05) instead of the sign, so that
            a shaft can start from rest. Beyond 1 rad/s the two are equal to the last bit.
        viscous: torque per shaft speed [N m s/rad].
        shaft_speed: omega [rad/s].
    """
    if coulomb == 0.0 and viscous == 0.0:
        return 0.0
    if abs(shaft_speed.real) > 20.0 * _STICTION_SPEED:
        direction = math.copysign(1.0, shaft_speed.real)
    else:
        direction = np.tanh(shaft_speed / _STICTION_SPEED)
    return coulomb * direction + viscous * shaft_speed


@compiled
def quadratic_drag(plant: Record, shaft_speed: Real) -> Real:
    """Torque c omega |omega| [N m] that opposes the rotation behind the gauge."""
    if plant.quadratic_drag == 0.0:
        return 0.0
    sign = 1.0 if shaft_speed.real >= 0.0 else -1.0
    return sign * plant.quadratic_drag * shaft_speed * shaft_speed


@compiled
def shaft_inertia(plant: Record) -> float:
    """Inertia I [kg m2] of the whole line at the propeller shaft, entrained water included."""
    rotating = plant.inertia_engine_side + plant.inertia_propeller_side
    return float(rotating + plant.entrained_inertia)


@compiled
def gauge_torque(plant: Record, drive_torque: Real, shaft_acceleration: Real) -> Real:
    """Torque M_m [N m] at the gauge between I_L and I_R (thesis eq. 2-17)."""
    return drive_torque - plant.inertia_engine_side * shaft_acceleration
