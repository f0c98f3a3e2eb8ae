"""Wind resistance: the coefficient, the kernel against the formula, and ships in wind."""

from __future__ import annotations

import math
import re

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from shaftline.performance.corrections import Wind, relative_wind
from shaftline.performance.corrections import wind_resistance as by_formula
from shaftline.plant import Sea, Ship, equilibrium, load_ship, realise
from shaftline.plant.replay import simulate_recording
from shaftline.plant.wind import Superstructure, wind_resistance

AREAS = {
    "frontal_area_m2": 1200.0,
    "length_overall_m": 180.0,
    "beam_m": 28.0,
    "lateral_area_m2": 2800.0,
    "deck_area_m2": 850.0,
    "lateral_centre_m": 5.0,
    "lateral_centre_height_m": 15.0,
    "bridge_height_m": 45.0,
}
TESTED = {"frontal_area_m2": 1161.0, "angle_deg": [0, 90, 180], "coefficient": [0.9, 0.1, -0.6]}


@pytest.mark.parametrize(
    ("degrees", "coefficient"),
    # calculated by hand from the printed regression coefficients of Fujiwara et al. (2005)
    [
        (0.0, 0.922 - 0.507 * 2800 / (180 * 28) - 1.162 * 5 / 180),
        (
            180.0,
            0.018
            - 5.091 * 28 / 180
            + 10.367 * 15 / 180
            - 3.011 * 850 / 180**2
            - 0.341 * 1200 / 28**2,
        ),
    ],
)
def test_the_wind_coefficient_ahead_and_astern_is_the_term_along_the_ship(
    degrees: float, coefficient: float
) -> None:
    ship = Superstructure.model_validate(AREAS)
    assert ship.wind_coefficient(math.radians(degrees)) == pytest.approx(coefficient)


def test_the_wind_coefficient_is_symmetric_and_continuous() -> None:
    ship = Superstructure.model_validate(AREAS)
    angles = np.radians(np.arange(0.0, 180.1, 0.25))
    values = np.array([ship.wind_coefficient(float(a)) for a in angles])
    assert np.max(np.abs(np.diff(values))) < 0.02
    assert [ship.wind_coefficient(-float(a)) for a in angles] == pytest.approx(values.tolist())


def test_an_empty_table_has_no_wind_resistance() -> None:
    assert Superstructure().wind_coefficient(0.3) == 0.0
    assert by_formula(Superstructure(), Wind(12.0, 0.3), 7.0) == 0.0


def test_a_wind_tunnel_test_replaces_the_regression() -> None:
    ship = Superstructure.model_validate(TESTED)
    assert ship.wind_coefficient(math.radians(45.0)) == pytest.approx(0.5)
    assert ship.wind_coefficient(math.radians(-135.0)) == pytest.approx(-0.25)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"beam_m": 9.0}, "frontal_area_m2 is missing"),
        ({"frontal_area_m2": 9.0}, "length_overall_m, beam_m, lateral_area_m2, deck_area_m2, "),
        (TESTED | {"coefficient": [0.9]}, "angle_deg has 3 values and coefficient 1"),
        (TESTED | {"angle_deg": [0, 90, 170]}, "angle_deg must rise from 0 to 180"),
        (TESTED | {"angle_deg": [0, 0, 180]}, "angle_deg must rise from 0 to 180"),
    ],
)
def test_an_incomplete_superstructure_is_refused(keys: dict[str, object], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        Superstructure.model_validate(keys)


@pytest.fixture(scope="module")
def ship() -> Ship:
    return load_ship("frigate-at-sea")


@pytest.mark.parametrize("speed", [0.0, 8.0, -3.0])
@pytest.mark.parametrize("travel_deg", [0.0, 40.0, 90.0, 135.0, 180.0, 250.0])
def test_the_kernel_equals_the_formula_of_the_trial(
    ship: Ship, speed: float, travel_deg: float
) -> None:
    """A relative tolerance of 0.2 % of the largest force, for the table of 81 points."""
    plant, angle = ship.record(), math.radians(travel_deg)
    found = wind_resistance(plant, 14.0, math.cos(angle), math.sin(angle), speed, 0.0, 0.0)
    # Astern, the ship's own wind is from astern, where the formula of the trial subtracts it ahead.
    own = ship.superstructure.wind_coefficient(math.pi if speed < 0.0 else 0.0)
    own -= ship.superstructure.wind_coefficient(0.0)
    pressure = 0.5 * 1.225 * ship.superstructure.frontal_area_m2
    wind = relative_wind(Wind(14.0, angle + math.pi), speed, 0.0)
    expected = by_formula(ship.superstructure, wind, speed) - own * pressure * speed**2
    assert found == pytest.approx(expected, abs=2e-3 * pressure * (14.0 + abs(speed)) ** 2)


def test_a_heading_turns_the_wind(ship: Ship) -> None:
    plant, turned = ship.record(), math.radians(70.0)
    ahead = wind_resistance(plant, 12.0, -1.0, 0.0, 7.0, 0.0, 0.0)
    again = wind_resistance(plant, 12.0, -math.cos(turned), -math.sin(turned), 7.0, 0.0, turned)
    assert again == pytest.approx(ahead, rel=1e-9)
    assert wind_resistance(plant, 12.0, 1.0, 0.0, 7.0, 0.0, 0.0) < 0.0 < ahead
    assert wind_resistance(plant, 0.0, 1.0, 0.0, 7.0, 0.4, 0.0) == 0.0


def test_complex_steps_give_the_slope(ship: Ship) -> None:
    plant = ship.record()
    slope = wind_resistance(plant, 12.0, -0.6, 0.8, 7.0 + 1e-20j, 0.1 + 0j, 0.2 + 0j).imag / 1e-20
    low, high = (wind_resistance(plant, 12.0, -0.6, 0.8, v, 0.1, 0.2) for v in (6.9999, 7.0001))
    assert slope == pytest.approx((high - low) / 2e-4, rel=1e-6)


def test_wind_slows_a_ship_to_the_speed_of_its_resistance(ship: Ship) -> None:
    """The final speed is the steady one under the same force, given as a factor on the resistance."""
    rows = np.arange(0.0, 900.0, 1.0)
    table = pd.DataFrame({"time_s": rows, "fuel_rack_mm": 22.0, "pitch_ratio_command": 1.2})
    calm = simulate_recording(ship, table)["ship_speed_m_s"].iloc[-1]
    windy = realise(Sea(hs_m=0.0, tp_s=8.0, wind_m_s=16.0), ship.propeller.depth_m, 1)
    found = simulate_recording(ship, table, windy)
    speed = found["ship_speed_m_s"].iloc[-1]
    assert speed < calm - 0.2
    force = wind_resistance(ship.record(), 16.0, -1.0, 0.0, speed, 0.0, 0.0)
    drag = ship.hull.resistance_coefficient_N_s2_m2 * speed**2
    same = equilibrium(ship, 22.0, 1.2, resistance_factor=1.0 + force / drag).state.ship_speed
    assert speed == pytest.approx(same, abs=0.01)


def test_a_wind_without_a_superstructure_is_refused(frigate: Ship) -> None:
    windy = realise(Sea(hs_m=1.0, tp_s=8.0, wind_m_s=12.0), frigate.propeller.depth_m, 1)
    table = pd.DataFrame({"time_s": [0.0, 1.0], "fuel_rack_mm": 22.0, "pitch_ratio_command": 1.2})
    reason = "frigate: a wind of 12 m/s has no effect on a ship without a [superstructure]"
    with pytest.raises(ValueError, match=re.escape(reason)):
        simulate_recording(frigate, table, windy)
