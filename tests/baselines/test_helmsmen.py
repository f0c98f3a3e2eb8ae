"""Autopilot and track keeper: set-points, measurements, simulations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.baselines import (
    Autopilot,
    ControllerError,
    SteeringMeasurements,
    TrackKeeper,
    helmsman_names,
    make_helmsman,
)
from shaftline.baselines.helmsman import quintic
from shaftline.plant import ShipError, Voyage, load_ship

SHIP = load_ship("ddg-51-surrogate")
SPEED, LENGTH = 11.318, SHIP.manoeuvring.length_m


def observation(**values: Any) -> SteeringMeasurements:
    """Return measurements with the given values, the design speed and zeros."""
    plain: dict[str, Any] = (
        dict.fromkeys(SteeringMeasurements._fields, 0.0) | {"ship_speed": SPEED} | values
    )
    rows = max(np.size(value) for value in plain.values())
    return SteeringMeasurements(
        *(np.broadcast_to(np.asarray(v, float), rows).copy() for v in plain.values())
    )


def test_known_by_name_with_options() -> None:
    assert helmsman_names() == ["autopilot", "track-keeper", "lqg-autopilot"]
    pilot = make_helmsman("autopilot:turn_deg=4,gain=2", SHIP, 0.5, SPEED)
    assert isinstance(pilot, Autopilot)
    assert pilot.turn == pytest.approx(math.radians(4.0))
    with pytest.raises(
        ControllerError, match="unknown helmsman 'x'; known: autopilot, track-keeper, lqg"
    ):
        make_helmsman("x", SHIP, 0.5)
    with pytest.raises(ControllerError, match="option 'speed' is unknown"):
        make_helmsman("autopilot:speed=3", SHIP, 0.5)
    with pytest.raises(ShipError, match=r"frigate cannot be steered.*manoeuvring.length_m"):
        make_helmsman("autopilot", load_ship("frigate"), 0.5)
    for text, named in (
        ("autopilot:gain=0", "gain = 0"),
        ("track-keeper:change_lengths=-1", "change_lengths = -1"),
    ):
        with pytest.raises(ValueError, match=named):
            make_helmsman(text, SHIP, 0.5, SPEED)


def test_the_set_point_turns_to_a_new_heading_by_the_shorter_way() -> None:
    pilot = Autopilot(SHIP, 0.5, SPEED, turn_deg=8.0)
    orders = np.radians([90.0, 190.0, -2.0])
    memory = pilot.initial_state(observation(heading=np.zeros(3)))
    way = SPEED * 0.5 / LENGTH
    for _ in range(10):
        pilot.rudder(observation(heading_order=orders, heading=0.0), memory)
    np.testing.assert_allclose(
        np.degrees(memory[:, 0]),
        [80.0 * way, -80.0 * way, -2.0 if 80.0 * way > 2.0 else 0.0],
        atol=1e-9,
    )
    # Headings are equal modulo one turn.
    wound = observation(heading=2.0 * math.pi, heading_order=0.0)
    assert abs(pilot.error(wound, np.zeros((1, 1)))[0]) < 1e-12


def test_the_set_point_moves_to_a_new_line_along_a_quintic() -> None:
    keeper = TrackKeeper(SHIP, 0.5, SPEED, change_lengths=10.0)
    memory = keeper.initial_state(observation())
    steps = round(10.0 * LENGTH / SPEED / 0.5)
    aims = []
    for _ in range(steps + 5):
        keeper.rudder(observation(track_order=-100.0), memory)
        aims.append(memory[0, 0])
    assert aims[-1] == pytest.approx(-100.0)
    assert aims[steps // 2 - 1] == pytest.approx(-50.0, abs=1.0)
    slope = np.diff(aims)
    assert abs(slope[0]) < 1e-3 * abs(slope).max()
    assert np.all(slope <= 0.0)
    share = np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(quintic(share), [0.0, 0.0, 0.5, 1.0, 1.0])


def test_a_measurement_that_fails_keeps_the_last_error() -> None:
    pilot = Autopilot(SHIP, 0.5, SPEED)
    memory = pilot.initial_state(observation(heading=0.1, heading_order=0.1))
    for _ in range(5):
        command = pilot.rudder(
            observation(heading=math.nan, heading_order=0.1, ship_speed=math.nan), memory
        )
        assert command[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(memory).all()


def sailed(helmsman: Any, lengths: float, **orders: float) -> NDArray[np.float64]:
    """Return heading [deg], cross track [L] and rudder [deg] of a voyage, shape (k, 3)."""
    point = helmsman.point
    voyage, state, memory, rows = (
        Voyage(SHIP, point.state, point.inputs.drive),
        point.state,
        None,
        [],
    )
    steps = round(helmsman.interval_s / SHIP.time_step_s)
    for _ in range(round(lengths * LENGTH / SPEED / helmsman.interval_s)):
        now = observation(
            heading=state.heading,
            yaw_rate=state.yaw_rate,
            rudder_angle=state.rudder_angle,
            cross_track=state.cross_track,
            ship_speed=state.ship_speed,
            **orders,
        )
        memory = helmsman.initial_state(now) if memory is None else memory
        command = float(helmsman.rudder(now, memory)[0])
        rows.append(
            (math.degrees(state.heading), state.cross_track / LENGTH, math.degrees(command))
        )
        state = voyage.run(point.inputs.drive, point.inputs.pitch_command, command, steps)
    return np.array(rows)


def test_the_autopilot_turns_the_ship_to_the_order() -> None:
    found = sailed(Autopilot(SHIP, 0.5, SPEED), 25.0, heading_order=math.radians(30.0))
    assert found[-1, 0] == pytest.approx(30.0, abs=0.05)
    assert found[:, 0].max() < 31.5
    assert found[:, 1][-1] > 5.0  # to starboard, as the positive heading


def test_the_track_keeper_brings_the_ship_to_the_line() -> None:
    found = sailed(TrackKeeper(SHIP, 0.5, SPEED, change_lengths=20.0), 40.0, track_order=LENGTH)
    assert found[-1, 1] == pytest.approx(1.0, abs=2e-3)
    assert found[-1, 0] == pytest.approx(0.0, abs=0.05)
    assert 0.0 < found[:, 0].max() < 12.0


def test_a_batch_equals_single_ships() -> None:
    keeper = TrackKeeper(SHIP, 0.5, SPEED)
    rng = np.random.default_rng(3)
    tracks = rng.normal(0.0, 20.0, (30, 4))
    speeds = rng.uniform(8.0, 12.0, 4)

    def commands(columns: slice) -> NDArray[np.float64]:
        memory, found = None, []
        for row in tracks:
            now = observation(cross_track=row[columns], ship_speed=speeds[columns])
            memory = keeper.initial_state(now) if memory is None else memory
            found.append(keeper.rudder(now, memory))
        return np.array(found)

    whole = commands(slice(None))
    for k in range(4):
        assert np.array_equal(whole[:, k : k + 1], commands(slice(k, k + 1)))
