"""Tolerances: the uncertainty of the parameters in a ship file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic.fields import FieldInfo

from .keys import Section, declared

GUESSED = 0.3
"""Tolerance of a guessed parameter, as a share of its value."""


def _known_to(tolerance: float, description: str, *keys: str, guessed: float = GUESSED) -> Any:
    """Declare a tolerance, the standard deviation of the parameters with some keys; 0: exactly known.

    Its default is ``tolerance`` for a file with measured parameters, ``guessed`` for one with guessed
    ones.
    """
    extra: dict[str, Any] = {"of": [*keys], "guessed": guessed}
    description = f"standard deviation of {description}"
    return Field(default=tolerance, ge=0, le=0.5, description=description, json_schema_extra=extra)


class Tolerances(Section):
    """Uncertainty of the nominal parameters; a larger deviation counts as missing physics."""

    # fmt: off
    default: Literal["measured", "guessed"] = Field(default="measured",
        description="default of the tolerances that are not given: for a ship file with measured "
        "parameters, or with guessed ones (0.3; wake fraction 0.1, torque offset 0.05)")
    resistance: float = _known_to(0.004, "the resistance, as a share of it",
        "hull.resistance_coefficient_N_s2_m2")
    mass: float = _known_to(0.005, "the ship's mass, as a share of it", "hull.mass_kg")
    wake_fraction: float = _known_to(0.0015, "the wake fraction w, added to it", "hull.wake_fraction",
        guessed=0.1)
    thrust_curve: float = _known_to(0.002, "the propeller's KT, as a share of it",
        "propeller.thrust_coefficient")
    torque_curve: float = _known_to(0.002, "the propeller's KQ, as a share of it",
        "propeller.relative_rotative_efficiency", "propeller.torque_coefficient")
    inertia: float = _known_to(0.005, "each inertia of the shaft, as a share of it",
        "transmission.inertia_engine_side_kg_m2", "transmission.inertia_propeller_side_kg_m2")
    torque_per_rack: float = _known_to(0.0015, "the diesel's b, as a share of it",
        "prime_mover.torque_per_rack_N_m_mm")
    torque_offset: float = _known_to(0.001, "the diesel's c, as a share of its highest torque",
        "prime_mover.torque_offset_N_m", guessed=0.05)
    motor_constant: float = _known_to(0.002, "the motor's K_e, as a share of it",
        "prime_mover.motor_constant_V_s_rad")
    armature_resistance: float = _known_to(0.0025, "the motor's R_a, as a share of it",
        "prime_mover.armature_resistance_ohm")
    pitch_time_constant: float = _known_to(0.01, "the pitch actuator's tau_p, as a share of it",
        "pitch_actuator.time_constant_s")
    hull_derivatives: float = _known_to(0.02,
        "each linear derivative of a hull that turns, as a share of it", "manoeuvring.Y_v",
        "manoeuvring.Y_r", "manoeuvring.N_v", "manoeuvring.N_r")
    rudder_force: float = _known_to(0.02, "the rudder's normal force, as a share of it",
        "rudder.normal_force_slope")
    numbers: dict[str, Annotated[float, Field(ge=0)]] = Field(default={},
        description="standard deviation of any parameter, by its dotted key and in its unit; "
        "it replaces the tolerances above")
    correlations: dict[str, dict[str, Annotated[float, Field(ge=-1, le=1)]]] = Field(default={},
        description="correlation of the errors of two parameters in `numbers`, by the dotted key of "
        "one and then of the other; 0 if not given")
    # fmt: on

    @model_validator(mode="before")
    @classmethod
    def _filled(cls, given: Any) -> Any:
        """Return the table with the missing tolerances of a guessed file added."""
        if not isinstance(given, dict) or given.get("default") != "guessed":
            return given
        return {
            name: declared(info, "guessed")
            for name, info in cls.model_fields.items()
            if keys_of_tolerance(info)
        } | given

    @model_validator(mode="after")
    def _known_together(self) -> Tolerances:
        for first, others in self.correlations.items():
            for key in (first, *others):
                if key not in self.numbers:
                    raise ValueError(
                        f"correlations name {key}, which has no standard deviation in "
                        "tolerances.numbers; add it there"
                    )
        return self

    def __hash__(self) -> int:
        """Return a hash of the values, so that ships can be cached by their content."""
        plain = self.model_dump(exclude={"numbers", "correlations"}).values()
        pairs = (
            (a, b, one) for a, others in self.correlations.items() for b, one in others.items()
        )
        return hash((*plain, *self.numbers.items(), *pairs))

    def correlation(self, first: str, second: str) -> float:
        """Return the correlation of the errors of two parameters, given by their dotted keys."""
        if first == second:
            return 1.0
        one = self.correlations.get(first, {}).get(second, 0.0)
        return one or self.correlations.get(second, {}).get(first, 0.0)


def keys_of_tolerance(info: FieldInfo) -> list[str]:
    """Return the dotted keys of the parameters that a tolerance describes."""
    return list(declared(info, "of", ()))


TOLERANCE_OF_KEY = {
    key: name for name, info in Tolerances.model_fields.items() for key in keys_of_tolerance(info)
}
"""Name of the tolerance that describes a parameter, by the parameter's dotted key."""
