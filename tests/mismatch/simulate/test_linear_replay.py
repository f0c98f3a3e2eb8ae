"""Recordings replayed by the ship's linear model."""

from __future__ import annotations

import control
import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.joint_replay import JointReplay, LinearReplay
from shaftline.plant import Equilibrium, Ship, linearise, simulate_recording

STEP = 0.05


def stirred(frigate: Ship, size: float, seconds: float = 120.0) -> pd.DataFrame:
    """The frigate about X = 22 mm, P/D = 1.3, rack and pitch stirred by sines of some size."""
    time = np.arange(0.0, seconds, STEP)
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": 22.0 + size * np.sin(0.3 * time),
            "pitch_ratio_command": 1.3 - 0.05 * size * np.sin(0.17 * time),
        }
    )
    return simulate_recording(frigate, table)


def far(frigate: Ship, size: float) -> float:
    """Largest difference of linear and whole simulation, per size, over all channels' swings."""
    table = stirred(frigate, size)
    whole, linear = JointReplay(frigate, table), LinearReplay(frigate, table)
    found = linear.simulated(linear.simulate(frigate.record()))
    wanted = whole.simulated(whole.simulate(frigate.record()))
    assert {"shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s", "pitch_ratio"} <= set(found)
    return max(float(np.abs(found[c] - wanted[c]).max() / np.ptp(wanted[c])) for c in found)


def test_what_it_lacks_is_of_second_order(frigate: Ship) -> None:
    """Ten times smaller motions are followed ten times better, relative to their size."""
    small, smaller = far(frigate, 0.3), far(frigate, 0.03)
    assert small < 0.03
    assert smaller == pytest.approx(0.1 * small, rel=0.2)


def test_about_a_steady_state_it_is_the_linear_model(
    frigate: Ship, design_point: Equilibrium
) -> None:
    time = np.arange(0.0, 40.0, STEP)
    away = 0.5 * np.sign(np.sin(0.4 * time + 1e-9))
    away -= away[:-1].mean()
    state = design_point.state
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": 22.0 + away,
            "pitch_ratio_command": 1.4,
            "pitch_ratio": state.pitch_ratio,
            "shaft_speed_rad_s": state.shaft_speed,
            "ship_speed_m_s": state.ship_speed,
            "shaft_torque_N_m": design_point.outputs.shaft_torque,
        }
    )
    replay = LinearReplay(frigate, table)
    found = replay.simulated(replay.simulate(frigate.record()))
    system = control.c2d(linearise(frigate, design_point), replay.runs[0].dt)
    fine = np.repeat(away[:-1], replay.runs[0].per_row)
    inputs = np.zeros((4, len(fine)))
    inputs[1] = fine
    answer = control.forced_response(
        system, replay.runs[0].dt * np.arange(len(fine)), inputs
    ).outputs
    for row, column in ((1, "shaft_speed_rad_s"), (2, "ship_speed_m_s")):
        wanted = table[column].iloc[0] + answer[row][:: replay.runs[0].per_row]
        np.testing.assert_allclose(found[column][:-1], wanted, rtol=1e-6)


def test_the_angle_is_carried_too(servo: Ship) -> None:
    """Without friction that bends, the linear model is the whole one."""
    time = 0.01 * np.arange(400)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": 50.0 * np.sin(4.0 * time) + 5.0})
    table["shaft_angle_rad"] = 0.0
    table["shaft_angle_rad"] = simulate_recording(servo, table)["shaft_angle_rad"]
    replay = LinearReplay(servo, table)
    found = replay.simulated(replay.simulate(servo.record()))
    np.testing.assert_allclose(found["shaft_angle_rad"], table["shaft_angle_rad"], atol=1e-4)


def test_a_speed_that_is_held_is_refused(held_frigate: Ship) -> None:
    table = pd.DataFrame(
        {"time_s": [0.0, 0.1, 0.2], "shaft_speed_rad_s": 10.0, "ship_speed_m_s": 8.0}
    )
    with pytest.raises(
        ValueError, match="prescribes the shaft speed, which the linear replay does not model"
    ):
        LinearReplay(held_frigate, table)
