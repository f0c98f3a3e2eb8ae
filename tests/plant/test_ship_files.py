from __future__ import annotations

import math
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from shaftline.plant import Ship, ShipError, load_ship, ship_names, write_ship
from shaftline.plant.ship_files import ship_keys

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


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ShipError, match=r"nowhere\.toml: cannot be read"):
        load_ship(tmp_path / "nowhere.toml")


def test_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ShipError, match=r"binary\.toml: cannot be read"):
        load_ship(tmp_path / "binary.toml")


def test_unknown_preset_names_the_known_ones() -> None:
    with pytest.raises(
        ShipError,
        match=r"unknown ship 'frigat'.*frigate, frigate-at-sea, frigate-turning, kvlcc2, rov-thruster",
    ):
        load_ship("frigat")


@pytest.mark.parametrize("limit", ["rack_rate_limit_mm_s = inf", "torque_limit_N_m = inf"])
def test_limits_may_be_infinite(edited: Edit, limit: str) -> None:
    old = "torque_limit_N_m = 38000.0"
    new = limit if limit.startswith("torque") else f"{old}\n{limit}"
    assert load_ship(edited(old, new)).name == "frigate"


SHAPE = {
    "term": [
        {
            "id": "shape",
            "acts_on": "resistance",
            "expression": "table(ship_speed, 0, 0, 2.5, 1e-7, 1e3, -3e8)",
        }
    ]
}


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
    with pytest.raises(
        ValueError, match=r"mine\.json: a ship file must have a name that ends in \.toml"
    ):
        write_ship(frigate, tmp_path / "mine.json")


def reference() -> list[tuple[str, ...]]:
    """The table of a ship file's keys, as the manual prints it."""
    page = (Path(__file__).parents[2] / "docs" / "reference.md").read_text(encoding="utf-8")
    lines = page.split("## Keys of a ship file")[1].strip().splitlines()[2:]
    rows = [line.strip("|").split(" | ") for line in lines]
    return [tuple(cell.strip().replace("\\|", "|") for cell in row) for row in rows]


def test_every_key_has_the_unit_range_and_default_that_the_manual_states() -> None:
    stated, found = (
        {
            row[0]: tuple(cell.strip() for cell in row)
            for row in rows
            if not row[0].startswith("term.")
        }
        for rows in (reference(), ship_keys())
    )
    assert list(found) == list(stated)
    for key, row in found.items():
        assert row == stated[key]


def test_the_keys_of_each_prime_mover_are_told_apart() -> None:
    rows = {row[0]: row for row in ship_keys()}
    assert rows["prime_mover.rack_max_mm (diesel)"][1:4] == ("mm", "> 0 and <= 200", "required")
    assert rows["prime_mover.voltage_max_V (dc-motor)"][1:3] == ("V", "> 0 and <= 100000")
    assert rows["propeller.model"][2:4] == (
        "b-series, four-quadrant, bollard, table, none",
        "b-series",
    )
    assert rows["propeller.diameter_m"][3] == "required with a propeller"
    assert rows["hull.fixed"][2:4] == ("true, false", "False")
    assert "diesel" in {row[2] for row in ship_keys() if row[0] == "prime_mover.type"}


UNITS = {"m", "s", "kg", "rpm", "deg", "rad", "N", "V", "A", "mm", "m2", "ohm"}


def test_the_unit_in_a_keys_name_is_the_keys_unit() -> None:
    for label, unit, allowed, _, description in ship_keys():
        last = label.split()[0].split(".")[-1].rpartition("_")[2]
        if last in UNITS and not label.startswith("rudder.normal"):
            assert last in unit.replace("/", " ").split(), label
        assert description, label
        assert (allowed == "text") == (
            label
            in {"term.id", "term.expression", "term.state", "term.rate", "term.parameters.unit"}
        ), label


def test_a_file_from_another_editor_may_begin_with_a_mark(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "plant/ships/frigate.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8-sig")
    assert load_ship(tmp_path / "mine.toml").hull == load_ship("frigate").hull
