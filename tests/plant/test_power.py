"""Power of the shaft and of the drive, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import Schedule, State, equilibrium, load_ship, simulate
from shaftline.plant.columns import absent_columns, simulated_columns
from shaftline.plant.drives.prime_mover import delivered_power, supplied_power
from shaftline.plant.linear import tangent
from shaftline.plant.state import active_states

from .test_fluid import fan

TUG = load_ship("tito-neri-sine")


def test_a_held_shaft_takes_its_load_by_the_drives_efficiency() -> None:
    ship = fan(
        prime_mover={
            "type": "speed-command",
            "speed_max_rad_s": 1300.0,
            "drive_efficiency": 0.8,
            "idle_power_W": 3.0,
        },
    )
    found = simulate(ship, Schedule(600.0, 0.7), 0.5, initial=State(0.7, 600.0, 0.0))[-1]
    mechanical = found["propeller_torque"] * 600.0
    assert found["shaft_power"] == pytest.approx(mechanical, rel=1e-12)
    assert found["electric_power"] == pytest.approx(mechanical / 0.8 + 3.0, rel=1e-12)


def test_a_drive_that_brakes_gives_back_what_its_losses_leave() -> None:
    plant = fan().record()
    plant["drive_efficiency"], plant["idle_power"] = 0.8, 5.0
    assert supplied_power(plant, -100.0) == pytest.approx(-75.0)
    assert supplied_power(plant, 100.0) == pytest.approx(130.0)
    for mechanical in (-100.0, 0.0, 40.0):
        assert delivered_power(plant, supplied_power(plant, mechanical)) == pytest.approx(
            mechanical
        )


def test_a_motor_takes_its_voltage_times_its_current() -> None:
    ship = TUG.with_values({"prime_mover.supply_limit_V": 6.0})
    start = equilibrium(ship, 5.0, 1.0).state
    found = simulate(ship, Schedule(9.0, 1.0), 2.0, initial=start)[-1]
    assert found["electric_power"] == pytest.approx(6.0 * found["motor_current"], rel=1e-12)
    assert found["motor_current"] > 0.0


def test_a_torque_command_takes_torque_times_engine_speed() -> None:
    mover = {"type": "torque-command", "torque_max_N_m": 2.0, "drive_efficiency": 0.5}
    line = {
        "gear_ratio": 2.0,
        "efficiency": 1.0,
        "inertia_engine_side_kg_m2": 1e-3,
        "inertia_propeller_side_kg_m2": 1e-4,
    }
    ship = fan(prime_mover=mover, transmission=line)
    found = simulate(ship, Schedule(0.05, 0.7), 1.0, initial=State(0.7, 300.0, 0.0))[-1]
    assert found["electric_power"] == pytest.approx(0.05 * 2.0 * found["shaft_speed"] / 0.5)


def test_power_is_read_by_the_torque_meter_and_the_speed_sensor() -> None:
    gauge = {"sensors.torque_gain": 1.1, "sensors.torque_bias_N_m": 0.2}
    start = equilibrium(TUG, 5.0, 1.0).state
    found = simulate(TUG.with_values(gauge), Schedule(5.0, 1.0), 2.0, initial=start)
    np.testing.assert_allclose(
        found["shaft_power"], (1.1 * found["shaft_torque"] + 0.2) * found["shaft_speed"], rtol=1e-12
    )


def test_a_diesel_takes_no_electric_power() -> None:
    frigate = load_ship("frigate")
    assert "electric_power_W" in absent_columns(frigate)
    assert "electric_power_W" not in simulated_columns(frigate)
    assert {"electric_power_W", "shaft_power_W"} <= set(simulated_columns(TUG))


def test_linear_models_know_power() -> None:
    """dP/domega = M + omega dM/domega at a working point."""
    point = equilibrium(TUG, 5.0, 1.0)
    found = tangent(
        TUG.record(),
        point.state,
        point.inputs,
        1.0,
        active_states(TUG.record()),
        ("shaft_torque", "shaft_power"),
    )
    omega, torque = point.state.shaft_speed, found.values[0]
    assert found.values[1] == pytest.approx(torque * omega)
    at = active_states(TUG.record()).index("shaft_speed")
    assert found.c[1, at] == pytest.approx(torque + omega * found.c[0, at], rel=1e-9)
