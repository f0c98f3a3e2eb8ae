"""KT and KQ of a ship's propeller, whatever they come from, and the way back from KQ to J.

KT and KQ over J are those of a shaft that turns ahead with the inflow. A four-quadrant propeller has
curves for all else too; of a shaft that turns astern J and KQ are those in the direction of rotation.

The propeller: its numbers, its load by the open-water curves, and what may be lost from it.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.numeric import begun_between, clip, newton_step
from .four_quadrant import (
    PITCH_NODES,
    TABLE_SHAPE,
    between_nodes,
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
    RECORD_FIELDS,
    REVOLUTIONS_PER_RADIAN,
    OpenWaterTable,
    advance_ratio,
    b_series,
    constant_coefficient,
    invert_table,
    invert_torque_coefficient,
    open_water,
    open_water_slope,
    table_curve,
)
from .surroundings import static_pressure
from .validity import Validity
from .ventilation import (
    SURFACE_TORQUE_POWER,
    can_ventilate,
    lost_suction,
    relative_submergence,
    suction_head,
    surface_factor,
)

POLYNOMIALS, FOUR_QUADRANT, NO_PROPELLER, TABLE = 0, 1, 2, 3
"""Codes of ``plant.propeller_model``. The polynomials are those of the B-series, or constants at bollard
pull; without a propeller they are 0.
"""


_UNUSED = (-math.inf, math.inf)


def _is_bollard(plant: Any) -> bool:
    """Return whether KT and KQ are constants, which were measured at rest in both directions."""
    curves = np.stack([plant["kt"], plant["kq"]])
    curves[:, 0, 0] = 0.0
    return bool(plant["propeller_model"] == POLYNOMIALS and not curves.any())


def _advance_ratio(plant: Any, samples: NDArray[Any]) -> NDArray[np.float64]:
    turns = samples["shaft_speed"] * REVOLUTIONS_PER_RADIAN
    apart = np.where(turns < 0.0, np.nan, np.maximum(turns, MIN_REVOLUTIONS))
    return np.asarray(samples["advance_velocity"] / (apart * plant["diameter"]))


def _advance_ratios(plant: Any) -> tuple[float, float]:
    if plant["propeller_model"] in (FOUR_QUADRANT, NO_PROPELLER):
        return _UNUSED
    if _is_bollard(plant):
        return 0.0, 0.0
    return float(plant["advance_ratio_min"]), float(plant["advance_ratio_max"])


def _shaft_speeds(plant: Any) -> tuple[float, float]:
    any_way = plant["propeller_model"] in (FOUR_QUADRANT, NO_PROPELLER) or _is_bollard(plant)
    return _UNUSED if any_way else (0.0, math.inf)


def _pitch_ratios(plant: Any) -> tuple[float, float]:
    series = plant["propeller_model"] == FOUR_QUADRANT or (
        plant["propeller_model"] == POLYNOMIALS and not _is_bollard(plant)
    )
    return (PITCH_NODES[0], PITCH_NODES[-1]) if series else _UNUSED


VALIDITY = (
    Validity(
        "the propeller's advance ratio J", "-", _advance_ratio, _advance_ratios,
        "KT and KQ are held at the edges of the range, so a shaft at rest in the flow meets no force",
    ),
    Validity(
        "the propeller's shaft speed", "rad/s", lambda _, samples: samples["shaft_speed"],
        _shaft_speeds, "astern the curves of ahead rotation act with n |n|, no measured ones",
    ),
    Validity(
        "the blades' pitch ratio P/D", "-", lambda _, samples: samples["pitch_ratio"], _pitch_ratios,
        "the B-series was tested in the range; outside its polynomials are continued, its "
        "four-quadrant curves held",
    ),
)  # fmt: skip
"""Ranges of the open-water curves. The series' pitch is that of Oosterveld & van Oossanen (1975)."""


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


_STEP = 1e-30  # of the complex step

FOLD_MARGIN = 0.05
"""Share of KQ by which it must differ from the ends of the ring vortex's fold to be told from them."""


@compiled_apart
def torque_in_any_quadrant(
    plant: Record, velocity_per_diameter: Real, revolutions: Real, pitch_ratio: Real
) -> Real:
    """KQ n |n| [1/s2] by the ship's four-quadrant curves, with ``astern_load_fraction``.

    Args:
        plant: ship record.
        velocity_per_diameter: v_a / D [1/s].
        revolutions: n [1/s], either sign.
        pitch_ratio: P/D [-].
    """
    _, torque = four_quadrant_coefficients(
        plant.four_quadrant,
        plant.four_quadrant_pitch,
        velocity_per_diameter,
        revolutions,
        pitch_ratio,
    )
    return torque if revolutions.real >= 0.0 else torque * plant.astern_load_fraction


@compiled_apart
def coefficients_along(
    plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float
) -> tuple[Real, Real]:
    """KT = T / (rho n |n| D^4) and KQ = Q / (rho n |n| D^5) [-], turning ahead (1) or astern (-1).

    Args:
        plant: ship record; four-quadrant curves alone know a shaft that turns astern.
        advance_ratio: J = v_a / (n D) [-].
        pitch_ratio: P/D [-].
        direction: of rotation.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        thrust, torque = four_quadrant_coefficients(
            plant.four_quadrant,
            plant.four_quadrant_pitch,
            direction * advance_ratio,
            direction,
            pitch_ratio,
        )
        share = 1.0 if direction > 0.0 else plant.astern_load_fraction
        return direction * share * thrust, direction * share * torque
    kt = thrust_coefficient(plant, advance_ratio, pitch_ratio)
    return kt, torque_coefficient(plant, advance_ratio, pitch_ratio)


@compiled
def _along(plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float) -> Real:
    return coefficients_along(plant, advance_ratio, pitch_ratio, direction)[1]


@compiled
def _fold(plant: Record, pitch_ratio: float, direction: float) -> tuple[float, float]:
    """J [-] of the ring vortex's dip and peak."""
    i, weight = between_nodes(plant.four_quadrant_pitch, pitch_ratio)
    ends = plant.ring_vortex[0 if direction > 0.0 else 1]
    low, high = ends[i], ends[i + 1]
    return low[0] + weight * (high[0] - low[0]), low[1] + weight * (high[1] - low[1])


@compiled_apart
def outside_ring_vortex(
    plant: Record, advance_ratio: float, pitch_ratio: float, direction: float, known: bool
) -> bool:
    """Whether a shaft that turns with the inflow can be told from one that turns against it.

    Args:
        plant: ship record, of a four-quadrant propeller.
        advance_ratio: J = v_a / (n D) [-], as estimated.
        pitch_ratio: P/D [-].
        direction: 1 where the shaft turns ahead, -1 astern.
        known: whether it could be told shortly before.

    Against the inflow (J < 0) the flow is a ring vortex, unsteady and of no use for an estimate:
    zone 1 of Pivano et al. 2008, section 4.1. The torques of its fold are those of moderate J too: who
    comes from there may trust them up to the fold's peak, who does not must wait for one below its dip.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    if not advance_ratio >= max(peak, 0.0):
        return False
    end = _along(plant, peak if known else dip, pitch_ratio, direction)
    here = _along(plant, advance_ratio, pitch_ratio, direction)
    return bool(here < (1.0 - FOLD_MARGIN) * end)


@compiled_apart
def _invert_four_quadrants(
    plant: Record, torque_coefficient: float, pitch_ratio: float, guess: float, direction: float
) -> tuple[float, bool]:
    """J at which the four-quadrant curve has a KQ, on the falling branch nearest to the guess.

    A KQ beyond those of the fold lies on one branch alone, which is then taken, whatever the guess. In
    between, it is held at the branch's end where the branch does not reach it.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    least = _along(plant, dip, pitch_ratio, direction)
    most = _along(plant, peak, pitch_ratio, direction)
    if not (math.isfinite(torque_coefficient) and math.isfinite(most)):
        return guess, False
    if not math.isfinite(guess):
        guess = 0.0
    with_inflow = guess > 0.5 * (dip + peak)
    if torque_coefficient > (1.0 + FOLD_MARGIN) * most:
        with_inflow = False
    if torque_coefficient < (1.0 - FOLD_MARGIN) * least:
        with_inflow = True
    if with_inflow and torque_coefficient >= most:
        return peak, False
    if not with_inflow and torque_coefficient <= least:
        return dip, False
    # the branches have no other end: double the bound until it lies beyond
    low, high = peak, max(guess, 1.0)
    if not with_inflow:
        low, high = min(guess, -1.0), dip
    for _ in range(60):
        if with_inflow and _along(plant, high, pitch_ratio, direction) > torque_coefficient:
            low, high = high, 2.0 * high
        elif not with_inflow and _along(plant, low, pitch_ratio, direction) < torque_coefficient:
            low, high = 2.0 * low, low
        else:
            break
    j = begun_between(guess, low, high)
    for _ in range(60):
        value = _along(plant, j + 1j * _STEP, pitch_ratio, direction)
        error, slope = value.real - torque_coefficient, value.imag / _STEP
        following, low, high = newton_step(j, error, slope, low, high)
        if abs(following - j) <= 1e-14 * max(1.0, abs(j)):
            break
        j = following
    return following, following >= 0.0


@compiled
def advance_ratio_of(
    plant: Record,
    torque_coefficient: float,
    pitch_ratio: float,
    guess: float,
    direction: float = 1.0,
) -> tuple[float, bool]:
    """Advance ratio J = v_a / (n D) at which the propeller has a KQ [-], and whether to trust it.

    Args:
        plant: ship record.
        torque_coefficient: KQ = Q / (rho n |n| D^5) [-] to be met.
        pitch_ratio: P/D [-].
        guess: start, for example the previous J; of a four-quadrant curve it also chooses the branch.
        direction: 1 where the shaft turns ahead; -1 astern, which four-quadrant curves alone know.

    To be trusted it must lie on the falling branch from J = 0 on.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        j, valid = _invert_four_quadrants(plant, torque_coefficient, pitch_ratio, guess, direction)
    elif plant.propeller_model == TABLE:
        j, valid = invert_table(plant, torque_coefficient, pitch_ratio, guess)
    else:
        j, valid = invert_torque_coefficient(plant.kq, torque_coefficient, pitch_ratio, guess)
    return j, valid


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
