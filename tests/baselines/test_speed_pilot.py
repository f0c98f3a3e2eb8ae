from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.combinator import Combinator, combinator_curve
from shaftline.baselines.governor import highest_rack
from shaftline.baselines.registry import ControllerError, make_controller
from shaftline.baselines.speed_pilot import SpeedPilot
from shaftline.envs import FrigateVectorEnv
from shaftline.plant import Ship, ShipError, load_ship

from .voyage import INTERVAL_S, sail

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
    end = sail(SpeedPilot(ship), ship, order, 450.0, resistance=resistance)[-1]
    assert end.ship_speed == pytest.approx(order, rel=3e-3)
    if resistance > 1.0:  # the test means nothing where the combinator does as well
        assert Combinator(ship).steady(order, resistance).ship_speed < 0.975 * order


@by_ship
@pytest.mark.parametrize("share", [0.0, 0.7, 0.9])
def test_commands_come_to_rest_in_calm_water(ship: Ship, share: float) -> None:
    # an order of 0 lies below the curve: there the lower limiter alone holds the engine
    log = sail(SpeedPilot(ship), ship, share * top_speed(ship), 250.0)[-40:]
    swing = np.ptp([end.action for end in log], axis=0)
    assert np.all(swing < 0.01), f"pitch and rack swing by {swing} of 2"


@functools.cache
def step_order(name: str, before: float, after: float) -> tuple[Any, Any]:
    """Shaft speed over the range's ends [-], and rack over the envelope's [-], once the order steps."""
    ship = load_ship(name)
    plant, (low, high) = ship.record(), ship.shaft_speeds
    top, change = top_speed(ship), round(100.0 / INTERVAL_S)
    log = sail(SpeedPilot(ship), ship, lambda t: (before if t < 100.0 else after) * top, 250.0)
    speed = np.array([end.shaft_speed for end in log])
    rack = np.array([0.5 * (end.action[1] + 1.0) * plant["drive_max"] for end in log])
    # the plant cuts the torque at the envelope in any case, so what is judged is the command, against
    # the speed that the pilot read when it gave it
    allowed = np.array([highest_rack(plant, float(w)) for w in speed[:-1]])
    share = (rack[1:] / allowed)[change:]
    return (speed[change:].min() / low, speed[change:].max() / high), share


@by_ship
@pytest.mark.parametrize("after", [0.35, 0.0])
def test_deceleration_does_not_stall_the_engine(ship: Ship, after: float) -> None:
    (lowest, _), _ = step_order(ship.name, 1.0, after)
    assert lowest > 0.98  # of the engine's lowest speed; it stalls at 0.3


@by_ship
def test_acceleration_keeps_within_the_engine(ship: Ship) -> None:
    (_, highest), rack = step_order(ship.name, 0.35, 1.05)
    assert highest < 1.12  # the engine trips at 1.15
    assert 0.999 < rack.max() < 1.001  # the limiter has been reached, and held


def test_speed_offset_moves_the_speed_reached() -> None:
    ferry = SHIPS[1]
    order = 0.7 * top_speed(ferry)
    ends = [sail(SpeedPilot(ferry, speed_offset=d), ferry, order, 200.0)[-1] for d in (0.0, -0.3)]
    assert ends[1].ship_speed - ends[0].ship_speed == pytest.approx(-0.3, abs=0.01)


def test_integral_stands_still_while_the_error_is_large_or_the_rack_at_a_limit() -> None:
    pilot = SpeedPilot("frigate")

    def gained(error: float, order: float = 8.0, shaft_speed: float = 10.0) -> float:
        row = [order, shaft_speed, 1e5, 1.2, 15.0, order - error, 7.0, 1.0]
        return float(pilot.predict(row)[1][0, 3])

    # k_v dt / T a metre per second; T of the frigate is 73 s
    curve = combinator_curve(pilot.ship).ship_speed
    hull = pilot.ship.hull
    reset = hull.mass_kg / (2.0 * hull.resistance_coefficient_N_s2_m2 * curve.mean())
    assert reset == pytest.approx(73.3, abs=0.1)
    assert gained(0.2) == pytest.approx(0.2 * pilot._speed_gain * 0.5 / reset)
    assert gained(-0.2) == pytest.approx(-gained(0.2))
    assert gained(0.6) == gained(-0.6) == 0.0
    low, high = pilot.ship.shaft_speeds
    assert gained(0.2, shaft_speed=1.2 * high) == 0.0 > gained(-0.2, shaft_speed=1.2 * high)
    # at a low order, so that the idling engine's own envelope is not in the way
    assert gained(-0.2, 3.0, 0.9 * low) == 0.0 < gained(0.2, 3.0, 0.9 * low)


def torque_deviation(**settings: float) -> Any:
    """Standard deviation of the torque at the gauge [N m] after the first minute, by seed."""
    env = FrigateVectorEnv(4, threads=1, task="transit", sea="state-6", episode_s=200.0)
    pilot = SpeedPilot("frigate", **settings)
    (seen, _), memory, torque = env.reset(seed=3), None, []
    for _ in range(env.batch.settings.intervals - 1):
        action, memory = pilot.predict(seen, memory)
        seen, _, ended, _, _ = env.step(action)
        assert not ended.any()
        torque.append(seen[:, 2])
    env.close()
    return np.std(torque[120:], axis=0)


def test_torque_gain_takes_the_swing_out_of_the_torque() -> None:
    assert np.all(torque_deviation(torque_gain=1.0) < 0.85 * torque_deviation(torque_gain=0.0))


def test_episodes_begin_afresh_and_batches_equal_singles() -> None:
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
    np.testing.assert_array_equal(kept, state + 1.0)  # what is passed in stays untouched
    for row, action, memory in zip(ROWS, again, (None, kept[1:]), strict=True):
        np.testing.assert_array_equal(pilot.predict(row, memory)[0], action)
    assert np.all(np.abs(actions) < 1.0)


def test_what_does_not_fit_is_refused() -> None:
    frigate = SHIPS[0]
    pilot = make_controller("speed-pilot:speed_gain=3,torque_gain=0.5", frigate, 0.5)
    assert isinstance(pilot, SpeedPilot)
    assert pilot.settings.torque_gain == 0.5
    with pytest.raises(ControllerError, match="foo"):
        make_controller("speed-pilot:foo=1", frigate, 0.5)
    with pytest.raises(ShipError, match="needs a diesel"):
        SpeedPilot("tito-neri-sine")
