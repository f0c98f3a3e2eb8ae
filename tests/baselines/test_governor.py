from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.governor import (
    Governor,
    govern,
    highest_rack,
    limit_rack,
    limiter_slope,
    rack_limits,
    tune,
)
from shaftline.baselines.steady_points import steady_point
from shaftline.envs.batch import LIMITER_RESPONSE_S
from shaftline.plant import Ship, ShipError, equilibrium, load_ship
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.dynamics import evaluate
from shaftline.plant.memory import MEMORY
from shaftline.plant.shaft import shaft_inertia
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, constant_inputs, prepare, step
from shaftline.plant.waves import calm_sea

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


def starting_rack(ship: Ship, pitch: float) -> float:
    return steady_point(ship, 0.8 * ship.shaft_speeds[1], pitch).fuel_rack


def governed(
    ship: Ship, order: float, pitch: float, seconds: float
) -> tuple[list[float], list[float]]:
    """Return shaft speeds and racks of a simulation with a governor, every 0.5 s."""
    plant, governor, dt = ship.record(), Governor(ship), ship.time_step_s
    begin = equilibrium(ship, starting_rack(ship, pitch), pitch)
    state, memory = np.zeros(1, STATE)[0], np.zeros(1, MEMORY)[0]
    for name, value in begin.state._asdict().items():
        state[name] = value
    prepare(plant, state, memory, calm_sea(), begin.inputs.drive, UNDISTURBED, dt)
    before = [state["shaft_speed"]]  # the order before the step
    integral = governor.settle(before, [memory["rack"]], before)
    speeds, racks = [], []
    for _ in range(round(seconds / 0.5)):
        rack, integral = governor.command([order], [state["shaft_speed"]], integral)
        for _ in range(round(0.5 / dt)):
            acting = constant_inputs(float(rack[0]), pitch, 0.0, UNDISTURBED)
            step(plant, state, memory, calm_sea(), acting, dt)
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
    assert np.ptp(racks[-100:]) < 0.05  # no oscillation [mm]


@by_ship
def test_response_has_the_ordered_time_constant(ship: Ship) -> None:
    start = 0.8 * ship.shaft_speeds[1]
    order = 0.95 * start  # small enough not to reach a limit
    speeds, _ = governed(ship, order, 0.8, 8.0)
    left = (speeds[3] - order) / (start - order)  # after 2 s
    assert left == pytest.approx(math.exp(-1.0), abs=0.15)
    assert min(speeds) > order - 0.15 * (start - order)


@by_ship
def test_limiter_is_the_rack_at_the_envelope(ship: Ship) -> None:
    plant = ship.record()
    for share in (0.3, 0.5, 0.8, 1.0):
        speed = share * ship.shaft_speeds[1]
        engine_speed = float(plant["gear_ratio"]) * speed
        torque = rack_torque(plant, engine_speed, highest_rack(plant, speed))
        assert torque == pytest.approx(torque_limit(plant, engine_speed), rel=1e-12)


def test_limiter_ends_at_the_stops() -> None:
    plant = SHIPS[0].record()
    plant["drive_max"] = 20.0
    assert highest_rack(plant, 13.0) == 20.0
    plant["torque_limit_idle"] = -1e6
    plant["drive_min"] = 1.0
    assert highest_rack(plant, 6.0) == 1.0


def test_inside_the_limits_it_is_a_pi() -> None:
    plant = SHIPS[0].record()
    rack, integral = govern(plant, 10.5, 10.0, 15.0, 4.0, 0.6)
    assert integral == pytest.approx(15.0 + 0.6 * 0.5)
    assert rack == pytest.approx(4.0 * 0.5 + 15.3)
    assert list(govern(plant, 9.5, 10.0, 15.0, 4.0, 0.6)) == pytest.approx([12.7, 14.7])


def test_at_a_limit_the_integral_changes_only_away_from_it() -> None:
    plant = SHIPS[0].record()
    highest = highest_rack(plant, 8.0)
    assert govern(plant, 14.0, 8.0, 20.0, 10.0, 1.0) == (highest, 20.0)
    # Above the limit and too fast: the integral may decrease.
    rack, integral = govern(plant, 7.9, 8.0, 60.0, 1.0, 10.0)
    assert rack == highest
    assert integral == pytest.approx(59.0)
    assert govern(plant, 5.0, 14.0, 3.0, 10.0, 1.0) == (0.0, 3.0)
    # Below the end stop and too slow: the integral may increase.
    rack, integral = govern(plant, 14.1, 14.0, -60.0, 1.0, 10.0)
    assert rack == 0.0
    assert integral == pytest.approx(-59.0)


@pytest.mark.parametrize(("held", "rack"), [(20.0, 20.0), (55.0, 40.0), (-3.0, 0.0)])
def test_without_a_measurement_only_the_integral_acts(held: float, rack: float) -> None:
    plant = SHIPS[0].record()
    assert govern(plant, 14.0, math.nan, held, 10.0, 1.0) == (rack, held)


@by_ship
@pytest.mark.parametrize(("interval", "response"), [(0.5, 2.0), (0.1, 4.0)])
def test_gains_cancel_the_pole_of_the_shaft(ship: Ship, interval: float, response: float) -> None:
    """(z - p)(z - 1) + g ((k_p + k_i) z - k_p) has the roots p and exp(-h / T)."""
    plant, pitch = ship.record(), 0.9
    gains = tune(ship, interval, response, pitch)
    assert len(gains.shaft_speed) >= 4
    for speed, kp, ki in zip(*gains, strict=True):
        rack = steady_point(ship, float(speed), pitch).fuel_rack
        start = equilibrium(ship, rack, pitch)

        def acceleration(away: float, more: float, start: Any = start) -> float:
            state = start.state._replace(shaft_speed=start.state.shaft_speed + away)
            inputs = start.inputs._replace(drive=start.inputs.drive + more)
            return float(evaluate(plant, state, inputs, pitch)[0].shaft_speed)

        a = (acceleration(1e-4, 0.0) - acceleration(-1e-4, 0.0)) / 2e-4
        b = (acceleration(0.0, 1e-3) - acceleration(0.0, -1e-3)) / 2e-3
        p, q = math.exp(a * interval), math.exp(-interval / response)
        g = b * (p - 1.0) / a
        roots = np.roots([1.0, -p - 1.0 + g * (kp + ki), p - g * kp])
        assert np.sort(roots) == pytest.approx(sorted((p, q)), rel=1e-5)


def test_response_is_never_faster_than_the_interval_or_the_engine() -> None:
    frigate = SHIPS[0]
    slowest = tune(frigate, 0.5, 1.5)
    assert tune(frigate, 0.5, 0.1).proportional == pytest.approx(slowest.proportional)
    sluggish = frigate.with_values({"prime_mover.lag_s": 1.0, "prime_mover.dead_time_s": 0.5})
    assert tune(sluggish, 0.5).integral == pytest.approx(tune(frigate, 0.5, 4.5).integral)
    middle = tune(frigate, 0.5, pitch_ratio=1.0)  # of 0.6 to 1.4
    assert np.array_equal(tune(frigate, 0.5), middle)
    assert not np.array_equal(middle.proportional, tune(frigate, 0.5, pitch_ratio=0.9).proportional)


def test_working_points_beyond_the_envelope_are_left_out() -> None:
    frigate, ferry = SHIPS
    for ship, pitch, count in ((ferry, 0.9, 4), (frigate, 0.9, 6)):
        speeds = np.linspace(*ship.shaft_speeds, 6)
        inside = [w for w in speeds if steady_point(ship, float(w), pitch).torque_share < 1.0]
        assert len(inside) == count
        assert tune(ship, 0.5, pitch_ratio=pitch).shaft_speed == pytest.approx(inside, rel=1e-6)
    weak = frigate.with_values(
        {"prime_mover.torque_limit_N_m": 100.0, "prime_mover.torque_limit_at_min_speed_N_m": 100.0}
    )
    with pytest.raises(ValueError, match=r"frigate: no steady state within .* P/D 1\.4"):
        tune(weak, 0.5, pitch_ratio=1.4)


def test_a_bank_interpolates_its_gains_and_holds_orders_inside_the_engine() -> None:
    governor = Governor(SHIPS[0])
    lowest, highest = SHIPS[0].shaft_speeds
    gains = governor.gains
    speed = 0.25 * gains.shaft_speed[2] + 0.75 * gains.shaft_speed[3]
    kp, ki = (0.25 * gain[2] + 0.75 * gain[3] for gain in gains[1:])
    rack, integral = governor.command([speed + 0.1], [speed], [15.0])
    assert integral[0] == pytest.approx(15.0 + ki * 0.1)
    assert rack[0] == pytest.approx(kp * 0.1 + 15.0 + ki * 0.1)
    for order, held in ((99.0, highest), (0.1, lowest)):
        rack, integral = governor.command([order], [held - 0.05], [15.0])
        same, _ = governor.command([held], [held - 0.05], [15.0])
        assert rack == same
    # In a steady state k_p e + I + k_i e is the rack, within the stops.
    settled = governor.settle([speed], [22.0], [speed + 0.3])
    assert settled[0] == pytest.approx(22.0 - (kp + ki) * 0.3)
    assert governor.settle([speed, speed], [39.0, 1.0], [speed - 2.0, speed + 2.0]).tolist() == [
        40.0,
        0.0,
    ]


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
    with pytest.raises(ShipError, match="needs a diesel engine"):
        Governor("tito-neri-sine")
    for interval, response in ((0.0, 2.0), (0.5, 0.0)):
        with pytest.raises(ValueError, match="must be positive"):
            tune(SHIPS[0], interval, response)


LOWEST, HIGHEST = (rpm * math.pi / 30.0 / 7.38 for rpm in (350.0, 1000.0))
"""Lowest and highest shaft speed of the frigate [rad/s]."""


def test_the_rack_limits_correct_a_speed_error_in_the_response_time() -> None:
    """0.8 J_total dn / T over the shaft torque of one mm of rack, or the whole rack within 10 %."""
    plant = load_ship("frigate").record()
    per_mm = plant["torque_per_rack"] * plant["gear_ratio"] * plant["transmission_efficiency"]
    expected = 0.8 * shaft_inertia(plant) / (0.1 * per_mm)
    assert limiter_slope(plant, 0.1) == pytest.approx(expected)
    assert limiter_slope(plant, 9.0) == pytest.approx(40.0 / (0.1 * HIGHEST))


@pytest.mark.parametrize(
    ("speed", "low", "high"),
    [
        # At the lowest speed the rack of zero torque; below it 10 mm more per rad/s.
        (LOWEST, 6.334, 16.834),
        (LOWEST - 0.1, 7.334, None),
        (LOWEST + 0.3, 3.334, None),
        (LOWEST + 0.7, 0.0, None),
        (8.0, 0.0, None),
        # The torque limiter up to the highest speed, then 10 mm less per rad/s.
        (HIGHEST, 0.0, 35.11),
        (HIGHEST + 0.5, 0.0, None),
        (HIGHEST + 6.0, 0.0, 0.0),
    ],
)
def test_rack_limits_keep_the_engine_above_idle_below_its_envelope_and_its_highest_speed(
    speed: float, low: float, high: float | None
) -> None:
    plant = load_ship("frigate").record()
    least, most = rack_limits(plant, speed, 10.0)
    beyond = max(speed - HIGHEST, 0.0)
    assert most == pytest.approx(max(highest_rack(plant, speed) - 10.0 * beyond, 0.0))
    assert least == pytest.approx(low, abs=2e-3)
    if high is not None:
        assert most == pytest.approx(high, abs=0.02)
    for asked in (-5.0, 0.0, least, 0.5 * (least + most), most, 40.0):
        kept = limit_rack(plant, asked, speed, 10.0)
        assert kept == min(max(asked, least), most)
    assert limit_rack(plant, 12.3, math.nan, 10.0) == 12.3


def test_the_torque_limit_stands_above_the_idle_limit() -> None:
    plant = load_ship("frigate").record()
    least, most = rack_limits(plant, 0.3 * LOWEST, 30.0)
    assert least == most == pytest.approx(highest_rack(plant, 0.3 * LOWEST))


@pytest.mark.parametrize("name", ["frigate", "frigate-at-sea", "frigate-turning", "ferry"])
def test_the_fuel_is_cut_before_the_engine_trips(name: str) -> None:
    plant = load_ship(name).record()
    trip = 1.149 * plant["engine_speed_max"] / plant["gear_ratio"]
    _, most = rack_limits(plant, trip, limiter_slope(plant, LIMITER_RESPONSE_S))
    assert most == 0.0
