"""Torque of an electric drive without a torque meter, from samples and from a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import (
    ObserverError,
    follow,
    follow_table,
    get_observer,
    simulated_measurements,
)
from shaftline.observers.torque_curve import observer_plant, torque_of_drive, uses_drive_torque
from shaftline.plant import Schedule, Ship, State, load_ship, simulate

from .rig import INERTIA, PITCH, RIG, reversed_run

GEARED = RIG.with_values({"transmission.inertia_propeller_side_kg_m2": 0.01})
MOTOR = Ship.model_validate(
    RIG.model_dump(exclude_unset=True)
    | {
        "prime_mover": {
            "type": "dc-motor",
            "motor_constant_V_s_rad": 0.2,
            "armature_resistance_ohm": 0.3,
            "reverse_torque_fraction": 0.9,
            "torque_offset_N_m": 0.1,
            "voltage_max_V": 60.0,
        }
    }
)


@pytest.fixture(scope="module")
def run() -> Any:
    return reversed_run()


def net(run: Any, ship: Ship = RIG) -> Any:
    """Return the true torque of propeller and inertia."""
    own = INERTIA * run["shaft_acceleration"]
    return run["propeller_torque"] + own


def test_ships_without_a_torque_meter() -> None:
    assert uses_drive_torque(RIG)
    assert uses_drive_torque(MOTOR)
    assert not uses_drive_torque(GEARED)
    for name in ("frigate", "ddg-51-surrogate", "esso-osaka"):
        assert not uses_drive_torque(load_ship(name))


def test_the_whole_inertia_is_behind_the_drive() -> None:
    record = observer_plant(RIG)
    assert (record["inertia_propeller_side"], record["inertia_engine_side"]) == (INERTIA, 0.0)
    assert get_observer("luenberger").inertia(RIG) == INERTIA
    assert observer_plant(GEARED) == GEARED.record()
    watery = RIG.with_values({"propeller.entrained_inertia_kg_m2": 0.004})
    assert get_observer("luenberger").inertia(watery) == pytest.approx(INERTIA + 0.004)


def test_torque_is_what_drives_propeller_and_inertia(run: Any) -> None:
    measurements = simulated_measurements(run, RIG)
    np.testing.assert_allclose(measurements[:, 1], net(run), atol=1e-9)
    assert np.ptp(measurements[:, 1] - run["measured_shaft_torque"]) > 1.0
    assert np.array_equal(simulated_measurements(run)[:, 1], run["measured_shaft_torque"])
    geared = simulate(GEARED, Schedule(4.0, PITCH), 0.5, initial=State(PITCH, 5.0, 0.0))
    assert np.array_equal(simulated_measurements(geared, GEARED), simulated_measurements(geared))


def driven_by_voltage() -> Any:
    schedule = Schedule(
        lambda t: np.interp(t, [0, 1, 4, 6, 8], [20, 20, 20, -20, -20]), PITCH, inflow=0.3
    )
    return simulate(MOTOR, schedule, 8.0, initial=State(PITCH, 30.0, 0.0))


def test_a_table_is_read_by_what_its_drive_records(run: Any) -> None:
    names = {
        "time_s": "time",
        "shaft_speed_rad_s": "measured_shaft_speed",
        "pitch_ratio": "measured_pitch_ratio",
    }
    observer = get_observer("immersion-invariance")
    motor = driven_by_voltage()
    np.testing.assert_allclose(simulated_measurements(motor, MOTOR)[:, 1], net(motor), atol=1e-9)
    assert motor["motor_current"].min() < -1.0 < 1.0 < motor["motor_current"].max()
    for ship, samples, column, recorded in (
        (RIG, run, "motor_torque_N_m", "brake_torque"),
        (MOTOR, motor, "motor_current_A", "motor_current"),
    ):
        table = pd.DataFrame({own: samples[name] for own, name in names.items()})
        with pytest.raises(
            ObserverError, match=f"{ship.name}: an observer needs the column {column}"
        ):
            follow_table(observer, ship, table)
        found = follow_table(observer, ship, table.assign(**{column: samples[recorded]}))
        expected, valid = follow(
            observer, ship, simulated_measurements(samples, ship), ship.time_step_s
        )
        np.testing.assert_allclose(found["estimated_advance_velocity_m_s"], expected, atol=1e-9)
        assert found["estimate_valid"].tolist() == valid.astype(int).tolist()


def test_friction_is_taken_off_on_both_sides() -> None:
    rates = np.array([20.0, -20.0])
    found = torque_of_drive(RIG, np.array([5.0, -5.0]), rates)
    expected = 0.98 * 5.0 - 0.9 - 0.008 * 20.0
    assert found == pytest.approx([expected, -expected])
