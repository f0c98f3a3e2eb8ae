from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import ShipError, load_ship
from shaftline.plant.drives import DcMotor, SpeedSource, TorqueSource
from shaftline.plant.record import PLANT


def test_end_stops_of_a_demand_either_way_are_alike() -> None:
    motor = {"motor_constant_V_s_rad": 1.0, "armature_resistance_ohm": 1.0, "voltage_max_V": 3.0}
    for mover in (
        DcMotor(type="dc-motor", **motor),
        SpeedSource(type="speed-command", speed_max_rad_s=3.0),
        TorqueSource(type="torque-command", torque_max_N_m=3.0),
    ):
        record: Any = np.zeros(1, PLANT)[0]
        mover.fill(record)
        limits = [record[name] for name in ("drive_max", "drive_min", "rack_rate_limit")]
        assert limits == [3.0, -3.0, math.inf]


def test_each_says_what_is_applied_to_it() -> None:
    ships = {name: load_ship(name) for name in ("frigate", "rov-thruster")}
    assert [ship.has_voltage for ship in ships.values()] == [False, True]
    assert [ship.has_diesel for ship in ships.values()] == [True, False]


def test_a_drive_s_dead_time_is_that_of_its_command() -> None:
    slow = load_ship("frigate").with_values({"prime_mover.dead_time_s": 0.3})
    assert slow.prime_mover.delays == {"prime_mover.dead_time_s": 0.3}
    rov = load_ship("rov-thruster").with_values({"prime_mover.command_delay_s": 0.1})
    assert rov.prime_mover.delays == {"prime_mover.command_delay_s": 0.1}
    with pytest.raises(ShipError, match=r"prime_mover\.command_delay_s = 3\.0 s exceeds 2\.04 s"):
        rov.with_values({"prime_mover.command_delay_s": 3.0})
    assert load_ship("towing-tank").prime_mover.delays == {"prime_mover.command_delay_s": 0.0}


def test_only_an_armature_with_inductance_bounds_the_time_step() -> None:
    assert load_ship("frigate").prime_mover.time_constants == {}
    bare = load_ship("rov-thruster").with_values({"prime_mover.armature_inductance_H": 0.0})
    assert bare.prime_mover.time_constants == {}
    coil = bare.with_values(
        {
            "prime_mover.armature_inductance_H": 0.02,
            "prime_mover.armature_resistance_ohm": 4.0,
            "integration.time_step_s": 0.004,
        }
    )
    (constant,) = coil.prime_mover.time_constants.values()
    assert math.isclose(constant, 0.005)
