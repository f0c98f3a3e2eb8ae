from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import equilibrium, load_ship
from shaftline.plant.columns import drive_column
from shaftline.plant.equilibria import SteadyReplay, simulate_steady

ROWS = 30


def orders(name: str, low: float, high: float) -> tuple[Any, pd.DataFrame]:
    """Orders that differ much from row to row, an hour apart."""
    ship, rng = load_ship(name), np.random.default_rng(2)
    table = pd.DataFrame({"time_s": 3600.0 * np.arange(ROWS)})
    table[drive_column(ship)] = rng.uniform(low, high, ROWS)
    if ship.has_variable_pitch:
        top = ship.propeller.pitch_ratio_max
        table["pitch_ratio_command"] = rng.uniform(0.75 * top, top, ROWS)
    return ship, table


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("ferry", 12.0, 28.0), ("frigate", 10.0, 25.0), ("esso-osaka", 3.0, 9.0)],
)
def test_a_row_is_the_equilibrium_that_scipy_finds(name: str, low: float, high: float) -> None:
    ship, table = orders(name, low, high)
    found = SteadyReplay(ship, table).simulate(ship.record())
    for k in range(0, ROWS, 5):
        pitch = table.get("pitch_ratio_command", pd.Series(np.full(ROWS, 9.9)))[k]
        pitch = min(pitch, ship.propeller.pitch_ratio_max)
        state, outputs, _ = equilibrium(ship, table[drive_column(ship)][k], pitch)
        assert found["shaft_speed"][k] == pytest.approx(state.shaft_speed, rel=1e-9)
        assert found["ship_speed"][k] == pytest.approx(state.ship_speed, rel=1e-9)
        assert found["measured_shaft_torque"][k] == pytest.approx(outputs.shaft_torque, rel=1e-9)


def test_forces_and_torques_of_the_file_balance_in_every_row() -> None:
    ship, table = orders("ferry", 12.0, 28.0)
    found = SteadyReplay(ship, table).simulate(ship.record())
    drag = 203.5 * found["ship_speed"] ** 2
    np.testing.assert_allclose((1.0 - 0.06) * found["thrust"], drag, rtol=1e-9)
    engine = -0.25 * 3.5 * found["shaft_speed"] + 18.5 * table["fuel_rack_mm"] - 40.0
    free = engine < 260.0  # below the smoke limit the map is two straight lines
    assert free.sum() > 5
    np.testing.assert_allclose(
        found["propeller_torque"][free], 0.97 * 3.5 * engine[free], rtol=1e-9
    )


def test_inertia_mass_and_lags_do_not_act() -> None:
    ship, table = orders("frigate", 10.0, 25.0)
    other = ship.with_values(
        {
            "hull.mass_kg": 9e6,
            "transmission.inertia_engine_side_kg_m2": 2e5,
            "pitch_actuator.time_constant_s": 20.0,
            "prime_mover.lag_s": 5.0,
            "sensors.torque_delay_s": 1.0,
        }
    )
    table = table.assign(shaft_speed_rad_s=10.0, shaft_torque_N_m=1e5, ship_speed_m_s=6.0)
    pd.testing.assert_frame_equal(
        simulate_steady(ship, table), simulate_steady(other, table), rtol=1e-9
    )


def test_an_episode_acts_at_the_rows_of_its_window() -> None:
    ship, table = orders("frigate", 20.0, 20.0)
    table["pitch_ratio_command"] = 1.2
    fouled = ship.with_values(
        {
            "hull.episode_resistance_fraction": 0.2,
            "hull.episode_start_s": 9.5 * 3600.0,
            "hull.episode_end_s": 19.5 * 3600.0,
        }
    )
    speed = SteadyReplay(ship, table).simulate(fouled.record())["ship_speed"]
    slow = np.flatnonzero(speed < speed.max() - 0.1)
    np.testing.assert_array_equal(slow, np.arange(10, 20))
