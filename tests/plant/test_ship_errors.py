"""What is wrong with a ship is told with file, key, unit and allowed range."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.drives import DcMotor, Diesel, Drive
from shaftline.plant.hull import Hull
from shaftline.plant.ship import type_tag, union_members, validate_tables

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


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 3.3e6", "mass_kgs = 3.3e6", ["hull.mass_kgs", "not a known key"]),
        ("diameter_m = 4.2", "", ["propeller.diameter_m is missing", "unit m", "> 0 and <= 15"]),
        ("gear_ratio = 7.38", "", ["transmission.gear_ratio is missing", "> 0 and <= 100"]),
        ("resistance_coefficient_N_s2_m2 = 3306.2", "", ["resistance_coefficient_N_s2_m2 is missing"]),
        ("blades = 5", "", ["propeller", "blades is missing", "propeller.model = 'b-series'"]),
        ('model = "b-series"', 'model = "bollard"', ["torque_coefficient is missing", "bollard"]),
        ("[water]", "[waters]", ["waters is not a known key"]),
        ("mass_kg = 3.3e6", '"hull.mass_kg" = 3.3e6', ["in quotes", "write mass_kg under [hull]"]),
        ("density_kg_m3 = 1025.0", "", ["water.density_kg_m3 is missing", "with a propeller"]),
        ("diameter_m = 4.2", 'diameter_m = "4.2"', ["propeller.diameter_m", "'4.2'", "unit m;"]),
        ("diameter_m = 4.2", "diameter_m = true", ["propeller.diameter_m", "True", "number"]),
        ("propellers = 2", "propellers = 2.5", ["hull.propellers", "2.5", ">= 1 and <= 8"]),
        ("blades = 5", "blades = 9", ["propeller.blades = 9", ">= 2 and <= 7"]),
        ("efficiency = 0.95", "efficiency = 1.2", ["transmission.efficiency = 1.2", "<= 1"]),
        ("density_kg_m3 = 1025.0", "density_kg_m3 = 0.4", ["water.density_kg_m3", "unit kg/m3"]),
        ("density_kg_m3 = 1025.0", "density_kg_m3 = 1.025",
         ["water.density_kg_m3 = 1.025 kg/m3 is a gas", "hull.fixed = true"]),
        ("time_constant_s = 2.0", "time_constant_s = nan", ["pitch_actuator.time_constant_s = nan"]),
        ("rack_max_mm = 40.0", "rack_max_mm = inf", ["prime_mover.rack_max_mm = inf", "<= 200"]),
        ("gear_ratio = 7.38", "gear_ratio = -inf", ["transmission.gear_ratio = -inf", "> 0"]),
        ("torque_limit_N_m = 38000.0", "torque_limit_N_m = nan", ["torque_limit_N_m = nan"]),
        ('model = "b-series"', 'model = "kaplan"', ["propeller.model = 'kaplan'", "b-series"]),
        ('type = "diesel"', 'type = "steam"', ["prime_mover.type = 'steam'", "dc-motor, diesel"]),
        ('type = "diesel"', "", ["prime_mover", "type"]),
        ("speed_min_rpm = 350.0", "speed_min_rpm = 1e3",
         ["speed_min_rpm = 1000 must be below speed_max_rpm"]),
        ("pitch_ratio_min = 0.6", "pitch_ratio_min = 1.5",
         ["pitch_ratio_min = 1.5 must not exceed pitch_ratio_max"]),
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
    with pytest.raises(ShipError) as caught:
        load_ship(path)
    first, second = str(caught.value).splitlines()
    assert first.startswith(f"{path}: propeller.diameter_m = 0.0")
    assert second.startswith(f"{path}: propeller.blades = 1")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"propeller.diameter_m": None},
         "f: propeller.diameter_m is missing; it is required with propeller.model = 'b-series' "
         "(unit m; allowed: > 0 and <= 15)"),
        ({"water.density_kg_m3": None},
         "f: water.density_kg_m3 is missing; it is required with a propeller "
         "(unit kg/m3; allowed: >= 0.5 and <= 14000)"),
        ({"hull.colour": 1.0},
         "f: hull.colour is not a known key; `shaftline list --markdown FILE` lists the known keys"),
        ({"prime_mover.rack_max_mm": None},
         "f: prime_mover.rack_max_mm is missing (unit mm; allowed: > 0 and <= 200)"),
        ({"prime_mover.colour": 1.0},
         "f: prime_mover.colour is not a known key; `shaftline list --markdown FILE` lists the known "
         "keys"),
        ({"prime_mover.type": "steam"},
         "f: prime_mover.type = 'steam' is unknown (allowed: dc-motor, diesel, "
         "speed-command, torque-command)"),
        ({"prime_mover.type": None},
         "f: prime_mover.type is missing (allowed: dc-motor, diesel, speed-command, torque-command)"),
        ({"hull.mass_kg": -1.0},
         "f: hull.mass_kg = -1.0: input should be greater than or equal to 0.01 "
         "(unit kg; allowed: >= 0.01 and <= 1e+09)"),
        ({"prime_mover.speed_min_rpm": 1e3},
         "f: prime_mover: speed_min_rpm = 1000 must be below speed_max_rpm = 1000"),
        ({"sensors.torque_delay_s": 6.0, "integration.time_step_s": 0.01},
         "f: sensors.torque_delay_s = 6.0 s exceeds 5.1 s, the longest delay that a time step of 0.01 s "
         "allows; give a shorter delay or a longer integration.time_step_s"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_a_mistake_is_one_sentence(change: dict[str, Any], sentence: str) -> None:
    change = {"sensors.pitch_offset": 0.0, "integration.time_step_s": 0.05} | change
    tree = load_ship("frigate").model_dump(exclude_unset=True) | {"sensors": {}, "integration": {}}
    for dotted, value in change.items():
        section, key = dotted.split(".")
        if value is None:
            del tree[section][key]
        else:
            tree[section][key] = value
    with pytest.raises(ShipError) as caught:
        validate_tables(Ship, tree, "f")
    assert str(caught.value) == sentence


def test_what_is_wrong_with_the_ship_as_a_whole_has_no_key() -> None:
    with pytest.raises(ShipError, match=r"^f: ship = 3: input should be a valid dict"):
        validate_tables(Ship, 3, "f")  # type: ignore[arg-type]


def test_a_right_ship_passes() -> None:
    tree = load_ship("ferry").model_dump(exclude_unset=True)
    assert validate_tables(Ship, tree, "f") == load_ship("ferry")


def test_kinds_of_a_union_and_their_tags() -> None:
    assert union_members(Drive)[:2] == (Diesel, DcMotor)
    assert union_members(Hull) == (Hull,)
    assert [type_tag(kind) for kind in union_members(Drive)] == [
        "diesel",
        "dc-motor",
        "torque-command",
        "speed-command",
    ]
