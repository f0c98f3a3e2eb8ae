from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lsim

from shaftline.plant import Equilibrium, Schedule, Ship, simulate


def pitch_step(ship: Ship, start: Equilibrium, commands: Any, duration: float) -> NDArray[Any]:
    return simulate(ship, Schedule(22.0, commands), duration, initial=start.state)


def with_actuator(ship: Ship, **values: float) -> Ship:
    return ship.with_values({f"pitch_actuator.{key}": value for key, value in values.items()})


def with_sensors(ship: Ship, **values: float) -> Ship:
    return ship.with_values({f"sensors.{key}": value for key, value in values.items()})


@pytest.fixture(scope="module")
def lively() -> Schedule:
    return Schedule(lambda t: np.where(t < 5.0, 22.0, 27.5), lambda t: 1.2 + 0.1 * np.sin(0.5 * t))


def test_pitch_follows_first_order(frigate: Ship, design_point: Equilibrium) -> None:
    samples = pitch_step(frigate, design_point, 1.0, 10.0)
    expected = 1.0 + 0.4 * np.exp(-samples["time"] / 2.0)
    np.testing.assert_allclose(samples["pitch_ratio"], expected, rtol=1e-8)


@pytest.mark.parametrize(("command", "reached"), [(0.2, 0.6), (1.6, 1.4)])
def test_pitch_stays_in_its_range(
    frigate: Ship, design_point: Equilibrium, command: float, reached: float
) -> None:
    samples = pitch_step(frigate, design_point, command, 60.0)
    assert samples["pitch_ratio"][-1] == pytest.approx(reached, abs=1e-9)


def test_dead_band_leaves_its_own_width(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_actuator(frigate, dead_band=0.03)
    samples = pitch_step(ship, design_point, 1.0, 60.0)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.03, abs=1e-9)


def test_commands_inside_the_dead_band_do_nothing(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_actuator(frigate, dead_band=0.03)
    samples = pitch_step(ship, design_point, 1.372, 20.0)
    assert np.all(samples["pitch_ratio"] == 1.4)


def test_rate_limit_bounds_the_pitch_rate(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_actuator(frigate, rate_limit_per_s=0.05)
    rate = np.diff(pitch_step(ship, design_point, 1.0, 20.0)["pitch_ratio"]) / 0.05
    assert rate.min() == pytest.approx(-0.05)
    assert rate[0] == pytest.approx(-0.05)  # unlimited it would be -0.2


def test_backlash_leaves_half_its_width_on_either_side(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = with_actuator(frigate, backlash=0.04)
    samples = pitch_step(ship, design_point, lambda t: np.where(t < 40.0, 1.0, 1.2), 80.0)
    assert samples["pitch_ratio"][799] == pytest.approx(1.0 + 0.02, abs=1e-8)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.2 - 0.02, abs=1e-8)


def test_blades_rest_while_the_play_is_taken_up(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_actuator(frigate, backlash=0.04)
    samples = pitch_step(ship, design_point, 1.39, 20.0)  # within half the play
    assert np.all(samples["pitch_ratio"] == 1.4)


def test_actuator_offset_moves_the_blades(frigate: Ship, design_point: Equilibrium) -> None:
    samples = pitch_step(with_actuator(frigate, offset=0.05), design_point, 1.0, 60.0)
    assert samples["pitch_ratio"][-1] == pytest.approx(1.05, abs=1e-9)
    assert samples["measured_pitch_ratio"][-1] == samples["pitch_ratio"][-1]


def test_sensor_offset_moves_the_reading(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    ship = with_sensors(frigate, pitch_offset=-0.03)
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    np.testing.assert_allclose(s["measured_pitch_ratio"], s["pitch_ratio"] - 0.03, rtol=1e-12)


def test_torque_reading_has_gain_and_bias(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    ship = with_sensors(frigate, torque_gain=1.04, torque_bias_N_m=-2e3)
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    expected = 1.04 * s["shaft_torque"] - 2e3
    np.testing.assert_allclose(s["measured_shaft_torque"], expected, rtol=1e-12)


@pytest.mark.parametrize("steps", [1, 10, 60])
def test_torque_delay_shifts_the_reading(
    frigate: Ship, design_point: Equilibrium, lively: Schedule, steps: int
) -> None:
    ship = with_sensors(frigate, torque_delay_s=0.05 * steps)
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    late, prompt = s["measured_shaft_torque"][steps:], s["shaft_torque"][:-steps]
    np.testing.assert_allclose(late, prompt, rtol=1e-9)
    assert np.all(s["measured_shaft_torque"][:steps] == pytest.approx(late[0], rel=0.05))


def test_torque_delay_between_samples_interpolates(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    ship = with_sensors(frigate, torque_delay_s=0.07)  # 1.4 samples
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    torque = s["shaft_torque"]
    expected = 0.6 * torque[1:-1] + 0.4 * torque[:-2]
    np.testing.assert_allclose(s["measured_shaft_torque"][2:], expected, rtol=1e-9)


def test_speed_log_lags_first_order(frigate: Ship, design_point: Equilibrium) -> None:
    ship = with_sensors(frigate, speed_log_lag_s=20.0)
    s = simulate(ship, Schedule(30.0, 1.4), 200.0, initial=design_point.state)
    rise = s["ship_speed"] - s["ship_speed"][0]
    _, expected, _ = lsim(([1.0], [20.0, 1.0]), rise, s["time"])
    found = s["measured_ship_speed"] - s["ship_speed"][0]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.ptp(rise) > 1.0


def test_sound_instruments_read_the_truth(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    s = simulate(frigate, lively, 20.0, initial=design_point.state)
    for name in ("pitch_ratio", "shaft_torque", "ship_speed"):
        np.testing.assert_array_equal(s[f"measured_{name}"], s[name])
