"""A series of readings, a record with a belief of one's own, a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import (
    follow,
    follow_record,
    follow_table,
    get_observer,
    observer_names,
    readings_of,
)
from shaftline.plant import Equilibrium, Schedule, Ship, simulate

from .screw import DT, SHIP, noisy_readings, sampled


@pytest.mark.parametrize("name", observer_names())
def test_a_series_is_its_samples(name: str) -> None:
    readings = noisy_readings(30)
    readings[10, 0] = np.nan
    velocity, valid = follow(get_observer(name), SHIP, readings, DT)
    after = sampled(get_observer(name).discretise(SHIP, DT), readings)
    assert velocity.tolist() == [e["advance_velocity"] for e in after]
    assert valid.tolist() == [bool(e["valid"]) for e in after]


def test_a_record_may_believe_something_else() -> None:
    readings = noisy_readings(30)
    record = get_observer("power-balance").discretise(SHIP, DT)
    plain = follow_record(record, readings)[0]
    assert plain.tolist() == follow(get_observer("power-balance"), SHIP, readings, DT)[0].tolist()
    record["ship"]["kq"] *= 1.1
    assert np.all(follow_record(record, readings)[0] > plain)


def table_of(readings: Any, dt: float) -> pd.DataFrame:
    names = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio", "shaft_acceleration_rad_s2",
             "advance_velocity_m_s"]  # fmt: skip
    table = pd.DataFrame(readings, columns=names)
    return table.assign(time_s=dt * np.arange(len(table)))


@pytest.mark.parametrize("name", ["oracle", "shaft-acceleration", "luenberger"])
@pytest.mark.parametrize("dt", [0.05, 0.2])
def test_a_table_is_followed_by_its_columns_and_time_step(name: str, dt: float) -> None:
    readings = noisy_readings(30)
    table = table_of(readings, dt)
    table.loc[29, "time_s"] += 1e-3  # one odd sample does not change the step
    found = follow_table(get_observer(name), SHIP, table)
    velocity, valid = follow(get_observer(name), SHIP, readings, dt)
    np.testing.assert_allclose(found["estimated_advance_velocity_m_s"], velocity, rtol=1e-9)
    assert found["estimate_valid"].tolist() == valid.astype(int).tolist()
    assert found[table.columns].equals(table)


def test_a_table_may_lack_acceleration_and_truth() -> None:
    table = table_of(noisy_readings(30), DT)
    bare = table.drop(columns=["shaft_acceleration_rad_s2", "advance_velocity_m_s"])
    for name in ("power-balance", "random-walk-kalman"):
        full = follow_table(get_observer(name), SHIP, table)
        found = follow_table(get_observer(name), SHIP, bare)
        assert found["estimated_advance_velocity_m_s"].equals(
            full["estimated_advance_velocity_m_s"]
        )
    for name in ("oracle", "shaft-acceleration"):
        assert not follow_table(get_observer(name), SHIP, bare)["estimate_valid"].any()


def test_readings_of_a_simulation(frigate: Ship, design_point: Equilibrium) -> None:
    run = simulate(frigate, Schedule(22.0, 1.3), 2.0, initial=design_point.state)
    readings = readings_of(run)
    names = ("measured_shaft_speed", "measured_shaft_torque", "measured_pitch_ratio",
             "shaft_acceleration", "advance_velocity")  # fmt: skip
    assert readings.shape == (len(run), 5)
    for column, name in enumerate(names):
        assert np.array_equal(readings[:, column], run[name])
