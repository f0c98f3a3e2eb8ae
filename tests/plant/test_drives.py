"""Prime movers together: each has a code of its own by which the kernels know it."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from shaftline.plant import Ship, load_ship
from shaftline.plant.drives import (
    DC_MOTOR,
    DIESEL,
    DRIVES,
    DcMotor,
    Diesel,
    Drive,
    DriveStates,
    drive_output,
)
from shaftline.plant.drives.dc_motor import drive_motor
from shaftline.plant.drives.diesel import drive_diesel

TUG = load_ship("tito-neri-sine")
STATES = DriveStates(9000.0, 0.5, 0.3, 0.2)


def test_every_kind_has_a_code_a_column_and_a_tag_of_its_own() -> None:
    assert set(DRIVES) == set(get_args(Drive))
    assert [drive.code for drive in DRIVES] == [0, 1, 2, 3]
    assert (Diesel.code, DcMotor.code) == (DIESEL, DC_MOTOR)
    assert len({drive.demand.column for drive in DRIVES}) == len(DRIVES)
    assert len({drive.demand.name for drive in DRIVES}) == len(DRIVES)


@pytest.mark.parametrize("lag", [0.0, 1.5])
def test_a_diesel_has_a_torque_and_no_current(plant: Any, lag: float) -> None:
    plant["engine_lag"] = lag
    found = drive_output(plant, 78.0, 22.0, DriveStates(9000.0, 5.0, 0.3, 0.2))
    torque, rate, *_ = drive_diesel(plant, 78.0, 22.0, 9000.0, 0.3, 0.2)
    assert found == (torque, rate, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("inductance", [0.0, 6e-4])
def test_a_motor_has_a_current_and_no_lagging_torque(inductance: float) -> None:
    plant = TUG.record()
    plant["armature_inductance"] = inductance
    found = drive_output(plant, 200.0, 6.0, STATES)
    torque, current, rate, voltage = drive_motor(plant, 200.0, 6.0, 0.5)
    assert found == (torque, 0.0, current, rate, voltage, 0.0, 0.0)


def test_a_torque_source_has_its_demand() -> None:
    plant = TUG.record()
    plant["prime_mover"] = 2
    assert drive_output(plant, 200.0, 0.15, STATES) == (0.15, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_speed_source_has_no_torque_but_its_load() -> None:
    plant = TUG.record()
    plant["prime_mover"], plant["speed_held"] = 3, 1
    assert drive_output(plant, 200.0, 20.0, STATES) == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_ship_names_its_kind_in_its_record(frigate: Ship) -> None:
    assert frigate.record()["prime_mover"] == DIESEL
    assert TUG.record()["prime_mover"] == DC_MOTOR
