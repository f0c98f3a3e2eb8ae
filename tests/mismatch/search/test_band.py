"""Up to which frequency a catalogue is judged."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.search.catalogue import applicable_effects
from shaftline.mismatch.search.spectra import highest_informative_frequency, rows_per_average
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording


def run(ship: Ship, every: int) -> pd.DataFrame:
    """A servo's torque in steps of a second for 200 s, at 200 Hz or a part of it."""
    rng = np.random.default_rng(2)
    rows = 40_000
    torque = np.repeat(rng.uniform(-90.0, 90.0, rows // 200), 200)
    table = pd.DataFrame({"time_s": 0.005 * np.arange(rows), "motor_torque_N_m": torque})
    table["shaft_speed_rad_s"] = 0.0
    table = simulate_recording(ship, table)[list(table)]
    table["shaft_speed_rad_s"] += 0.01 * rng.standard_normal(rows)
    return table.iloc[::every].reset_index(drop=True)


def hertz(ship: Ship, table: pd.DataFrame, exclude: tuple[str, ...] = ()) -> float:
    balances = Balances(JointReplay(ship, table))
    effects = [e for e in applicable_effects(ship, set(table.columns), exclude) if not e.together]
    return highest_informative_frequency(balances, effects, [(0, balances.replay.rows)])


def test_it_does_not_follow_the_sampling_rate(servo: Ship) -> None:
    fast = hertz(servo, run(servo, 1))
    assert 0.5 < fast < 5.0
    assert hertz(servo, run(servo, 5)) == pytest.approx(fast, rel=0.1)


def test_it_is_that_of_the_fastest_effect(servo: Ship) -> None:
    table = run(servo, 1)
    assert hertz(servo, table, ("speed-sensor-delay",)) < 0.9 * hertz(servo, table)


def test_a_period_keeps_five_rows() -> None:
    assert rows_per_average(0.001, 2.0) == 100
    assert rows_per_average(0.001, 2.1) == 95
    assert rows_per_average(0.1, 3.0) == 1
    assert rows_per_average(0.1, math.inf) == 1
