from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.combinator import Combinator, combinator_curve
from shaftline.baselines.controller import decode
from shaftline.baselines.governor import highest_rack
from shaftline.baselines.speed_pilot import FilteredSignals, PilotSettings, SpeedPilot
from shaftline.baselines.steady_points import steady_point
from shaftline.envs import CLASSIC, FrigateVectorEnv
from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.drives.diesel import Diesel, rack_of_torque

from .voyage import INTERVAL_S, run_voyage

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)

ROWS = np.array(
    [[8.0, 9.0, 1e5, 1.2, 15.0, 7.8, 6.6, 1.0], [11.0, 12.0, 2e5, 1.3, 28.0, 10.8, 8.5, 0.0]]
)


def top_speed(ship: Ship) -> float:
    return float(combinator_curve(ship).ship_speed[-1])


@by_ship
@pytest.mark.parametrize(("share", "resistance"), [(0.45, 1.0), (0.7, 1.2), (0.9, 1.0)])
def test_ordered_speed_is_reached(ship: Ship, share: float, resistance: float) -> None:
    order = share * top_speed(ship)
    end = run_voyage(SpeedPilot(ship), ship, order, 450.0, resistance=resistance)[-1]
    assert end.ship_speed == pytest.approx(order, rel=3e-3)
    if resistance > 1.0:  # in calm water the combinator holds the speed too
        assert Combinator(ship).steady_point(order, resistance).ship_speed < 0.975 * order


@by_ship
@pytest.mark.parametrize("share", [0.0, 0.7, 0.9])
def test_commands_come_to_rest_in_calm_water(ship: Ship, share: float) -> None:
    # An order of 0 lies below the curve, where only the lower rack limit acts.
    log = run_voyage(SpeedPilot(ship), ship, share * top_speed(ship), 250.0)[-40:]
    fluctuation = np.ptp([end.action for end in log], axis=0)
    assert np.all(fluctuation < 0.01), f"pitch and rack fluctuate by {fluctuation} of 2"


@functools.cache
def step_order(name: str, before: float, after: float) -> tuple[Any, Any]:
    """Return shaft speed and rack over their limits [-] after a step of the order."""
    ship = load_ship(name)
    plant, (low, high) = ship.record(), ship.shaft_speeds
    top, change = top_speed(ship), round(100.0 / INTERVAL_S)
    log = run_voyage(
        SpeedPilot(ship), ship, lambda t: (before if t < 100.0 else after) * top, 250.0
    )
    speed = np.array([end.shaft_speed for end in log])
    rack = np.array([0.5 * (end.action[1] + 1.0) * plant["drive_max"] for end in log])
    # The plant limits the torque, so the test uses the command and the shaft speed measured for it.
    allowed = np.array([highest_rack(plant, float(w)) for w in speed[:-1]])
    share = (rack[1:] / allowed)[change:]
    return (speed[change:].min() / low, speed[change:].max() / high), share


@by_ship
@pytest.mark.parametrize("after", [0.35, 0.0])
def test_deceleration_does_not_stall_the_engine(ship: Ship, after: float) -> None:
    (lowest, _), _ = step_order(ship.name, 1.0, after)
    assert lowest > 0.98  # over the lowest engine speed; the engine stalls at 0.3


@by_ship
def test_acceleration_keeps_within_the_engine(ship: Ship) -> None:
    (_, highest), rack = step_order(ship.name, 0.35, 1.05)
    assert highest < 1.12  # the engine trips at 1.15
    assert 0.999 < rack.max() < 1.001  # the rack reaches the limiter and stays there


def test_speed_offset_moves_the_speed_reached() -> None:
    ferry = SHIPS[1]
    order = 0.7 * top_speed(ferry)
    ends = [
        run_voyage(SpeedPilot(ferry, speed_offset=d), ferry, order, 200.0)[-1] for d in (0.0, -0.3)
    ]
    assert ends[1].ship_speed - ends[0].ship_speed == pytest.approx(-0.3, abs=0.01)


def test_integral_is_held_at_a_large_error_or_a_rack_limit() -> None:
    pilot = SpeedPilot("frigate")

    def gained(error: float, order: float = 8.0, shaft_speed: float = 10.0) -> float:
        row = [order, shaft_speed, 1e5, 1.2, 15.0, order - error, 7.0, 1.0]
        memory = pilot.predict(row)[1]
        memory[0, 3] = 0.0  # no load in addition to that of calm water
        return float(pilot.predict(row, memory)[1][0, 3])

    # k_v dt / T per m/s; T of the frigate is 73 s.
    curve = combinator_curve(pilot.ship).ship_speed
    hull = pilot.ship.hull
    reset = hull.mass_kg / (2.0 * hull.resistance_coefficient_N_s2_m2 * curve.mean())
    assert reset == pytest.approx(73.3, abs=0.1)
    assert gained(0.2) == pytest.approx(0.2 * pilot._speed_gain * 0.5 / reset)
    assert gained(-0.2) == pytest.approx(-gained(0.2))
    assert gained(0.6) == gained(-0.6) == 0.0
    low, high = pilot.ship.shaft_speeds
    assert gained(0.2, shaft_speed=1.2 * high) == 0.0 > gained(-0.2, shaft_speed=1.2 * high)
    # A low order keeps the idling engine inside its torque limit.
    assert gained(-0.2, 3.0, 0.9 * low) == 0.0 < gained(0.2, 3.0, 0.9 * low)


def test_it_starts_bumpless() -> None:
    """The rack above that of the curve at the ship speed is the additional load, and is kept."""
    pilot = SpeedPilot("frigate", torque_gain=0.0, shaft_gain=0.0)
    low = pilot.predict([7.0, 9.0, 1e5, 1.2, 17.0, 7.0, 6.6, 1.0])[0]
    assert decode(float(low[1]), 0.0, 40.0) == pytest.approx(17.0, abs=1e-4)
    faster = SpeedPilot("frigate", torque_gain=0.0, shaft_gain=0.0, integral_gain=3.0)
    grown = []
    for one in (pilot, faster):
        row = [7.2, 9.0, 1e5, 1.2, 17.0, 7.0, 6.6, 1.0]
        memory = one.predict(row)[1]
        grown.append(float(one.predict(row, memory)[1][0, 3] - memory[0, 3]))
    assert grown[1] == pytest.approx(3.0 * grown[0])


def torque_deviation(**settings: float) -> Any:
    """Return the standard deviation of the shaft torque [N m] after the first minute, by seed."""
    env = FrigateVectorEnv(
        4, threads=1, task="transit", sea="state-6", max_episode_steps=400, **CLASSIC
    )
    pilot = SpeedPilot("frigate", **settings)
    seen, _ = env.reset(seed=3, options={"speed_order_m_s": 8.0})
    memory, torque = None, []
    for _ in range(399):
        action, memory = pilot.predict(seen, memory)
        seen, _, ended, _, _ = env.step(action)
        assert not ended.any()
        torque.append(seen[:, 2])
    env.close()
    return np.std(torque[120:], axis=0)


def test_torque_gain_reduces_the_torque_fluctuation() -> None:
    assert np.all(torque_deviation(torque_gain=1.0) < 0.85 * torque_deviation(torque_gain=0.0))


def test_episodes_start_in_the_initial_state_and_batches_equal_singles() -> None:
    pilot = SpeedPilot("frigate")
    actions, state = pilot.predict(ROWS)
    assert actions.dtype == np.float32
    assert actions.shape == (2, 2)
    assert state.shape == (2, 4)
    kept = state + 1.0
    again, later = pilot.predict(ROWS, kept, np.array([True, False]))
    np.testing.assert_array_equal(again[0], actions[0])
    np.testing.assert_array_equal(later[0], state[0])
    assert np.all(later[1] != state[1])
    np.testing.assert_array_equal(kept, state + 1.0)  # the argument is not changed
    for row, action, memory in zip(ROWS, again, (None, kept[1:]), strict=True):
        np.testing.assert_array_equal(pilot.predict(row, memory)[0], action)
    assert np.all(np.abs(actions) < 1.0)


@by_ship
def test_units_of_the_gains(ship: Ship) -> None:
    pilot, interval = SpeedPilot(ship, 0.25), 0.25
    down = ship.transmission.gear_ratio * ship.transmission.efficiency
    mover = ship.prime_mover
    assert isinstance(mover, Diesel)
    line = ship.transmission
    inertia = line.inertia_engine_side_kg_m2 + line.inertia_propeller_side_kg_m2
    per_torque = 1.0 / (mover.torque_per_rack_N_m_mm * down)
    screw = ship.propeller
    pitches = screw.pitch_ratio_max - screw.pitch_ratio_min
    rested = FilteredSignals(*(np.array([x]) for x in (0.0, 10.0, 1e3, 0.0)))
    order = np.array([0.7 * top_speed(ship)])
    nothing = PilotSettings(0.0, 0.0, 0.0, 0.0, 0.0)

    def command(settings: PilotSettings, shaft_speed: float, torque: float) -> Any:
        low, high = ship.shaft_speeds
        middle = 0.5 * (low + high)
        slowed = rested._replace(shaft_speed=np.array([middle]))
        found = pilot.command(order, np.array([middle + shaft_speed]), torque, slowed, settings)
        return np.array([float(x[0]) for x in found])

    still = command(nothing, 0.0, 1e3)
    light = 0.01 * mover.torque_limit_N_m * down
    # Each gain alone: the changes of pitch, rack and integral.
    rack = command(nothing._replace(torque_gain=0.8), 0.0, 1e3 - light) - still
    assert rack == pytest.approx([0.0, 0.8 * light * per_torque, 0.0], abs=1e-9)
    rack = command(nothing._replace(shaft_gain=0.3), -0.05, 1e3) - still
    assert rack == pytest.approx([0.0, 0.3 * inertia / interval * per_torque * 0.05, 0.0], abs=1e-9)
    pitch = command(nothing._replace(pitch_gain=0.5), 0.0, 1e3 - light) - still
    assert pitch == pytest.approx(
        [0.5 * pitches / (mover.torque_limit_N_m * down) * light, 0.0, 0.0], abs=1e-12
    )
    assert command(nothing._replace(pitch_offset=0.1), 0.0, 1e3)[0] == pytest.approx(still[0] + 0.1)


@by_ship
def test_calm_commands_are_the_curves(ship: Ship) -> None:
    pilot, curve = SpeedPilot(ship), combinator_curve(ship)
    racks = [
        steady_point(ship, float(n), float(p)).fuel_rack
        for n, p in zip(curve.shaft_speed, curve.pitch_ratio, strict=True)
    ]
    middle = 0.5 * sum(ship.shaft_speeds)
    for order in (curve.ship_speed[7], 0.3 * curve.ship_speed[20] + 0.7 * curve.ship_speed[21]):
        slowed = FilteredSignals(*(np.array([x]) for x in (0.1, middle, 1e3, 0.5)))
        now = np.array([middle]), np.array([1e3])
        pitch, rack, integral = pilot.command(np.array([order]), *now, slowed, PilotSettings())
        assert pitch[0] == pytest.approx(np.interp(order, curve.ship_speed, curve.pitch_ratio))
        slope = (racks[-1] - racks[0]) / (curve.ship_speed[-1] - curve.ship_speed[0])
        calm = np.interp(order, curve.ship_speed, racks)
        assert rack[0] == pytest.approx(calm + 2.0 * slope * 0.1 + 0.5)  # speed_gain 2
        hull = ship.hull
        reset = hull.mass_kg / (2.0 * hull.resistance_coefficient_N_s2_m2 * curve.ship_speed.mean())
        assert integral[0] == pytest.approx(0.5 + 2.0 * slope * 0.5 / reset * 0.1)
    # An order beyond the curve is limited to it; an offset is part of the error.
    for order, offset, aim in ((99.0, 0.0, -1), (-3.0, 0.0, 0), (curve.ship_speed[-1], -0.1, None)):
        slowed = FilteredSignals(*(np.array([x]) for x in (0.0, middle, 1e3, 0.0)))
        settings = PilotSettings(speed_offset=offset)
        pitch, _, integral = pilot.command(np.array([order]), *now, slowed, settings)
        if aim is not None:
            assert pitch[0] == curve.pitch_ratio[aim]
            assert integral[0] == 0.0  # a large error: the integral is held
        else:
            assert integral[0] == pytest.approx(-2.0 * slope * 0.5 / reset * 0.1)


@pytest.mark.parametrize(("error", "moves"), [(0.499, True), (0.501, False), (-0.501, False)])
def test_integral_moves_while_the_error_is_below_half_a_metre_a_second(
    error: float, moves: bool
) -> None:
    pilot = SpeedPilot("frigate")
    slowed = FilteredSignals(*(np.array([x]) for x in (error, 10.0, 1e5, 0.0)))
    *_, integral = pilot.command(
        np.array([8.0]), np.array([10.0]), np.array([1e5]), slowed, PilotSettings()
    )
    assert (integral[0] != 0.0) == moves


@by_ship
def test_racks_end_at_the_envelope_and_at_the_engines_speeds(ship: Ship) -> None:
    pilot, plant, (low, high) = SpeedPilot(ship), ship.record(), ship.shaft_speeds
    line, mover = ship.transmission, ship.diesel
    inertia = line.inertia_engine_side_kg_m2 + line.inertia_propeller_side_kg_m2
    slope = 0.8 * inertia / 0.5 / (mover.torque_per_rack_N_m_mm * line.gear_ratio * line.efficiency)
    unloaded = rack_of_torque(plant, line.gear_ratio * low, 0.0)

    def limits(shaft_speed: float) -> tuple[float, float]:
        ends = []
        for integral in (-1e3, 1e3):
            slowed = FilteredSignals(*(np.array([x]) for x in (0.0, shaft_speed, 1e3, integral)))
            now = np.array([shaft_speed]), np.array([1e3])
            ends.append(float(pilot.command(np.array([4.0]), *now, slowed, PilotSettings())[1][0]))
        return ends[0], ends[1]

    grid = np.linspace(0.5 * low, 1.2 * high, 101)  # exact at its points
    for w in grid[[0, 5, 15, 40, 60, 80, 90, 100]]:
        most = max(highest_rack(plant, float(w)) - slope * max(w - high, 0.0), 0.0)
        least = min(max(unloaded + slope * (low - w), 0.0), most)
        assert limits(float(w)) == pytest.approx((least, most), abs=1e-9)
    assert limits(float(grid[0]))[0] > 0.0
    assert limits(float(grid[90]))[1] < highest_rack(plant, float(grid[90])) - 0.1


def test_measurements_are_filtered_over_two_and_eight_seconds() -> None:
    pilot = SpeedPilot("frigate", 0.25)
    first, second = ROWS[0].copy(), ROWS[0].copy()
    second[[1, 2, 5]] = 10.0, 1.2e5, 7.6
    _, memory = pilot.predict(first)
    assert memory[0, :3] == pytest.approx([0.2, 9.0, 1e5])
    _, after = pilot.predict(second, memory)
    keep = np.exp(-0.25 / np.array([2.0, 8.0, 8.0]))
    assert after[0, :3] == pytest.approx(keep * [0.2, 9.0, 1e5] + (1.0 - keep) * [0.4, 10.0, 1.2e5])
    lost = second.copy()
    lost[2] = np.nan
    _, held = pilot.predict(lost, memory)
    assert held[0, 2] == pytest.approx(1e5)
    assert held[0, 1] == after[0, 1]


def test_predict_uses_the_settings() -> None:
    pilot = SpeedPilot("frigate", speed_offset=0.1, pitch_offset=-0.05, torque_gain=0.4)
    _, memory = pilot.predict(ROWS)
    action, after = pilot.predict(ROWS, memory)
    slowed = FilteredSignals(*np.column_stack([after[:, :3], memory[:, 3]]).T)
    pitch, rack, integral = pilot.command(
        ROWS[:, 0], ROWS[:, 1], ROWS[:, 2], slowed, PilotSettings(0.1, -0.05, 0.4)
    )
    assert action[:, 0] == pytest.approx((pitch - 0.6) / 0.4 - 1.0, abs=1e-6)
    assert action[:, 1] == pytest.approx(rack / 20.0 - 1.0, abs=1e-6)
    assert after[:, 3] == pytest.approx(integral)


def test_defaults_are_those_of_the_page() -> None:
    assert PilotSettings() == PilotSettings(0.0, 0.0, 1.0, 0.15, 0.7)
    assert SpeedPilot("frigate").settings == PilotSettings()


def test_invalid_options_are_refused() -> None:
    with pytest.raises(TypeError, match="foo"):
        SpeedPilot("frigate", foo=1.0)
    with pytest.raises(ShipError, match="needs a diesel engine"):
        SpeedPilot("tito-neri-sine")
