"""A ship as a whole: what it says of itself, what fits together, and its keys."""

from __future__ import annotations

import math
from typing import Any

import pytest

from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.memory import HISTORY

TUG = load_ship("tito-neri-sine")


def torque_tug() -> Ship:
    tree = TUG.model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "torque-command", "torque_max_N_m": 0.2}
    return Ship.model_validate(tree)


@pytest.mark.parametrize(
    ("ship", "says"),
    [
        (load_ship("frigate"), (True, False, True, True, "engine")),
        (TUG, (False, True, False, False, "motor")),
        (torque_tug(), (False, False, False, False, "motor")),
        (
            load_ship("frigate").with_values(
                {"hull.fixed": True, "propeller.pitch_ratio_min": 1.4}
            ),
            (True, False, False, False, "engine"),
        ),
    ],
    ids=lambda value: value.name if isinstance(value, Ship) else "",
)
def test_a_ship_says_what_it_is(ship: Ship, says: tuple[Any, ...]) -> None:
    found = (ship.has_diesel, ship.has_voltage, ship.has_variable_pitch, ship.moves)
    assert (*found, ship.drive_balance) == says


def test_a_ship_has_the_balances_of_its_parts(frigate: Ship) -> None:
    assert frigate.balances == ("engine", "propeller", "sensor", "hull", "pitch-actuator")
    assert TUG.balances == ("motor", "propeller", "sensor")
    moored = frigate.with_values({"hull.fixed": True})
    assert moored.balances == ("engine", "propeller", "sensor", "pitch-actuator")


def test_a_drive_without_a_propeller_has_the_balances_of_a_drive(
    servo: Ship, frigate: Ship
) -> None:
    assert servo.balances == ("motor", "sensor")
    assert frigate.has_propeller
    assert not servo.has_propeller


@pytest.mark.parametrize(
    ("key", "why"),
    [
        ("propeller.entrained_inertia_kg_m2", "servo has no propeller"),
        ("propeller.astern_load_fraction", "servo has no propeller"),
        ("ventilation.torque_loss", "servo has no propeller"),
        ("water.density_kg_m3", "servo has no propeller"),
        ("hull.wake_fraction", "servo has no propeller"),
        ("hull.wake_slope_s_m", "servo has no propeller"),
        ("hull.thrust_deduction", "servo has a hull that is fixed"),
        ("hull.mass_kg", "servo has a hull that is fixed"),
    ],
)
def test_a_number_that_acts_on_nothing_is_none_of_the_ship(servo: Ship, key: str, why: str) -> None:
    with pytest.raises(ShipError, match=f"{key} has no effect: {why}"):
        servo.parameter(key)
    assert not servo.has_key(key)


FREED = {
    "frigate": [
        "hull.wake_fraction",
        "hull.thrust_deduction",
        "hull.resistance_coefficient_N_s2_m2",
        "hull.mass_kg",
        "propeller.relative_rotative_efficiency",
        "transmission.gear_ratio",
        "transmission.inertia_propeller_side_kg_m2",
        "prime_mover.torque_per_rack_N_m_mm",
        "pitch_actuator.time_constant_s",
        "transmission.coulomb_friction_engine_side_N_m",
    ],
    "tito-neri-sine": [
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "prime_mover.armature_inductance_H",
        "transmission.inertia_engine_side_kg_m2",
        "transmission.coulomb_friction_engine_side_N_m",
        "propeller.torque_coefficient",
        "prime_mover.torque_offset_N_m",
        "transmission.stiction_speed_rad_s",
    ],
    "rov-thruster": ["propeller.thrust_coefficient", "propeller.torque_coefficient"],
}


@pytest.mark.parametrize(("name", "key"), [(s, k) for s, keys in FREED.items() for k in keys])
def test_a_number_that_may_be_freed_is_written_as_with_values_does(name: str, key: str) -> None:
    ship = load_ship(name)
    number = ship.parameter(key)
    value = number.value * 1.01 if number.value else 1e-3
    record = ship.record()
    assert number.read(record) == pytest.approx(number.value, rel=1e-15)
    number.write(record, value)
    assert record.tobytes() == ship.with_values({key: value}).record().tobytes()


def test_coefficients_that_follow_j_are_no_single_numbers(frigate: Ship) -> None:
    with pytest.raises(ShipError, match="frigate has a propeller whose KT and KQ follow J"):
        frigate.parameter("propeller.torque_coefficient")


def test_a_hull_without_a_propeller_has_resistance_and_no_thrust(frigate: Ship) -> None:
    tree = frigate.model_dump(exclude_unset=True)
    towed = Ship.model_validate(tree | {"propeller": {"model": "none"}})
    assert towed.balances == ("engine", "sensor", "hull")
    assert towed.has_key("hull.resistance_coefficient_N_s2_m2")
    assert not towed.has_key("hull.thrust_deduction")


def test_running_speeds_are_those_of_the_propeller_shaft(frigate: Ship) -> None:
    low, high = frigate.shaft_speeds
    assert low == pytest.approx(350.0 * math.pi / 30.0 / 7.38, rel=1e-14)
    assert high == pytest.approx(1000.0 * math.pi / 30.0 / 7.38, rel=1e-14)
    with pytest.raises(
        ShipError, match=r"needs a diesel engine, not prime_mover\.type = 'dc-motor'"
    ):
        _ = TUG.shaft_speeds


def test_a_number_stands_at_its_key(frigate: Ship) -> None:
    number = frigate.parameter("hull.mass_kg")
    assert (number.key, number.value, number.place) == ("hull.mass_kg", 3.3e6, ())
    assert frigate.parameter("prime_mover.rack_max_mm").value == 40.0


def test_a_ship_knows_its_keys(frigate: Ship) -> None:
    assert frigate.has_key("prime_mover.lag_s")
    assert not TUG.has_key("prime_mover.lag_s")
    assert not frigate.has_key("propeller.blades")  # no field of its own


def test_time_step_is_that_of_the_integration(frigate: Ship) -> None:
    assert (frigate.time_step_s, TUG.time_step_s) == (0.05, 1e-4)


def test_values_may_open_a_section_that_the_file_leaves_out(frigate: Ship) -> None:
    assert "sensors" not in frigate.model_fields_set
    assert frigate.with_values({"sensors.pitch_offset": 0.1}).sensors.pitch_offset == 0.1


def test_with_values_changes_a_copy(frigate: Ship) -> None:
    lighter = frigate.with_values({"hull.mass_kg": 2e6, "transmission.gear_ratio": 7.0})
    assert (lighter.hull.mass_kg, lighter.transmission.gear_ratio) == (2e6, 7.0)
    assert (frigate.hull.mass_kg, frigate.transmission.gear_ratio) == (3.3e6, 7.38)


def test_with_values_reaches_the_record(frigate: Ship) -> None:
    record = frigate.with_values({"sensors.torque_gain": 1.1}).record()
    assert record["torque_sensor_gain"] == 1.1


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"hull.mass_kg": -1.0}, r"frigate: hull\.mass_kg = -1\.0.*unit kg; allowed: >= 0\.01"),
        ({"hull.current_m_s": math.nan}, r"hull\.current_m_s = nan"),
        ({"tolerances.mass": math.inf}, r"tolerances\.mass = inf.*>= 0 and <= 0\.5"),
        ({"hull.colour": 1.0}, r"hull\.colour is not a known key"),
        ({"sail.area_m2": 1.0}, "sail is not a known key"),
        ({"hull.mass_kg.x": 1.0}, r"'mass_kg' is no section"),
    ],
    ids=str,
)
def test_with_values_validates(frigate: Ship, values: dict[str, float], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        frigate.with_values(values)


@pytest.mark.parametrize(
    ("key", "field", "info"),
    [
        (
            "transmission.coulomb_friction_engine_side_N_m",
            "coulomb_engine_side",
            ("N m", 0, 1e7, 0),
        ),
        ("prime_mover.rack_rate_limit_mm_s", "rack_rate_limit", ("mm/s", 0, math.inf, math.inf)),
        ("hull.current_m_s", "current", ("m/s", -5, 5, 0)),
        ("sensors.torque_gain", "torque_sensor_gain", ("-", 0, 3, 1)),
        ("hull.mass_kg", "mass", ("kg", 0.01, 1e9, None)),
    ],
)
def test_key_has_a_field_and_a_range(
    frigate: Ship, key: str, field: str, info: tuple[object, ...]
) -> None:
    assert frigate.parameter(key).field == field
    assert frigate.parameter(key).info[:4] == info


def test_prime_mover_decides_about_its_keys(frigate: Ship) -> None:
    tug = load_ship("tito-neri-sine")
    assert tug.parameter("prime_mover.command_dead_zone_V").field == "command_dead_zone"
    with pytest.raises(
        ShipError, match=r"frigate: prime_mover\.command_dead_zone_V is not a known"
    ):
        frigate.parameter("prime_mover.command_dead_zone_V")


@pytest.mark.parametrize(
    "key",
    [
        "hull",
        "hull.colour",
        "name",
        "rudder.angle",
        "sail.area_m2",
        "record.x",
        "tolerances.x",
    ],
)
def test_unknown_key_is_named(frigate: Ship, key: str) -> None:
    with pytest.raises(ShipError, match=f"{key} is not a known key"):
        frigate.parameter(key)


@pytest.mark.parametrize(
    "key",
    ["propeller.blades", "hull.propellers", "prime_mover.speed_min_rpm", "tolerances.mass"],
)
def test_key_without_a_field_of_its_own_is_named(frigate: Ship, key: str) -> None:
    with pytest.raises(ShipError, match=f"{key} has no field of its own"):
        frigate.parameter(key)


def test_ship_is_frozen(frigate: Ship) -> None:
    with pytest.raises(ValueError, match="frozen"):
        frigate.hull.mass_kg = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "key", ["sensors.torque_delay_s", "sensors.speed_delay_s", "prime_mover.dead_time_s"]
)
def test_delay_beyond_the_memory_is_refused(frigate: Ship, key: str) -> None:
    short = {"integration.time_step_s": 0.01}
    longest = 0.01 * (HISTORY - 2)
    frigate.with_values({**short, key: longest})
    with pytest.raises(ShipError, match=rf"{key} = 5\.3 s .* the longest delay"):
        frigate.with_values({**short, key: 5.3})


def test_time_step_must_resolve_the_armature() -> None:
    tug = load_ship("tito-neri-sine")
    constant = 0.000603 / 1.51
    tug.with_values({"integration.time_step_s": 0.99 * constant})
    with pytest.raises(
        ShipError, match=r"resistance_ohm = 0\.0003993 s is shorter than .*time_step_s"
    ):
        tug.with_values({"integration.time_step_s": 1.01 * constant})
    keys = (
        "prime_mover.armature_inductance_H",
        "prime_mover.armature_resistance_ohm",
        "integration.time_step_s",
    )
    at = tug.with_values(dict(zip(keys, (0.5, 64.0, 0.5 / 64.0), strict=True)))
    assert at.time_step_s == 0.0078125


def test_motor_without_inductance_takes_any_step() -> None:
    tug = load_ship("tito-neri-sine")
    values = {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.01}
    assert tug.with_values(values).time_step_s == 0.01


TERMS = [
    {"id": "first", "acts_on": "thrust", "expression": "k", "parameters": {"k": 1.0}},
    {
        "id": "second",
        "acts_on": "load_torque",
        "expression": "j * k",
        "parameters": {"j": 2.0, "k": {"value": 3.0, "unit": "N m", "low": 0.0, "high": 9.0}},
    },
]


def test_a_terms_number_is_found_by_term_and_name(frigate: Ship) -> None:
    ship = frigate.with_values({"term": TERMS})
    found = ship.parameter("term.second.k")
    assert (found.value, found.place, found.field) == (3.0, (1, 1), "term_constants")
    assert found.info[:4] == ("N m", 0.0, 9.0, None)
    assert ship.parameter("term.first.k").place == (0, 0)
    for key in ("term.first.j", "term.third.k", "term.second", "term"):
        with pytest.raises(ShipError, match=f"{key} is not a known key"):
            ship.parameter(key)


def test_a_terms_number_is_changed_by_its_key(frigate: Ship) -> None:
    ship = frigate.with_values({"term": TERMS})
    changed = ship.with_values({"term.second.k": 4.0})
    assert [p.value for term in changed.term for p in term.parameters.values()] == [1.0, 2.0, 4.0]
    assert changed.term[1].parameters["k"].high == 9.0
    with pytest.raises(ShipError, match="outside its range from low = 0 to high = 9"):
        ship.with_values({"term.second.k": 10.0})


def test_a_ship_takes_one_term_more(frigate: Ship) -> None:
    both = frigate.with_values({"term": TERMS})
    assert frigate.with_term(both.term[0]).with_term(both.term[1]) == both
    with pytest.raises(ShipError, match="term 'first' is defined twice"):
        both.with_term(both.term[0])
    assert both.record()["term_count"] == 2
