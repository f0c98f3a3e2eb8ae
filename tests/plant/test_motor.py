from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import Schedule, Ship, equilibrium, linearise, load_ship, simulate
from shaftline.plant.drives.dc_motor import applied_voltage, motor_torque


def tug(**values: float) -> Ship:
    keys = {f"prime_mover.{key}": value for key, value in values.items()}
    return load_ship("tito-neri-sine").with_values(keys)


@pytest.mark.parametrize(
    ("demand", "voltage"),
    [(0.4, 0.0), (-0.4, 0.0), (2.0, 1.5), (-2.0, -1.5), (9.0, 6.0), (-9.0, -6.0), (6.4, 5.9)],
)
def test_dead_zone_is_taken_off_before_the_supply_limits(demand: float, voltage: float) -> None:
    plant = tug(command_dead_zone_V=0.5, supply_limit_V=6.0).record()
    assert applied_voltage(plant, demand, 0.0) == pytest.approx(voltage, rel=1e-15)


@pytest.mark.parametrize(
    ("demand", "slope"), [(0.3, 0.0), (3.0, 1.0), (-3.0, 1.0), (8.0, 0.0), (-8.0, 0.0)]
)
def test_voltage_has_an_exact_slope(demand: float, slope: float) -> None:
    plant = tug(command_dead_zone_V=0.5, supply_limit_V=6.0).record()
    assert complex(applied_voltage(plant, demand + 1e-30j, 0.0)).imag / 1e-30 == slope


def test_motor_under_a_dead_zone_runs_as_one_with_less_voltage() -> None:
    plain = equilibrium(tug(), 4.0, 1.0)
    found = equilibrium(tug(command_dead_zone_V=1.0), 5.0, 1.0)
    assert found.state.shaft_speed == pytest.approx(plain.state.shaft_speed, rel=1e-9)
    assert (
        pytest.approx(linearise(tug(), plain).B) == linearise(tug(command_dead_zone_V=1.0), found).B
    )


def test_supply_limit_lies_below_the_end_stop() -> None:
    start = equilibrium(tug(), 4.0, 1.0).state
    runs = [
        simulate(tug(supply_limit_V=limit), Schedule(drive, 1.0), 1.0, initial=start)
        for limit, drive in ((6.0, 11.0), (6.0, 20.0), (np.inf, 6.0))
    ]
    for run in runs[1:]:
        np.testing.assert_array_equal(run["shaft_speed"], runs[0]["shaft_speed"])


def test_torque_astern_is_a_fraction_and_has_no_jump() -> None:
    plant = tug(reverse_torque_fraction=0.8).record()
    assert motor_torque(plant, 2.0) == 2.0 * 0.0183
    assert motor_torque(plant, -2.0) == pytest.approx(-2.0 * 0.8 * 0.0183, rel=1e-15)
    assert complex(motor_torque(plant, -2.0 + 1e-30j)).imag / 1e-30 == pytest.approx(0.8 * 0.0183)


@pytest.mark.parametrize("fraction", [1.0, 0.8])
def test_tug_turns_astern_as_fast_as_its_torque_lets_it(fraction: float) -> None:
    ship = tug(reverse_torque_fraction=fraction)
    start = equilibrium(ship, 6.0, 1.0).state
    ahead, astern = (
        simulate(ship, Schedule(drive, 1.0), 2.0, initial=start)[-1] for drive in (6.0, -6.0)
    )
    if fraction == 1.0:
        assert astern["shaft_speed"] == pytest.approx(-ahead["shaft_speed"], rel=1e-6)
        assert astern["propeller_torque"] == pytest.approx(-ahead["propeller_torque"], rel=1e-6)
    else:
        assert -0.98 * ahead["shaft_speed"] < astern["shaft_speed"] < -0.5 * ahead["shaft_speed"]
