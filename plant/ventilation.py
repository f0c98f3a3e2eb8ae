"""Ventilation: air drawn to the propeller when it comes near the surface under load.

Whether a propeller ventilates depends on its relative submergence h/R and on its loading, and once
air is drawn in it stays until the propeller has dived deeper than where it began (Smogeli 2006,
chapter 2; Kozlowska et al. 2009). Here:

- onset where h/R < onset_submergence + loading_gain * KT,
- recovery where h/R > recovery_submergence + loading_gain * KT,
- the degree of ventilation follows the on/off state with a growth and a washout time,
- thrust and torque fall by ``thrust_loss`` and ``torque_loss`` at full ventilation.

With both losses at 0, their neutral value, the propeller never ventilates.
"""

from __future__ import annotations

from ..core.compiled import Real, Record, compiled


@compiled
def can_ventilate(plant: Record) -> bool:
    """Whether the ship's record has ventilation switched on."""
    return bool(plant.ventilation_thrust_loss > 0.0 or plant.ventilation_torque_loss > 0.0)


@compiled
def ventilation_state(
    plant: Record, ventilated: bool, submergence: float, thrust_coefficient: float
) -> bool:
    """On/off state with hysteresis.

    Args:
        plant: ship record.
        ventilated: state before.
        submergence: depth h of the propeller's centre [m].
        thrust_coefficient: KT [-] that the propeller would have without air.
    """
    relative = 2.0 * submergence / plant.diameter
    shift = plant.ventilation_loading_gain * thrust_coefficient
    if ventilated:
        return bool(relative <= plant.ventilation_recovery_submergence + shift)
    return bool(relative < plant.ventilation_onset_submergence + shift)


@compiled
def ventilation_rate(plant: Record, degree: Real, ventilated: bool) -> Real:
    """d(degree)/dt [1/s] towards 1 with the growth time, towards 0 with the washout time."""
    if ventilated:
        return (1.0 - degree) / plant.ventilation_growth_time
    return -degree / plant.ventilation_washout_time
