"""Estimate resistance, wake and thrust deduction of a ship from her main dimensions (Holtrop & Mennen).

Regression on model tests and sea trials of displacement ships. Sources:

- J. Holtrop and G. G. J. Mennen (1982): An approximate power prediction method. International
  Shipbuilding Progress 29 (335), 166-170.
- J. Holtrop (1984): A statistical re-analysis of resistance and propulsion data. International
  Shipbuilding Progress 31 (363), 272-276.

The formulas are those of 1984. What that paper leaves unchanged (bulb, transom, correlation allowance,
wetted surface, angle of entrance) is taken from 1982.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pydantic import Field, model_validator

from ..core.models import FileModel
from .surroundings import GRAVITY

VISCOSITY = 1.18831e-6
"""Kinematic viscosity of sea water at 15 degrees Celsius [m2/s], as in the examples of 1982 and 1984."""


FORM = ("midship_coefficient", "waterplane_coefficient", "lcb_percent")
"""Keys of a hull that can be estimated."""


def estimate_form(block: float, froude: float) -> dict[str, float]:
    """Return estimates of the keys :data:`FORM` of a hull.

    C_M = 1 / (1 + (1 - C_B)^3.5) and C_WP = (1 + 2 C_B) / 3 (Schneekluth & Bertram 1998, Ship design for
    efficiency and economy, chapter 1); the centre of buoyancy 8.8 - 38.9 Fn per cent of the length
    forward of midships, at most 3 (the same, after Guldhammer and Harvald).

    Args:
        block: block coefficient.
        froude: Froude number at the design speed.
    """
    return {
        "midship_coefficient": 1.0 / (1.0 + max(1.0 - block, 0.0) ** 3.5),
        "waterplane_coefficient": min((1.0 + 2.0 * block) / 3.0, 1.0),
        "lcb_percent": min(max(8.8 - 38.9 * froude, -3.0), 3.0),
    }


class HullForm(FileModel):
    """Main dimensions and form coefficients of a hull.

    Example:
        >>> hull = HullForm(
        ...     length_m=205, beam_m=32, draught_m=10, displacement_m3=37500, midship_coefficient=0.98,
        ...     waterplane_coefficient=0.75, lcb_percent=-0.75, transom_area_m2=16, bulb_area_m2=20,
        ...     bulb_centre_m=4, appendage_area_m2=50, appendage_factor=1.5, stern_shape=10,
        ... )
        >>> round(resistance(hull, 12.86).total / 1000)  # at 25 knots [kN]
        1815
    """

    length_m: float = Field(gt=1, le=500, description="length on the water line")
    beam_m: float = Field(gt=0.2, le=100, description="moulded beam at the water line")
    draught_m: float = Field(gt=0.1, le=40, description="mean moulded draught")
    displacement_m3: float = Field(gt=0.1, le=1e6, description="moulded volume displacement")
    midship_coefficient: float = Field(gt=0.4, le=1, description="midship section coefficient C_M")
    waterplane_coefficient: float = Field(gt=0.4, le=1, description="water plane coefficient C_WP")
    lcb_percent: float = Field(
        ge=-8, le=8, description="centre of buoyancy forward of half the length, % of the length"
    )
    draught_forward_m: float | None = Field(default=None, gt=0.1, le=40)
    draught_aft_m: float | None = Field(default=None, gt=0.1, le=40)
    transom_area_m2: float = Field(default=0.0, ge=0, description="immersed transom at rest")
    bulb_area_m2: float = Field(
        default=0.0, ge=0, description="bulb's section at the fore perpendicular"
    )
    bulb_centre_m: float = Field(
        default=0.0, ge=0, description="centre of that section above the keel"
    )
    appendage_area_m2: float = Field(default=0.0, ge=0, description="wetted area of the appendages")
    appendage_factor: float = Field(default=1.5, ge=1, le=5, description="1 + k2 of the appendages")
    stern_shape: float = Field(
        default=0.0,
        ge=-25,
        le=10,
        description="C_stern: -25 pram with gondola, -10 V-shaped, 0 normal, 10 U-shaped sections",
    )
    entrance_angle_deg: float | None = Field(
        default=None, gt=0, lt=90, description="half angle of entrance; by regression without it"
    )
    wetted_surface_m2: float | None = Field(
        default=None, gt=0, description="wetted surface of the hull; by regression without it"
    )

    @model_validator(mode="after")
    def _check(self) -> HullForm:
        block, prismatic = self.block_coefficient, self.prismatic_coefficient
        if not 0.3 < block < 0.95:
            raise ValueError(
                f"displacement_m3 = {self.displacement_m3:g} gives a block coefficient of {block:.2f} "
                "with length_m, beam_m and draught_m; ships have 0.3 to 0.95: check the four values"
            )
        if not 0.4 < prismatic < 0.95:
            raise ValueError(
                f"the prismatic coefficient is {prismatic:.2f} (block / midship coefficient); "
                "ships have 0.4 to 0.95: check displacement_m3 and midship_coefficient"
            )
        if self.bulb_area_m2 and self.bulb_centre_m > 0.6 * self.forward:
            raise ValueError(
                f"bulb_centre_m = {self.bulb_centre_m:g} must be at most 0.6 of the draught forward, "
                f"{self.forward:g} m"
            )
        return self

    @property
    def block_coefficient(self) -> float:
        """Block coefficient C_B."""
        return self.displacement_m3 / (self.length_m * self.beam_m * self.draught_m)

    @property
    def prismatic_coefficient(self) -> float:
        """Prismatic coefficient C_P."""
        return self.block_coefficient / self.midship_coefficient

    @property
    def forward(self) -> float:
        """Draught at the fore perpendicular [m]."""
        return self.draught_m if self.draught_forward_m is None else self.draught_forward_m

    @property
    def aft(self) -> float:
        """Draught at the aft perpendicular [m]."""
        return self.draught_m if self.draught_aft_m is None else self.draught_aft_m

    @property
    def midship_area(self) -> float:
        """Midship section under water [m2]."""
        return self.midship_coefficient * self.beam_m * self.draught_m

    @property
    def length_of_run(self) -> float:
        """Length of run L_R [m] (1982, p. 166)."""
        prismatic = self.prismatic_coefficient
        run = 1.0 - prismatic + 0.06 * prismatic * self.lcb_percent / (4.0 * prismatic - 1.0)
        return self.length_m * run

    @property
    def wetted_surface(self) -> float:
        """Wetted surface S of the bare hull [m2] (1982, p. 166)."""
        if self.wetted_surface_m2 is not None:
            return self.wetted_surface_m2
        block, midship = self.block_coefficient, self.midship_coefficient
        shape = (
            0.453
            + 0.4425 * block
            - 0.2862 * midship
            - 0.003467 * self.beam_m / self.draught_m
            + 0.3696 * self.waterplane_coefficient
        )
        girth = 2.0 * self.draught_m + self.beam_m
        return self.length_m * girth * math.sqrt(midship) * shape + 2.38 * self.bulb_area_m2 / block

    @property
    def entrance_angle(self) -> float:
        """Half angle of entrance i_E [degrees] (1982, p. 167)."""
        if self.entrance_angle_deg is not None:
            return self.entrance_angle_deg
        length, beam = self.length_m, self.beam_m
        exponent = (
            (length / beam) ** 0.80856
            * (1.0 - self.waterplane_coefficient) ** 0.30484
            * (1.0 - self.prismatic_coefficient - 0.0225 * self.lcb_percent) ** 0.6367
            * (self.length_of_run / beam) ** 0.34574
            * (100.0 * self.displacement_m3 / length**3) ** 0.16302
        )
        return 1.0 + 89.0 * math.exp(-exponent)

    @property
    def form_factor(self) -> float:
        """Form factor 1 + k1 of the bare hull (1984, p. 272)."""
        length = self.length_m
        stern = 1.0 + 0.011 * self.stern_shape
        slope = (
            (self.beam_m / length) ** 1.06806
            * (self.draught_m / length) ** 0.46106
            * (length / self.length_of_run) ** 0.121563
            * (length**3 / self.displacement_m3) ** 0.36486
            * (1.0 - self.prismatic_coefficient) ** -0.604247
        )
        return float(0.93 + 0.487118 * stern * slope)

    @property
    def bulb_factor(self) -> float:
        """Factor c2 of the wave resistance by a bulbous bow (1982, p. 167)."""
        area = self.bulb_area_m2
        if area == 0.0:
            return 1.0
        depth = 0.31 * math.sqrt(area) + self.forward - self.bulb_centre_m
        return math.exp(
            -1.89 * math.sqrt(0.56 * area**1.5 / (self.beam_m * self.draught_m * depth))
        )

    @property
    def correlation_allowance(self) -> float:
        """Model-ship correlation allowance C_A (1982, p. 168), for the roughness of a clean hull."""
        length = self.length_m
        deep = 0.04 - min(self.forward / length, 0.04)
        bulb = 0.003 * math.sqrt(length / 7.5) * self.block_coefficient**4 * self.bulb_factor * deep
        return float(0.006 * (length + 100.0) ** -0.16 - 0.00205 + bulb)


class Resistance(NamedTuple):
    """Components of the resistance in calm deep water [N]."""

    friction: float
    """Of the hull, with the form factor."""
    appendages: float
    waves: float
    bulb: float
    transom: float
    correlation: float

    @property
    def total(self) -> float:
        """Total resistance [N]."""
        return sum(self)


def friction_coefficient(reynolds: float) -> float:
    """Return the friction coefficient C_F of the ITTC 1957 line.

    Args:
        reynolds: Reynolds number by the length of the ship.
    """
    return 0.075 / (math.log10(reynolds) - 2.0) ** 2


def resistance(
    hull: HullForm,
    speed_m_s: float,
    density_kg_m3: float = 1025.0,
    viscosity_m2_s: float = VISCOSITY,
) -> Resistance:
    """Return the resistance of a ship in calm deep water (Holtrop 1984).

    Args:
        hull: main dimensions.
        speed_m_s: speed through the water, above 0 [m/s].
        density_kg_m3: density of the water.
        viscosity_m2_s: kinematic viscosity of the water.

    Raises:
        ValueError: the speed is not above 0.
    """
    if speed_m_s <= 0.0:
        raise ValueError(f"speed_m_s = {speed_m_s:g} must be above 0")
    pressure = 0.5 * density_kg_m3 * speed_m_s**2
    skin = pressure * friction_coefficient(speed_m_s * hull.length_m / viscosity_m2_s)
    weight = density_kg_m3 * GRAVITY
    wetted = hull.wetted_surface
    return Resistance(
        friction=skin * wetted * hull.form_factor,
        appendages=skin * hull.appendage_area_m2 * hull.appendage_factor,
        waves=weight * hull.displacement_m3 * _wave_ratio(hull, speed_m_s),
        bulb=weight * _bulb_volume(hull, speed_m_s),
        transom=pressure * hull.transom_area_m2 * _transom_coefficient(hull, speed_m_s),
        correlation=pressure * (wetted + hull.appendage_area_m2) * hull.correlation_allowance,
    )


SLOW, FAST = 0.4, 0.55
"""Froude numbers below and above which one of the two formulas of the wave resistance holds."""


def _wave_ratio(hull: HullForm, speed: float) -> float:
    """Return the wave resistance over the weight of the displaced water (1984, p. 272)."""
    froude = speed / math.sqrt(GRAVITY * hull.length_m)
    if froude <= SLOW:
        return _slow_waves(hull, froude)
    if froude >= FAST:
        return _fast_waves(hull, froude)
    slow, fast = _slow_waves(hull, SLOW), _fast_waves(hull, FAST)
    return slow + (froude - SLOW) / (FAST - SLOW) * (fast - slow)


def _slow_waves(hull: HullForm, froude: float) -> float:
    length, beam, draught = hull.length_m, hull.beam_m, hull.draught_m
    ratio, prismatic = beam / length, hull.prismatic_coefficient
    if ratio < 0.11:
        c7 = 0.229577 * ratio ** (1.0 / 3.0)
    else:
        c7 = ratio if ratio <= 0.25 else 0.5 - 0.0625 / ratio
    c1 = (
        2223105.0
        * c7**3.78613
        * (draught / beam) ** 1.07961
        * (90.0 - hull.entrance_angle) ** -1.37565
    )
    c16 = (
        8.07981 * prismatic - 13.8673 * prismatic**2 + 6.984388 * prismatic**3
        if prismatic < 0.8
        else 1.73014 - 0.7067 * prismatic
    )
    slender = hull.displacement_m3 ** (1.0 / 3.0) / length
    m1 = 0.0140407 * length / draught - 1.75254 * slender - 4.79323 * ratio - c16
    exponent = m1 * froude**-0.9 + _interference(hull, froude)
    return float(c1 * _bulb_and_transom(hull) * math.exp(exponent))


def _fast_waves(hull: HullForm, froude: float) -> float:
    length, beam = hull.length_m, hull.beam_m
    c17 = (
        6919.3
        * hull.midship_coefficient**-1.3346
        * (hull.displacement_m3 / length**3) ** 2.00977
        * (length / beam - 2.0) ** 1.40692
    )
    m3 = -7.2035 * (beam / length) ** 0.326869 * (hull.draught_m / beam) ** 0.605375
    exponent = m3 * froude**-0.9 + _interference(hull, froude)
    return float(c17 * _bulb_and_transom(hull) * math.exp(exponent))


def _bulb_and_transom(hull: HullForm) -> float:
    """Return c2 c5."""
    return hull.bulb_factor * (1.0 - 0.8 * hull.transom_area_m2 / hull.midship_area)


def _interference(hull: HullForm, froude: float) -> float:
    """Return m4 cos(lambda Fn^-2), the interference of bow and stern waves."""
    length, volume = hull.length_m, hull.displacement_m3
    slender = length**3 / volume
    if slender < 512.0:
        c15 = -1.69385
    else:
        c15 = 0.0 if slender > 1726.91 else -1.69385 + (slender ** (1.0 / 3.0) - 8.0) / 2.36
    wave = 1.446 * hull.prismatic_coefficient - min(0.03 * length / hull.beam_m, 0.36)
    m4 = 0.4 * c15 * math.exp(-0.034 * froude**-3.29)
    return m4 * math.cos(wave * froude**-2)


def _bulb_volume(hull: HullForm, speed: float) -> float:
    """Return the additional resistance of a bulb near the surface over rho g [m3] (1982, p. 168)."""
    area, forward = hull.bulb_area_m2, hull.forward
    if area == 0.0:
        return 0.0
    emergence = 0.56 * math.sqrt(area) / (forward - 1.5 * hull.bulb_centre_m)
    depth = forward - hull.bulb_centre_m - 0.25 * math.sqrt(area)
    froude = speed / math.sqrt(GRAVITY * depth + 0.15 * speed**2)
    risen = math.exp(-3.0 / emergence**2) * froude**3 / (1.0 + froude**2)
    return float(0.11 * risen * area**1.5)


def _transom_coefficient(hull: HullForm, speed: float) -> float:
    """Return c6 of the immersed transom (1982, p. 168)."""
    area = hull.transom_area_m2
    if area == 0.0:
        return 0.0
    width = hull.beam_m * (1.0 + hull.waterplane_coefficient)
    froude = speed / math.sqrt(2.0 * GRAVITY * area / width)
    return max(0.2 * (1.0 - 0.2 * froude), 0.0)


class Interaction(NamedTuple):
    """Interaction of hull and propeller."""

    wake_fraction: float
    thrust_deduction: float
    relative_rotative_efficiency: float


def interaction(
    hull: HullForm,
    diameter_m: float,
    speed_m_s: float,
    screws: int = 1,
    expanded_area_ratio: float = 0.6,
    pitch_ratio: float = 1.0,
    viscosity_m2_s: float = VISCOSITY,
) -> Interaction:
    """Return wake fraction, thrust deduction and relative rotative efficiency (Holtrop 1984, p. 273).

    Args:
        hull: main dimensions.
        diameter_m: diameter of the propeller.
        speed_m_s: speed through the water, above 0 [m/s].
        screws: 1 or 2 propellers.
        expanded_area_ratio: used for one propeller.
        pitch_ratio: used for two propellers.
        viscosity_m2_s: kinematic viscosity of the water.

    Raises:
        ValueError: neither one nor two propellers.
    """
    if screws not in (1, 2):
        raise ValueError(f"screws = {screws}: the regression has ships with 1 or 2 propellers")
    length, beam, draught, aft = hull.length_m, hull.beam_m, hull.draught_m, hull.aft
    block, prismatic, lcb = hull.block_coefficient, hull.prismatic_coefficient, hull.lcb_percent
    friction = friction_coefficient(speed_m_s * length / viscosity_m2_s)
    viscous = hull.form_factor * friction + hull.correlation_allowance
    section = math.sqrt(beam * draught)
    if screws == 2:
        return Interaction(
            0.3095 * block + 10.0 * viscous * block - 0.23 * diameter_m / section,
            0.325 * block - 0.1885 * diameter_m / section,
            0.9737 + 0.111 * (prismatic - 0.0225 * lcb) - 0.06325 * pitch_ratio,
        )
    wetted = hull.wetted_surface
    if beam / aft < 5.0:
        c8 = beam * wetted / (length * diameter_m * aft)
    else:
        c8 = wetted * (7.0 * beam / aft - 25.0) / (length * diameter_m * (beam / aft - 3.0))
    c9 = c8 if c8 < 28.0 else 32.0 - 16.0 / (c8 - 24.0)
    ratio = aft / diameter_m
    c11 = ratio if ratio < 2.0 else 0.0833333 * ratio**3 + 1.33333
    c19 = (
        0.12997 / (0.95 - block) - 0.11056 / (0.95 - prismatic)
        if prismatic < 0.7
        else 0.18567 / (1.3571 - hull.midship_coefficient) - 0.71276 + 0.38648 * prismatic
    )
    c20 = 1.0 + 0.015 * hull.stern_shape
    run = 1.0 - (1.45 * prismatic - 0.315 - 0.0225 * lcb)
    wake = (
        c9 * c20 * viscous * length / aft * (0.050776 + 0.93405 * c11 * viscous / run)
        + 0.27915 * c20 * math.sqrt(beam / (length * run))
        + c19 * c20
    )
    deduction = (
        0.25014
        * (beam / length) ** 0.28956
        * (section / diameter_m) ** 0.2624
        / (1.0 - prismatic + 0.0225 * lcb) ** 0.01762
        + 0.0015 * hull.stern_shape
    )
    rotative = 0.9922 - 0.05908 * expanded_area_ratio + 0.07424 * (prismatic - 0.0225 * lcb)
    return Interaction(wake, deduction, rotative)
