"""Heading and track: positive to starboard, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.plant import Schedule, approach, load_ship, simulate
from shaftline.plant.kinematics import current_met, over_ground
from shaftline.plant.state import State


@pytest.mark.parametrize(
    ("heading", "expected"),
    [(0.0, (4.0, 1.0)), (90.0, (-1.0, 4.0)), (180.0, (-4.0, -1.0)), (-90.0, (1.0, -4.0))],
)
def test_velocity_turns_with_the_heading(heading: float, expected: tuple[float, float]) -> None:
    state = State(1.0, 1.0, 4.0, sway_speed=1.0, heading=math.radians(heading))
    assert over_ground(state) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("heading", "expected"),
    [(0.0, (0.7, 0.2)), (90.0, (0.2, -0.7)), (180.0, (-0.7, -0.2)), (-90.0, (-0.2, 0.7))],
)
def test_current_meets_the_ship_by_her_heading(
    heading: float, expected: tuple[float, float]
) -> None:
    values = {"hull.current_m_s": 0.7, "manoeuvring.cross_current_m_s": 0.2}
    plant = load_ship("kvlcc2").with_values(values).record()
    assert current_met(plant, math.radians(heading)) == pytest.approx(expected, abs=1e-12)


def test_track_and_heading_are_the_integrals_of_their_rates() -> None:
    ship = load_ship("kvlcc2")
    point = approach(ship, 1.18)
    orders = Schedule(point.inputs.drive, 0.721, rudder_command=0.35)
    run = simulate(ship, orders, 150.0, initial=point.state)
    u, v, heading = run["ship_speed"], run["sway_speed"], run["heading"]
    cosine, sine = np.cos(heading), np.sin(heading)
    for signal, rate in (
        ("position", u * cosine - v * sine),
        ("cross_track", u * sine + v * cosine),
        ("heading", run["yaw_rate"]),
    ):
        sailed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * 0.05)])
        np.testing.assert_allclose(run[signal], sailed, atol=1e-4)
    assert heading[-1] > 2.0 * math.pi  # counted on beyond a turn


def test_a_ship_that_does_not_turn_keeps_her_course() -> None:
    ship = load_ship("frigate")
    point = approach(ship, 8.0)
    orders = Schedule(point.inputs.drive, point.inputs.pitch_command, rudder_command=0.3)
    run = simulate(ship, orders, 20.0, initial=point.state)
    for signal in ("heading", "cross_track", "sway_speed", "yaw_rate"):
        assert not run[signal].any()
