"""Plant as the model of the filter: turning ships, held shaft speeds, parameters at their bounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import ObserverError
from shaftline.observers.augmented_plant import _limit_parameters
from shaftline.observers.ship_filter import ShipFilter
from shaftline.plant import Schedule, Ship, approach, equilibrium, linearise, load_ship, simulate
from shaftline.plant.columns import (
    HEADING,
    MEASURED,
    RUDDER,
    RUDDER_COMMAND,
    SWAY_SPEED,
    YAW_RATE,
    drive_column,
)
from shaftline.plant.replay import Replay
from shaftline.plant.state import active_states

Y_V, Y_R, N_V, N_R = (f"manoeuvring.{name}" for name in ("Y_v", "Y_r", "N_v", "N_r"))
TURNING = ("ship_speed_m_s", SWAY_SPEED, YAW_RATE, HEADING, RUDDER)
SPEEDS = {"ddg-51-surrogate": 11.0, "esso-osaka": 3.6, "kvlcc2": 1.18}


def simulate_turn(ship: Ship, seconds: float, helm: str, every: int = 1) -> pd.DataFrame:
    """Return a recording without noise of a voyage with rudder commands to both sides."""
    point = approach(ship, SPEEDS[ship.name])
    schedule = Schedule(
        point.inputs.drive, 1.0, rudder_command=lambda t: 0.2 * np.sign(np.sin(0.15 * t + 0.01))
    )
    samples = simulate(ship, schedule, seconds, initial=point.state)[::every]
    columns = {column: samples[MEASURED[column]] for column in TURNING[:-1]}
    columns |= {drive_column(ship): samples["drive"], "time_s": samples["time"]}
    signal = "rudder_angle" if helm == RUDDER else "rudder_command"
    return pd.DataFrame(columns | {helm: samples[signal]})


def blind(ship: Ship, noise: dict[str, float], key: str = Y_V) -> ShipFilter:
    """Return a filter that no measurement corrects."""
    states = active_states(ship.record())
    return ShipFilter(
        ship,
        [key],
        parameter_spread={key: 1e-30},
        noise=noise,
        state_spread=dict.fromkeys(states, 0.0),
    )


@pytest.mark.parametrize(
    ("name", "helm", "every"),
    [
        ("ddg-51-surrogate", RUDDER_COMMAND, 1),
        ("ddg-51-surrogate", RUDDER, 4),
        ("esso-osaka", RUDDER_COMMAND, 2),
        ("kvlcc2", RUDDER, 1),
    ],
)
def test_the_prediction_of_a_turn_is_the_simulation(name: str, helm: str, every: int) -> None:
    """Bit-identical with a commanded or measured rudder and a free or held shaft."""
    ship = load_ship(name)
    replay = Replay(ship, simulate_turn(ship, 60.0, helm, every))
    own = blind(ship, dict.fromkeys(TURNING[:-1], 1e30))
    followed = own.follow(replay)
    simulation = replay.simulate(ship.record())
    assert np.ptp(simulation["heading"]) > 5e-3
    for state in ("ship_speed", "sway_speed", "yaw_rate", "heading"):
        np.testing.assert_array_equal(
            followed.estimates[:, own.states.index(state)], simulation[state]
        )


@pytest.mark.parametrize("name", ["ddg-51-surrogate", "esso-osaka"])
def test_the_measured_rudder_is_the_one_that_acts(name: str) -> None:
    """It is the state of a steering gear with a lag, and the command without a lag."""
    ship = load_ship(name)
    table = simulate_turn(ship, 60.0, RUDDER_COMMAND)
    replay = Replay(ship, table)
    angle = replay.simulate(ship.record())["rudder_angle"]
    assert np.ptp(angle) > 0.3
    replay.table = table.assign(**{RUDDER: angle + 0.01})
    followed = blind(ship, {RUDDER: 0.1}).follow(replay)
    np.testing.assert_allclose(followed.innovations[:, 0], 0.1, rtol=1e-9)


def test_steering_gear_is_not_identifiable_from_a_measured_rudder() -> None:
    key, ship = "rudder.time_constant_s", load_ship("ddg-51-surrogate")
    own = blind(ship, {YAW_RATE: 1.0}, key)
    with pytest.raises(
        ObserverError, match=r"time_constant_s is not identifiable from a recording with rudder_rad"
    ):
        own.follow(Replay(ship, simulate_turn(ship, 20.0, RUDDER)))
    # With a command the lag applies again.
    own = blind(ship, {YAW_RATE: 1e30})
    own.follow(Replay(ship, simulate_turn(ship, 20.0, RUDDER)))
    replay = Replay(ship, simulate_turn(ship, 20.0, RUDDER_COMMAND))
    followed, simulation = own.follow(replay), replay.simulate(ship.record())
    yaw = followed.estimates[:, own.states.index("yaw_rate")]
    np.testing.assert_array_equal(yaw, simulation["yaw_rate"])


@pytest.mark.parametrize("column", [SWAY_SPEED, YAW_RATE, HEADING])
@pytest.mark.parametrize("name", ["ddg-51-surrogate", "esso-osaka"])
def test_a_measurement_in_a_turn_corrects_the_parameters(name: str, column: str) -> None:
    """An exact measurement at the end changes each parameter by variance times derivative."""
    ship, keys = load_ship(name), (Y_V, Y_R, N_V, N_R)
    table = simulate_turn(ship, 50.0, RUDDER_COMMAND)
    replay, signal = Replay(ship, table), MEASURED[column]
    spread = dict.fromkeys(keys, 1e-6)
    own = ShipFilter(
        ship,
        keys,
        parameter_spread=spread,
        noise={column: 1e-13},
        state_spread=dict.fromkeys(active_states(ship.record()), 0.0),
    )
    nominal = replay.simulate(ship.record())[signal][-1]
    measurements = table.copy()
    measurements[column] = math.nan
    more = 1e-7 * float(np.ptp(table[column]))
    measurements.loc[measurements.index[-1], column] = nominal + more
    replay.table = measurements
    own.follow(replay)
    slopes = []
    for key in keys:
        number, ends = ship.parameter(key), []
        for side in (1e-6, -1e-6):
            record = ship.record()
            number.write(record, number.value + side)
            ends.append(replay.simulate(record)[signal][-1])
        slopes.append((ends[0] - ends[1]) / 2e-6)
    squares = np.square(slopes)
    assert np.all(squares > 0.0)
    expected = np.array(slopes) * more / (np.sum(squares) + (1e-13 / 1e-6) ** 2)
    np.testing.assert_allclose(own.parameters - own._model.start, expected, rtol=3e-3)


def test_covariance_on_a_straight_course_is_that_of_a_linear_filter() -> None:
    """On a straight course sway and yaw are linear: P = Phi P Phi' and one measurement."""
    ship = load_ship("esso-osaka")
    point = approach(ship, SPEEDS[ship.name])
    still = Schedule(point.inputs.drive, 1.0)
    samples = simulate(ship, still, 1.0, initial=point.state)
    columns = {column: samples[MEASURED[column]] for column in TURNING}
    columns |= {drive_column(ship): samples["drive"], "time_s": samples["time"]}
    columns[RUDDER_COMMAND] = samples["rudder_command"]
    table = pd.DataFrame(columns)
    replay = Replay(ship, table)
    table = table.assign(**{SWAY_SPEED: np.nan})
    table.loc[table.index[-1], SWAY_SPEED] = 0.0
    replay.table = table
    spreads = {"ship_speed": 0.0, "sway_speed": 0.02, "yaw_rate": 1e-4, "heading": 1e-3}
    own = ShipFilter(
        ship, [Y_V], parameter_spread={Y_V: 1e-30}, noise={SWAY_SPEED: 0.01}, state_spread=spreads
    )
    own.follow(replay)
    whole = linearise(ship, point, outputs=("sway_speed",))
    kept = [whole.state_labels.index(n) for n in ("sway_speed", "yaw_rate", "heading")]
    a, dt = whole.A[np.ix_(kept, kept)], ship.time_step_s
    p = np.diag([spreads[n] ** 2 for n in ("sway_speed", "yaw_rate", "heading")])
    phi = np.eye(3) + a * dt + 0.5 * (a * dt) @ (a * dt)
    for _ in range(len(table) - 1):
        p = phi @ p @ phi.T
    gain = p[:, 0] / (p[0, 0] + 0.01**2)
    p = p - np.outer(gain, p[0])
    kept = [own.states.index(n) for n in ("sway_speed", "yaw_rate", "heading")]
    np.testing.assert_allclose(own.p[np.ix_(kept, kept)], p, rtol=1e-7, atol=1e-18)


def test_a_held_shaft_speed_is_interpolated_as_in_the_simulation(held_frigate: Ship) -> None:
    """The speed is interpolated between rows, and the torque includes the inertia."""
    begin = equilibrium(held_frigate, 9.0, 1.2)
    schedule = Schedule(lambda t: 9.0 + np.sin(0.3 * t), 1.2)
    samples = simulate(held_frigate, schedule, 40.0, initial=begin.state)
    noise = {"shaft_torque_N_m": 1e3, "ship_speed_m_s": 0.1}
    columns = {"time_s": samples["time"], "shaft_speed_rad_s": samples["shaft_speed"]}
    columns["pitch_ratio_command"] = samples["pitch_command"]
    table = pd.DataFrame(columns | {c: samples[MEASURED[c]] for c in noise})
    key = "hull.fouling_fraction"
    replay = Replay(held_frigate, table)
    own = blind(held_frigate, noise, key)
    assert "shaft_speed" not in own.states
    followed, simulation = own.follow(replay), replay.simulate(held_frigate.record())
    speed = followed.estimates[:, own.states.index("ship_speed")]
    np.testing.assert_array_equal(speed, simulation["ship_speed"])
    off = (table["shaft_torque_N_m"] - simulation["measured_shaft_torque"]) / 1e3
    np.testing.assert_allclose(followed.innovations[:, 0], off, atol=1e-9)
    inertia = held_frigate.transmission.inertia_propeller_side_kg_m2
    assert np.ptp(simulation["shaft_acceleration"]) * inertia > 1e3


def turning_filter() -> ShipFilter:
    ship = load_ship("esso-osaka")
    return ShipFilter(
        ship,
        [Y_V, N_V],
        parameter_spread={Y_V: 0.02, N_V: 0.002},
        noise={SWAY_SPEED: 0.1},
        state_spread=dict.fromkeys(active_states(ship.record()), 0.1),
    )


def test_a_parameter_at_its_bound_corrects_the_other_estimates() -> None:
    """The likeliest estimate with the parameter at its bound is z + P e (end - z_i) / P_ii."""
    own = turning_filter()
    rng = np.random.default_rng(1)
    root = rng.normal(size=(len(own.z),) * 2)
    p, z = root @ root.T, rng.normal(size=len(own.z))
    at = len(z) - 2
    z[at] = 0.3  # Y_v must stay below 0
    end = own._model.high[0]
    assert -1e-6 < end < 0.0
    expected = z + p[:, at] * (end - 0.3) / p[at, at]
    moved: Any = z.copy()
    _limit_parameters(own._model, moved, p)
    np.testing.assert_allclose(moved, expected, rtol=1e-12, atol=1e-15)
    assert moved[at] == pytest.approx(end, rel=1e-6)
    # Inside the range nothing changes; without a covariance only the parameter changes.
    inside = expected.copy()
    inside[at] = -0.02
    moved = inside.copy()
    _limit_parameters(own._model, moved, p)
    np.testing.assert_array_equal(moved, inside)
    moved = z.copy()
    _limit_parameters(own._model, moved, np.zeros_like(p))
    np.testing.assert_array_equal(np.delete(moved, at), np.delete(z, at))
    assert moved[at] == end
