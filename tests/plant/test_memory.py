"""Delay lines, instruments, and memories that begin as if they had been there for ever."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lsim

from shaftline.plant import Equilibrium, Schedule, Ship, load_ship, simulate
from shaftline.plant.memory import (
    HISTORY,
    MEMORY,
    _delayed,
    begin_step,
    end_step,
    read_instruments,
    settle_memory,
)
from shaftline.plant.replay import simulate_recording
from shaftline.plant.state import Outputs, State

DT = 0.05
OUTPUTS = Outputs(1.3, 7.9, 2e5, 8e4, 9e4, 1.3e4, 0.0, 2e5, 0.0, 0.2, 4.0, 9e5, 0.0)
STATE = State(1.31, 10.0, 8.0, 5.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def memory() -> Any:
    return np.zeros(1, MEMORY)[0]


@pytest.mark.parametrize("cursor", [0, 2, 127, 128, 1000])
@pytest.mark.parametrize(
    ("delay", "expected"),
    [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0), (2.25, 2.25), (0.5, 0.5), (126.0, 126.0)],
)
def test_delay_line_looks_back_and_between_samples(
    cursor: int, delay: float, expected: float
) -> None:
    """On a ramp, whose sample of n steps ago is n less."""
    line = np.zeros(HISTORY)
    for k in range(cursor - HISTORY + 1, cursor + 1):
        line[k % HISTORY] = 10.0 * k
    assert _delayed(line, cursor, delay) == pytest.approx(10.0 * (cursor - expected), abs=1e-9)


def test_a_delayed_step_has_its_share_of_the_step_in_which_it_comes() -> None:
    line = np.zeros(HISTORY)
    line[5:] = 1.0  # sample 5 and later
    assert [_delayed(line, k, 2.25) for k in (6, 7, 8, 9)] == pytest.approx([0.0, 0.75, 1.0, 1.0])


def test_the_longest_delays_fit_the_usual_step(frigate: Ship) -> None:
    """Six seconds at 0.05 s, the ranges' upper ends."""
    ship = frigate.with_values({"sensors.torque_delay_s": 6.0, "prime_mover.dead_time_s": 6.0})
    assert ship.time_step_s == DT


def test_demand_passes_dead_time_then_rate_limit(plant: Any, memory: Any) -> None:
    plant["command_dead_time"], plant["rack_rate_limit"] = 2.5 * DT, 100.0
    memory["rack"], memory["cursor"] = 20.0, 130
    memory["demands"][:] = 20.0
    delivered = []
    for _ in range(6):
        delivered.append(begin_step(plant, memory, 40.0, DT))
        memory["cursor"] += 1
    # from the third step on half the rise, then all of it; 5 mm a step are let through
    assert delivered == pytest.approx([20.0, 20.0, 25.0, 30.0, 35.0, 40.0])
    assert memory["rack"] == delivered[-1]
    assert (memory["rack_start"], memory["rack_middle"]) == (35.0, 37.5)
    end_step(plant, memory, 8.0, DT)
    assert (memory["rack_start"], memory["rack_middle"]) == (40.0, 40.0)  # it stands
    assert memory["demands"][130 - HISTORY] == 40.0


def test_without_dead_time_the_demand_is_delivered_at_once(plant: Any, memory: Any) -> None:
    assert begin_step(plant, memory, 33.0, DT) == 33.0
    assert begin_step(plant, memory, 99.0, DT) == memory["rack"] == 40.0
    assert not memory["demands"].any()


def test_instruments_read_with_offset_gain_and_bias(plant: Any, memory: Any) -> None:
    plant["pitch_sensor_offset"] = -0.03
    plant["torque_sensor_gain"], plant["torque_sensor_bias"] = 1.04, -2e3
    read_instruments(plant, memory, 10.0, OUTPUTS, DT)
    assert memory["pitch_ratio"] == pytest.approx(1.27)
    assert memory["shaft_torque"] == pytest.approx(1.04 * 9e4 - 2e3)
    assert memory["blade_pitch"] == 1.3


def test_sound_instruments_read_the_truth(plant: Any, memory: Any) -> None:
    read_instruments(plant, memory, 10.0, OUTPUTS, DT)
    assert (memory["pitch_ratio"], memory["shaft_torque"]) == (1.3, 9e4)
    assert not memory["torques"].any()


def test_torque_is_read_late(plant: Any, memory: Any) -> None:
    plant["torque_sensor_delay"] = 1.25 * DT
    memory["cursor"], memory["torques"][:] = 200, 5e4
    read = []
    for _ in range(3):
        read_instruments(plant, memory, 10.0, OUTPUTS, DT)
        read_instruments(plant, memory, 10.0, OUTPUTS, DT)  # seeing it twice changes nothing
        read.append(float(memory["shaft_torque"]))
        memory["cursor"] += 1
    assert read == pytest.approx([5e4, 5e4 + 0.75 * 4e4, 9e4])


def test_speed_log_follows_exactly_first_order(plant: Any, memory: Any) -> None:
    plant["speed_log_lag"], memory["speed_log"] = 2.0, 1.0
    for _ in range(40):  # 2 s: one time constant
        end_step(plant, memory, 5.0, DT)
    assert memory["speed_log"] == pytest.approx(5.0 - 4.0 * math.exp(-1.0), rel=1e-12)
    assert memory["cursor"] == 40


def test_speed_sensor_lags_behind_a_ramp_by_its_time_constant(plant: Any, memory: Any) -> None:
    """Of a ramp from rest a first-order lag reads a (t - T + T exp(-t / T)), at any step."""
    settle_memory(plant, memory, STATE._replace(shaft_speed=0.0), OUTPUTS, 22.0, DT)
    plant["speed_sensor_lag"] = 0.3
    for k in range(1, 60):
        end_step(plant, memory, 8.0, DT)
        for _ in range(2):  # seeing it twice changes nothing
            read_instruments(plant, memory, 2.0 * k * DT, OUTPUTS, DT)
        time = k * DT
        expected = 2.0 * (time - 0.3 + 0.3 * math.exp(-time / 0.3))
        assert memory["shaft_speed"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("key", "output", "reading"),
    [
        ("torque_sensor_lag", "shaft_torque", "shaft_torque"),
        ("thrust_sensor_lag", "thrust", "thrust"),
        ("current_sensor_lag", "motor_current", "motor_current"),
        ("power_sensor_lag", "electric_power", "electric_power"),
    ],
)
def test_sensors_lag_behind_a_ramp(
    plant: Any, memory: Any, key: str, output: str, reading: str
) -> None:
    """Behind their lag stand gain and bias, 0.9 (a (t - T + T exp(-t / T))) + 50; power has neither."""
    at_rest = OUTPUTS._replace(**{output: 0.0})
    settle_memory(plant, memory, STATE, at_rest, 22.0, DT)
    plant[key] = 0.3
    gain, bias = (1.0, 0.0) if output == "electric_power" else (0.9, 50.0)
    if output != "electric_power":
        plant[key.replace("lag", "gain")], plant[key.replace("lag", "bias")] = gain, bias
    for k in range(1, 60):
        end_step(plant, memory, 8.0, DT)
        time = k * DT
        for _ in range(2):  # seeing it twice changes nothing
            read_instruments(plant, memory, 10.0, at_rest._replace(**{output: 2e3 * time}), DT)
        behind = 2e3 * (time - 0.3 + 0.3 * math.exp(-time / 0.3))
        assert memory[reading] == pytest.approx(gain * behind + bias, rel=1e-9)


def test_gains_of_speed_and_current_are_read(plant: Any, memory: Any) -> None:
    plant["speed_sensor_gain"] = 1.02
    plant["current_sensor_gain"], plant["current_sensor_bias"] = 0.95, -0.3
    read_instruments(plant, memory, 10.0, OUTPUTS._replace(motor_current=20.0), DT)
    assert memory["shaft_speed"] == pytest.approx(10.2)
    assert memory["motor_current"] == pytest.approx(0.95 * 20.0 - 0.3)


def test_a_motor_s_command_lags_as_a_first_order_filter() -> None:
    """A step of 4 V behind a lag of 3.4 steps: start, middle and end of each step on the exponential."""
    plant = (
        load_ship("tito-neri-sine").with_values({"prime_mover.command_lag_s": 3.4 * DT}).record()
    )
    memory = np.zeros(1, MEMORY)[0]
    for k in range(8):
        end = begin_step(plant, memory, 4.0, DT)
        moments = 4.0 * (1.0 - np.exp(-(k + np.array([0.0, 0.5, 1.0])) / 3.4))
        found = [memory["rack_start"], memory["rack_middle"], end]
        assert found == pytest.approx(list(moments), rel=1e-12, abs=1e-12)
        end_step(plant, memory, 0.0, DT)
    before = float(memory["rack"])
    end = begin_step(plant, memory, 1e6, DT)  # towards its end stop alone
    highest = load_ship("tito-neri-sine").parameter("prime_mover.voltage_max_V").value
    assert end == pytest.approx(highest + (before - highest) * math.exp(-1.0 / 3.4))


@pytest.mark.parametrize("steps", [3, 2.25])
def test_a_motor_s_command_comes_late(steps: float) -> None:
    plant = load_ship("tito-neri-sine").with_values({"prime_mover.command_delay_s": 0.01}).record()
    plant["command_dead_time"] = steps * DT
    memory = np.zeros(1, MEMORY)[0]
    delivered = []
    for _ in range(5):
        delivered.append(begin_step(plant, memory, 4.0, DT))
        end_step(plant, memory, 0.0, DT)
    share = 1.0 - steps % 1
    assert delivered == pytest.approx([0.0, 0.0, 4.0 * (share if steps % 1 else 0.0), 4.0, 4.0])


def test_without_lag_the_log_reads_the_speed(plant: Any, memory: Any) -> None:
    end_step(plant, memory, 5.0, DT)
    assert (memory["speed_log"], memory["cursor"]) == (5.0, 1)


def test_settled_memories_have_seen_nothing_else(plant: Any, memory: Any) -> None:
    for name in ("command_dead_time", "torque_sensor_delay", "speed_sensor_delay"):
        plant[name] = 3.4 * DT
    plant["speed_log_lag"], plant["torque_sensor_gain"] = 5.0, 1.1
    for name in MEMORY.names or ():
        memory[name] = 7  # whatever it held
    settle_memory(plant, memory, STATE, OUTPUTS, 22.0, DT)
    assert (memory["rack"], memory["rack_start"], memory["cursor"]) == (22.0, 22.0, 0)
    assert (memory["speed_log"], memory["blade_pitch"]) == (8.0, 1.3)
    for _ in range(8):
        assert begin_step(plant, memory, 22.0, DT) == 22.0
        read_instruments(plant, memory, 10.0, OUTPUTS, DT)
        assert memory["shaft_torque"] == pytest.approx(1.1 * 9e4)
        assert memory["shaft_speed"] == 10.0
        end_step(plant, memory, 8.0, DT)
        assert memory["speed_log"] == 8.0


@pytest.fixture(scope="module")
def lively() -> Schedule:
    return Schedule(lambda t: np.where(t < 5.0, 22.0, 27.5), lambda t: 1.2 + 0.1 * np.sin(0.5 * t))


@pytest.mark.parametrize("steps", [1, 10, 60])
def test_torque_delay_shifts_the_reading(
    frigate: Ship, design_point: Equilibrium, lively: Schedule, steps: int
) -> None:
    ship = frigate.with_values({"sensors.torque_delay_s": DT * steps})
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    late, prompt = s["measured_shaft_torque"][steps:], s["shaft_torque"][:-steps]
    np.testing.assert_allclose(late, prompt, rtol=1e-9)
    assert np.all(s["measured_shaft_torque"][:steps] == pytest.approx(late[0], rel=0.05))


def test_torque_delay_between_samples_interpolates(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    ship = frigate.with_values({"sensors.torque_delay_s": 0.07})  # 1.4 samples
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    torque = s["shaft_torque"]
    expected = 0.6 * torque[1:-1] + 0.4 * torque[:-2]
    np.testing.assert_allclose(s["measured_shaft_torque"][2:], expected, rtol=1e-9)


@pytest.mark.parametrize("steps", [1, 1.4, 60])
def test_speed_delay_shifts_the_reading_and_nothing_else(
    frigate: Ship, design_point: Equilibrium, lively: Schedule, steps: float
) -> None:
    ship = frigate.with_values({"sensors.speed_delay_s": DT * steps})
    s = simulate(ship, lively, 20.0, initial=design_point.state)
    plain = simulate(frigate, lively, 20.0, initial=design_point.state)
    np.testing.assert_array_equal(s["shaft_speed"], plain["shaft_speed"])
    np.testing.assert_array_equal(plain["measured_shaft_speed"], plain["shaft_speed"])
    late = np.interp(s["time"] - DT * steps, s["time"], s["shaft_speed"])
    np.testing.assert_allclose(s["measured_shaft_speed"], late, rtol=1e-12)


@pytest.mark.parametrize("steps", [1, 12, 40])
def test_dead_time_shifts_the_response(
    frigate: Ship, design_point: Equilibrium, steps: int
) -> None:
    ship = frigate.with_values({"prime_mover.dead_time_s": DT * steps})
    step = Schedule(lambda t: np.where(t < 5.0, 22.0, 27.5), 1.4)
    prompt, late = (simulate(s, step, 20.0, initial=design_point.state) for s in (frigate, ship))
    np.testing.assert_allclose(late["shaft_speed"][steps:], prompt["shaft_speed"][:-steps], 1e-9)
    assert late["shaft_speed"][140] < prompt["shaft_speed"][140]


def test_dead_time_between_steps_interpolates(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"prime_mover.dead_time_s": 0.52})
    step = Schedule(lambda t: np.where(t < 5.0, 22.0, 27.0), 1.4)
    torque = simulate(ship, step, 10.0, initial=design_point.state)["brake_torque"]
    share = (torque[110] - torque[109]) / (5.0 * 1428.6)  # 0.48 s after the step's own sample
    assert share == pytest.approx(0.6, abs=0.01)


def test_the_gain_of_the_speed_log_applies_before_its_lag(plant: Any, memory: Any) -> None:
    plant["speed_log_gain"], plant["speed_log_lag"], memory["speed_log"] = 1.1, 2.0, 1.0
    end_step(plant, memory, 5.0, 2.0)
    assert memory["speed_log"] == pytest.approx(5.5 - 4.5 * math.exp(-1.0), rel=1e-12)
    plant["speed_log_lag"] = 0.0
    end_step(plant, memory, 5.0, 2.0)
    assert memory["speed_log"] == pytest.approx(5.5, rel=1e-12)


def test_a_replay_starts_at_the_speed_that_the_log_would_show(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values({"sensors.speed_log_gain": 1.05})
    truth = simulate(frigate, Schedule(25.0, 1.2), 60.0, initial=design_point.state)
    table = pd.DataFrame(
        {
            "time_s": truth["time"],
            "fuel_rack_mm": 25.0,
            "pitch_ratio_command": 1.2,
            "pitch_ratio": truth["pitch_ratio"],
            "shaft_speed_rad_s": truth["shaft_speed"],
            "ship_speed_m_s": 1.05 * truth["ship_speed"],
        }
    )[:: round(1.0 / (truth["time"][1] - truth["time"][0]))].reset_index(drop=True)
    again = simulate_recording(ship, table)
    np.testing.assert_allclose(again["ship_speed_m_s"], table["ship_speed_m_s"], rtol=1e-4)
    np.testing.assert_allclose(again["shaft_speed_rad_s"], table["shaft_speed_rad_s"], rtol=1e-4)


def test_speed_log_lags_on_a_voyage(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"sensors.speed_log_lag_s": 20.0})
    s = simulate(ship, Schedule(30.0, 1.4), 200.0, initial=design_point.state)
    rise = s["ship_speed"] - s["ship_speed"][0]
    _, expected, _ = lsim(([1.0], [20.0, 1.0]), rise, s["time"])
    found = s["measured_ship_speed"] - s["ship_speed"][0]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.ptp(rise) > 1.0


def test_sound_instruments_read_the_truth_on_a_voyage(
    frigate: Ship, design_point: Equilibrium, lively: Schedule
) -> None:
    s = simulate(frigate, lively, 20.0, initial=design_point.state)
    for name in ("pitch_ratio", "shaft_torque", "ship_speed"):
        np.testing.assert_array_equal(s[f"measured_{name}"], s[name])
