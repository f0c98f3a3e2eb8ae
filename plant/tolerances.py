"""How well each number of a ship is known."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from .keys import Section


def _known_to(tolerance: float, description: str, needs: str = "") -> Any:
    """How well a number of the ship is known: one standard deviation; 0 is exactly."""
    description = f"standard deviation of {description}"
    return Field(
        default=tolerance, ge=0, le=0.5, description=description, json_schema_extra={"needs": needs}
    )


class Tolerances(Section):
    """How far the nominal numbers may be off before a diagnosis calls it missing physics."""

    resistance: float = _known_to(0.004, "the resistance, as a share of it", "moves")
    mass: float = _known_to(0.005, "the ship's mass, as a share of it", "moves")
    wake_fraction: float = _known_to(
        0.0015, "the wake fraction w, added to it", "moves has_propeller"
    )
    thrust_curve: float = _known_to(
        0.002, "the propeller's KT, as a share of it", "moves has_propeller"
    )
    torque_curve: float = _known_to(0.002, "the propeller's KQ, as a share of it", "has_propeller")
    inertia: float = _known_to(0.005, "each inertia of the shaft, as a share of it")
    torque_per_rack: float = _known_to(0.0015, "the diesel's b, as a share of it", "has_diesel")
    torque_offset: float = _known_to(
        0.001, "the diesel's c, as a share of its highest torque", "has_diesel"
    )
    motor_constant: float = _known_to(0.002, "the motor's K_e, as a share of it", "has_voltage")
    armature_resistance: float = _known_to(
        0.0025, "the motor's R_a, as a share of it", "has_voltage"
    )
    pitch_time_constant: float = _known_to(
        0.01, "the pitch actuator's tau_p, as a share of it", "has_variable_pitch"
    )
