"""The longest time step that simulates recordings as the ship's own step does."""

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import diagnose
from shaftline.mismatch.options import Options
from shaftline.mismatch.search.catalogue import applicable_effects
from shaftline.mismatch.simulate.joint_replay import START_STEPS, JointReplay
from shaftline.mismatch.simulate.time_step import (
    ABOUT,
    INEXACT,
    restore_time_step,
    with_longest_time_step,
)
from shaftline.plant import Ship, ShipError, load_ship, simulate_recording


def slow_log(ship: Ship, interval_s: float = 1.0, rows: int = 600) -> pd.DataFrame:
    """Return a recording of a ship under steps of fuel rack and pitch, with noise."""
    time = interval_s * np.arange(rows)
    commands = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": np.where(time % 120.0 < 60.0, 18.0, 24.0),
            "pitch_ratio_command": np.where(time % 200.0 < 100.0, 1.1, 1.4),
            "shaft_torque_N_m": 0.0,
            "pitch_ratio": 1.1,
        }
    )
    table = simulate_recording(ship, commands)
    rng = np.random.default_rng(3)
    noise = {"shaft_speed_rad_s": 0.01, "shaft_torque_N_m": 2e3, "ship_speed_m_s": 0.01}
    for column, rms in (noise | {"pitch_ratio": 0.002}).items():
        table[column] += rms * rng.standard_normal(rows)
    return table


@pytest.fixture(scope="module")
def ship() -> Ship:
    return load_ship("frigate")


@pytest.fixture(scope="module")
def log(ship: Ship) -> pd.DataFrame:
    return slow_log(ship)


def test_a_row_every_second_is_simulated_in_two_steps(ship: Ship, log: pd.DataFrame) -> None:
    slower = with_longest_time_step(ship, [log])
    assert slower.time_step_s == pytest.approx(0.5)
    own = JointReplay(ship, log)
    other = JointReplay(slower, log, start_over_s=START_STEPS * ship.time_step_s)
    exact, values = (r.simulate_channels(r.ship.record()) for r in (own, other))
    assert other.start == own.start
    for name in exact:
        change = np.sqrt(np.mean((values[name] - exact[name]) ** 2))
        assert 0.0 < change <= INEXACT * own.noise_rms[name]


def test_ten_rows_a_second_are_simulated_in_one_step_each(ship: Ship) -> None:
    log = slow_log(ship, 0.1, 1200)
    slower = with_longest_time_step(ship, [log])
    assert slower.time_step_s == pytest.approx(0.1)
    own, other = JointReplay(ship, log), JointReplay(slower, log, start_over_s=2.0)
    exact, values = (r.simulate_channels(r.ship.record()) for r in (own, other))
    for name in exact:
        change = np.sqrt(np.mean((values[name] - exact[name]) ** 2))
        assert 0.0 < change <= 1e-4 * own.noise_rms[name]


def test_as_many_rows_a_second_as_steps_keep_the_step_of_the_file(ship: Ship) -> None:
    assert with_longest_time_step(ship, [slow_log(ship, ship.time_step_s, 400)]) is ship


def test_one_step_a_row_is_not_taken_where_it_changes_a_channel(ship: Ship) -> None:
    stiff = ship.with_values({"pitch_actuator.time_constant_s": 0.2})
    found = with_longest_time_step(stiff, [slow_log(stiff, 0.2, 1200)])
    assert found.time_step_s == pytest.approx(0.1)


def test_a_time_constant_of_the_ship_limits_the_step(ship: Ship, log: pd.DataFrame) -> None:
    quick = ship.with_values({"pitch_actuator.time_constant_s": 0.15})
    assert with_longest_time_step(quick, [log]).time_step_s <= 0.15


def test_an_effect_with_its_own_time_constant_limits_the_step(
    ship: Ship, log: pd.DataFrame
) -> None:
    def slow(ship: Ship) -> Ship:
        return ship.with_values({"prime_mover.lag_s": 0.25})

    with pytest.raises(ShipError, match=r"shorter than integration\.time_step_s = 0\.5 s"):
        slow(with_longest_time_step(ship, [log]))
    assert with_longest_time_step(ship, [log], [slow]).time_step_s == pytest.approx(0.25)


def test_every_effect_of_the_catalogue_allows_the_longest_step(
    ship: Ship, log: pd.DataFrame
) -> None:
    changes = [e.on for e in applicable_effects(ship, log.columns)]
    assert with_longest_time_step(ship, [log], changes).time_step_s == pytest.approx(0.5)


def test_a_short_dead_time_needs_the_short_step(ship: Ship, log: pd.DataFrame) -> None:
    for delay_s, step_s in ((0.0, 0.5), (0.1, 0.1)):
        late = ship.with_values({"prime_mover.dead_time_s": delay_s})
        found = with_longest_time_step(late, [log], (), 0.5, ABOUT)
        assert found.time_step_s == pytest.approx(step_s)


def test_the_step_is_restored_unless_it_became_shorter(ship: Ship) -> None:
    def at(step_s: float) -> Ship:
        return ship.with_values({"integration.time_step_s": step_s})

    assert restore_time_step(at(0.25), ship).time_step_s == ship.time_step_s
    assert restore_time_step(at(0.0125), ship).time_step_s == 0.0125


def test_the_ships_of_a_diagnosis_have_the_step_of_the_file(ship: Ship) -> None:
    fouled = ship.with_values(
        {"hull.resistance_coefficient_N_s2_m2": 1.3 * ship.hull.resistance_coefficient_N_s2_m2}
    )
    diagnosis = diagnose(ship, slow_log(fouled), options=Options(quick=True))
    ships = (diagnosis.ship, diagnosis.corrected, *diagnosis.alternatives.values())
    assert {one.time_step_s for one in ships} == {ship.time_step_s}
    (finding,) = diagnosis.findings
    assert finding.effect.id == "hull-fouling"
    assert finding.estimates[0].value == pytest.approx(0.3, abs=0.03)
