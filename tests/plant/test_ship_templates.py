"""Files to start from: they load as they are, and every optional line in them is true."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shaftline.plant import Ship, ShipError, equilibrium, load_ship, simulate_recording
from shaftline.plant.columns import drive_column
from shaftline.plant.ship_files import template, template_names, template_text

NAMES = template_names()
EACH = pytest.mark.parametrize("name", NAMES)
DRIVES = {
    "diesel-controllable-pitch": 22.0,
    "electric-fixed-pitch": 40.0,
    "thruster-on-a-bench": 2.0,
    "drive-with-load": 60.0,
    "constant-revolutions": 60.0,
}


def written(name: str, folder: Path, text: str) -> Ship:
    (folder / f"{name}.toml").write_text(text)
    return load_ship(folder / f"{name}.toml")


def test_there_is_one_for_each_kind_of_rig() -> None:
    assert set(NAMES) == set(DRIVES)
    ships = [template(name) for name in NAMES]
    assert {type(ship.prime_mover).__name__ for ship in ships} == {
        "Diesel",
        "DcMotor",
        "TorqueSource",
        "SpeedSource",
    }
    assert {ship.propeller.model for ship in ships} == {"b-series", "bollard", "table", "none"}
    with pytest.raises(
        ShipError, match="unknown template 'yacht'; known templates: constant-revolutions"
    ):
        template("yacht")


@EACH
def test_a_template_loads_as_the_ship_that_it_shows(name: str, tmp_path: Path) -> None:
    assert written(name, tmp_path, template_text(name)) == template(name)
    named = written(name, tmp_path, template_text(name, "mine"))
    assert named.name == "mine"


@EACH
def test_what_is_left_out_has_the_value_that_acts(name: str, tmp_path: Path) -> None:
    """Every line behind a # may be given as it stands, and changes nothing."""
    text = template_text(name)
    given = re.sub(r"^# (\[[\w.]+\]|\w+ = .*)$", r"\1", text, flags=re.MULTILINE)
    assert given != text
    ship = written(name, tmp_path, given)
    assert ship.record().tobytes() == template(name).record().tobytes()
    assert ship.tolerances == template(name).tolerances


@EACH
def test_every_number_that_acts_is_told_with_its_range(name: str) -> None:
    ship, text = template(name), template_text(name)
    given: dict[str, Any] = tomllib.loads(
        re.sub(r"^# (\[[\w.]+\]|\w+ = .*)$", r"\1", text, flags=re.M)
    )
    for section in ("hull", "propeller", "ventilation", "prime_mover", "transmission", "sensors"):
        for key in type(getattr(ship, section)).model_fields:
            dotted = f"{section}.{key}"
            assert (key in given.get(section, {})) >= ship.has_key(dotted), dotted
    line = next(line for line in text.splitlines() if line.startswith("# quadratic_drag_"))
    assert line.endswith(
        "# c of the drag c omega |omega| behind the torque meter [N m s2/rad2] "
        "(>= 0 and <= 1e+07; no effect at this value)"
    )


def test_what_acts_on_nothing_is_not_in_it() -> None:
    servo = template_text("drive-with-load")
    for word in (
        "diameter_m",
        "wake_",
        "ventilation",
        "mass_kg",
        "pitch_actuator",
        "density",
        "KQ",
    ):
        assert word not in servo
    held = template_text("constant-revolutions")
    assert "gear_ratio" not in held
    assert "thrust_coefficient = [0.31," in held


@EACH
def test_a_template_sails(name: str) -> None:
    ship = template(name)
    point = equilibrium(ship, DRIVES[name], ship.propeller.pitch_ratio_max)
    assert point.state.shaft_speed > 0.05
    time = [0.1 * k for k in range(20)]
    table = pd.DataFrame({"time_s": time, drive_column(ship): DRIVES[name]})
    if ship.has_variable_pitch:
        table["pitch_ratio_command"] = 1.2
    assert simulate_recording(ship, table).notna().all().all()


def test_presets_are_not_written_down_twice() -> None:
    assert template("diesel-controllable-pitch") is load_ship("frigate")
    assert template("thruster-on-a-bench") is load_ship("rov-thruster")


@pytest.mark.parametrize("name", template_names())
def test_every_number_is_told_with_its_unit(name: str) -> None:
    numbers = re.findall(
        r"^(?:# )?(\w+) = (?:-?\d+\.\d+\S*|-?inf) +# (.*)$", template_text(name), re.M
    )
    assert len(numbers) > 15
    for key, comment in numbers:
        assert re.search(r"\[[^]]+\]", comment), f"{key}: {comment}"
