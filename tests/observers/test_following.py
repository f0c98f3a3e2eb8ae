"""Series of measurements, records with a changed ship model, and tables."""

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
    simulated_measurements,
)
from shaftline.plant import Equilibrium, Schedule, Ship, simulate

from .screw import DT, SHIP, noisy_measurements, sampled


@pytest.mark.parametrize("name", observer_names())
def test_a_series_is_its_samples(name: str) -> None:
    measurements = noisy_measurements(30)
    measurements[10, 0] = np.nan
    velocity, valid = follow(get_observer(name), SHIP, measurements, DT)
    after = sampled(get_observer(name).discretise(SHIP, DT), measurements)
    assert velocity.tolist() == [e["advance_velocity"] for e in after]
    assert valid.tolist() == [bool(e["valid"]) for e in after]


def test_a_record_may_hold_another_ship_model() -> None:
    measurements = noisy_measurements(30)
    record = get_observer("power-balance").discretise(SHIP, DT)
    plain = follow_record(record, measurements)[0]
    assert (
        plain.tolist() == follow(get_observer("power-balance"), SHIP, measurements, DT)[0].tolist()
    )
    record["ship"]["kq"] *= 1.1
    assert np.all(follow_record(record, measurements)[0] > plain)


def table_of(measurements: Any, dt: float) -> pd.DataFrame:
    names = [
        "shaft_speed_rad_s",
        "shaft_torque_N_m",
        "pitch_ratio",
        "shaft_acceleration_rad_s2",
        "advance_velocity_m_s",
    ]
    table = pd.DataFrame(measurements, columns=names)
    return table.assign(time_s=dt * np.arange(len(table)))


@pytest.mark.parametrize("name", ["oracle", "shaft-acceleration", "luenberger"])
@pytest.mark.parametrize("dt", [0.05, 0.2])
def test_a_table_is_followed_by_its_columns_and_time_step(name: str, dt: float) -> None:
    measurements = noisy_measurements(30)
    table = table_of(measurements, dt)
    table.loc[29, "time_s"] += 1e-3  # one irregular sample does not change the sample time
    found = follow_table(get_observer(name), SHIP, table)
    velocity, valid = follow(get_observer(name), SHIP, measurements, dt)
    np.testing.assert_allclose(found["estimated_advance_velocity_m_s"], velocity, rtol=1e-9)
    assert found["estimate_valid"].tolist() == valid.astype(int).tolist()
    assert found[table.columns].equals(table)


def test_a_table_may_lack_acceleration_and_truth() -> None:
    table = table_of(noisy_measurements(30), DT)
    bare = table.drop(columns=["shaft_acceleration_rad_s2", "advance_velocity_m_s"])
    for name in ("power-balance", "random-walk-kalman"):
        full = follow_table(get_observer(name), SHIP, table)
        found = follow_table(get_observer(name), SHIP, bare)
        assert found["estimated_advance_velocity_m_s"].equals(
            full["estimated_advance_velocity_m_s"]
        )
    for name in ("oracle", "shaft-acceleration"):
        assert not follow_table(get_observer(name), SHIP, bare)["estimate_valid"].any()


def test_measurements_of_a_simulation(frigate: Ship, design_point: Equilibrium) -> None:
    run = simulate(frigate, Schedule(22.0, 1.3), 2.0, initial=design_point.state)
    measurements = simulated_measurements(run)
    names = (
        "measured_shaft_speed",
        "measured_shaft_torque",
        "measured_pitch_ratio",
        "shaft_acceleration",
        "advance_velocity",
    )
    assert measurements.shape == (len(run), 5)
    for column, name in enumerate(names):
        assert np.array_equal(measurements[:, column], run[name])
