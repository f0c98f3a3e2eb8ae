"""The kernels' record: every number of a ship's file has a field, and reaches it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Ship, load_ship, ship_names
from shaftline.plant.hull import Hull
from shaftline.plant.keys import record_field
from shaftline.plant.record import PLANT, SECTIONS, record_of
from shaftline.plant.surroundings import Water
from shaftline.plant.terms import RECORD_FIELDS

FRIGATE, TUG = load_ship("frigate"), load_ship("tito-neri-sine")
DESTROYER = load_ship("ddg-51-surrogate")
STEERED = ("manoeuvring", "rudder", "roll")
OF_A_MOTOR = ("prime_mover", "sensors.current", "sensors.power")


def numbers(ship: Ship) -> list[str]:
    """Dotted keys of all numbers of a ship that have a field in the record."""
    sections = {name: getattr(ship, name) for name in type(ship).model_fields}
    return [
        f"{name}.{key}"
        for name, section in sections.items()
        if section is not None and hasattr(type(section), "model_fields")
        for key, info in type(section).model_fields.items()
        if record_field(info) is not None
    ]


NEEDED = {
    f"prime_mover.{lag}": {
        f"prime_mover.{limit}_N_m": 1e4,
        f"prime_mover.{limit}_rise_N_m": 3e4,
    }
    for lag, limit in (("charge_air_lag_s", "smoke_limit"), ("warmth_lag_s", "loading_limit"))
}
"""What a number cannot be without."""

ROLL = {
    "roll.metacentric_height_m": 1.5,
    "roll.period_s": 11.0,
    "roll.damping_ratio": 0.05,
    "roll.hull_force_depth_m": 4.6,
    "roll.rudder_force_depth_m": 6.5,
}
"""What every number of a roll cannot be without."""


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("frigate", key)
        for key in numbers(FRIGATE)
        if not key.startswith((*STEERED, *OF_A_MOTOR[1:]))
    ]
    + [("ddg-51-surrogate", key) for key in numbers(DESTROYER) if key.startswith(STEERED)]
    + [("tito-neri-sine", key) for key in numbers(TUG) if key.startswith(OF_A_MOTOR)],
)
def test_a_number_of_the_file_is_in_its_field(name: str, key: str) -> None:
    ship = load_ship(name)
    if key.startswith("roll."):
        ship = ship.with_values(ROLL)
    number = ship.parameter(key)
    low, high = number.info[1:3]
    before = number.read(ship.record())
    assert before == number.value
    value = 1.01 * before if before and math.isfinite(before) else 0.01 * min(high, 100.0)
    value = value if value < high else 0.99 * before
    if key == "prime_mover.command_delay_s":
        value = 0.01  # the tug's time step is 0.1 ms
    assert low <= value <= high
    own = NEEDED.get(key, {})
    assert ship.with_values({key: value, **own}).record()[number.field] == value != before
    record = ship.record()
    number.write(record, value)
    assert number.read(record) == value


def test_no_two_numbers_share_a_field() -> None:
    shared: dict[str, set[Any]] = {}
    for section in SECTIONS:
        for key, info in section.model_fields.items():
            if (field := record_field(info)) is not None:
                shared.setdefault(field, set()).add((section.__name__, key))
    twice = {field for field, places in shared.items() if len(places) > 1}
    # of whichever prime mover there is
    assert twice == {
        "drive_max",
        "torque_offset",
        "drive_efficiency",
        "idle_power",
        "command_dead_time",
        "command_lag",
    }


def test_the_record_has_a_field_for_each_number_and_what_is_derived() -> None:
    expected = {"drive_min", "prime_mover", *(field[0] for field in RECORD_FIELDS)}
    for section in SECTIONS:
        fields = [record_field(info) for info in section.model_fields.values()]
        expected |= {field for field in fields if field is not None}
        expected |= {field[0] for field in section.derived}
    assert set(PLANT.names or ()) == expected
    assert PLANT["kt"].shape == (5, 4)
    assert PLANT["prime_mover"] == PLANT["propeller_model"] == np.int64
    assert PLANT["mass"] == np.float64


def test_a_record_is_filled_by_its_sections_and_else_zero() -> None:
    record = record_of([Water(density_kg_m3=1010.0), Hull(fixed=True)], 2)
    assert (record["density"], record["prime_mover"], record["hull_fixed"]) == (1010.0, 2, 1)
    assert record["diameter"] == 0.0


def test_ship_fills_its_record_anew_each_time(frigate: Ship) -> None:
    frigate.record()["mass"] = 1.0
    assert frigate.record()["mass"] == 3.3e6


@pytest.mark.parametrize("name", ship_names())
def test_record_holds_no_strange_number(name: str) -> None:
    record = load_ship(name).record()
    for field in record.dtype.names:
        assert not np.any(np.isnan(record[field])), field


def test_kernels_know_nothing_of_tolerances(frigate: Ship) -> None:
    unsure = frigate.with_values({"tolerances.resistance": 0.05})
    assert unsure.tolerances.resistance == 0.05
    assert unsure.record().tobytes() == frigate.record().tobytes()
