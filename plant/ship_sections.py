"""The sections of a ship's file: every number with its key, unit, allowed range and meaning.

Each number stands once, here: its TOML key (with unit), its range, its neutral value where it is an
effect that a ship may or may not have, and the name of its field in the kernels' record.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from .unexplained import MAX_KNOTS

INF = math.inf


def _number(description: str, unit: str = "-", *, record: str, **limits: Any) -> Any:
    """A number of a ship: unit, allowed range, and its field in the kernels' record."""
    return Field(
        description=description, json_schema_extra={"unit": unit, "record": record}, **limits
    )


def _effect(
    neutral: float, description: str, unit: str = "-", *, record: str, **limits: Any
) -> Any:
    """A number whose ``neutral`` value means that the effect is absent."""
    field = _number(description, unit, record=record, default=neutral, **limits)
    field.json_schema_extra["effect"] = True
    return field


def _coefficient(term: str, neutral: float, *, record: str) -> Any:
    """A coefficient of the fuel surface: fuel share per power share and speed share."""
    return _number(
        f"of {term} in the fuel surface", record=record, ge=-100, le=100, default=neutral
    )


class Section(BaseModel):
    """A table of the file: immutable, strictly typed, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Water(Section):
    """The water that the ship sails in."""

    density_kg_m3: float = _number("density", "kg/m3", record="density", ge=990, le=1035)


def _require(section: BaseModel, keys: tuple[str, ...], because: str) -> None:
    """Refuse a section in which keys are left out that another key's value asks for."""
    absent = [key for key in keys if key not in section.model_fields_set]
    if absent:
        raise ValueError(f"{absent[0]} is missing; it is required {because}")


class Hull(Section):
    """Surge dynamics, resistance and wake."""

    fixed: bool = Field(
        default=False, description="held at its place, as in a bollard pull or on a bench"
    )
    mass_kg: float = _number("mass with added mass", "kg", record="mass", gt=0, le=1e9, default=1.0)
    resistance_coefficient_N_s2_m2: float = _number(
        "R = c1 v^2", "N s2/m2", record="resistance_coefficient", ge=0, le=1e7, default=0.0
    )
    thrust_deduction: float = _number("t", record="thrust_deduction", ge=-0.2, lt=0.6, default=0.0)
    wake_fraction: float = _number("w", record="wake_fraction", ge=-0.2, lt=0.6, default=0.0)
    propellers: int = Field(default=1, ge=1, le=8, description="number of equal propellers k_p")
    fouling_fraction: float = _effect(
        0.0, "added share of the resistance", record="hull_fouling", ge=-0.5, le=3
    )
    current_m_s: float = _effect(
        0.0, "current along the track, positive from astern", "m/s", record="current", ge=-5, le=5
    )
    wake_slope_s_m: float = _effect(
        0.0, "change of wake fraction with speed", "s/m", record="wake_slope", ge=-0.2, le=0.2
    )
    wake_reference_speed_m_s: float = _number(
        "speed at which the wake fraction is w", "m/s", record="wake_reference_speed",
        ge=0, le=40, default=0.0,
    )  # fmt: skip
    episode_resistance_fraction: float = _effect(
        0.0, "added share of the resistance during an episode", record="episode_resistance",
        ge=-0.9, le=10,
    )  # fmt: skip
    episode_start_s: float = _number(
        "its start, from the simulation's", "s", record="episode_start", ge=0, default=0.0
    )
    episode_end_s: float = _number("its end", "s", record="episode_end", ge=0, default=INF)

    @model_validator(mode="after")
    def _complete(self) -> Hull:
        if self.episode_end_s < self.episode_start_s:
            raise ValueError("episode_end_s must not be before episode_start_s")
        if not self.fixed:
            keys = ("mass_kg", "resistance_coefficient_N_s2_m2")
            _require(self, keys, "unless hull.fixed is true")
        return self


class Propeller(Section):
    """Open-water curves and what may be lost from them."""

    model: Literal["b-series", "four-quadrant", "bollard"] = "b-series"
    diameter_m: float = _number("diameter D", "m", record="diameter", gt=0, le=15)
    blades: int = Field(default=4, ge=2, le=7, description="number of blades Z")
    expanded_area_ratio: float = Field(default=0.7, ge=0.3, le=1.05, description="EAR")
    pitch_ratio_min: float = _number(
        "lowest P/D; equal to the highest for a fixed-pitch propeller", record="pitch_ratio_min",
        ge=-1.6, le=1.6, default=1.0,
    )  # fmt: skip
    pitch_ratio_max: float = _number(
        "highest P/D", record="pitch_ratio_max", ge=-1.6, le=1.6, default=1.0
    )
    relative_rotative_efficiency: float = _number(
        "eta_r", record="relative_rotative_efficiency", gt=0.5, lt=1.5, default=1.0
    )
    depth_m: float = _number("depth of the centre", "m", record="depth", ge=0, le=30, default=4.0)
    thrust_coefficient: float = Field(default=0.0, ge=0, le=2, description="KT at J = 0 (bollard)")
    torque_coefficient: float = Field(default=0.0, ge=0, le=1, description="KQ at J = 0 (bollard)")
    roughness_drag: float = _effect(
        0.0, "added blade drag coefficient", record="propeller_roughness", ge=0, le=0.05
    )
    entrained_inertia_kg_m2: float = _effect(
        0.0, "inertia of entrained water", "kg m2", record="entrained_inertia", ge=0, le=1e7
    )
    inflow_lag_s: float = _effect(
        0.0, "first-order lag of the inflow", "s", record="inflow_lag", ge=0, le=60
    )
    astern_load_fraction: float = _effect(
        1.0, "thrust and torque of a shaft that turns astern / by the curves",
        record="astern_load_fraction", ge=0.1, le=5,
    )  # fmt: skip
    cavitation_breakdown: float = _effect(
        0.0, "thrust lost per unit deficit of cavitation number", record="cavitation_breakdown",
        ge=0, le=3,
    )  # fmt: skip
    cavitation_onset_number: float = _number(
        "sigma_n at which breakdown begins", record="cavitation_onset_number",
        gt=0, le=50, default=1.0,
    )  # fmt: skip
    cavitation_torque_share: float = _number(
        "torque loss / thrust loss", record="cavitation_torque_share", ge=0, le=1, default=0.8
    )

    @model_validator(mode="after")
    def _complete(self) -> Propeller:
        keys: tuple[str, ...] = ("torque_coefficient",)
        if self.model != "bollard":
            keys = ("blades", "expanded_area_ratio", "pitch_ratio_min", "pitch_ratio_max")
        _require(self, keys, f"with propeller.model = {self.model!r}")
        if self.pitch_ratio_min > self.pitch_ratio_max:
            raise ValueError("pitch_ratio_min must not exceed pitch_ratio_max")
        return self


class Ventilation(Section):
    """Ventilation of the propeller; absent while both losses are 0."""

    thrust_loss: float = _effect(
        0.0, "share of thrust lost", record="ventilation_thrust_loss", ge=0, le=0.95
    )
    torque_loss: float = _effect(
        0.0, "share of torque lost", record="ventilation_torque_loss", ge=0, le=0.95
    )
    onset_submergence: float = _number(
        "h/R of onset", record="ventilation_onset_submergence", ge=-1, le=5, default=1.0
    )
    recovery_submergence: float = _number(
        "h/R of recovery", record="ventilation_recovery_submergence", ge=-1, le=6, default=1.3
    )
    loading_gain: float = _number(
        "h/R added per unit KT", record="ventilation_loading_gain", ge=0, le=10, default=0.0
    )
    growth_time_s: float = _number(
        "time constant of growth", "s", record="ventilation_growth_time", ge=0.05, le=20,
        default=0.5,
    )  # fmt: skip
    washout_time_s: float = _number(
        "time constant of recovery", "s", record="ventilation_washout_time", ge=0.05, le=60,
        default=1.5,
    )  # fmt: skip

    @model_validator(mode="after")
    def _in_order(self) -> Ventilation:
        if self.recovery_submergence < self.onset_submergence:
            raise ValueError("recovery_submergence must not be below onset_submergence")
        return self


class Diesel(Section):
    """Diesel engine by its fuel rack map M_b = a omega_e + b X + c."""

    type: Literal["diesel"]
    torque_per_speed_N_m_s_rad: float = _number(
        "a", "N m s/rad", record="torque_per_speed", ge=-1e5, le=0
    )
    torque_per_rack_N_m_mm: float = _number("b", "N m/mm", record="torque_per_rack", gt=0, le=1e6)
    torque_offset_N_m: float = _number("c", "N m", record="torque_offset", ge=-1e6, le=1e6)
    rack_max_mm: float = _number("end stop of the rack", "mm", record="drive_max", gt=0, le=200)
    speed_min_rpm: float = Field(ge=0, le=3000, description="lowest running speed")
    speed_max_rpm: float = Field(gt=0, le=5000, description="highest running speed")
    torque_limit_N_m: float = _number(
        "highest brake torque", "N m", record="torque_limit", gt=0, default=INF
    )
    torque_limit_at_min_speed_N_m: float = _number(
        "brake torque limit at the lowest speed", "N m", record="torque_limit_idle", gt=0,
        default=INF,
    )  # fmt: skip
    torque_limit_slope_N_m_s_rad: float = _number(
        "rise of the limit with engine speed", "N m s/rad", record="torque_limit_slope",
        ge=0, le=1e6, default=0.0,
    )  # fmt: skip
    lag_s: float = _effect(
        0.0, "first-order lag of the torque", "s", record="engine_lag", ge=0, le=30
    )
    dead_time_s: float = _effect(
        0.0, "delay of the rack's demand", "s", record="engine_dead_time", ge=0, le=6
    )
    rack_rate_limit_mm_s: float = _effect(
        INF, "fastest travel of the rack", "mm/s", record="rack_rate_limit", gt=0
    )
    derating_fraction: float = _effect(
        0.0, "share of torque lost", record="derating", ge=-0.5, le=0.9
    )
    torque_curvature_N_m_s2_rad2: float = _effect(
        0.0, "bend of the map's lines over engine speed", "N m s2/rad2", record="torque_curvature",
        ge=-1e4, le=1e4,
    )  # fmt: skip
    torque_curvature_speed_rad_s: float = _number(
        "engine speed about which they bend", "rad/s", record="torque_curvature_speed",
        ge=0, le=500, default=0.0,
    )  # fmt: skip
    fuel_base_g_kWh: float = _effect(
        0.0, "specific consumption that scales the fuel surface; 0 is no fuel model", "g/kWh",
        record="fuel_base", ge=0, le=1000,
    )  # fmt: skip
    fuel_rated_power_W: float = _number(
        "power N_r by which the surface's power is divided (its speed, by the highest)", "W",
        record="fuel_rated_power", gt=0, le=1e9, default=1.0,
    )  # fmt: skip
    fuel_p0_s1: float = _coefficient("omega", 0.0, record="fuel_p0_s1")
    fuel_p0_s2: float = _coefficient("omega^2", 0.0, record="fuel_p0_s2")
    fuel_p1_s0: float = _coefficient("N", 1.0, record="fuel_p1_s0")
    fuel_p1_s1: float = _coefficient("N omega", 0.0, record="fuel_p1_s1")
    fuel_p1_s2: float = _coefficient("N omega^2", 0.0, record="fuel_p1_s2")
    fuel_p2_s0: float = _coefficient("N^2", 0.0, record="fuel_p2_s0")
    fuel_p2_s1: float = _coefficient("N^2 omega", 0.0, record="fuel_p2_s1")
    fuel_p3_s0: float = _coefficient("N^3", 0.0, record="fuel_p3_s0")

    @model_validator(mode="after")
    def _fuel_complete(self) -> Diesel:
        if self.fuel_base_g_kWh > 0.0:
            _require(self, ("fuel_rated_power_W",), "with a fuel_base_g_kWh")
        return self

    @model_validator(mode="after")
    def _speeds_in_order(self) -> Diesel:
        if self.speed_min_rpm >= self.speed_max_rpm:
            raise ValueError("speed_min_rpm must be below speed_max_rpm")
        return self


class DcMotor(Section):
    """Direct-current motor driven by a voltage."""

    type: Literal["dc-motor"]
    motor_constant_V_s_rad: float = _number(
        "K_e, back-EMF and torque constant", "V s/rad = N m/A", record="motor_constant",
        gt=0, le=1e3,
    )  # fmt: skip
    armature_resistance_ohm: float = _number(
        "R_a", "ohm", record="armature_resistance", gt=0, le=1e4
    )
    armature_inductance_H: float = _number(
        "L_a; 0 leaves the current without dynamics", "H", record="armature_inductance",
        ge=0, le=100, default=0.0,
    )  # fmt: skip
    voltage_max_V: float = _number(
        "end stop of the demand, either way", "V", record="drive_max", gt=0, le=1e5
    )
    command_dead_zone_V: float = _effect(
        0.0, "demand that gives nothing (half width); taken off beyond it", "V",
        record="command_dead_zone", ge=0, le=1e5,
    )  # fmt: skip
    reverse_torque_fraction: float = _effect(
        1.0, "torque constant at negative current / at positive", record="reverse_torque_fraction",
        gt=0, le=2,
    )  # fmt: skip
    supply_limit_V: float = _effect(
        INF, "highest voltage that reaches the armature, either way", "V", record="supply_limit",
        gt=0,
    )  # fmt: skip
    supply_current_limit_A: float = _effect(
        INF, "highest current that the supply gives, either way", "A",
        record="supply_current_limit", gt=0,
    )  # fmt: skip


class TorqueSource(Section):
    """Drive that delivers the torque that it is told."""

    type: Literal["torque-command"]
    torque_max_N_m: float = _number("torque limit", "N m", record="drive_max", gt=0, le=1e8)


class Transmission(Section):
    """Gearbox, inertias on either side of the torque gauge, friction."""

    gear_ratio: float = _number("engine speed / shaft speed", record="gear_ratio", gt=0, le=100)
    efficiency: float = _number("eta_trm", record="transmission_efficiency", gt=0.3, le=1)
    inertia_engine_side_kg_m2: float = _number(
        "I_L, at the propeller shaft", "kg m2", record="inertia_engine_side", gt=0, le=1e9
    )
    inertia_propeller_side_kg_m2: float = _number(
        "I_R", "kg m2", record="inertia_propeller_side", ge=0, le=1e9
    )
    coulomb_friction_engine_side_N_m: float = _effect(
        0.0, "Coulomb friction before the gauge, at the propeller shaft", "N m",
        record="coulomb_engine_side", ge=0, le=1e7,
    )  # fmt: skip
    viscous_friction_engine_side_N_m_s_rad: float = _effect(
        0.0, "viscous friction before the gauge", "N m s/rad", record="viscous_engine_side",
        ge=0, le=1e7,
    )  # fmt: skip
    coulomb_friction_propeller_side_N_m: float = _effect(
        0.0, "Coulomb friction behind the gauge", "N m", record="coulomb_propeller_side",
        ge=0, le=1e7,
    )  # fmt: skip
    viscous_friction_propeller_side_N_m_s_rad: float = _effect(
        0.0, "viscous friction behind the gauge", "N m s/rad", record="viscous_propeller_side",
        ge=0, le=1e7,
    )  # fmt: skip
    quadratic_drag_N_m_s2_rad2: float = _effect(
        0.0, "c omega |omega| behind the gauge", "N m s2/rad2", record="quadratic_drag",
        ge=0, le=1e7,
    )  # fmt: skip


class PitchActuator(Section):
    """Hydraulic pitch mechanism, first order."""

    time_constant_s: float = _number(
        "tau_p", "s", record="pitch_time_constant", ge=0.05, le=100, default=2.0
    )
    dead_band: float = _effect(
        0.0, "P/D error that does not move it (half width)", record="pitch_dead_band", ge=0, le=0.5
    )
    backlash: float = _effect(
        0.0, "play between actuator and blade (full width)", record="pitch_backlash", ge=0, le=0.5
    )
    rate_limit_per_s: float = _effect(
        INF, "fastest change of P/D", "1/s", record="pitch_rate_limit", gt=0
    )
    offset: float = _effect(
        0.0, "P/D reached minus P/D commanded", record="pitch_actuator_offset", ge=-0.5, le=0.5
    )


class Sensors(Section):
    """Systematic errors of the instruments (noise is added where measurements are used)."""

    pitch_offset: float = _effect(
        0.0, "P/D read minus P/D", record="pitch_sensor_offset", ge=-0.5, le=0.5
    )
    torque_bias_N_m: float = _effect(
        0.0, "torque read at no torque", "N m", record="torque_sensor_bias", ge=-1e7, le=1e7
    )
    torque_gain: float = _effect(
        1.0, "torque read per torque", record="torque_sensor_gain", gt=0, le=3
    )
    torque_delay_s: float = _effect(
        0.0, "delay of the torque signal", "s", record="torque_sensor_delay", ge=0, le=6
    )
    speed_log_lag_s: float = _effect(
        0.0, "first-order lag of the speed log", "s", record="speed_log_lag", ge=0, le=600
    )


class Integration(Section):
    """Fixed-step integration."""

    time_step_s: float = _number("RK4 step", "s", record="time_step", gt=0, le=0.5, default=0.05)


def _known_to(tolerance: float, description: str) -> Any:
    """How well a number of the ship is known: one standard deviation; 0 is exactly."""
    description = f"standard deviation of {description}"
    return Field(default=tolerance, ge=0, le=0.5, description=description)


class Tolerances(Section):
    """How far the nominal numbers may be off before a diagnosis calls it missing physics."""

    resistance: float = _known_to(0.004, "the resistance, as a share of it")
    mass: float = _known_to(0.005, "the ship's mass, as a share of it")
    wake_fraction: float = _known_to(0.0015, "the wake fraction w, added to it")
    thrust_curve: float = _known_to(0.002, "the propeller's KT, as a share of it")
    torque_curve: float = _known_to(0.002, "the propeller's KQ, as a share of it")
    inertia: float = _known_to(0.005, "each inertia of the shaft, as a share of it")
    torque_per_rack: float = _known_to(0.0015, "the diesel's b, as a share of it")
    torque_offset: float = _known_to(0.001, "the diesel's c, as a share of its highest torque")
    motor_constant: float = _known_to(0.002, "the motor's K_e, as a share of it")
    armature_resistance: float = _known_to(0.0025, "the motor's R_a, as a share of it")
    pitch_time_constant: float = _known_to(0.01, "the pitch actuator's tau_p, as a share of it")


_Knot = Annotated[float, Field(ge=-1e9, le=1e9)]


def _knots(description: str) -> Any:
    return Field(description=description, min_length=2, max_length=MAX_KNOTS, strict=False)


class Unexplained(Section):
    """A torque, force or rate of unknown origin, as a function of one signal."""

    balance: Literal["engine", "propeller", "hull", "pitch-actuator"] = Field(
        description="where it is added: drive torque (of a motor too), propeller torque, force on "
        "the ship, rate of P/D; positive drives ahead or raises"
    )
    signal: Literal["shaft_speed", "ship_speed", "pitch_ratio", "drive", "time"] = Field(
        description="what it follows; drive is what reaches the prime mover"
    )
    knots: tuple[_Knot, ...] = _knots(
        "rising values of the signal [SI; fuel rack in mm], 2 to 12 of them"
    )
    values: tuple[_Knot, ...] = _knots(
        "one for each knot [N m | N | 1/s]; linear between, held outside"
    )

    @model_validator(mode="after")
    def _matched(self) -> Unexplained:
        if len(self.knots) != len(self.values):
            raise ValueError(
                f"knots and values must be as many; they are {len(self.knots)} and "
                f"{len(self.values)}"
            )
        if any(b <= a for a, b in zip(self.knots, self.knots[1:], strict=False)):
            raise ValueError("knots must rise")
        return self


class KeyInfo(NamedTuple):
    """Unit and range of a ship's number; ``neutral`` is None where it describes no effect."""

    unit: str
    low: float
    high: float
    neutral: float | None


def info_of(info: FieldInfo) -> KeyInfo:
    """Unit, range and neutral value of a number; a bound may itself be excluded (> or <)."""
    low, high = -INF, INF
    for limit in info.metadata:
        low = max(low, getattr(limit, "ge", -INF), getattr(limit, "gt", -INF))
        high = min(high, getattr(limit, "le", INF), getattr(limit, "lt", INF))
    extra = info.json_schema_extra
    effect = isinstance(extra, dict) and "effect" in extra
    neutral = float(info.default) if effect else None
    return KeyInfo(unit_of(info), float(low), float(high), neutral)


def allowed_range(info: FieldInfo) -> str:
    """Allowed range of a number, in words."""
    bounds = [
        f"{sign} {getattr(m, name):g}"
        for m in info.metadata
        for name, sign in (("ge", ">="), ("gt", ">"), ("le", "<="), ("lt", "<"))
        if getattr(m, name, None) is not None
    ]
    return " and ".join(bounds) or "any number"


def unit_of(info: FieldInfo) -> str:
    """Unit of a number."""
    extra = info.json_schema_extra
    return str(extra.get("unit", "-")) if isinstance(extra, dict) else "-"


def record_field(info: FieldInfo) -> str | None:
    """Name of a number's field in the kernels' record; None for what stays outside."""
    extra = info.json_schema_extra
    return str(extra["record"]) if isinstance(extra, dict) and "record" in extra else None
