"""Commands that answer the waves."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.noise_model import (
    COMMAND_RESPONDS,
    MOST_ROWS,
    command_opposes_waves,
    correlation,
    reason_to_skip,
)
from shaftline.plant import Ship

ROWS, INTERVAL_S = 6000, 0.1


def in_waves(gain: float, steps: bool = False) -> pd.DataFrame:
    """A shaft speed that waves move by 0.2 rad/s at 0.1 Hz, and a fuel rack that answers by a gain."""
    time = INTERVAL_S * np.arange(ROWS)
    waves = 0.2 * np.sin(0.2 * np.pi * time)
    rack = 15.0 + gain * waves
    if steps:
        rack += np.where(np.sin(0.02 * np.pi * time) > 0.0, 3.0, -3.0)
    return pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": rack,
            "pitch_ratio_command": 1.1,
            "pitch_ratio": 1.1,
            "shaft_speed_rad_s": 9.0 + waves,
            "shaft_torque_N_m": 9e4,
            "ship_speed_m_s": 8.0,
        }
    )


@pytest.mark.parametrize(("gain", "answers"), [(-5.0, True), (5.0, False), (0.0, False)])
def test_a_command_that_opposes_the_speed_answers_the_waves(
    frigate: Ship, gain: float, answers: bool
) -> None:
    replay = JointReplay(frigate, in_waves(gain))
    assert command_opposes_waves(replay) is answers
    assert reason_to_skip(replay) == (COMMAND_RESPONDS if answers else "")


def test_a_rig_that_does_not_move_knows_no_waves(servo: Ship) -> None:
    time = 0.01 * np.arange(ROWS)
    speed = 2.0 * np.sin(time)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": -speed, "shaft_speed_rad_s": speed})
    assert not command_opposes_waves(JointReplay(servo, table))


def test_more_rows_than_the_search_takes_are_refused_with_their_number(frigate: Ship) -> None:
    table = in_waves(0.0)
    longer = pd.concat([table] * 6, ignore_index=True)
    longer["time_s"] = INTERVAL_S * np.arange(len(longer))
    said = reason_to_skip(JointReplay(frigate, longer))
    assert said == f"the recordings have 36000 rows, more than {MOST_ROWS}; shorten them"


def test_the_correlation_is_that_of_the_band() -> None:
    """Two signals that agree below the band and oppose each other in it."""
    time = INTERVAL_S * np.arange(ROWS)
    slow, fast = np.sin(0.01 * np.pi * time), 0.1 * np.sin(0.2 * np.pi * time)
    assert correlation(slow + fast, slow - fast, 10.0, 0.03, 0.3) == pytest.approx(-1.0, abs=0.02)
    assert correlation(slow, np.zeros(ROWS), 10.0, 0.03, 0.3) == 0.0
