"""The closed loop: commands that depend on the measurement."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.validation.simulator import bench, governor
from shaftline.validation.simulator.governor import RACK, VOLTAGE, limit_rate
from shaftline.validation.simulator.instruments import add_instruments, voyage
from shaftline.validation.simulator.parameters import frigate_parameters
from shaftline.validation.simulator.voyage import simulate_voyage

PERIOD = 0.1
NOISE = {"encoder_noise": 0.01}
ORDERS, PITCH = voyage("steps", 80.0, PERIOD, np.random.default_rng(3), governed=True)


def test_the_same_points_are_ordered_by_rack_or_by_speed() -> None:
    rack, pitch = voyage("steps", 80.0, PERIOD, np.random.default_rng(3))
    assert (pitch == PITCH).all()
    assert (np.diff(rack) != 0.0).sum() == (np.diff(ORDERS) != 0.0).sum()
    assert 6.5 <= ORDERS.min() < ORDERS.max() <= 12.0


@pytest.mark.parametrize(
    "more",
    [{}, {"lag_time": 1.0}, {"dead_time": 0.6, "dead_time_jitter": 0.05}, {"rack_slowness": 0.3}],
    ids=["plain", "lag", "dead-time", "slow-rack"],
)
def test_under_its_own_commands_the_ship_moves_the_same(
    more: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop's equations are those of the open voyage, actuators and all."""
    numbers = frigate_parameters() | NOISE | more
    table = governor.simulate_governed(numbers, ORDERS, PITCH, PERIOD, 7)
    monkeypatch.setattr("shaftline.validation.simulator.voyage.JUMP", 0.0)  # halt at every demand
    again = simulate_voyage(numbers, table["fuel_rack_mm"].to_numpy(), PITCH, PERIOD)
    held = governor.simulate_held(numbers, table["fuel_rack_mm"].to_numpy(), PITCH, PERIOD)
    for column in ("shaft_speed_rad_s", "ship_speed_m_s", "shaft_torque_N_m"):
        for other in (table, held):
            off = float(np.std(other[column] - again[column]))
            assert off < 2e-3 * float(np.std(again[column])), column


def test_the_speed_is_held_by_what_the_encoder_shows() -> None:
    numbers = frigate_parameters() | NOISE
    table = governor.simulate_governed(numbers, ORDERS, PITCH, PERIOD, 7)
    wanted = limit_rate(ORDERS, RACK, PERIOD)
    assert float(np.std(table["shaft_speed_rad_s"] - wanted)) < 0.2 * float(np.std(wanted))
    # between two samples the demand moves by the rule, on the measurement that is recorded
    reading = add_instruments(table, numbers, PERIOD, 7)["shaft_speed_rad_s"].to_numpy()
    error, demand = wanted - reading, table["fuel_rack_mm"].to_numpy()
    steps = RACK.gain * np.diff(error) + RACK.reset * PERIOD * error[1:]
    free = (demand[1:] > 0.0) & (demand[1:] < RACK.high) & (demand[:-1] > 0.0)
    free &= demand[:-1] < RACK.high
    np.testing.assert_allclose(np.diff(demand)[free], steps[free], atol=1e-9)


def test_it_begins_at_rest_where_it_was_ordered() -> None:
    heavier = frigate_parameters(resistance=1.1) | {"encoder_noise": 0.0}
    orders = np.full(200, 9.0)
    table = governor.simulate_governed(heavier, orders, np.full(200, 1.2), PERIOD, 7)
    assert float(np.ptp(table["shaft_speed_rad_s"])) < 5e-3
    assert float(np.ptp(table["fuel_rack_mm"])) < 0.05


def test_the_order_changes_no_faster_than_the_governor_lets_it() -> None:
    steep = limit_rate(np.array([5.0, 5.0, 6.0, 6.0, 6.0]), RACK, 1.0)
    np.testing.assert_allclose(steep, [5.0, 5.0, 5.25, 5.5, 5.75])


def test_the_thruster_too() -> None:
    volts = bench.voltage_programme("reversals", 60.0, PERIOD, np.random.default_rng(3))
    orders = governor.bench_orders(volts)
    numbers = bench.bench_parameters() | NOISE | {"dry_front": 0.3, "flow_memory": 0.5}
    table = governor.run_bench_governed(numbers, orders, PERIOD, 7)
    again = bench.run_bench(numbers, table["motor_voltage_V"].to_numpy(), PERIOD)
    late = slice(100, None)  # the open run begins at rest at its first demand
    for column in ("shaft_speed_rad_s", "motor_current_A"):
        off = float(np.std((table[column] - again[column])[late]))
        assert off < 0.02 * float(np.std(again[column][late])), column
    wanted = limit_rate(orders, VOLTAGE, PERIOD)
    assert float(np.std(table["shaft_speed_rad_s"] - wanted)) < 0.3 * float(np.std(wanted))
    assert table["motor_voltage_V"].abs().max() <= VOLTAGE.high


def test_speeds_are_ordered_that_the_voltages_hold() -> None:
    volts = np.array([-30.0, -5.0, 0.0, 12.0, 36.0])
    for volt, speed in zip(volts, governor.bench_orders(volts), strict=True):
        run = bench.run_bench(bench.bench_parameters(), np.full(5, volt), PERIOD)
        assert float(run["shaft_speed_rad_s"].iloc[-1]) == pytest.approx(speed, abs=0.05)
