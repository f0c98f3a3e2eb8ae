"""The propeller: its numbers, its load by the open-water curves, and what may be lost from it."""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled
from ..core.numeric import clip
from .four_quadrant import (
    PITCH_NODES,
    TABLE_SHAPE,
    four_quadrant_coefficients,
    ring_vortex,
    scaled_to_bollard,
)
from .keys import Section, effect, entry, number, require
from .open_water import (
    CURVE_SHAPE,
    MAX_ADVANCE_RATIO,
    MIN_ADVANCE_RATIO,
    MIN_REVOLUTIONS,
    PITCH_POWERS,
    REVOLUTIONS_PER_RADIAN,
    advance_ratio,
    b_series,
    constant_coefficient,
)
from .open_water_table import RECORD_FIELDS, OpenWaterTable
from .propeller_curves import (
    FOUR_QUADRANT,
    NO_PROPELLER,
    TABLE,
    VALIDITY,
    thrust_coefficient,
    torque_coefficient,
)
from .surroundings import static_pressure
from .ventilation import (
    SURFACE_TORQUE_POWER,
    can_ventilate,
    lost_suction,
    relative_submergence,
    suction_head,
    surface_factor,
)

PITCH_RANGES = {"b-series": (0.4, 1.6), "four-quadrant": (PITCH_NODES[0], PITCH_NODES[-1])}
"""Lowest and highest P/D that a ship may have with a model.

The series was tested from 0.5 to 1.4. Its polynomials are taken a little further. At a negative pitch
they would give thrust ahead, and so would the four-quadrant curves, which are held outside their range.
"""


class Propeller(Section):
    """Open-water curves and what may be lost from them."""

    needs = "has_propeller"
    validity = VALIDITY
    derived = (
        ("propeller_model", np.int64),
        ("expanded_area_ratio", np.float64),
        ("blade_solidity", np.float64),
        ("kt", np.float64, CURVE_SHAPE),
        ("kq", np.float64, CURVE_SHAPE),
        ("four_quadrant_pitch", np.float64, (len(PITCH_NODES),)),
        ("four_quadrant", np.float64, TABLE_SHAPE),
        ("ring_vortex", np.float64, (2, len(PITCH_NODES), 2)),
        ("advance_ratio_min", np.float64),
        ("advance_ratio_max", np.float64),
        *RECORD_FIELDS,
    )

    model: Literal["b-series", "four-quadrant", "bollard", "table", "none"] = Field(
        default="b-series", description="open-water curves; none is a shaft without a propeller"
    )
    diameter_m: float = number(
        "diameter D", "m", record="diameter", required="with a propeller", gt=0, le=15, default=1.0
    )
    blades: int = Field(default=4, ge=2, le=7, description="number of blades Z")
    expanded_area_ratio: float = Field(default=0.7, ge=0.3, le=1.05, description="EAR")
    pitch_ratio_min: float = number(
        "lowest P/D; equal to the highest for a fixed-pitch propeller", record="pitch_ratio_min",
        ge=-1.6, le=1.6, default=1.0,
    )  # fmt: skip
    pitch_ratio_max: float = number(
        "highest P/D", record="pitch_ratio_max", ge=-1.6, le=1.6, default=1.0
    )
    relative_rotative_efficiency: float = number(
        "eta_r", record="relative_rotative_efficiency", gt=0.5, lt=1.5, default=1.0
    )
    depth_m: float = number("depth of the centre", "m", record="depth", ge=0, le=30, default=4.0)
    thrust_coefficient: float = entry(
        "KT at J = 0 (bollard)", record="kt", place=(0, 0), needs="has_constant_coefficients",
        ge=0, le=2, default=0.0,
    )  # fmt: skip
    torque_coefficient: float = entry(
        "KQ at J = 0 (bollard)", record="kq", place=(0, 0), needs="has_constant_coefficients",
        ge=0, le=1, default=0.0,
    )  # fmt: skip
    open_water: OpenWaterTable | None = Field(
        default=None, description="a table of one's own, with model table"
    )
    roughness_drag: float = effect(
        0.0, "added blade drag coefficient", record="propeller_roughness", ge=0, le=0.05
    )
    entrained_inertia_kg_m2: float = effect(
        0.0, "inertia of entrained water", "kg m2", record="entrained_inertia", ge=0, le=1e7
    )
    inflow_lag_s: float = effect(
        0.0, "first-order lag of the inflow", "s", record="inflow_lag", lag=True, ge=0, le=60
    )
    astern_load_fraction: float = effect(
        1.0, "thrust and torque of a shaft that turns astern / by the curves",
        record="astern_load_fraction", ge=0.1, le=5,
    )  # fmt: skip
    cavitation_breakdown: float = effect(
        0.0, "thrust lost per unit deficit of cavitation number", record="cavitation_breakdown",
        needs="in_water", ge=0, le=3,
    )  # fmt: skip
    cavitation_onset_number: float = number(
        "sigma_n at which breakdown begins", record="cavitation_onset_number",
        needs="in_water", gt=0, le=50, default=1.0,
    )  # fmt: skip
    cavitation_torque_share: float = number(
        "torque loss / thrust loss", record="cavitation_torque_share", needs="in_water",
        ge=0, le=1, default=0.8,
    )  # fmt: skip

    @model_validator(mode="after")
    def _complete(self) -> Propeller:
        if self.model == "none":
            if idle := sorted(self.model_fields_set - {"model"}):
                raise ValueError(f"{idle[0]} acts on nothing with propeller.model = 'none'")
            return self
        keys: tuple[str, ...] = (
            "blades",
            "expanded_area_ratio",
            "pitch_ratio_min",
            "pitch_ratio_max",
        )
        if self.model == "bollard":
            keys = ("torque_coefficient",)
        elif self.model == "table":
            keys = ("open_water",)
        elif self.open_water is not None:
            raise ValueError(f"open_water acts on nothing with propeller.model = {self.model!r}")
        require(self, ("diameter_m", *keys), f"with propeller.model = {self.model!r}")
        if self.pitch_ratio_min > self.pitch_ratio_max:
            raise ValueError("pitch_ratio_min must not exceed pitch_ratio_max")
        low, high = PITCH_RANGES.get(self.model, (-math.inf, math.inf))
        for name in ("pitch_ratio_min", "pitch_ratio_max"):
            if not low <= (value := getattr(self, name)) <= high:
                raise ValueError(
                    f"{name} = {value:g} lies outside {low:g} to {high:g}, where the curves of "
                    f"propeller.model = {self.model!r} hold. For blades that turn further, give "
                    "measured curves with model 'table' ([propeller.open_water] with pitch_ratio)"
                )
        if self.open_water is not None:
            tabled = self.open_water.pitch_ratio
            if not tabled and self.pitch_ratio_min < self.pitch_ratio_max:
                raise ValueError("blades that turn ask for open_water.pitch_ratio, two at least")
            if (
                tabled
                and not tabled[0] <= self.pitch_ratio_min <= self.pitch_ratio_max <= tabled[-1]
            ):
                raise ValueError(
                    f"pitch_ratio_min and pitch_ratio_max must lie within open_water.pitch_ratio, "
                    f"{tabled[0]:g} to {tabled[-1]:g}"
                )
        return self

    def fill(self, record: Any) -> None:
        """Its numbers and curves."""
        super().fill(record)
        record["expanded_area_ratio"] = self.expanded_area_ratio
        record["blade_solidity"] = 2.073 * self.expanded_area_ratio  # c Z / D at 0.75 R, B-series
        record["advance_ratio_min"] = MIN_ADVANCE_RATIO
        record["advance_ratio_max"] = MAX_ADVANCE_RATIO
        if self.model == "none":
            record["propeller_model"] = NO_PROPELLER
        elif self.open_water is not None:
            record["propeller_model"] = TABLE
            record["advance_ratio_min"] = self.open_water.advance_ratio[0]
            record["advance_ratio_max"] = self.open_water.advance_ratio[-1]
            self.open_water.fill_table(record)
        elif self.model == "bollard":
            record["kt"] = constant_coefficient(self.thrust_coefficient)
            record["kq"] = constant_coefficient(self.torque_coefficient)
        else:
            record["kt"] = b_series("KT", self.expanded_area_ratio, self.blades)
            record["kq"] = b_series("KQ", self.expanded_area_ratio, self.blades)
        record["four_quadrant_pitch"] = PITCH_NODES
        if self.model == "four-quadrant":
            record["propeller_model"] = FOUR_QUADRANT
            powers = np.power.outer(PITCH_NODES, PITCH_POWERS)
            record["four_quadrant"] = scaled_to_bollard(
                powers @ record["kt"][:, 0], powers @ record["kq"][:, 0]
            )
            record["ring_vortex"] = ring_vortex(record["four_quadrant"])


@compiled
def cavitation_number(plant: Record, revolutions: Real, submergence: Real) -> Real:
    """Cavitation number by shaft speed, sigma_n = (p0 + rho g h - p_v) / (rho n^2 D^2 / 2) [-]."""
    tip = 0.5 * plant.density * revolutions * revolutions * plant.diameter * plant.diameter
    return static_pressure(plant, submergence) / tip


@compiled
def cavitation_loss(plant: Record, revolutions: Real, submergence: Real) -> Real:
    """Fraction of thrust lost to cavitation breakdown [-], 0 where ``cavitation_breakdown`` is 0.

    Grows linearly as the cavitation number falls below the onset.
    """
    number = cavitation_number(plant, revolutions, submergence)
    deficit = 1.0 - number / plant.cavitation_onset_number
    return plant.cavitation_breakdown * clip(deficit, 0.0, 1.0)


class PropellerLoad(NamedTuple):
    """Open-water thrust T [N] and torque Q [N m] of one propeller; KT [-] before ventilation, positive
    where the thrust points in the direction of rotation.
    """

    thrust: Real
    torque: Real
    thrust_coefficient: Real


@compiled
def propeller_load(
    plant: Record,
    advance_velocity: Real,
    shaft_speed: Real,
    pitch_ratio: Real,
    submergence: Real,
    ventilation: Real,
) -> PropellerLoad:
    """Thrust and torque of one propeller (thesis eqs. 2-3 and 2-4), with its optional losses.

    Args:
        plant: ship record.
        advance_velocity: v_a [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        submergence: depth of the propeller's centre below the surface [m].
        ventilation: degree of ventilation, 0 (none) to 1 (full).

    The polynomials know ahead rotation only; astern their coefficients act with n |n|, so thrust and
    torque turn round with the shaft (four quadrants have curves of their own), times
    ``astern_load_fraction``: blades whose sections are made for one direction load less in the other.

    Roughness uses the ITTC-1978 scale corrections with the added blade drag Delta C_D:
    Delta KT = -0.3 (P/D) (c Z / D) Delta C_D and Delta KQ = 0.25 (c Z / D) Delta C_D.
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    n2 = n * n if n.real >= 0.0 else -n * n
    if plant.propeller_model == FOUR_QUADRANT:
        kt_n2, kq_n2 = four_quadrant_coefficients(
            plant.four_quadrant,
            plant.four_quadrant_pitch,
            advance_velocity / plant.diameter,
            n,
            pitch_ratio,
        )
    else:
        j = clip(
            advance_ratio(advance_velocity, shaft_speed, plant.diameter),
            plant.advance_ratio_min,
            plant.advance_ratio_max,
        )
        kt_n2 = thrust_coefficient(plant, j, pitch_ratio) * n2
        kq_n2 = torque_coefficient(plant, j, pitch_ratio) * n2
    if plant.propeller_roughness != 0.0:
        drag = plant.propeller_roughness * plant.blade_solidity * n2
        kt_n2 = kt_n2 - 0.3 * pitch_ratio * drag
        kq_n2 = kq_n2 + 0.25 * drag
    along = kt_n2 if n.real >= 0.0 else -kt_n2
    deep_kt = along / (n * n + MIN_REVOLUTIONS * MIN_REVOLUTIONS)
    if plant.cavitation_breakdown != 0.0:
        loss = cavitation_loss(plant, n, submergence)
        kt_n2 = kt_n2 * (1.0 - loss)
        kq_n2 = kq_n2 * (1.0 - loss * plant.cavitation_torque_share)
    if n.real < 0.0:
        kt_n2 = kt_n2 * plant.astern_load_fraction
        kq_n2 = kq_n2 * plant.astern_load_fraction
    relative = relative_submergence(plant, submergence)
    if can_ventilate(plant):
        lost = lost_suction(plant, relative, suction_head(plant, deep_kt, shaft_speed))
        kt_n2 = kt_n2 * (1.0 - ventilation * plant.ventilation_thrust_loss * lost)
        kq_n2 = kq_n2 * (1.0 - ventilation * plant.ventilation_torque_loss * lost)
    if plant.ventilation_surface_loss != 0.0:
        left = surface_factor(relative)
        kt_n2 = kt_n2 * (1.0 - plant.ventilation_surface_loss * (1.0 - left))
        kq_n2 = kq_n2 * (1.0 - plant.ventilation_surface_loss * (1.0 - left**SURFACE_TORQUE_POWER))
    force = plant.density * plant.diameter**4
    return PropellerLoad(force * kt_n2, force * plant.diameter * kq_n2, deep_kt)
