"""Resistance that wind, waves, water and depth add to that of a ship in calm deep sea water.

The formulas are those of ISO 15016:2015 (Guidelines for the assessment of speed and power performance
by analysis of speed trial data) and of ITTC Recommended Procedure 7.5-04-01-01.1 (2017), which agree
in what is used here. A positive value is a resistance; all values are in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import i1, k1

from ..plant.holtrop import HullForm, friction_coefficient
from ..plant.surroundings import GRAVITY
from ..plant.wind import AIR_DENSITY, Superstructure

SEA_WATER = 1026.0
"""Density of the sea water at 15 degrees Celsius to which a trial is corrected [kg/m3] (ISO 15016)."""


class Wind(NamedTuple):
    """Wind as speed and direction; a true wind has the direction from which it comes."""

    speed: float
    """[m/s]"""
    angle: float
    """[rad]; relative to the bow for a relative wind, to north for a true wind."""


def true_wind(relative: Wind, speed_over_ground: float, heading_rad: float) -> Wind:
    """Return the true wind from a relative wind.

    Example:
        >>> wind = true_wind(Wind(15.0, 0.0), speed_over_ground=5.0, heading_rad=0.0)
        >>> round(wind.speed, 6), round(wind.angle, 6)
        (10.0, 0.0)

    Args:
        relative: measured wind.
        speed_over_ground: [m/s], along the heading.
        heading_rad: heading from north.
    """
    north = relative.speed * math.cos(relative.angle + heading_rad)
    east = relative.speed * math.sin(relative.angle + heading_rad)
    return _from_components(
        north - speed_over_ground * math.cos(heading_rad),
        east - speed_over_ground * math.sin(heading_rad),
    )


def relative_wind(true: Wind, speed_over_ground: float, heading_rad: float) -> Wind:
    """Return the relative wind of a ship in a true wind; the inverse of :func:`true_wind`.

    Example:
        >>> relative_wind(Wind(10.0, 0.0), speed_over_ground=5.0, heading_rad=0.0)
        Wind(speed=15.0, angle=0.0)

    Args:
        true: wind over ground.
        speed_over_ground: [m/s], along the heading.
        heading_rad: heading from north.
    """
    angle = true.angle - heading_rad
    return _from_components(
        true.speed * math.cos(angle) + speed_over_ground, true.speed * math.sin(angle)
    )


def mean_wind(winds: Sequence[Wind]) -> Wind:
    """Return the mean of wind vectors, as for the runs of a double run (ISO 15016, Annex C).

    Example:
        >>> mean_wind([Wind(10.0, 0.0), Wind(6.0, 0.0)])
        Wind(speed=8.0, angle=0.0)
    """
    return _from_components(
        float(np.mean([wind.speed * math.cos(wind.angle) for wind in winds])),
        float(np.mean([wind.speed * math.sin(wind.angle) for wind in winds])),
    )


def _from_components(along: float, across: float) -> Wind:
    return Wind(math.hypot(along, across), math.atan2(across, along))


def wind_at_height(speed: float, height_m: float, reference_m: float) -> float:
    """Return the true wind speed at a reference height, by the power law with the exponent 1/7.

    Example:
        >>> round(wind_at_height(10.0, height_m=25.0, reference_m=10.0), 2)
        8.77

    Args:
        speed: wind speed at ``height_m`` [m/s].
        height_m: height of the anemometer above the water.
        reference_m: height for which the speed is wanted.
    """
    return speed * float((reference_m / height_m) ** (1.0 / 7.0))


def wind_resistance(
    ship: Superstructure, wind: Wind, speed_over_ground: float, air_density: float = AIR_DENSITY
) -> float:
    """Return the resistance increase R_AA by a relative wind [N] (ISO 15016:2015, Annex C).

    The air resistance of the ship's own speed belongs to calm water and is subtracted.

    Args:
        ship: ship above the water line.
        wind: relative wind at the reference height.
        speed_over_ground: [m/s].
        air_density: [kg/m3].
    """
    pressure = 0.5 * air_density * ship.frontal_area_m2
    return pressure * (
        ship.wind_coefficient(wind.angle) * wind.speed**2
        - ship.wind_coefficient(0.0) * speed_over_ground**2
    )


WAVE_RANGE = "L above 75 m, L/B 4 to 9, B/T 2.2 to 9, Froude number 0.1 to 0.3, C_B 0.39 to 0.9"
"""Range of STAWAVE-2."""


def in_wave_range(hull: HullForm, speed: float) -> bool:
    """Return whether STAWAVE-2 holds for a hull and a speed [m/s] (:data:`WAVE_RANGE`)."""
    froude = speed / math.sqrt(GRAVITY * hull.length_m)
    return (
        hull.length_m > 75.0
        and 4.0 < hull.length_m / hull.beam_m < 9.0
        and 2.2 < hull.beam_m / hull.draught_m < 9.0
        and 0.1 < froude < 0.3
        and 0.39 < hull.block_coefficient < 0.9
    )


def regular_wave_resistance(
    hull: HullForm,
    speed: float,
    frequency: float,
    gyradius: float = 0.25,
    density: float = SEA_WATER,
) -> float:
    """Return the resistance of regular head waves over their squared amplitude [N/m2] (STAWAVE-2).

    The sum of the resistance by the ship's motions and by reflected waves (ISO 15016:2015, Annex D).

    Args:
        hull: main dimensions.
        speed: speed through the water [m/s], above 0.
        frequency: circular frequency of the waves [rad/s].
        gyradius: pitch radius of gyration over the length.
        density: of the water [kg/m3].
    """
    length, beam, draught = hull.length_m, hull.beam_m, hull.draught_m
    froude = speed / math.sqrt(GRAVITY * length)
    scaled = (
        math.sqrt(length / GRAVITY) * gyradius ** (1.0 / 3.0) / (1.17 * froude**-0.143) * frequency
    )
    power, decay = (11.0, 14.0) if scaled < 1.0 else (-8.5, -566.0 * (length / beam) ** -2.66)
    shape = 60.3 * hull.block_coefficient**1.34 * froude**1.5 * math.exp(-3.5 * froude)
    motion = shape * scaled**power * math.exp(power / decay * (1.0 - scaled**decay))
    depth = 1.5 * frequency**2 / GRAVITY * draught
    speed_ratio = 0.692 * (speed / math.sqrt(draught * GRAVITY)) ** 0.769
    reflected = _reflection(depth) * (speed_ratio + 1.81 * hull.block_coefficient**6.95)
    return float(density * GRAVITY * beam * (4.0 * beam / length * motion + 0.5 * reflected))


def _reflection(depth: float) -> float:
    """Return pi^2 I1^2 / (pi^2 I1^2 + K1^2); 1 for short waves, where the Bessel functions overflow."""
    if depth > 50.0:
        return 1.0
    first = (math.pi * float(i1(depth))) ** 2
    return first / (first + float(k1(depth)) ** 2)


HEAD = math.radians(45.0)
"""Largest angle from the bow of waves that STAWAVE-2 counts as head waves."""


def wave_resistance(
    hull: HullForm,
    speed: float,
    significant_height: float,
    mean_period: float,
    angle_rad: float = 0.0,
    gyradius: float = 0.25,
    density: float = SEA_WATER,
) -> float:
    """Return the mean resistance of a sea [N] by STAWAVE-2 and the ITTC 1978 spectrum.

    Waves from more than 45 degrees off the bow have none (ISO 15016:2015, Annex D).

    Args:
        hull: main dimensions.
        speed: speed through the water [m/s].
        significant_height: significant wave height [m].
        mean_period: mean period T01 [s].
        angle_rad: direction from which the waves come, from the bow.
        gyradius: pitch radius of gyration over the length.
        density: of the water [kg/m3].
    """
    if significant_height <= 0.0 or speed <= 0.0 or mean_period <= 0.0:
        return 0.0
    if abs(math.remainder(angle_rad, 2.0 * math.pi)) > HEAD:
        return 0.0
    size, decay = 173.0 * significant_height**2 / mean_period**4, 691.0 / mean_period**4
    peak = (0.8 * decay) ** 0.25
    frequencies = np.linspace(0.5 * peak, 6.0 * peak, 600)
    spectrum = size / frequencies**5 * np.exp(-decay / frequencies**4)
    per_square = [
        regular_wave_resistance(hull, speed, float(w), gyradius, density) for w in frequencies
    ]
    return float(2.0 * np.trapezoid(spectrum * per_square, frequencies))


def sea_water_viscosity(temperature_C: float, density: float = SEA_WATER) -> float:
    """Return the kinematic viscosity of water [m2/s] (ISO 15016:2015, Annex E).

    Example:
        >>> f"{sea_water_viscosity(15.0):.3e}"
        '1.190e-06'

    Args:
        temperature_C: temperature of the water.
        density: of the water [kg/m3].
    """
    falling = (temperature_C + 20.0) ** (0.00172 * density - 2.202)
    return float(1e-6 * ((43.4233 - 0.03138 * density) * falling + 4.7478 - 0.005779 * density))


def water_resistance(
    hull: HullForm, speed: float, calm_resistance: float, temperature_C: float, density: float
) -> float:
    """Return the resistance increase R_AS by temperature and density [N] (ISO 15016:2015, Annex E).

    Args:
        hull: main dimensions.
        speed: speed through the water [m/s].
        calm_resistance: total resistance in sea water of 15 degrees Celsius [N].
        temperature_C: temperature of the water of the trial.
        density: density of that water [kg/m3].
    """
    here = friction_coefficient(speed * hull.length_m / sea_water_viscosity(temperature_C, density))
    there = friction_coefficient(speed * hull.length_m / sea_water_viscosity(15.0))
    friction = 0.5 * density * hull.wetted_surface * speed**2 * here
    return calm_resistance * (density / SEA_WATER - 1.0) - friction * (there / here - 1.0)


def shallow_water_speed_loss(speed: float, midship_area_m2: float, depth_m: float) -> float:
    """Return the loss of speed in shallow water over the speed in deep water (Lackenby 1963).

    Example:
        >>> round(shallow_water_speed_loss(speed=10.0, midship_area_m2=300.0, depth_m=40.0), 4)
        0.0175

    Args:
        speed: speed through the water [m/s].
        midship_area_m2: midship section under water.
        depth_m: depth of the water.
    """
    blockage = midship_area_m2 / depth_m**2
    if blockage < 0.05:
        return 0.0
    waves = 1.0 - math.sqrt(math.tanh(GRAVITY * depth_m / speed**2))
    return 0.1242 * (blockage - 0.05) + waves


def admiralty_factor(displacement_m3: float, contract_m3: float) -> float:
    """Return the factor (contract / trial)^(2/3) on the power, for displacements within 2 per cent.

    Example:
        >>> round(admiralty_factor(1000.0, 1010.0), 5)
        1.00666

    Args:
        displacement_m3: displacement at the trial.
        contract_m3: displacement of the contract.
    """
    return float((contract_m3 / displacement_m3) ** (2.0 / 3.0))
