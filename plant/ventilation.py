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

from pydantic import model_validator

from ..core.compiled import Real, Record, compiled
from .keys import Section, effect, number


class Ventilation(Section):
    """Ventilation of the propeller; absent while both losses are 0."""

    needs = "has_propeller"

    thrust_loss: float = effect(
        0.0, "share of thrust lost", record="ventilation_thrust_loss", ge=0, le=0.95
    )
    torque_loss: float = effect(
        0.0, "share of torque lost", record="ventilation_torque_loss", ge=0, le=0.95
    )
    onset_submergence: float = number(
        "h/R of onset", record="ventilation_onset_submergence", ge=-1, le=5, default=1.0
    )
    recovery_submergence: float = number(
        "h/R of recovery", record="ventilation_recovery_submergence", ge=-1, le=6, default=1.3
    )
    loading_gain: float = number(
        "h/R added per unit KT", record="ventilation_loading_gain", ge=0, le=10, default=0.0
    )
    growth_time_s: float = number(
        "time constant of growth", "s", record="ventilation_growth_time", ge=0.05, le=20,
        default=0.5,
    )  # fmt: skip
    washout_time_s: float = number(
        "time constant of recovery", "s", record="ventilation_washout_time", ge=0.05, le=60,
        default=1.5,
    )  # fmt: skip

    @model_validator(mode="after")
    def _in_order(self) -> Ventilation:
        if self.recovery_submergence < self.onset_submergence:
            raise ValueError("recovery_submergence must not be below onset_submergence")
        return self


@compiled
def can_ventilate(plant: Record) -> bool:
    """Whether the ship's record has ventilation switched on."""
    thrust, torque = plant.ventilation_thrust_loss, plant.ventilation_torque_loss
    return bool(thrust.real > 0.0 or torque.real > 0.0)


@compiled
def ventilation_state(
    plant: Record, ventilated: bool, submergence: float, thrust_coefficient: float
) -> bool:
    """On/off state with hysteresis.

    Args:
        plant: ship record.
        ventilated: state before.
        submergence: depth h of the propeller's centre [m].
        thrust_coefficient: KT [-] that the propeller would have without air, in the direction of
            rotation: one that is driven by the flow draws none in.
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
