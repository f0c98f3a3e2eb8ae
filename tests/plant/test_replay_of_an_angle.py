"""A recording of the shaft's angle in place of its speed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import Schedule, Ship, State, simulate
from shaftline.plant.replay import Replay, simulate_recording


def swung(ship: Ship, first: float = 40.0) -> pd.DataFrame:
    """A servo's recording of its angle, and of no speed."""
    time = 0.01 * np.arange(300)
    torque = 60.0 * np.sign(np.sin(3.0 * time + 0.5))
    start = State(1.0, 0.1, 0.0, shaft_angle=first)
    run = simulate(ship, Schedule(np.repeat(torque[:-1], 10), 1.0), time[-1], initial=start)[::10]
    return pd.DataFrame(
        {"time_s": time, "motor_torque_N_m": torque, "shaft_angle_rad": run["shaft_angle"]}
    )


def test_the_angle_is_the_integral_of_the_speed(servo: Ship) -> None:
    """Under a constant torque M from rest: M/d (t - T (1 - exp(-t/T))), with T = I/d = 0.5 s."""
    run = simulate(servo, Schedule(95.0, 1.0), 2.0, initial=State(1.0, 0.0, 0.0, shaft_angle=3.0))
    t = run["time"]
    expected = 3.0 + 0.5 * (t + 0.5 * np.expm1(-2.0 * t))
    np.testing.assert_allclose(run["shaft_angle"], expected, atol=1e-12)


def test_a_recording_of_the_angle_gives_the_start_and_is_answered(servo: Ship) -> None:
    table = swung(servo)
    replay = Replay(servo, table)
    assert replay.channels == ["shaft_angle_rad"]
    assert replay.start[1] == pytest.approx(0.1, abs=1e-4)
    assert replay.first_state().shaft_angle == pytest.approx(40.0, abs=1e-9)
    found = simulate_recording(servo, table)
    np.testing.assert_allclose(found["shaft_angle_rad"], table["shaft_angle_rad"], atol=1e-4)
    assert "shaft_angle_rad" not in simulate_recording(
        servo, table.assign(shaft_speed_rad_s=0.1).drop(columns="shaft_angle_rad")
    )


def test_the_first_speed_is_the_slope_of_a_parabola(servo: Ship) -> None:
    """A constant acceleration does not bias it; a measured speed goes before it."""
    time = 0.01 * np.arange(300)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": 0.0})
    table["shaft_angle_rad"] = 5.0 + 2.0 * time + 4.0 * time**2
    replay = Replay(servo, table, 0.1)
    assert (replay.start[1], replay.first_state().shaft_angle) == pytest.approx(
        (2.0, 5.0), abs=1e-9
    )
    beside = Replay(servo, table.assign(shaft_speed_rad_s=1.5), 0.1)
    assert (beside.start[1], beside.first_state().shaft_angle) == pytest.approx(
        (1.5, 5.0), abs=1e-9
    )
    two = Replay(servo, table.iloc[:2])  # a straight line is all that two rows give
    assert two.start[1] == pytest.approx(2.04)
