"""A ship estimated from its main particulars."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from shaftline.plant import Ship, ShipError, approach, load_ship
from shaftline.plant.holtrop import resistance
from shaftline.plant.particulars import (
    Particulars,
    design_point,
    fixed_pitch_remarks,
    hull_form,
    load_particulars,
    particulars_text,
    ship_from_particulars,
)
from shaftline.plant.surroundings import KNOT

TANKER: dict[str, Any] = {
    "name": "tanker",
    "length_m": 325.5,
    "beam_m": 58.0,
    "draught_m": 20.8,
    "displacement_t": 320438.0,
    "design_speed_kn": 15.5,
    "mcr_kW": 28000.0,
    "engine_speed_rpm": 76.0,
    "shaft_speed_rpm": 76.0,
    "propeller_diameter_m": 9.86,
    "midship_coefficient": 0.998,
    "lcb_percent": 3.5,
    "stern_shape": 10.0,
}
"""The tanker KVLCC2, a public benchmark; rating and shaft speed are assumed."""

FERRY: dict[str, Any] = {
    "name": "ferry",
    "length_m": 150.0,
    "beam_m": 25.0,
    "draught_m": 6.0,
    "displacement_t": 13500.0,
    "design_speed_kn": 21.0,
    "mcr_kW": 10000.0,
    "engine_speed_rpm": 500.0,
    "shaft_speed_rpm": 140.0,
    "propeller_diameter_m": 4.6,
    "shafts": 2,
    "controllable_pitch": True,
}


def test_the_propeller_of_kvlcc2_is_near_the_published_one() -> None:
    """P/D 0.721, expanded area ratio 0.431 (SIMMAN 2008); within 5 %, the scatter of such estimates."""
    given = Particulars(**TANKER)
    point = design_point(given, hull_form(given))
    assert point.pitch_ratio == pytest.approx(0.721, rel=0.05)
    assert point.expanded_area_ratio == pytest.approx(0.431, rel=0.05)


@pytest.mark.parametrize("particulars", [TANKER, FERRY], ids=["tanker", "ferry"])
def test_the_ship_makes_her_design_speed_within_her_rating(particulars: dict[str, Any]) -> None:
    given = Particulars(**particulars)
    ship = ship_from_particulars(given)
    point = approach(ship, given.design_speed_kn * KNOT, ship.propeller.pitch_ratio_max)
    expected = design_point(given, hull_form(given))
    assert point.outputs.resistance == pytest.approx(
        given.shafts * (1.0 - ship.hull.thrust_deduction) * point.outputs.thrust, rel=1e-6
    )
    if not given.controllable_pitch:
        assert point.state.shaft_speed / (2 * math.pi) == pytest.approx(
            expected.shaft_speed, rel=1e-3
        )
        power = point.outputs.brake_torque * point.state.shaft_speed * ship.transmission.gear_ratio
        assert power == pytest.approx(expected.shaft_power, rel=2e-3)
    assert expected.shaft_power < given.mcr_kW * 1e3


def test_the_text_is_a_ship_file_that_equals_the_ship(tmp_path: Path) -> None:
    file = tmp_path / "ferry.toml"
    file.write_text(particulars_text(Particulars(**FERRY)))
    read, made = load_ship(file), ship_from_particulars(Particulars(**FERRY))
    assert read.hull.wake_fraction == pytest.approx(made.hull.wake_fraction, rel=1e-5)
    assert read.name == "ferry"
    assert isinstance(read, Ship)
    assert read.tolerances.resistance == 0.1
    assert tomllib.loads(file.read_text())["propeller"]["pitch_ratio_min"] == 0.5


def test_a_name_with_quotes_stays_a_name(tmp_path: Path) -> None:
    file = tmp_path / "ferry.toml"
    file.write_text(particulars_text(Particulars(**FERRY | {"name": 'the "old" ferry'})))
    assert load_ship(file).name == 'the "old" ferry'


def test_the_engine_delivers_its_rating_at_its_rated_speed() -> None:
    ship = ship_from_particulars(Particulars(**FERRY))
    engine: Any = ship.prime_mover
    assert engine.torque_limit_N_m * 500.0 * math.pi / 30.0 == pytest.approx(10e6)
    full = engine.torque_per_rack_N_m_mm * engine.rack_max_mm + engine.torque_offset_N_m
    full += engine.torque_per_speed_N_m_s_rad * 500.0 * math.pi / 30.0
    assert full > engine.torque_limit_N_m  # the limit is reached before the end stop of the rack


def test_the_engine_has_its_inertia_at_the_propeller_shaft() -> None:
    """The kinetic energy at the rated shaft speed is 1.5 s of the rated power, whatever the gears."""
    ship = ship_from_particulars(Particulars(**FERRY))
    speed = FERRY["shaft_speed_rpm"] * math.pi / 30.0
    energy = 0.5 * ship.transmission.inertia_engine_side_kg_m2 * speed**2
    assert energy == pytest.approx(1.5 * FERRY["mcr_kW"] * 1e3)
    assert ship.transmission.gear_ratio > 3.0


def test_an_electric_motor_delivers_its_rating_with_its_efficiency() -> None:
    """At the highest voltage and the rated speed the torque is P / w and the input P / eta."""
    given = Particulars(**FERRY | {"prime_mover": "electric", "motor_efficiency": 0.9})
    ship = ship_from_particulars(given)
    motor: Any = ship.prime_mover
    speed = 500.0 * math.pi / 30.0
    back = motor.motor_constant_V_s_rad * speed
    current = (motor.voltage_max_V - back) / motor.armature_resistance_ohm
    assert motor.motor_constant_V_s_rad * current * speed == pytest.approx(10e6)
    assert motor.voltage_max_V * current == pytest.approx(10e6 / 0.9)
    assert ship.has_voltage
    energy = 0.5 * ship.transmission.inertia_engine_side_kg_m2
    energy *= (FERRY["shaft_speed_rpm"] * math.pi / 30.0) ** 2
    assert energy == pytest.approx(0.8 * FERRY["mcr_kW"] * 1e3)
    assert ship.tolerances.armature_resistance == 0.3
    assert fixed_pitch_remarks(given) == []


@pytest.mark.parametrize(
    ("mover", "key", "value"),
    [("diesel", "motor_efficiency", 0.9), ("electric", "full_load_rack_mm", 40.0)],
)
def test_keys_of_another_prime_mover_are_refused(mover: str, key: str, value: float) -> None:
    with pytest.raises(ValidationError, match=f"{key}: has no effect with prime_mover = '{mover}'"):
        Particulars(**FERRY | {"prime_mover": mover, key: value})


def test_the_resistance_is_near_holtrop_at_lower_speeds() -> None:
    given = Particulars(**FERRY)
    hull = ship_from_particulars(given).hull
    for share in (0.7, 0.85, 1.0):
        speed = share * given.design_speed_kn * 1852.0 / 3600.0
        expected = resistance(hull_form(given), speed, 1025.0).total
        found = (
            hull.resistance_coefficient_N_s2_m2 * speed**2 * share ** (hull.resistance_exponent - 2)
        )
        assert found == pytest.approx(expected, rel=0.06)


def test_a_given_pitch_is_kept() -> None:
    given = Particulars(**TANKER | {"pitch_ratio": 0.7})
    assert design_point(given, hull_form(given)).pitch_ratio == 0.7


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"mcr_kW": 9000.0}, "15.5 kn needs .* more than mcr_kW = 9000; lower design_speed_kn"),
        ({"shaft_speed_rpm": 20.5}, "no B-series propeller of 9.86 m at 60% to 110% of 20.5 rpm"),
        ({"displacement_t": 500000.0}, "block coefficient of 1.2"),
    ],
)
def test_machinery_and_hulls_that_do_not_fit_are_refused(
    change: dict[str, float], reason: str
) -> None:
    with pytest.raises(ShipError, match=reason):
        ship_from_particulars(Particulars(**TANKER | change))


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("propeller_diameter_m = 30.0", "propeller_diameter_m = 30.0"),
        ("propeller_diameter_m = 14.9\ndraught_m = 15.0", "does not fit under the water line"),
        ("shaft_speed_rpm = 200.0", "shaft_speed_rpm = 200 is above engine_speed_rpm = 76"),
        ("design_speed_kn = 60.0\nlength_m = 50.0", "is a Froude number of 1.39"),
        ("displacement_t = 31262.2", r"displacement_t = 31262.2 t .* block coefficient of 0\.08"),
        ("depth = 3", "depth is not a known key"),
    ],
)
def test_particulars_that_are_wrong_are_refused_by_key(
    line: str, reason: str, tmp_path: Path
) -> None:
    values = TANKER | tomllib.loads(line)
    file = tmp_path / "p.toml"
    file.write_text("".join(f"{key} = {value!r}\n" for key, value in values.items()))
    with pytest.raises(ShipError, match=reason):
        load_particulars(file)


def test_a_missing_key_is_named(tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text('name = "a"\n')
    with pytest.raises(ShipError, match="length_m is missing"):
        load_particulars(file)


def test_the_resistance_gives_the_power_of_the_trial() -> None:
    """At the design speed a ship with the resistance of the file needs the power of the trial."""
    given = Particulars(**FERRY)
    calm = design_point(given, hull_form(given))
    measured = given.model_copy(update={"trial_power_kW": 0.9e-3 * calm.shaft_power})
    point = design_point(measured, hull_form(measured))
    assert point.shaft_power == pytest.approx(0.9 * calm.shaft_power, rel=1e-3)
    assert 0.85 < point.resistance_share < 0.97
    ships = [ship_from_particulars(one) for one in (given, measured)]
    plain, scaled = (ship.hull.resistance_coefficient_N_s2_m2 for ship in ships)
    assert scaled / plain == pytest.approx(point.resistance_share, rel=1e-6)
    assert ships[1].tolerances.resistance < ships[0].tolerances.resistance
    assert "power of the yard's trial, 0.9" in particulars_text(measured)


def test_the_power_of_the_trial_changes_the_wave_resistance_and_not_friction() -> None:
    """A small ship needs twice the power of the regression: waves, which are steep, take the rest."""
    given = Particulars(
        name="trawler",
        length_m=35.0,
        beam_m=9.2,
        draught_m=4.2,
        displacement_t=780.0,
        design_speed_kn=11.4,
        mcr_kW=1200.0,
        engine_speed_rpm=900.0,
        shaft_speed_rpm=200.0,
        propeller_diameter_m=2.6,
        controllable_pitch=True,
        pitch_ratio=0.95,
        trial_power_kW=1060.0,
    )
    hull, form, speed = ship_from_particulars(given).hull, hull_form(given), 11.4 * KNOT
    share = design_point(given, form).resistance_share
    whole, slow = resistance(form, speed, 1025.0), resistance(form, 0.8 * speed, 1025.0)
    factor = (share * whole.total - whole.total + whole.waves) / whole.waves
    assert 2.0 < factor < 3.0
    expected = slow.total + (factor - 1.0) * slow.waves
    assert expected < 0.85 * share * slow.total
    found = hull.resistance_coefficient_N_s2_m2 * speed**2 * 0.8**hull.resistance_exponent
    assert found == pytest.approx(expected, rel=0.15)


def test_a_power_that_no_plausible_resistance_gives_is_refused() -> None:
    with pytest.raises(ShipError, match=r"trial_power_kW = 50000; .* of one engine"):
        ship_from_particulars(Particulars(**FERRY, trial_power_kW=50000.0))


def test_the_rack_at_full_load_gives_the_rated_torque() -> None:
    given = Particulars(**FERRY, full_load_rack_mm=62.0)
    engine: Any = ship_from_particulars(given).prime_mover
    speed = 500.0 * math.pi / 30.0
    torque = (
        engine.torque_per_rack_N_m_mm * 62.0
        + engine.torque_offset_N_m
        + engine.torque_per_speed_N_m_s_rad * speed
    )
    assert torque == pytest.approx(10e6 / speed, rel=1e-9)
    assert engine.rack_max_mm > 62.0


def test_a_fixed_pitch_that_keeps_the_ship_from_the_design_speed_is_said() -> None:
    """P/D 0.725 suits the tanker; 28 MW at 76 rpm are 3518 kN m, less at lower speeds."""
    assert fixed_pitch_remarks(Particulars(**TANKER)) == []
    (heavy,) = fixed_pitch_remarks(Particulars(**TANKER | {"pitch_ratio": 1.0}))
    assert heavy == (
        "with P/D 1 15.5 kn need 3679 kN m of each engine at 57 rpm of the shaft, above its limit of "
        "3222 kN m there: the ship stays below design_speed_kn. Lower pitch_ratio, or check "
        "trial_power_kW"
    )
    (light,) = fixed_pitch_remarks(Particulars(**TANKER | {"pitch_ratio": 0.55}))
    assert light == (
        "with P/D 0.55 15.5 kn need 84 rpm of the shaft, above shaft_speed_rpm = 76: the ship stays "
        "below design_speed_kn. Raise pitch_ratio, or check trial_power_kW"
    )
    other = TANKER | {"pitch_ratio": 1.0, "controllable_pitch": True}
    assert fixed_pitch_remarks(Particulars(**other)) == []
