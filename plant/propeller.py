"""Propeller: parameters, KT and KQ from any source, load and losses, and advance ratio J from KQ.

Without four-quadrant curves, KT and KQ over J hold for a shaft that turns ahead with the inflow. A
four-quadrant propeller has curves for all directions of rotation and inflow; if its shaft turns astern,
J and KQ are positive in the direction of rotation.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.lanes import one_by_one, where
from ..core.numeric import clip, modulus, newton_step, start_between
from .four_quadrant import (
    PITCH_NODES,
    TABLE_SHAPE,
    between_nodes,
    four_quadrant_coefficients,
    ring_vortex,
    scaled_to_bollard,
)
from .keys import Section, effect, entry, parameter, require
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
    """Return whether KT and KQ are constants, measured at bollard pull in both directions."""
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
    any_way = _is_bollard(plant) or _advance_ratios(plant) == _UNUSED
    return _UNUSED if any_way else (0.0, math.inf)


def _pitch_ratios(plant: Any) -> tuple[float, float]:
    series = plant["propeller_model"] in (FOUR_QUADRANT, POLYNOMIALS) and not _is_bollard(plant)
    return (PITCH_NODES[0], PITCH_NODES[-1]) if series else _UNUSED


VALIDITY = (
    Validity(
        "the propeller's advance ratio J",
        "-",
        _advance_ratio,
        _advance_ratios,
        "KT and KQ are constant outside the range, so a shaft at rest in a flow has no force",
    ),
    Validity(
        "the propeller's shaft speed",
        "rad/s",
        lambda _, samples: samples["shaft_speed"],
        _shaft_speeds,
        "astern the curves for rotation ahead are used with n |n|",
    ),
    Validity(
        "the blades' pitch ratio P/D",
        "-",
        lambda _, samples: samples["pitch_ratio"],
        _pitch_ratios,
        "the B-series was tested in the range; outside it the polynomials are extrapolated and the "
        "four-quadrant curves are constant",
    ),
)
"""Ranges of the open-water curves. The range of P/D is that of Oosterveld & van Oossanen (1975)."""


@one_by_one
@compiled
def _tabled_thrust(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    return table_curve(plant, plant.table_kt, advance_ratio, pitch_ratio)[0]


@one_by_one
@compiled
def _tabled_torque(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    return table_curve(plant, plant.table_kq, advance_ratio, pitch_ratio)[0]


@compiled
def thrust_coefficient(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """Return KT [-] at advance ratio J and pitch ratio P/D, for rotation ahead."""
    if plant.propeller_model == TABLE:
        value = _tabled_thrust(plant, advance_ratio, pitch_ratio)
    else:
        value = open_water(plant.kt, advance_ratio, pitch_ratio)
    return value


@compiled
def torque_coefficient(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """Return KQ [-] at advance ratio J and pitch ratio P/D, for rotation ahead."""
    if plant.propeller_model == TABLE:
        value = _tabled_torque(plant, advance_ratio, pitch_ratio)
    else:
        value = open_water(plant.kq, advance_ratio, pitch_ratio)
    return value


@compiled
def torque_coefficient_slope(plant: Record, advance_ratio: Real, pitch_ratio: Real) -> Real:
    """Return dKQ/dJ [-]."""
    if plant.propeller_model == TABLE:
        slope = table_curve(plant, plant.table_kq, advance_ratio, pitch_ratio)[1]
    else:
        slope = open_water_slope(plant.kq, advance_ratio, pitch_ratio)
    return slope


@one_by_one
@compiled
def _in_any_quadrant(
    plant: Record, velocity_per_diameter: Real, revolutions: Real, pitch_ratio: Real
) -> tuple[Real, Real]:
    table, nodes = plant.four_quadrant, plant.four_quadrant_pitch
    return four_quadrant_coefficients(table, nodes, velocity_per_diameter, revolutions, pitch_ratio)


_STEP = 1e-30  # complex step

FOLD_MARGIN = 0.05
"""Relative difference in KQ from the dip or peak of the ring vortex that makes a branch identifiable."""


@compiled_apart
def torque_in_any_quadrant(
    plant: Record, velocity_per_diameter: Real, revolutions: Real, pitch_ratio: Real
) -> Real:
    """Return KQ n |n| [1/s2] from the four-quadrant curves, with ``astern_load_fraction``.

    v_a / D is in 1/s, n in 1/s with either sign.
    """
    _, torque = _in_any_quadrant(plant, velocity_per_diameter, revolutions, pitch_ratio)
    return torque if revolutions.real >= 0.0 else torque * plant.astern_load_fraction


@compiled_apart
def coefficients_along(
    plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float
) -> tuple[Real, Real]:
    """Return KT = T / (rho n |n| D^4) and KQ = Q / (rho n |n| D^5) [-] for either direction of rotation.

    J = v_a / (n D); ``direction`` is 1 for rotation ahead and -1 astern, which only four-quadrant curves
    cover.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        velocity = direction * advance_ratio
        thrust, torque = _in_any_quadrant(plant, velocity, direction, pitch_ratio)
        share = 1.0 if direction > 0.0 else plant.astern_load_fraction
        return direction * share * thrust, direction * share * torque
    kt = thrust_coefficient(plant, advance_ratio, pitch_ratio)
    return kt, torque_coefficient(plant, advance_ratio, pitch_ratio)


@compiled
def _kq_along(plant: Record, advance_ratio: Real, pitch_ratio: float, direction: float) -> Real:
    return coefficients_along(plant, advance_ratio, pitch_ratio, direction)[1]


@compiled
def _fold(plant: Record, pitch_ratio: float, direction: float) -> tuple[float, float]:
    """Return J [-] of the dip and of the peak of KQ in the ring vortex."""
    i, weight = between_nodes(plant.four_quadrant_pitch, pitch_ratio)
    ends = plant.ring_vortex[0 if direction > 0.0 else 1]
    low, high = ends[i], ends[i + 1]
    return low[0] + weight * (high[0] - low[0]), low[1] + weight * (high[1] - low[1])


@compiled_apart
def outside_ring_vortex(
    plant: Record, advance_ratio: float, pitch_ratio: float, direction: float, known: bool
) -> bool:
    """Return whether KQ shows that the shaft turns with the inflow and not against it.

    Against the inflow (J < 0) the flow is an unsteady ring vortex, in which no estimate is possible:
    zone 1 of Pivano et al. 2008, section 4.1. Torques between its dip and its peak also occur at
    moderate J. An estimate that was valid before (``known``) stays valid up to the peak; a new one must
    have a KQ below the dip. J = v_a / (n D) is the estimate; ``direction`` is 1 if the shaft turns
    ahead, -1 if astern.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    if not advance_ratio >= max(peak, 0.0):
        return False
    end = _kq_along(plant, peak if known else dip, pitch_ratio, direction)
    here = _kq_along(plant, advance_ratio, pitch_ratio, direction)
    return bool(here < (1.0 - FOLD_MARGIN) * end)


@compiled_apart
def _invert_four_quadrants(
    plant: Record, torque_coefficient: float, pitch_ratio: float, guess: float, direction: float
) -> tuple[float, bool]:
    """Return J at which the four-quadrant curve has a KQ, on the falling branch nearest to the guess.

    A KQ above the peak or below the dip occurs on one branch only, which is then used for any guess. If
    the selected branch does not reach the KQ, J is the end of the branch and not valid.
    """
    dip, peak = _fold(plant, pitch_ratio, direction)
    least = _kq_along(plant, dip, pitch_ratio, direction)
    most = _kq_along(plant, peak, pitch_ratio, direction)
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
    # The branches have no outer end: double the bound until it lies beyond the solution.
    low, high = peak, max(guess, 1.0)
    if not with_inflow:
        low, high = min(guess, -1.0), dip
    for _ in range(60):
        if with_inflow and _kq_along(plant, high, pitch_ratio, direction) > torque_coefficient:
            low, high = high, 2.0 * high
        elif not with_inflow and _kq_along(plant, low, pitch_ratio, direction) < torque_coefficient:
            low, high = 2.0 * low, low
        else:
            break
    j = start_between(guess, low, high)
    for _ in range(60):
        value = _kq_along(plant, j + 1j * _STEP, pitch_ratio, direction)
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
    """Return J = v_a / (n D) at which the propeller has KQ = Q / (rho n |n| D^5), and its validity.

    It is valid on the falling branch from J = 0 on. ``guess`` is the start, for example the previous J;
    for a four-quadrant curve it also selects the branch. ``direction`` is 1 if the shaft turns ahead; -1
    astern, for four-quadrant curves only.
    """
    if plant.propeller_model == FOUR_QUADRANT:
        return _invert_four_quadrants(plant, torque_coefficient, pitch_ratio, guess, direction)
    if plant.propeller_model == TABLE:
        return invert_table(plant, torque_coefficient, pitch_ratio, guess)
    return invert_torque_coefficient(plant.kq, torque_coefficient, pitch_ratio, guess)


PITCH_RANGES = {"b-series": (0.4, 1.6), "four-quadrant": (PITCH_NODES[0], PITCH_NODES[-1])}
"""Lowest and highest P/D of a ship with each model.

The B-series was tested from 0.5 to 1.4; its polynomials are used slightly beyond. Negative pitch is
refused, because the polynomials would give thrust ahead there. So would the four-quadrant curves, which
are constant outside their range.
"""


class Propeller(Section):
    """Propeller: open-water curves and losses."""

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

    # fmt: off
    model: Literal["b-series", "four-quadrant", "bollard", "table", "none"] = Field(default="b-series",
        description="source of the open-water curves; none: a shaft without propeller")
    diameter_m: float = parameter("diameter D", "m", record="diameter", required="with a propeller",
        gt=0, le=15, default=1.0)
    blades: int = Field(default=4, ge=2, le=7, description="number of blades Z")
    expanded_area_ratio: float = Field(default=0.7, ge=0.3, le=1.05, description="expanded area ratio")
    pitch_ratio_min: float = parameter("lowest P/D; equal to the highest for a fixed-pitch propeller",
        record="pitch_ratio_min", ge=-1.6, le=1.6, default=1.0)
    pitch_ratio_max: float = parameter("highest P/D", record="pitch_ratio_max", ge=-1.6, le=1.6,
        default=1.0)
    relative_rotative_efficiency: float = parameter("relative rotative efficiency eta_r",
        record="relative_rotative_efficiency", gt=0.5, lt=1.5, default=1.0)
    depth_m: float = parameter("depth of the propeller's centre", "m", record="depth", ge=0, le=30,
        default=4.0)
    thrust_coefficient: float = entry("KT at J = 0 (bollard)", record="kt", place=(0, 0),
        needs="has_constant_coefficients", ge=0, le=2, default=0.0)
    torque_coefficient: float = entry("KQ at J = 0 (bollard)", record="kq", place=(0, 0),
        needs="has_constant_coefficients", ge=0, le=1, default=0.0)
    open_water: OpenWaterTable | None = Field(default=None,
        description="measured open-water table, for model table")
    roughness_drag: float = effect(0.0, "added blade drag coefficient", record="propeller_roughness",
        ge=0, le=0.05)
    entrained_inertia_kg_m2: float = effect(0.0, "inertia of entrained water", "kg m2",
        record="entrained_inertia", ge=0, le=1e7)
    inflow_lag_s: float = effect(0.0, "first-order lag of the inflow", "s", record="inflow_lag",
        lag=True, ge=0, le=60)
    astern_load_fraction: float = effect(1.0, "astern thrust and torque / those of the curves",
        record="astern_load_fraction", ge=0.1, le=5)
    cavitation_breakdown: float = effect(0.0, "thrust lost per unit deficit of cavitation number",
        record="cavitation_breakdown", needs="in_water", ge=0, le=3)
    cavitation_onset_number: float = parameter("sigma_n at which breakdown begins",
        record="cavitation_onset_number", needs="in_water", gt=0, le=50, default=1.0)
    cavitation_torque_share: float = parameter("torque loss / thrust loss",
        record="cavitation_torque_share", needs="in_water", ge=0, le=1, default=0.8)
    # fmt: on

    @model_validator(mode="after")
    def _complete(self) -> Propeller:
        if self.model == "none":
            for idle in sorted(self.model_fields_set - {"model"}):
                raise ValueError(f"{idle} has no effect with propeller.model = 'none'; remove it")
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
            raise ValueError(
                f"open_water has no effect with propeller.model = {self.model!r}; set model = 'table' "
                "or remove [propeller.open_water]"
            )
        require(self, ("diameter_m", *keys), f"with propeller.model = {self.model!r}")
        if self.pitch_ratio_min > self.pitch_ratio_max:
            raise ValueError(
                f"pitch_ratio_min = {self.pitch_ratio_min:g} must not exceed pitch_ratio_max = "
                f"{self.pitch_ratio_max:g}"
            )
        low, high = PITCH_RANGES.get(self.model, (-math.inf, math.inf))
        for name in ("pitch_ratio_min", "pitch_ratio_max"):
            if not low <= (value := getattr(self, name)) <= high:
                raise ValueError(
                    f"{name} = {value:g} lies outside {low:g} to {high:g}, the range of the curves of "
                    f"propeller.model = {self.model!r}. For a larger range of pitch, give measured "
                    "curves with model 'table' ([propeller.open_water] with pitch_ratio)"
                )
        if self.open_water is not None:
            tabled = self.open_water.pitch_ratio
            if not tabled and self.pitch_ratio_min < self.pitch_ratio_max:
                raise ValueError(
                    "a variable pitch needs open_water.pitch_ratio with at least two values; give them, "
                    "or set pitch_ratio_min equal to pitch_ratio_max"
                )
            least, most = self.pitch_ratio_min, self.pitch_ratio_max
            if tabled and not tabled[0] <= least <= most <= tabled[-1]:
                raise ValueError(
                    f"pitch_ratio_min and pitch_ratio_max must lie within open_water.pitch_ratio, "
                    f"{tabled[0]:g} to {tabled[-1]:g}"
                )
        return self

    def fill(self, record: Any) -> None:
        """Write the parameters and the open-water curves."""
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
    """Return the cavitation number sigma_n = (p0 + rho g h - p_v) / (rho n^2 D^2 / 2) [-]."""
    tip = 0.5 * plant.density * revolutions * revolutions * plant.diameter * plant.diameter
    return static_pressure(plant, submergence) / tip


@compiled
def cavitation_loss(plant: Record, revolutions: Real, submergence: Real) -> Real:
    """Return the fraction of thrust lost to cavitation [-]; 0 if ``cavitation_breakdown`` is 0.

    It grows linearly as the cavitation number falls below the onset.
    """
    parameter = cavitation_number(plant, revolutions, submergence)
    deficit = 1.0 - parameter / plant.cavitation_onset_number
    return plant.cavitation_breakdown * clip(deficit, 0.0, 1.0)


class PropellerLoad(NamedTuple):
    """Open-water thrust T [N] and torque Q [N m] of one propeller, and KT [-] before ventilation.

    KT is positive if the thrust points in the direction of rotation.
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
    """Return thrust and torque of one propeller (thesis eqs. 2-3 and 2-4), with optional losses.

    v_a is in m/s, omega in rad/s, the depth of the propeller's centre in m; the degree of ventilation is
    0 (none) to 1 (full).

    The polynomials cover rotation ahead only. Astern their coefficients are used with n |n|, so thrust
    and torque change sign with the shaft speed (four-quadrant curves cover both directions). Astern
    loads are multiplied by ``astern_load_fraction``, because blade sections are designed for rotation
    ahead and carry less load astern.

    Roughness uses the ITTC-1978 scale corrections with the added blade drag Delta C_D: Delta KT = -0.3
    (P/D) (c Z / D) Delta C_D and Delta KQ = 0.25 (c Z / D) Delta C_D.
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    n2 = n * modulus(n)
    if plant.propeller_model == FOUR_QUADRANT:
        velocity = advance_velocity / plant.diameter
        kt_n2, kq_n2 = _in_any_quadrant(plant, velocity, n, pitch_ratio)
    else:
        j = advance_ratio(advance_velocity, shaft_speed, plant.diameter)
        j = clip(j, plant.advance_ratio_min, plant.advance_ratio_max)
        kt_n2 = thrust_coefficient(plant, j, pitch_ratio) * n2
        kq_n2 = torque_coefficient(plant, j, pitch_ratio) * n2
    if plant.propeller_roughness != 0.0:
        drag = plant.propeller_roughness * plant.blade_solidity * n2
        kt_n2 = kt_n2 - 0.3 * pitch_ratio * drag
        kq_n2 = kq_n2 + 0.25 * drag
    along = where(n.real >= 0.0, kt_n2, -kt_n2)
    deep_kt = along / (n * n + MIN_REVOLUTIONS * MIN_REVOLUTIONS)
    if plant.cavitation_breakdown != 0.0:
        loss = cavitation_loss(plant, n, submergence)
        kt_n2 = kt_n2 * (1.0 - loss)
        kq_n2 = kq_n2 * (1.0 - loss * plant.cavitation_torque_share)
    share = where(n.real < 0.0, plant.astern_load_fraction, 1.0)
    kt_n2, kq_n2 = kt_n2 * share, kq_n2 * share
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
