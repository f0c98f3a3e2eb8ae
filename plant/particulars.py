"""Ship files from main particulars: what a yard's data sheet has, the rest estimated.

Resistance, wake and thrust deduction are those of Holtrop and Mennen (:mod:`.holtrop`). The propeller
is of the B-series; its blade area follows Keller's criterion, its pitch the thrust at the design
speed. The engine has the rack map and the fuel surface of the package's frigate, scaled to its rating;
an electric motor is a DC motor of its rating, to which a machine with a converter is equivalent.
Each estimated value has a note on its method, and the file has tolerances, by which a diagnosis knows
how uncertain it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator
from scipy.optimize import brentq

from ..core.models import FileModel, explain, read_model
from .drives.diesel import torque_limit
from .holtrop import HullForm, Interaction, estimate_form, interaction, resistance
from .open_water import b_series, open_water
from .ship import Ship, ShipError
from .ship_files import format_value, load_ship, template
from .surroundings import ATMOSPHERE, GRAVITY, KNOT, VAPOUR_PRESSURE
from .wind import Superstructure

WATER = 1025.0
"""Density of sea water [kg/m3]."""


LEAST_BLOCK = 0.3
"""Lowest block coefficient of a displacement ship."""


class Particulars(FileModel):
    """Main particulars of a ship. Form coefficients that are not given are estimated.

    Machinery is that of one shaft: one engine, gearbox and propeller each.
    """

    name: str = Field(min_length=1, max_length=60)
    length_m: float = Field(gt=5, le=500, description="length on the water line")
    beam_m: float = Field(gt=1, le=100, description="moulded beam at the water line")
    draught_m: float = Field(gt=0.3, le=40, description="mean moulded draught")
    displacement_t: float = Field(gt=5, le=1e6, description="displacement in sea water, in tonnes")
    design_speed_kn: float = Field(gt=2, le=60, description="design speed")
    prime_mover: Literal["diesel", "electric"] = Field(
        default="diesel", description="engine or electric motor"
    )
    mcr_kW: float = Field(
        gt=10, le=1e5, description="maximum continuous rating of one engine or motor"
    )
    engine_speed_rpm: float = Field(
        gt=30, le=3000, description="speed of engine or motor at that rating"
    )
    shaft_speed_rpm: float = Field(gt=20, le=2000, description="shaft speed at that rating")
    propeller_diameter_m: float = Field(gt=0.3, le=15)
    blades: int = Field(default=4, ge=3, le=7)
    shafts: Literal[1, 2] = Field(default=1, description="number of shafts")
    controllable_pitch: bool = Field(default=False, description="whether the pitch is controllable")
    pitch_ratio: float | None = Field(default=None, ge=0.5, le=1.4, description="design P/D")
    expanded_area_ratio: float | None = Field(default=None, ge=0.3, le=1.05)
    midship_coefficient: float | None = Field(default=None, gt=0.4, le=1)
    waterplane_coefficient: float | None = Field(default=None, gt=0.4, le=1)
    lcb_percent: float | None = Field(default=None, ge=-8, le=8)
    bulb_area_m2: float = Field(default=0.0, ge=0)
    bulb_centre_m: float = Field(default=0.0, ge=0)
    transom_area_m2: float = Field(default=0.0, ge=0)
    appendage_area_m2: float = Field(default=0.0, ge=0)
    stern_shape: float = Field(default=0.0, ge=-25, le=10)
    specific_consumption_g_kWh: float = Field(default=202.0, gt=100, lt=400)
    trial_power_kW: float | None = Field(
        default=None,
        gt=5,
        le=1e5,
        description="power of one engine at the design speed in the trial of the yard",
    )
    motor_efficiency: float = Field(
        default=0.95, ge=0.6, lt=1, description="of an electric motor at that rating"
    )
    full_load_rack_mm: float | None = Field(
        default=None, gt=1, le=200, description="fuel rack at the maximum continuous rating"
    )
    superstructure: Superstructure | None = Field(
        default=None, description="above the water; without it the wind adds no resistance"
    )

    @property
    def displacement_m3(self) -> float:
        """Displaced volume of sea water."""
        return self.displacement_t * 1000.0 / WATER

    @property
    def block_coefficient(self) -> float:
        """Displaced volume over length, beam and draught."""
        return self.displacement_m3 / (self.length_m * self.beam_m * self.draught_m)

    @property
    def hull(self) -> dict[str, float]:
        """Keys of :class:`~shaftline.plant.holtrop.HullForm` that are given, with their values."""
        keys = HullForm.model_fields
        return {key: value for key in keys if (value := getattr(self, key, None)) is not None}

    @model_validator(mode="after")
    def _fits(self) -> Particulars:
        block = self.block_coefficient
        if block < LEAST_BLOCK:
            raise ValueError(
                f"displacement_t = {self.displacement_t:g} t with these length_m, beam_m and draught_m "
                f"is a block coefficient of {block:.2f} (ships: {LEAST_BLOCK:g} or more); check units"
            )
        if self.propeller_diameter_m > 0.95 * self.draught_m:
            raise ValueError(
                f"propeller_diameter_m = {self.propeller_diameter_m:g} does not fit under the water "
                f"line with draught_m = {self.draught_m:g}"
            )
        if self.shaft_speed_rpm > 1.001 * self.engine_speed_rpm:
            raise ValueError(
                f"shaft_speed_rpm = {self.shaft_speed_rpm:g} is above engine_speed_rpm = "
                f"{self.engine_speed_rpm:g}; the gearbox of a ship reduces the speed"
            )
        other = {"diesel": {"motor_efficiency"}, "electric": {"full_load_rack_mm"}}
        if unused := self.model_fields_set & other[self.prime_mover]:
            raise ValueError(
                f"{unused.pop()}: has no effect with prime_mover = {self.prime_mover!r}"
            )
        froude = self.design_speed_kn * KNOT / math.sqrt(GRAVITY * self.length_m)
        if froude > 0.8:
            raise ValueError(
                f"design_speed_kn = {self.design_speed_kn:g} is a Froude number of {froude:.2f}; "
                "Holtrop and Mennen hold for displacement ships, up to 0.8"
            )
        return self


def load_particulars(path: str | Path) -> Particulars:
    """Read a TOML file of particulars.

    Args:
        path: file with the keys of :class:`Particulars`.

    Raises:
        ShipError: the file cannot be read, or a key or value is wrong; names file and key.
    """
    return read_model(Particulars, path, ShipError)


class Estimate(NamedTuple):
    """Value of a ship file with the note on its source."""

    value: Any
    note: str


Sections = dict[str, dict[str, Estimate]]


def hull_form(given: Particulars) -> HullForm:
    """Return the hull for Holtrop and Mennen, with form coefficients that are not given estimated.

    Raises:
        ValidationError: dimensions that fit no ship.
    """
    froude = given.design_speed_kn * KNOT / math.sqrt(GRAVITY * given.length_m)
    return HullForm(**estimate_form(given.block_coefficient, froude) | given.hull)


class DesignPoint(NamedTuple):
    """Propeller and its working point at the design speed."""

    resistance_share: float
    """Resistance as a multiple of that of Holtrop and Mennen."""
    pitch_ratio: float
    expanded_area_ratio: float
    shaft_speed: float
    """[rev/s]"""
    shaft_power: float
    """Of one shaft, in front of the gearbox [W]."""
    flow: Interaction


def gear_efficiency(given: Particulars) -> float:
    """Return the efficiency of shaft and gearbox: 0.99 without a gearbox, 0.97 with one."""
    return 0.99 if given.engine_speed_rpm < 1.05 * given.shaft_speed_rpm else 0.97


LEAST_SHARE, LARGEST_SHARE = 0.5, 2.0
"""Resistance as multiples of that of Holtrop and Mennen that a power in the yard's trial may need."""


def design_point(given: Particulars, hull: HullForm) -> DesignPoint:
    """Return pitch, blade area and working point of the propeller at the design speed.

    With the engine power of a trial the resistance is such that the design speed needs this power. The
    other values are those of :func:`_working_point`.

    Args:
        given: particulars.
        hull: hull of :func:`hull_form`.

    Raises:
        ShipError: no pitch of the B-series gives the thrust of the design speed, or no plausible
            resistance the power of the trial.
    """
    if given.trial_power_kW is None:
        return _working_point(given, hull, 1.0)
    wanted = given.trial_power_kW * 1e3

    def excess(share: float) -> float:
        return _working_point(given, hull, share).shaft_power - wanted

    needed = _working_point(given, hull, 1.0).shaft_power
    try:
        share = float(brentq(excess, LEAST_SHARE, LARGEST_SHARE, xtol=1e-4))
    except (ShipError, ValueError):  # A share needs more than the propeller gives, or none fits.
        raise ShipError(
            f"{given.name}: no resistance of {LEAST_SHARE:g} to {LARGEST_SHARE:g} times that of Holtrop "
            f"and Mennen, with which {given.design_speed_kn:g} kn need {needed / 1e3:.0f} kW, gives "
            f"trial_power_kW = {given.trial_power_kW:g}; it is the power of one engine at "
            "design_speed_kn"
        ) from None
    return _working_point(given, hull, share)


def _working_point(given: Particulars, hull: HullForm, share: float) -> DesignPoint:
    """Return the propeller and its working point with a share of Holtrop and Mennen's resistance.

    The blade area follows Keller's criterion (Keller 1966). Without a given pitch, pitch and shaft
    speed are such that the thrust equals the resistance and the power lies on the cubic propeller
    curve through the engine's rating.
    """
    speed, diameter = given.design_speed_kn * KNOT, given.propeller_diameter_m
    rated = given.shaft_speed_rpm / 60.0
    drag = share * resistance(hull, speed, WATER).total / given.shafts
    area, pitch = given.expanded_area_ratio or 0.6, given.pitch_ratio or 1.0
    for _ in range(20):  # wake, blade area and pitch depend on each other: a few rounds settle them
        flow = interaction(hull, diameter, speed, given.shafts, area, pitch)
        thrust = drag / (1.0 - flow.thrust_deduction)
        before = area, pitch
        area = given.expanded_area_ratio or _keller(given, thrust)
        pitch, revolutions, power = _match(given, flow, area, thrust, rated)
        if max(abs(area - before[0]), abs(pitch - before[1])) < 1e-6:
            break
    return DesignPoint(share, pitch, area, revolutions, power, flow)


def _keller(given: Particulars, thrust: float) -> float:
    """Return the expanded area ratio by Keller's criterion against cavitation."""
    depth = _shaft_depth(given)
    head = ATMOSPHERE - VAPOUR_PRESSURE + WATER * GRAVITY * depth
    loaded = (1.3 + 0.3 * given.blades) * thrust / (given.propeller_diameter_m**2 * head)
    return float(np.clip(loaded + (0.2 if given.shafts == 1 else 0.1), 0.35, 1.05))


def _shaft_depth(given: Particulars) -> float:
    """Return the depth of the shaft [m]: the blade tips clear the base line by 5 % of the diameter."""
    return given.draught_m - 0.55 * given.propeller_diameter_m


LOWEST_PITCH, HIGHEST_PITCH = 0.5, 1.4
"""Range of P/D of the B-series."""

SLOWEST, FASTEST = 0.6, 1.1
"""Shaft speeds at the design speed that are tried, as shares of the rated one."""


class _Screw(NamedTuple):
    """Propeller at the design speed."""

    given: Particulars
    flow: Interaction
    area: float
    thrust: float

    def _coefficient(self, curve: str, pitch: float, revolutions: float) -> float:
        inflow = self.given.design_speed_kn * KNOT * (1.0 - self.flow.wake_fraction)
        advance = inflow / (revolutions * self.given.propeller_diameter_m)
        return float(open_water(b_series(curve, self.area, self.given.blades), advance, pitch))

    def excess(self, pitch: float, revolutions: float) -> float:
        """Return the thrust above the wanted one [N]."""
        factor = WATER * revolutions**2 * self.given.propeller_diameter_m**4
        return factor * self._coefficient("KT", pitch, revolutions) - self.thrust

    def power(self, pitch: float, revolutions: float) -> float:
        """Return the power of one engine [W]."""
        factor = WATER * revolutions**2 * self.given.propeller_diameter_m**5
        torque = factor * self._coefficient("KQ", pitch, revolutions)
        shaft = 2.0 * math.pi * revolutions * torque / self.flow.relative_rotative_efficiency
        return shaft / gear_efficiency(self.given)

    def pitch_for(self, revolutions: float) -> float | None:
        """Return the pitch ratio that gives the thrust at a shaft speed; None if none does."""
        low, high = (self.excess(p, revolutions) for p in (LOWEST_PITCH, HIGHEST_PITCH))
        if low > 0.0 or high < 0.0:
            return None
        return float(brentq(self.excess, LOWEST_PITCH, HIGHEST_PITCH, args=(revolutions,)))


def _match(
    given: Particulars, flow: Interaction, area: float, thrust: float, rated: float
) -> tuple[float, float, float]:
    """Return pitch ratio, revolutions [1/s] and power of one engine [W] at the design speed."""
    screw = _Screw(given, flow, area, thrust)
    wanted = f"the thrust of {thrust / 1e3:.0f} kN at {given.design_speed_kn:g} kn"
    if (pitch := given.pitch_ratio) is not None:
        low, high = 0.2 * rated, 2.0 * rated
        if screw.excess(pitch, low) * screw.excess(pitch, high) > 0.0:
            raise ShipError(
                f"{given.name}: with pitch_ratio = {pitch:g} no shaft speed up to twice the rated one "
                f"gives {wanted}; check propeller_diameter_m, shaft_speed_rpm and design_speed_kn"
            )
        revolutions = float(brentq(lambda n: screw.excess(pitch, n), low, high))
        return pitch, revolutions, screw.power(pitch, revolutions)
    tried = []
    for share in np.linspace(SLOWEST, FASTEST, 51):
        revolutions = float(share * rated)
        if (found := screw.pitch_for(revolutions)) is not None:
            power = screw.power(found, revolutions)
            off_curve = abs(math.log(power / (given.mcr_kW * 1e3 * share**3)))
            tried.append((off_curve, found, revolutions, power))
    if not tried:
        raise ShipError(
            f"{given.name}: no B-series propeller of {given.propeller_diameter_m:g} m at {SLOWEST:.0%} "
            f"to {FASTEST:.0%} of {given.shaft_speed_rpm:g} rpm gives {wanted}; check "
            "propeller_diameter_m, shaft_speed_rpm and design_speed_kn"
        )
    return min(tried)[1:]


SCALED = "scaled from the package's frigate"


def estimate_sections(given: Particulars) -> Sections:
    """Return the keys of a ship file by section, with a note on the source of each value.

    Args:
        given: particulars.

    Raises:
        ShipError: the propeller cannot give the thrust of the design speed, or the engine its power.
        ValidationError: dimensions that fit no ship.
    """
    hull = hull_form(given)
    point = design_point(given, hull)
    power = given.mcr_kW * 1e3
    if point.shaft_power > 1.02 * power:
        raise ShipError(
            f"{given.name}: {given.design_speed_kn:g} kn needs {point.shaft_power / 1e3:.0f} kW of "
            f"each engine by Holtrop and Mennen, more than mcr_kW = {given.mcr_kW:g}; lower "
            "design_speed_kn or check displacement and dimensions"
        )
    return {
        "water": {"density_kg_m3": Estimate(WATER, "sea water of 15 degrees Celsius")},
        "hull": _hull(given, hull, point),
        "propeller": _propeller(given, point),
        "prime_mover": _motor(given) if given.prime_mover == "electric" else _engine(given),
        "transmission": _transmission(given, point),
        **(
            {"pitch_actuator": {"time_constant_s": Estimate(2.0, "assumed")}}
            if given.controllable_pitch
            else {}
        ),
        **(
            {} if given.superstructure is None else {"superstructure": _given(given.superstructure)}
        ),
        "tolerances": _tolerances(given),
    }


def _given(table: Superstructure) -> dict[str, Estimate]:
    return {key: Estimate(value, "") for key, value in table.model_dump(exclude_unset=True).items()}


_TOLERANCES = {
    "default": Estimate("guessed", "the values that follow are assumed standard deviations"),
    "resistance": Estimate(0.1, "Holtrop and Mennen for a single ship"),
    "mass": Estimate(0.02, ""),
    "inertia": Estimate(0.5, "of engine, flywheel and gearbox by their rating alone"),
    "pitch_time_constant": Estimate(0.5, ""),
    "wake_fraction": Estimate(0.05, ""),
    "thrust_curve": Estimate(0.03, "B-series for a real propeller"),
    "torque_curve": Estimate(0.03, "B-series for a real propeller"),
}
_ENGINE_TOLERANCES = {
    "torque_per_rack": Estimate(0.2, "the map of another engine"),
    "torque_offset": Estimate(0.1, "the map of another engine, of the highest torque"),
}
_MOTOR_TOLERANCES = {
    "motor_constant": Estimate(0.05, ""),
    "armature_resistance": Estimate(0.3, "from the efficiency of the motor alone"),
}


def _tolerances(given: Particulars) -> dict[str, Estimate]:
    """Return the tolerances; what the yard has measured makes some of them smaller."""
    known = {}
    if given.trial_power_kW is not None:
        known["resistance"] = Estimate(0.05, "from the power of the yard's trial")
    if given.full_load_rack_mm is not None:
        known["torque_per_rack"] = Estimate(0.1, "from the rack at full load")
    electric = given.prime_mover == "electric"
    return _TOLERANCES | (_MOTOR_TOLERANCES if electric else _ENGINE_TOLERANCES) | known


SLOWEST_SERVICE = 0.7
"""Share of the design speed down to which the resistance of the ship file shall hold. It is a power
law, which fits the range of service speeds alone: waves grow far faster than friction."""

WAVE_FACTORS = (0.3, 3.0)
"""Factors on the wave resistance of the regression that a power in the yard's trial may mean."""


def _resistance_curve(
    hull: HullForm, speeds: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """Return the resistance [N] at speeds (n,) [m/s], the last of them the design speed.

    At the design speed it is a multiple, the share, of that by Holtrop and Mennen. Friction is known far
    better than wave resistance (ITTC 1957), so the wave resistance is scaled, within
    :data:`WAVE_FACTORS`; all other parts have what remains.
    """
    parts = [resistance(hull, float(speed), WATER) for speed in speeds]
    waves = np.array([part.waves for part in parts])
    others = np.array([part.total for part in parts]) - waves
    wanted = share * (waves[-1] + others[-1])
    factor = float(np.clip((wanted - others[-1]) / max(waves[-1], 1e-9), *WAVE_FACTORS))
    remainder = (wanted - factor * waves[-1]) / others[-1]
    return np.asarray(factor * waves + remainder * others)


def _hull(given: Particulars, hull: HullForm, point: DesignPoint) -> dict[str, Estimate]:
    speed = given.design_speed_kn * KNOT
    shares = np.linspace(SLOWEST_SERVICE, 1.0, 11)
    forces = _resistance_curve(hull, shares * speed, point.resistance_share)
    high = float(forces[-1])
    slope = np.log(shares) @ np.log(forces / high) / (np.log(shares) @ np.log(shares))
    exponent = float(np.clip(slope, 1.5, 6.0))
    surge = 2.7 * WATER * hull.displacement_m3 ** (5.0 / 3.0) / given.length_m**2
    by_holtrop = "Holtrop and Mennen at the design speed"
    return {
        "mass_kg": Estimate(
            given.displacement_t * 1e3 + surge, "displacement and added mass by Soeding (1982)"
        ),
        "resistance_coefficient_N_s2_m2": Estimate(
            high / speed**2,
            by_holtrop
            if given.trial_power_kW is None
            else f"power of the yard's trial, {point.resistance_share:.3g} times Holtrop and Mennen",
        ),
        "resistance_exponent": Estimate(
            exponent, f"Holtrop and Mennen, {100 * SLOWEST_SERVICE:g} to 100 % of the design speed"
        ),
        "resistance_reference_speed_m_s": Estimate(speed, "design speed"),
        "thrust_deduction": Estimate(point.flow.thrust_deduction, by_holtrop),
        "wake_fraction": Estimate(point.flow.wake_fraction, by_holtrop),
        "propellers": Estimate(given.shafts, "given"),
        "beam_m": Estimate(given.beam_m, "given"),
        "bow_length_m": Estimate(0.25 * given.length_m, "assumed"),
    }


def _propeller(given: Particulars, point: DesignPoint) -> dict[str, Estimate]:
    pitch, note = point.pitch_ratio, "thrust at the design speed and the rating"
    if given.pitch_ratio is not None:
        note = "given"
    lowest, highest = (0.5, max(1.2, pitch)) if given.controllable_pitch else (pitch, pitch)
    area = "Keller's criterion" if given.expanded_area_ratio is None else "given"
    return {
        "model": Estimate("b-series", "assumed"),
        "diameter_m": Estimate(given.propeller_diameter_m, "given"),
        "blades": Estimate(given.blades, "given"),
        "expanded_area_ratio": Estimate(point.expanded_area_ratio, area),
        "pitch_ratio_min": Estimate(lowest, "of the B-series" if lowest < pitch else note),
        "pitch_ratio_max": Estimate(
            highest, note if lowest == pitch else f"design P/D {pitch:.3f}"
        ),
        "relative_rotative_efficiency": Estimate(
            point.flow.relative_rotative_efficiency, "Holtrop and Mennen"
        ),
        "depth_m": Estimate(_shaft_depth(given), "blade tips 5 % of the diameter above the keel"),
    }


def _engine(given: Particulars) -> dict[str, Estimate]:
    """Return the frigate's engine scaled to a rating: torque by torque, speed by speed."""
    engine: Any = load_ship("frigate").prime_mover
    rated_speed = given.engine_speed_rpm * math.pi / 30.0
    torque = given.mcr_kW * 1e3 / rated_speed
    share = torque / engine.torque_limit_N_m
    speed_share = rated_speed / (engine.speed_max_rpm * math.pi / 30.0)
    values: dict[str, Estimate] = {"type": Estimate("diesel", "assumed")}
    for key in ("torque_per_rack_N_m_mm", "torque_offset_N_m", "torque_limit_at_min_speed_N_m"):
        values[key] = Estimate(getattr(engine, key) * share, SCALED)
    for key in ("torque_per_speed_N_m_s_rad", "torque_limit_slope_N_m_s_rad"):
        values[key] = Estimate(getattr(engine, key) * share / speed_share, SCALED)
    values["torque_limit_N_m"] = Estimate(torque, "rated power over rated speed")
    values["rack_max_mm"] = Estimate(engine.rack_max_mm, "assumed: the scale of the rack")
    if given.full_load_rack_mm is not None:
        b, c, e = (
            values[key].value
            for key in ("torque_per_rack_N_m_mm", "torque_offset_N_m", "torque_per_speed_N_m_s_rad")
        )
        scale = given.full_load_rack_mm / ((torque - c - e * rated_speed) / b)
        values["torque_per_rack_N_m_mm"] = Estimate(b / scale, "from the rack at full load")
        values["rack_max_mm"] = Estimate(engine.rack_max_mm * scale, "from the rack at full load")
    values["speed_min_rpm"] = Estimate(engine.speed_min_rpm * speed_share, SCALED)
    values["speed_max_rpm"] = Estimate(given.engine_speed_rpm, "given")
    values["fuel_base_g_kWh"] = Estimate(
        given.specific_consumption_g_kWh,
        "given" if "specific_consumption_g_kWh" in given.model_fields_set else "assumed",
    )
    values["fuel_rated_power_W"] = Estimate(given.mcr_kW * 1e3, "given")
    for key in type(engine).model_fields:
        if key.startswith("fuel_p") and getattr(engine, key):
            values[key] = Estimate(getattr(engine, key), SCALED)
    return values


RATED_VOLTAGE = 1000.0
"""Voltage of an electric motor at its rating [V], assumed; only ratios to it matter."""


def _motor(given: Particulars) -> dict[str, Estimate]:
    """Return a DC motor that has the rating at :data:`RATED_VOLTAGE` with the given efficiency.

    All losses are those of the armature resistance: the torque is K i, the back voltage K w, and the
    current at the rating P / (eta U).
    """
    speed = given.engine_speed_rpm * math.pi / 30.0
    constant = given.motor_efficiency * RATED_VOLTAGE / speed
    current = given.mcr_kW * 1e3 / (given.motor_efficiency * RATED_VOLTAGE)
    resistance_ohm = (1.0 - given.motor_efficiency) * RATED_VOLTAGE / current
    rating = "rating and efficiency of the motor"
    return {
        "type": Estimate(
            template("electric-fixed-pitch").prime_mover.type,
            "DC motor, equivalent to a machine with a converter",
        ),
        "motor_constant_V_s_rad": Estimate(constant, rating),
        "armature_resistance_ohm": Estimate(resistance_ohm, rating),
        "voltage_max_V": Estimate(RATED_VOLTAGE, "assumed"),
    }


BRONZE = 7600.0
"""Density of propeller bronze [kg/m3]."""

INERTIA_CONSTANT_S = {"diesel": 1.5, "electric": 0.8}
"""Kinetic energy of engine or motor, flywheel and gearbox at rated speed over the rated power [s],
assumed."""


def _transmission(given: Particulars, point: DesignPoint) -> dict[str, Estimate]:
    rated = given.shaft_speed_rpm * math.pi / 30.0  # the inertia holds at the propeller shaft
    constant_s = INERTIA_CONSTANT_S[given.prime_mover]
    inertia = 2.0 * constant_s * given.mcr_kW * 1e3 / rated**2
    area, power = point.expanded_area_ratio, given.propeller_diameter_m**5
    # blades of the B-series: mean thickness 0.0102 D over the expanded area, radius of gyration 0.275 D
    blades = BRONZE * 0.25 * math.pi * area * 0.0102 * 0.275**2 * power
    water = 0.0703 * (point.pitch_ratio * area) ** 2 / (math.pi * given.blades) * WATER * power
    return {
        "gear_ratio": Estimate(given.engine_speed_rpm / given.shaft_speed_rpm, "given"),
        "efficiency": Estimate(gear_efficiency(given), "assumed"),
        "inertia_engine_side_kg_m2": Estimate(
            inertia, f"assumed: {constant_s:g} s of the rated power, at the propeller shaft"
        ),
        "inertia_propeller_side_kg_m2": Estimate(
            blades + water, "blades of the B-series, and water by Schwanecke (1963)"
        ),
    }


def ship_from_particulars(given: Particulars) -> Ship:
    """Return the ship of :func:`estimate_sections`.

    Args:
        given: particulars.

    Raises:
        ShipError: dimensions that fit no ship, or machinery that does not reach the design speed.
    """
    return _make_ship(given)[0]


def fixed_pitch_remarks(given: Particulars) -> list[str]:
    """Return a sentence where a fixed pitch keeps the ship from the design speed.

    Args:
        given: particulars.

    Raises:
        ShipError: as :func:`ship_from_particulars`.
    """
    if given.controllable_pitch or given.prime_mover == "electric":
        return []
    point = design_point(given, hull_form(given))
    speed = 2.0 * math.pi * point.shaft_speed * given.engine_speed_rpm / given.shaft_speed_rpm
    torque, turns = point.shaft_power / speed, 60.0 * point.shaft_speed
    limit = float(torque_limit(ship_from_particulars(given).record(), speed))
    where = f"with P/D {point.pitch_ratio:.3g} {given.design_speed_kn:g} kn need"
    if turns > 1.01 * given.shaft_speed_rpm:
        return [
            f"{where} {turns:.0f} rpm of the shaft, above shaft_speed_rpm = {given.shaft_speed_rpm:g}: "
            "the ship stays below design_speed_kn. Raise pitch_ratio, or check trial_power_kW"
        ]
    if torque > 1.01 * limit:
        return [
            f"{where} {torque / 1e3:.4g} kN m of each engine at {turns:.0f} rpm of the shaft, above its "
            f"limit of {limit / 1e3:.4g} kN m there: the ship stays below design_speed_kn. Lower "
            "pitch_ratio, or check trial_power_kW"
        ]
    return []


def _make_ship(given: Particulars) -> tuple[Ship, Sections]:
    """Return the ship and the sections of her file."""
    tree: dict[str, Any] = {"name": given.name, "description": _description(given)}
    try:
        sections = estimate_sections(given)
        for section, keys in sections.items():
            tree[section] = {key: estimate.value for key, estimate in keys.items()}
        return Ship.model_validate(tree), sections
    except ValidationError as error:
        raise ShipError(f"{given.name}: {explain(error)}") from None


def _description(given: Particulars) -> str:
    return f"{given.length_m:g} m, {given.design_speed_kn:g} kn, estimated from main particulars"


def particulars_text(given: Particulars) -> str:
    """Return the ship of :func:`estimate_sections` as the text of a commented ship file.

    Args:
        given: particulars.

    Raises:
        ShipError: as :func:`ship_from_particulars`.
    """
    ship, sections = _make_ship(given)
    return "\n".join(_lines(ship, sections)) + "\n"


def _lines(ship: Ship, sections: Sections) -> Iterator[str]:
    yield "# Made from main particulars by `shaftline new-ship --from-particulars`. What is not given"
    yield "# is estimated, by the method in its comment: replace what you know."
    yield f"name = {format_value(ship.name)}"
    yield f"description = {format_value(ship.description)}"
    for section, keys in sections.items():
        yield f"\n[{section}]"
        for key, (value, note) in keys.items():
            shown = _digits(value) if isinstance(value, int | float) else format_value(value)
            line = f"{key} = {shown}"
            yield f"{line:<48} # {note}" if note else line


def _digits(value: float) -> str:
    """Return a number with six significant digits as TOML."""
    if isinstance(value, int):
        return str(value)
    text = f"{value:.6g}"
    return text if any(mark in text for mark in ".en") else f"{text}.0"
