"""Corrections of a speed trial against values of another implementation, and their limits."""

from __future__ import annotations

import math

import pytest

from shaftline.performance.corrections import (
    SEA_WATER,
    Wind,
    admiralty_factor,
    in_wave_range,
    mean_wind,
    regular_wave_resistance,
    relative_wind,
    shallow_water_speed_loss,
    true_wind,
    water_resistance,
    wave_resistance,
    wind_at_height,
    wind_resistance,
)
from shaftline.plant.holtrop import HullForm
from shaftline.plant.surroundings import GRAVITY
from shaftline.plant.wind import Superstructure

TANKER = HullForm(
    length_m=320,
    beam_m=58,
    draught_m=20.8,
    displacement_m3=312622,
    midship_coefficient=0.998,
    waterplane_coefficient=0.9,
    lcb_percent=3.5,
)
KNOT = 1852.0 / 3600.0
TESTED = {"frontal_area_m2": 1161.0, "angle_deg": [0, 90, 180], "coefficient": [0.9, 0.1, -0.6]}


@pytest.mark.parametrize(
    ("length_ratio", "coefficient"),
    [
        (0.2, 0.59833),
        (0.5, 0.80324),
        (0.8, 1.43766),
        (1.0, 1.69708),
        (1.2, 1.2448),
        (1.5, 0.46587),
        (2.0, 0.10527),
    ],
)
def test_stawave_2_equals_another_implementation(length_ratio: float, coefficient: float) -> None:
    # R / (4 rho g zeta^2 B^2 / L) of the program sta.js (Johann426) at 15.5 kn; its Bessel functions are
    # polynomials with errors of about 1e-4
    frequency = math.sqrt(2.0 * math.pi * GRAVITY / (length_ratio * TANKER.length_m))
    force = regular_wave_resistance(TANKER, 15.5 * KNOT, frequency)
    unit = 4.0 * SEA_WATER * GRAVITY * TANKER.beam_m**2 / TANKER.length_m
    assert force / unit == pytest.approx(coefficient, rel=2e-3)


def test_the_resistance_of_a_sea_equals_another_implementation() -> None:
    # 73.61 kN by sta.js for Hs 1.5 m, T01 6 s at 15.1 kn, integrated with 200 steps on the left
    force = wave_resistance(TANKER, 15.1 * KNOT, 1.5, 6.0, density=1025.0)
    assert force == pytest.approx(73_610.0, rel=5e-3)
    assert wave_resistance(TANKER, 15.1 * KNOT, 3.0, 6.0, density=1025.0) == pytest.approx(
        4 * force
    )


@pytest.mark.parametrize(
    ("degrees", "counts"), [(0, True), (44, True), (-44, True), (46, False), (180, False)]
)
def test_only_waves_within_45_degrees_of_the_bow_count(degrees: float, counts: bool) -> None:
    assert (wave_resistance(TANKER, 8.0, 2.0, 7.0, math.radians(degrees)) > 0.0) is counts


def test_the_range_of_stawave_2_is_known() -> None:
    assert in_wave_range(TANKER, 8.0)
    assert not in_wave_range(TANKER, 20.0)


def test_true_and_relative_wind_are_inverse() -> None:
    true = Wind(11.0, 2.2)
    relative = relative_wind(true, 7.0, 0.6)
    assert true_wind(relative, 7.0, 0.6) == pytest.approx(true)
    # 10 m/s from ahead of a ship that makes 5 m/s to the south
    assert relative_wind(Wind(10.0, math.pi), 5.0, math.pi) == pytest.approx((15.0, 0.0), abs=1e-12)


def test_the_mean_wind_is_the_mean_vector() -> None:
    assert mean_wind([Wind(10.0, 0.0), Wind(10.0, math.pi / 2)]) == pytest.approx(
        (10.0 / math.sqrt(2.0), math.pi / 4)
    )


def test_the_wind_grows_with_height_by_the_seventh_root() -> None:
    assert wind_at_height(10.0, 25.0, 10.0) == pytest.approx(10.0 * 0.4 ** (1 / 7))


def test_still_air_and_wind_from_ahead() -> None:
    ship = Superstructure.model_validate(TESTED)
    assert wind_resistance(ship, Wind(7.0, 0.0), 7.0) == 0.0
    ahead = 0.5 * 1.225 * 1161.0 * 0.9 * (15.0**2 - 7.0**2)
    assert wind_resistance(ship, Wind(15.0, 0.0), 7.0) == pytest.approx(ahead)


def test_cold_and_light_water() -> None:
    assert water_resistance(TANKER, 8.0, 1.5e6, 15.0, SEA_WATER) == 0.0
    assert water_resistance(TANKER, 8.0, 1.5e6, 5.0, SEA_WATER) > 0.0  # cold water is more viscous
    # fresh water is lighter by 2.5 % and less viscous by 4 %, which lowers friction by about 0.6 %
    fresh, lighter = water_resistance(TANKER, 8.0, 1.5e6, 15.0, 1000.0), 1000.0 / SEA_WATER - 1.0
    assert 1.5e6 * (lighter - 0.01) < fresh < 1.5e6 * lighter


def test_shallow_water_by_lackenby() -> None:
    # A/h^2 = 0.1875, tanh(g h / V^2) = 0.99922
    expected = 0.1242 * (0.1875 - 0.05) + 1.0 - math.sqrt(math.tanh(9.81 * 40.0 / 100.0))
    assert shallow_water_speed_loss(10.0, 300.0, 40.0) == pytest.approx(expected, rel=1e-4)
    assert shallow_water_speed_loss(10.0, 300.0, 78.0) == 0.0


def test_the_admiralty_formula() -> None:
    assert admiralty_factor(1000.0, 1010.0) == pytest.approx(1.01 ** (2 / 3))
