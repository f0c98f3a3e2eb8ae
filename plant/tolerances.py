"""How well each number of a ship is known."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic.fields import FieldInfo

from .keys import Section

GUESSED = 0.3
"""Tolerance of a parameter that was guessed, as a share of it."""


def _known_to(tolerance: float, description: str, *keys: str, guessed: float = GUESSED) -> Any:
    """How well some numbers of a ship are known: one standard deviation; 0 is exactly.

    Args:
        tolerance: where the file was made with care.
        description: of the numbers.
        keys: their dotted keys.
        guessed: tolerance where the file's default is that they were guessed.
    """
    extra: dict[str, Any] = {"of": [*keys], "guessed": guessed}
    description = f"standard deviation of {description}"
    return Field(default=tolerance, ge=0, le=0.5, description=description, json_schema_extra=extra)


class Tolerances(Section):
    """How far the nominal numbers may be off before a diagnosis calls it missing physics."""

    default: Literal["measured", "guessed"] = Field(
        default="measured",
        description="what the tolerances that do not stand here are: those of a file made with care, or "
        "those of a file whose parameters were guessed (0.3; wake fraction 0.1, torque offset 0.05)",
    )
    resistance: float = _known_to(
        0.004, "the resistance, as a share of it", "hull.resistance_coefficient_N_s2_m2"
    )
    mass: float = _known_to(0.005, "the ship's mass, as a share of it", "hull.mass_kg")
    wake_fraction: float = _known_to(
        0.0015, "the wake fraction w, added to it", "hull.wake_fraction", guessed=0.1
    )
    thrust_curve: float = _known_to(
        0.002, "the propeller's KT, as a share of it", "propeller.thrust_coefficient"
    )
    torque_curve: float = _known_to(
        0.002, "the propeller's KQ, as a share of it",
        "propeller.relative_rotative_efficiency", "propeller.torque_coefficient",
    )  # fmt: skip
    inertia: float = _known_to(
        0.005, "each inertia of the shaft, as a share of it",
        "transmission.inertia_engine_side_kg_m2", "transmission.inertia_propeller_side_kg_m2",
    )  # fmt: skip
    torque_per_rack: float = _known_to(
        0.0015, "the diesel's b, as a share of it", "prime_mover.torque_per_rack_N_m_mm"
    )
    torque_offset: float = _known_to(
        0.001,
        "the diesel's c, as a share of its highest torque",
        "prime_mover.torque_offset_N_m",
        guessed=0.05,
    )
    motor_constant: float = _known_to(
        0.002, "the motor's K_e, as a share of it", "prime_mover.motor_constant_V_s_rad"
    )
    armature_resistance: float = _known_to(
        0.0025, "the motor's R_a, as a share of it", "prime_mover.armature_resistance_ohm"
    )
    pitch_time_constant: float = _known_to(
        0.01, "the pitch actuator's tau_p, as a share of it", "pitch_actuator.time_constant_s"
    )
    hull_derivatives: float = _known_to(
        0.02, "each linear derivative of a hull that turns, as a share of it",
        "manoeuvring.Y_v", "manoeuvring.Y_r", "manoeuvring.N_v", "manoeuvring.N_r",
    )  # fmt: skip
    rudder_force: float = _known_to(
        0.02, "the rudder's normal force, as a share of it", "rudder.normal_force_slope"
    )
    numbers: dict[str, Annotated[float, Field(ge=0)]] = Field(
        default={},
        description="standard deviation of any number, by its dotted key and in its unit; "
        "in place of what the others say of it",
    )
    correlations: dict[str, dict[str, Annotated[float, Field(ge=-1, le=1)]]] = Field(
        default={},
        description="correlation of the errors of two of `numbers`, by the dotted key of one and then "
        "of the other; 0 where it does not stand",
    )

    @model_validator(mode="before")
    @classmethod
    def _filled(cls, given: Any) -> Any:
        """Return what stands in the file with the tolerances of a file that was guessed."""
        if not isinstance(given, dict) or given.get("default") != "guessed":
            return given
        return {
            name: _extra(info, "guessed")
            for name, info in cls.model_fields.items()
            if spoken_of(info)
        } | given

    @model_validator(mode="after")
    def _known_together(self) -> Tolerances:
        for first, others in self.correlations.items():
            for key in (first, *others):
                if key not in self.numbers:
                    raise ValueError(
                        f"correlations speak of {key}, which has no standard deviation in numbers"
                    )
        return self

    def __hash__(self) -> int:
        """Of its values: ships are remembered by what stands in them."""
        plain = self.model_dump(exclude={"numbers", "correlations"}).values()
        pairs = (
            (a, b, one) for a, others in self.correlations.items() for b, one in others.items()
        )
        return hash((*plain, *self.numbers.items(), *pairs))

    def correlation(self, first: str, second: str) -> float:
        """Of the errors of two numbers, by their dotted keys."""
        if first == second:
            return 1.0
        one = self.correlations.get(first, {}).get(second, 0.0)
        return one or self.correlations.get(second, {}).get(first, 0.0)


def spoken_of(info: FieldInfo) -> list[str]:
    """Dotted keys of the numbers of which a tolerance speaks."""
    return list(_extra(info, "of") or [])


def _extra(info: FieldInfo, name: str) -> Any:
    """What a tolerance carries beside its value; None where it does not."""
    extra: Any = info.json_schema_extra
    return extra.get(name) if extra else None


TOLERATED = {key: name for name, info in Tolerances.model_fields.items() for key in spoken_of(info)}
"""Name of the tolerance that speaks of a number, by its dotted key."""
