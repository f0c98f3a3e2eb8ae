from __future__ import annotations

import math
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Ship, ShipError, load_ship, ship_names, write_ship
from shaftline.plant.memory import HISTORY

FRIGATE = resources.files("shaftline.plant").joinpath("ships/frigate.toml").read_text("utf-8")

Edit = Callable[[str, str], Path]


@pytest.fixture
def edited(tmp_path: Path) -> Edit:
    """The frigate's file with one line changed."""

    def edit(old: str, new: str) -> Path:
        assert FRIGATE.count(old) == 1
        path = tmp_path / "mine.toml"
        path.write_text(FRIGATE.replace(old, new), encoding="utf-8")
        return path

    return edit


def test_presets_are_listed() -> None:
    assert {"frigate", "tito-neri-sine", "tito-neri-staircase"} <= set(ship_names())


@pytest.mark.parametrize("name", ship_names())
def test_preset_loads_under_its_own_name(name: str) -> None:
    assert load_ship(name).name == name


def test_file_gives_the_same_ship_as_the_preset(edited: Edit) -> None:
    path = edited('name = "frigate"', 'name = "frigate"  # mine')
    assert load_ship(path) == load_ship(str(path)) == load_ship("frigate")


def test_ship_passes_through(frigate: Ship) -> None:
    assert load_ship(frigate) is frigate


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 3.3e6", "mass_kgs = 3.3e6", ["hull.mass_kgs", "not a known key"]),
        ("diameter_m = 4.2", "", ["propeller.diameter_m is missing", "unit m", "> 0 and <= 15"]),
        ("gear_ratio = 7.38", "", ["transmission.gear_ratio is missing", "> 0 and <= 100"]),
        ("resistance_coefficient_N_s2_m2 = 3306.2", "", ["resistance_coefficient_N_s2_m2 is missing"]),
        ("blades = 5", "", ["propeller", "blades is missing", "propeller.model = 'b-series'"]),
        ('model = "b-series"', 'model = "bollard"', ["torque_coefficient is missing", "bollard"]),
        ("[water]", "[waters]", ["water is missing", "waters is not a known key"]),
        ("diameter_m = 4.2", 'diameter_m = "4.2"', ["propeller.diameter_m", "'4.2'", "unit m;"]),
        ("diameter_m = 4.2", "diameter_m = true", ["propeller.diameter_m", "True", "number"]),
        ("propellers = 2", "propellers = 2.5", ["hull.propellers", "2.5", ">= 1 and <= 8"]),
        ("blades = 5", "blades = 9", ["propeller.blades = 9", ">= 2 and <= 7"]),
        ("efficiency = 0.95", "efficiency = 1.2", ["transmission.efficiency = 1.2", "<= 1"]),
        ("density_kg_m3 = 1025.0", "density_kg_m3 = 1.0", ["water.density_kg_m3", "unit kg/m3"]),
        ("time_constant_s = 2.0", "time_constant_s = nan", ["pitch_actuator.time_constant_s = nan"]),
        ("rack_max_mm = 40.0", "rack_max_mm = inf", ["prime_mover.rack_max_mm = inf", "<= 200"]),
        ("gear_ratio = 7.38", "gear_ratio = -inf", ["transmission.gear_ratio = -inf", "> 0"]),
        ("torque_limit_N_m = 38000.0", "torque_limit_N_m = nan", ["torque_limit_N_m = nan"]),
        ('model = "b-series"', 'model = "kaplan"', ["propeller.model = 'kaplan'", "b-series"]),
        ('type = "diesel"', 'type = "steam"', ["prime_mover.type = 'steam'", "dc-motor, diesel"]),
        ('type = "diesel"', "", ["prime_mover", "type"]),
        ("speed_min_rpm = 350.0", "speed_min_rpm = 1e3", ["speed_min_rpm must be below"]),
        ("pitch_ratio_min = 0.6", "pitch_ratio_min = 1.5", ["pitch_ratio_min must not exceed"]),
        ("[pitch_actuator]", "[tolerances]\nwake_fraction = 0.6\n[pitch_actuator]",
         ["tolerances.wake_fraction = 0.6", "unit -; allowed: >= 0 and <= 0.5"]),
        ("[pitch_actuator]", "[tolerances]\nmass = -0.01\n[pitch_actuator]",
         ["tolerances.mass = -0.01", "unit -; allowed: >= 0 and <= 0.5"]),
        ("[pitch_actuator]", "[tolerances]\ncolour = 0.1\n[pitch_actuator]",
         ["tolerances.colour is not a known key"]),
        ("diameter_m = 4.2", "diameter_m = ", ["not valid TOML", "line"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_mistake_is_named_with_file_key_and_range(
    edited: Edit, old: str, new: str, words: list[str]
) -> None:
    path = edited(old, new)
    with pytest.raises(ShipError) as caught:
        load_ship(path)
    for word in ("mine.toml", *words):
        assert word in str(caught.value)


def test_all_mistakes_are_named_at_once(edited: Edit) -> None:
    path = edited("diameter_m = 4.2\nblades = 5", "diameter_m = 0.0\nblades = 1")
    with pytest.raises(ShipError, match=r"(?s)propeller\.diameter_m.*propeller\.blades"):
        load_ship(path)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ShipError, match=r"nowhere\.toml: cannot be read"):
        load_ship(tmp_path / "nowhere.toml")


def test_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ShipError, match=r"binary\.toml: cannot be read"):
        load_ship(tmp_path / "binary.toml")


def test_unknown_preset_names_the_known_ones() -> None:
    with pytest.raises(
        ShipError, match=r"unknown ship 'frigat'.*frigate, rov-thruster, tito-neri-sine"
    ):
        load_ship("frigat")


@pytest.mark.parametrize("limit", ["rack_rate_limit_mm_s = inf", "torque_limit_N_m = inf"])
def test_limits_may_be_infinite(edited: Edit, limit: str) -> None:
    old = "torque_limit_N_m = 38000.0"
    new = limit if limit.startswith("torque") else f"{old}\n{limit}"
    assert load_ship(edited(old, new)).name == "frigate"


def test_with_values_changes_a_copy(frigate: Ship) -> None:
    lighter = frigate.with_values({"hull.mass_kg": 2e6, "transmission.gear_ratio": 7.0})
    assert (lighter.hull.mass_kg, lighter.transmission.gear_ratio) == (2e6, 7.0)
    assert (frigate.hull.mass_kg, frigate.transmission.gear_ratio) == (3.3e6, 7.38)


def test_with_values_reaches_the_record(frigate: Ship) -> None:
    record = frigate.with_values({"sensors.torque_gain": 1.1}).record()
    assert record["torque_sensor_gain"] == 1.1


def test_kernels_know_nothing_of_tolerances(frigate: Ship) -> None:
    unsure = frigate.with_values({"tolerances.resistance": 0.05})
    assert unsure.tolerances.resistance == 0.05
    assert unsure.record().tobytes() == frigate.record().tobytes()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"hull.mass_kg": -1.0}, r"frigate: hull\.mass_kg = -1\.0.*unit kg; allowed: > 0"),
        ({"hull.current_m_s": math.nan}, r"hull\.current_m_s = nan"),
        ({"tolerances.mass": math.inf}, r"tolerances\.mass = inf.*>= 0 and <= 0\.5"),
        ({"hull.colour": 1.0}, r"hull\.colour is not a known key"),
        ({"rudder.angle": 1.0}, "rudder is not a known key"),
        ({"hull.mass_kg.x": 1.0}, r"no section 'mass_kg'"),
    ],
    ids=str,
)
def test_with_values_validates(frigate: Ship, values: dict[str, float], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        frigate.with_values(values)


SHAPE = {
    "unexplained.balance": "hull", "unexplained.signal": "ship_speed",
    "unexplained.knots": (0.0, 2.5, 1e3), "unexplained.values": (0.0, -1e-7, 3e8),
}  # fmt: skip


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"pitch_actuator.rate_limit_per_s": math.inf, "sensors.torque_gain": 1.05},
        {"tolerances.resistance": 0.05, "tolerances.mass": 0.0},
        SHAPE,
    ],
)
@pytest.mark.parametrize("name", [n for n in ship_names() if not load_ship(n).hull.fixed])
def test_written_ship_is_read_back(name: str, values: dict[str, Any], tmp_path: Path) -> None:
    ship = load_ship(name).with_values(values)
    found = load_ship(write_ship(ship, tmp_path / "new" / "mine.toml"))
    assert found == ship
    assert found.model_dump(exclude_unset=True) == ship.model_dump(exclude_unset=True)
    assert found.record().tobytes() == ship.record().tobytes()


def test_written_motor_is_read_back(tmp_path: Path) -> None:
    ship = load_ship("tito-neri-sine").with_values({"prime_mover.supply_limit_V": math.inf})
    path = write_ship(ship, tmp_path / "tug.toml")
    assert load_ship(path) == ship
    assert "supply_limit_V = inf" in path.read_text()
    assert "efficiency = 1.0\n" in path.read_text()
    assert "viscous" not in path.read_text()


def test_ship_is_written_to_toml_only(frigate: Ship, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"mine\.json: a ship's file ends in \.toml"):
        write_ship(frigate, tmp_path / "mine.json")


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
        ("hull.mass_kg", "mass", ("kg", 0, 1e9, None)),
    ],
)
def test_key_has_a_field_and_a_range(
    frigate: Ship, key: str, field: str, info: tuple[object, ...]
) -> None:
    assert frigate.number(key).field == field
    assert frigate.number(key).info == info


def test_prime_mover_decides_about_its_keys(frigate: Ship) -> None:
    tug = load_ship("tito-neri-sine")
    assert tug.number("prime_mover.command_dead_zone_V").field == "command_dead_zone"
    with pytest.raises(
        ShipError, match=r"frigate: prime_mover\.command_dead_zone_V is not a known"
    ):
        frigate.number("prime_mover.command_dead_zone_V")


@pytest.mark.parametrize(
    "key",
    [
        "hull",
        "hull.colour",
        "name",
        "rudder.angle",
        "record.x",
        "unexplained.knots",
        "tolerances.x",
    ],
)
def test_unknown_key_is_named(frigate: Ship, key: str) -> None:
    with pytest.raises(ShipError, match=f"{key} is not a known key"):
        frigate.number(key)


@pytest.mark.parametrize(
    "key",
    ["propeller.blades", "hull.propellers", "prime_mover.speed_min_rpm", "tolerances.mass"],
)
def test_key_without_a_field_of_its_own_is_named(frigate: Ship, key: str) -> None:
    with pytest.raises(ShipError, match=f"{key} has no field of its own"):
        frigate.number(key)


def test_ship_is_frozen(frigate: Ship) -> None:
    with pytest.raises(ValueError, match="frozen"):
        frigate.hull.mass_kg = 1.0  # type: ignore[misc]


def test_record_is_a_new_one_each_time(frigate: Ship) -> None:
    frigate.record()["mass"] = 1.0
    assert frigate.record()["mass"] == 3.3e6


def test_record_holds_no_strange_number() -> None:
    for name in ship_names():
        record = load_ship(name).record()
        for field in record.dtype.names:
            assert not np.any(np.isnan(record[field])), field


@pytest.mark.parametrize("key", ["sensors.torque_delay_s", "prime_mover.dead_time_s"])
def test_delay_beyond_the_memory_is_refused(frigate: Ship, key: str) -> None:
    short = {"integration.time_step_s": 0.01}
    longest = 0.01 * (HISTORY - 2)
    frigate.with_values({**short, key: longest})
    with pytest.raises(ShipError, match=rf"{key} = 1\.3 s .* the longest delay"):
        frigate.with_values({**short, key: 1.3})


def test_time_step_must_resolve_the_armature() -> None:
    tug = load_ship("tito-neri-sine")
    constant = 0.000603 / 1.51
    tug.with_values({"integration.time_step_s": 0.99 * constant})
    with pytest.raises(ShipError, match=r"integration\.time_step_s .* L/R = 0\.000399 s"):
        tug.with_values({"integration.time_step_s": 1.01 * constant})


def test_motor_without_inductance_takes_any_step() -> None:
    tug = load_ship("tito-neri-sine")
    values = {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.01}
    assert tug.with_values(values).time_step_s == 0.01


def test_a_moored_ship_set_free_needs_mass_and_resistance() -> None:
    moored = load_ship("tito-neri-sine")
    with pytest.raises(ShipError, match=r"hull: mass_kg is missing"):
        moored.with_values({"hull.fixed": False})
