from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.baselines.governor import Governor, govern, highest_rack, tune
from shaftline.baselines.steady_points import steady_point
from shaftline.plant import Schedule, Ship, ShipError, equilibrium, load_ship, simulate
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.memory import MEMORY
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, prepare, step
from shaftline.plant.waves import calm

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


def starting_rack(ship: Ship, pitch: float) -> float:
    return steady_point(ship, 0.8 * ship.shaft_speeds[1], pitch).fuel_rack


def governed(
    ship: Ship, order: float, pitch: float, seconds: float
) -> tuple[list[float], list[float]]:
    """Shaft speeds and racks of a governed run, at each 0.5 s."""
    plant, governor, dt = ship.record(), Governor(ship), ship.time_step_s
    begin = equilibrium(ship, starting_rack(ship, pitch), pitch)
    state, memory = np.zeros(1, STATE)[0], np.zeros(1, MEMORY)[0]
    for name, value in begin.state._asdict().items():
        state[name] = value
    prepare(plant, state, memory, calm(), begin.inputs.drive, UNDISTURBED, dt)
    before = [state["shaft_speed"]]  # until now this was the order
    integral = governor.settle(before, [memory["rack"]], before)
    speeds, racks = [], []
    for _ in range(round(seconds / 0.5)):
        rack, integral = governor.command([order], [state["shaft_speed"]], integral)
        for _ in range(round(0.5 / dt)):
            step(plant, state, memory, calm(), float(rack[0]), pitch, *(UNDISTURBED,) * 3, dt)
        speeds.append(float(state["shaft_speed"]))
        racks.append(float(rack[0]))
    return speeds, racks


@by_ship
@pytest.mark.parametrize("pitch", [0.6, 0.9])
@pytest.mark.parametrize("share", [0.5, 0.75])
def test_governor_holds_the_ordered_shaft_speed(ship: Ship, share: float, pitch: float) -> None:
    order = share * ship.shaft_speeds[1]
    speeds, racks = governed(ship, order, pitch, 600.0)
    assert speeds[-1] == pytest.approx(order, rel=1e-3)
    assert racks[-1] == pytest.approx(steady_point(ship, order, pitch).fuel_rack, rel=0.01)
    assert np.ptp(racks[-100:]) < 0.05  # mm: no hunting


@by_ship
def test_response_has_the_ordered_time_constant(ship: Ship) -> None:
    start = 0.8 * ship.shaft_speeds[1]
    order = 0.95 * start  # small enough not to reach a limit
    speeds, _ = governed(ship, order, 0.8, 8.0)
    left = (speeds[3] - order) / (start - order)  # after 2 s
    assert left == pytest.approx(math.exp(-1.0), abs=0.15)
    assert min(speeds) > order - 0.15 * (start - order)


@by_ship
def test_limiter_keeps_inside_the_envelope(ship: Ship) -> None:
    plant = ship.record()
    for share in (0.3, 0.5, 0.8, 1.0):
        speed = share * ship.shaft_speeds[1]
        engine_speed = float(plant["gear_ratio"]) * speed
        torque = rack_torque(plant, engine_speed, highest_rack(plant, speed))
        assert torque <= torque_limit(plant, engine_speed) * (1 + 1e-12)


def test_integral_rests_at_the_limits() -> None:
    plant = SHIPS[0].record()
    rack, integral = govern(plant, 14.0, 8.0, 20.0, 10.0, 1.0)
    assert rack == highest_rack(plant, 8.0)
    assert integral == 20.0
    rack, integral = govern(plant, 5.0, 14.0, 3.0, 10.0, 1.0)
    assert (rack, integral) == (0.0, 3.0)
    rack, integral = govern(plant, 14.0, math.nan, 20.0, 10.0, 1.0)
    assert (rack, integral) == (20.0, 20.0)


def test_first_command_is_bumpless_and_batch_is_single() -> None:
    governor = Governor(SHIPS[0])
    speeds, racks, orders = np.array([8.0, 12.0]), np.array([15.0, 25.0]), np.array([8.3, 11.5])
    integral = governor.settle(speeds, racks, orders)
    command, following = governor.command(orders, speeds, integral)
    assert command == pytest.approx(racks)
    for i in range(2):
        alone, memory = governor.command(orders[i : i + 1], speeds[i : i + 1], integral[i : i + 1])
        assert alone[0] == command[i]
        assert memory[0] == following[i]


def test_bad_input_is_named() -> None:
    with pytest.raises(ShipError, match="needs a diesel"):
        Governor("tito-neri-sine")
    with pytest.raises(ValueError, match="must be positive"):
        tune(SHIPS[0], 0.0)


def test_steady_point_is_where_a_simulation_ends() -> None:
    ferry = SHIPS[1]
    point = steady_point(ferry, 45.0, 0.8, 1.1)
    begin = equilibrium(ferry, point.fuel_rack, 0.8)
    schedule = Schedule(point.fuel_rack, 0.8, resistance_factor=1.1)
    last = simulate(ferry, schedule, 400.0, initial=begin.state)[-1]
    assert last["shaft_speed"] == pytest.approx(point.shaft_speed, rel=1e-6)
    assert last["ship_speed"] == pytest.approx(point.ship_speed, rel=1e-6)
    assert last["thrust"] == pytest.approx(point.thrust, rel=1e-6)
