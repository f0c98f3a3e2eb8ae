from __future__ import annotations

import math

import pytest

from shaftline.plant import Schedule, Ship, State, equilibrium, load_ship, simulate
from shaftline.plant.drives.torque_source import TorqueSource


@pytest.fixture(scope="module")
def tug() -> Ship:
    tree = load_ship("tito-neri-sine").model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "torque-command", "torque_max_N_m": 0.2}
    return Ship.model_validate(tree)


def test_record_has_end_stops_either_way_and_no_rack(tug: Ship) -> None:
    plant = tug.record()
    assert (plant["drive_min"], plant["drive_max"]) == (-0.2, 0.2)
    assert plant["rack_rate_limit"] == math.inf
    assert plant["prime_mover"] == TorqueSource.code == 2


def test_an_offset_drives_the_shaft_beside_the_demand(servo: Ship) -> None:
    """Ahead where it is positive: 3 N m of it and no demand turn the servo at 3 / d."""
    pushed = servo.with_values({"prime_mover.torque_offset_N_m": 3.0})
    run = simulate(pushed, Schedule(0.0, 1.0), 8.0, initial=State(1.0, 0.0, 0.0))
    assert run["shaft_speed"][-1] == pytest.approx(3.0 / 190.0, rel=1e-6)
    assert run["brake_torque"][-1] == 3.0
    assert pushed.parameter("prime_mover.torque_offset_N_m").info[:4] == ("N m", -1e8, 1e8, 0.0)


def test_it_is_driven_by_a_torque() -> None:
    assert TorqueSource.balance == "motor"
    assert TorqueSource.demand.column == "motor_torque_N_m"
    demand = TorqueSource.demand
    assert (demand.low, demand.high, demand.unit) == (-1e8, 1e8, "N m")


def test_it_delivers_what_it_is_told_up_to_its_limit(tug: Ship) -> None:
    start = equilibrium(tug, 0.1, 1.0)
    assert start.outputs.brake_torque == 0.1
    for demand, torque in ((0.15, 0.15), (0.5, 0.2), (-0.5, -0.2)):
        run = simulate(tug, Schedule(demand, 1.0), 0.01, initial=start.state)
        assert run["brake_torque"][-1] == torque
