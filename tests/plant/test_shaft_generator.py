"""Machinery beside one engine and one shaft, as terms of a ship file (docs/ships.md)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from shaftline.core.files import parse_toml
from shaftline.plant import Ship, equilibrium, load_ship

PAGE = Path(__file__).parents[2] / "docs" / "ships.md"


def documented(name: str) -> dict[str, Any]:
    """Return the term that the page prints."""
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (block,) = (block for block in blocks if f'id = "{name}"' in block)
    (term,) = parse_toml(block, "docs/ships.md")["term"]
    return dict(term)


def with_power(power: float) -> Ship:
    term = documented("shaft-generator")
    term["parameters"]["power"]["value"] = power
    return load_ship("frigate").with_values({"term": [term]})


@pytest.mark.parametrize("power", [300e3, -300e3])
def test_a_shaft_generator_takes_its_power_and_a_motor_gives_it(power: float) -> None:
    ship = with_power(power)
    point = equilibrium(ship, 20.0, 1.2)
    omega, line = point.state.shaft_speed, ship.transmission
    engine = point.outputs.brake_torque * line.gear_ratio * line.efficiency * omega
    assert engine == pytest.approx(point.outputs.shaft_power + power, rel=1e-9)
    alone = equilibrium(load_ship("frigate"), 20.0, 1.2).state.ship_speed
    assert (point.state.ship_speed < alone) == (power > 0.0)


def test_a_trailing_propeller_drags() -> None:
    frigate = load_ship("frigate")
    both = equilibrium(frigate, 20.0, 1.2)
    term = documented("trailing-propeller")
    drag = term["parameters"]["drag"]["value"]
    half = frigate.with_values({"hull.propellers": 1, "term": [term]})
    point = equilibrium(half, 20.0, 1.2)
    hull = equilibrium(frigate.with_values({"hull.propellers": 1}), 20.0, 1.2)
    speed = point.state.ship_speed
    assert speed < hull.state.ship_speed < both.state.ship_speed
    calm = frigate.hull.resistance_coefficient_N_s2_m2 * speed**2
    assert point.outputs.resistance == pytest.approx(calm + drag * speed**2, rel=1e-6)
