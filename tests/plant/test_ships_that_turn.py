"""Files of ships that turn: what is wrong in them is refused by name."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from shaftline.plant import Ship, ShipError, approach, load_ship, turning_circle


def without(section: str, *keys: str) -> dict[str, Any]:
    """The tanker's tables without some keys of one, or without the whole of it."""
    tree = load_ship("kvlcc2").model_dump(exclude_unset=True)
    if not keys:
        del tree[section]
    for key in keys:
        del tree[section][key]
    return tree


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"Y_v": 0.1}, r"manoeuvring\.Y_v = 0\.1: .*less than 0 \(unit -; allowed: < 0\)"),
        ({"N_r": 0.0}, r"manoeuvring\.N_r = 0\.0: .*allowed: < 0"),
        ({"Y_vdot": 0.1}, r"manoeuvring\.Y_vdot = 0\.1: .*allowed: <= 0"),
        (
            {"displacement_kg": 4000.0},
            r"hull\.mass_kg = 3515\.2 kg includes the added mass, so it must not be "
            r"less than manoeuvring\.displacement_kg = 4000 kg",
        ),
        (
            {"Y_rdot": -1.0, "N_vdot": -1.0},
            "the inertia matrix of sway and yaw is not positive definite",
        ),
        (
            {"length_m": 600.0},
            r"manoeuvring\.length_m = 600\.0: .*unit m; allowed: >= 0 and <= 500",
        ),
    ],
)
def test_wrong_sections_are_refused_by_name(values: dict[str, float], words: str) -> None:
    keys = {f"manoeuvring.{key}": value for key, value in values.items()}
    with pytest.raises(ShipError, match=words):
        load_ship("kvlcc2").with_values(keys)


NEEDED = (
    "draught_m",
    "displacement_kg",
    "radius_of_gyration_m",
    "Y_vdot",
    "N_rdot",
    "Y_v",
    "Y_r",
    "N_v",
    "N_r",
)


@pytest.mark.parametrize("key", NEEDED)
def test_a_ship_that_turns_needs_its_linear_derivatives(key: str) -> None:
    tree = without("manoeuvring", key)
    with pytest.raises(
        ValueError, match=f"{key} is missing; it is required with a manoeuvring.len"
    ):
        Ship.model_validate(tree)


def test_a_hull_that_is_fixed_does_not_turn() -> None:
    with pytest.raises(ShipError, match=r"length_m requires a hull that moves"):
        load_ship("kvlcc2").with_values({"hull.fixed": True})


def test_a_rudder_needs_a_ship_that_turns() -> None:
    with pytest.raises(
        ValueError, match=r"rudder\.area_m2 has no effect without a manoeuvring\.len"
    ):
        Ship.model_validate(without("manoeuvring"))


@pytest.mark.parametrize("key", ["normal_force_slope", "position_m", "yaw_lever_m"])
def test_a_rudder_needs_its_place_and_slope(key: str) -> None:
    with pytest.raises(ValueError, match=f"{key} is missing; it is required with a rudder.area_m2"):
        Ship.model_validate(without("rudder", key))


def test_a_steering_gear_with_a_rate_limit_needs_a_lag() -> None:
    with pytest.raises(
        ShipError, match=r"time_constant_s must be above 0 s if rate_limit_rad_s is given"
    ):
        load_ship("kvlcc2").with_values({"rudder.time_constant_s": 0.0})


@pytest.mark.parametrize("value", [0.0, 1.7])
def test_end_stops_have_their_range(value: float) -> None:
    with pytest.raises(ShipError, match=r"angle_max_rad .*unit rad; allowed: > 0 and <= 1\.6"):
        load_ship("kvlcc2").with_values({"rudder.angle_max_rad": value})


def test_a_ship_that_does_not_turn_has_no_numbers_of_a_turn(frigate: Ship) -> None:
    for key in ("manoeuvring.Y_v", "rudder.area_m2"):
        with pytest.raises(ShipError, match=r"does not turn: it has no manoeuvring\.length_m"):
            frigate.parameter(key)


def test_the_pages_example_is_a_ship_that_turns() -> None:
    page = (Path(__file__).parents[2] / "docs" / "manoeuvring.md").read_text(encoding="utf-8")
    block, roll = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    tree = without("rudder") | tomllib.loads(block) | tomllib.loads(roll)
    tree["hull"] = {"mass_kg": 1.15e7, "resistance_coefficient_N_s2_m2": 6000.0}
    tree["propeller"]["diameter_m"] = 4.5
    ship = Ship.model_validate(tree)
    turn = turning_circle(ship, approach(ship, 7.0), 0.35)
    assert 1.0 < turn.tactical_diameter < 10.0
    assert turn.heel is not None
    assert 0.0 < turn.heel.inward_rad < turn.heel.steady_rad < turn.heel.outward_rad < 0.3
