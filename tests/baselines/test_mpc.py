"""Model-predictive control: model, constraints, and the effect of a preview."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from shaftline.baselines import mpc
from shaftline.baselines.controller import measurements_of
from shaftline.baselines.mpc import (
    AHEAD,
    ModelPredictive,
    forecast,
    predict_shaft,
    quadratic_programme,
    torques,
)
from shaftline.baselines.registry import ControllerError, make_controller
from shaftline.baselines.speed_pilot import SpeedPilot
from shaftline.envs import CLASSIC, FrigateVectorEnv, get_task
from shaftline.envs.tasks import controller_for
from shaftline.plant import load_ship

pytest.importorskip("casadi")

SHIP = load_ship("frigate-at-sea")
PLANT = SHIP.record()
PILOT = SpeedPilot(SHIP, torque_gain=0.0, shaft_gain=0.0, pitch_gain=0.0)
N = 12


def observe(**values: float) -> Any:
    """Return an observation of steady motion at 7 m/s with an undisturbed inflow, shape (1, 8)."""
    speed = 7.0
    steady = {
        "order": speed,
        "shaft_speed": 9.6,
        "torque": 1.4e5,
        "pitch": float(np.interp(speed, PILOT._speeds, PILOT._pitch)),
        "rack": float(np.interp(speed, PILOT._speeds, PILOT._rack)),
        "speed": speed,
        "velocity": 0.95 * speed,
        "valid": 1.0,
    }
    return np.array([list((steady | values).values())])


def with_preview(inflow: list[float], **values: float) -> Any:
    """Return an observation with the inflow of the waves 0 to 6 s ahead, shape (1, 15)."""
    return np.hstack([observe(**values), [inflow]])


def prediction(pitch: Any, rack: Any, velocity: Any, disturbance: float = 0.0) -> Any:
    """Return shaft speeds, torques and their derivatives along a plan."""
    found = predict_shaft(PLANT, 0.5, disturbance, velocity, pitch, rack, 9.6)
    return found.speeds, found.shaft, found.engine, found.slopes[:N], found.slopes[N:]


PITCH = 1.1 + 0.05 * np.sin(np.arange(N + 1))
RACK = 18.0 + np.cos(np.arange(N))
VELOCITY = 6.6 + 0.5 * np.sin(0.35 * np.arange(N))


def test_the_prediction_is_that_of_a_fine_integration() -> None:
    speeds, shaft, engine, *_ = prediction(PITCH, RACK, VELOCITY, 3e3)
    w, fine, inertia = 9.6, 500, 53697.0 + 14411.0
    for k in range(N):
        means = np.zeros(2)
        for i in range(fine):
            p = PITCH[k] + (PITCH[k + 1] - PITCH[k]) * (i + 0.5) / fine
            drive, load, brake = torques(PLANT, VELOCITY[k], w, p, RACK[k])
            rate = (drive - load + 3e3) / inertia
            means += np.array([drive - 53697.0 * rate, brake]) / fine
            w += 0.5 / fine * rate
        assert speeds[k + 1] == pytest.approx(w, abs=0.01)
        assert shaft[k] == pytest.approx(means[0], rel=0.01)
        assert engine[k] == pytest.approx(means[1], rel=0.01)
    assert np.ptp(speeds) > 0.2


@pytest.mark.parametrize("variable", [0, 3, 11, 12, 17, 23])
def test_the_derivatives_are_those_of_the_prediction(variable: int) -> None:
    step, slopes = 1e-3, prediction(PITCH, RACK, VELOCITY)[3:]
    ends = []
    for sign in (1.0, -1.0):
        plan = np.concatenate([PITCH[1:], RACK])
        plan[variable] += sign * step
        ends.append(prediction(np.append(PITCH[0], plan[:N]), plan[N:], VELOCITY)[1:3])
    for which in (0, 1):
        numeric = (ends[0][which] - ends[1][which]) / (2.0 * step)
        largest = np.abs(numeric).max()
        assert slopes[which][:, variable] == pytest.approx(numeric, abs=0.05 * largest)


def test_more_pitch_brakes_the_shaft_and_more_rack_drives_it() -> None:
    steady = np.full(N + 1, 1.1), np.full(N, 18.0), np.full(N, 6.6)
    speeds = prediction(*steady)[0]
    assert prediction(steady[0] + 0.05, *steady[1:])[0][-1] < speeds[-1] - 0.1
    assert prediction(steady[0], steady[1] + 1.0, steady[2])[0][-1] > speeds[-1] + 0.05
    assert prediction(*steady[:2], steady[2] + 0.3)[0][-1] > speeds[-1] + 0.05


def test_the_next_shaft_speed_is_that_of_the_plant() -> None:
    env = FrigateVectorEnv(
        2,
        task="rough-sea",
        sea="state-5",
        observer="oracle",
        sensor_noise=0.0,
        max_episode_steps=200,
        **CLASSIC,
    )
    law = make_controller("mpc", env.batch.ship, 0.5)
    observation, _ = env.reset(seed=1, options={"speed_order_m_s": 6.0})
    state, errors, changes = None, [], []
    for _ in range(150):
        before = observation[:, 1]
        action, state = law.predict(observation, state)
        observation, *_ = env.step(action)
        errors.append(observation[:, 1] - state[:, AHEAD])
        changes.append(observation[:, 1] - before)
    assert np.std(errors[50:]) < 0.5 * np.std(changes[50:])


@pytest.mark.parametrize("name", ["mpc", "mpc-preview"])
def test_in_steady_motion_it_commands_the_base_of_the_pilot(name: str) -> None:
    law = make_controller(name, SHIP, 0.5)
    observation, state = with_preview([0.0] * 7), None
    base, rack = PILOT.act(
        measurements_of(observe()), PILOT.initial_state(measurements_of(observe()))
    )
    for _ in range(20):
        now = measurements_of(observation, law.preview)
        memory = law.initial_state(now) if state is None else state
        pitch, racks = law.act(now, memory)
        state = memory
        assert pitch == pytest.approx(base, abs=2e-3)
        assert racks == pytest.approx(rack, abs=0.1)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_pitch_moves_before_a_wave_that_the_sensor_shows(sign: float) -> None:
    """Less inflow increases the load: the pitch decreases before the wave arrives at 2 s.

    It goes the other way for the first interval, which slows the shaft and spreads the load.
    """
    law = ModelPredictive(SHIP, preview=True)
    memory = law.initial_state(measurements_of(with_preview([0.0] * 7), preview=True))
    base, aim = memory[0, mpc._PLAN :].copy(), float(memory[0, mpc.SHAFT_MEAN])
    now = measurements_of(with_preview([0.0, 0.0, *[1.2 * sign] * 5]), preview=True)
    law.act(now, memory)
    plan, ahead = memory[0, mpc._PLAN :], law.velocities(now, memory)[0]
    moved = sign * (plan - base)
    assert moved[3] > 0.03
    assert (np.diff(moved[:4]) > 0.02).all()
    swings = []
    for path in (plan, base):
        _, shaft, *_ = prediction(
            np.append(now.pitch_ratio, path[:N]), path[N:], ahead, memory[0, mpc.DISTURBANCE]
        )
        swings.append(np.sqrt(np.mean((shaft - aim) ** 2)))
    assert swings[0] < 0.6 * swings[1]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_rising_estimate_is_continued(sign: float) -> None:
    law = ModelPredictive(SHIP)
    memory = law.initial_state(measurements_of(observe()))
    for step in range(1, 6):
        velocity = 0.95 * 7.0 + sign * 0.1 * step
        pitch, _ = law.act(measurements_of(observe(velocity=velocity)), memory)
    ahead = law.velocities(measurements_of(observe()), memory)[0] - 0.95 * 7.0
    assert sign * ahead[0] > 0.4
    assert abs(ahead[-1]) < 0.3
    assert sign * (pitch[0] - observe()[0, 3]) > 0.01


def test_the_forecast_begins_with_the_inflow_and_its_slope_and_decays() -> None:
    times = np.array([0.0, 1e-6, 60.0])
    wave = forecast(np.array([0.4]), np.array([-0.2]), np.array([0.7]), 2.0, times)[0]
    assert wave[0] == 0.4
    assert (wave[1] - wave[0]) / 1e-6 == pytest.approx(-0.2 - 0.4 / 2.0, rel=1e-4)
    assert abs(wave[2]) < 1e-9


def rough(n: int, seed: int = 3) -> Any:
    """Return observations of n ships far from steady motion, shape (n, 15)."""
    rng = np.random.default_rng(seed)
    spread = [1.5, 1.0, 3e4, 0.3, 6.0, 1.5, 1.0, 0.0, *[0.8] * 7]
    return with_preview([0.0] * 7) + np.array(spread) * rng.uniform(-1.0, 1.0, (n, 15))


@pytest.mark.parametrize("name", ["mpc", "mpc-preview"])
def test_the_plan_obeys_rate_and_ranges(name: str) -> None:
    law = make_controller(name, SHIP, 0.5)
    assert isinstance(law, ModelPredictive)
    observations = rough(40)
    now = measurements_of(observations, law.preview)
    memory = law.initial_state(now)
    solved = 0
    for seed in range(3):
        now = measurements_of(rough(40, seed), law.preview)
        pitch, rack = law.act(now, memory)
        plan = memory[:, mpc._PLAN : mpc._PLAN + N]
        racks = memory[:, mpc._PLAN + N :]
        held = np.ptp(plan, axis=1) == 0.0  # the base command without a solution
        solved += int((~held).sum())
        path = np.column_stack([np.clip(now.pitch_ratio, 0.6, 1.4), plan])[~held]
        assert np.abs(np.diff(path, axis=1)).max() <= 0.05 * 0.5 + 1e-6
        assert path.min() >= 0.6 - 1e-6
        assert path.max() <= 1.4 + 1e-6
        assert racks.min() >= -1e-6
        assert racks.max() <= 40.0 + 1e-6
        most = law.limits(now.shaft_speed)[1]
        assert (rack <= most + 1e-6).all()
        assert pitch.min() >= 0.6
        assert pitch.max() <= 1.4
    assert solved > 100


def test_a_command_moves_the_pitch_by_the_planned_travel() -> None:
    law = ModelPredictive(SHIP)
    for travel in (0.003, -0.01, 0.0235, -0.0248):
        pitch, error = 0.0, law._error(travel)
        for _ in range(5000):
            pitch += 1e-4 * float(np.clip((error - pitch) / 2.0, -0.05, 0.05))
        assert pitch == pytest.approx(travel, abs=2e-5)
    assert not np.isfinite(load_ship("frigate").record()["pitch_rate_limit"])
    quick = ModelPredictive("frigate")
    assert quick._error(0.1) == pytest.approx(0.1 / (1.0 - math.exp(-0.5 / 2.0)))


@pytest.mark.parametrize("name", ["mpc", "mpc-preview"])
def test_a_ship_alone_is_commanded_as_in_a_batch(name: str) -> None:
    law = make_controller(name, SHIP, 0.5)
    state, alone = None, [None] * 3
    for seed in range(3):
        observations = rough(3, seed)
        actions, state = law.predict(observations, state)
        for i in range(3):
            action, alone[i] = law.predict(observations[i], alone[i])
            assert action == pytest.approx(actions[i], abs=1e-6)


@pytest.mark.parametrize("name", ["mpc", "mpc-preview"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", [*range(9), slice(0, 15), slice(8, 15)])
def test_measurements_that_fail_give_finite_actions(name: str, value: float, column: Any) -> None:
    law = make_controller(name, SHIP, 0.5)
    broken = with_preview([0.1] * 7)
    broken[:, column] = value
    for order in ((broken, with_preview([0.0] * 7)), (with_preview([0.0] * 7), broken)):
        state = None
        for observation in (*order, *order):
            action, state = law.predict(observation, state)
            assert np.isfinite(action).all()
            assert np.isfinite(state).all()


def test_a_measurement_that_fails_once_changes_little() -> None:
    law = ModelPredictive(SHIP)
    actions = []
    for shaft_speed in (9.6, math.nan):
        memory = law.initial_state(measurements_of(observe()))
        law.act(measurements_of(observe()), memory)
        actions.append(np.array(law.act(measurements_of(observe(shaft_speed=shaft_speed)), memory)))
    assert actions[1] == pytest.approx(actions[0], abs=1e-9)


def test_without_a_solution_it_commands_the_base(monkeypatch: pytest.MonkeyPatch) -> None:
    law = ModelPredictive(SHIP)
    monkeypatch.setattr(ModelPredictive, "plan", lambda *_: None)
    now = measurements_of(observe(velocity=6.0, pitch=1.0))
    pitch, rack = law.act(now, law.initial_state(now))
    base, racks = PILOT.act(now, PILOT.initial_state(now))
    assert pitch == pytest.approx(base)
    assert rack == pytest.approx(racks)


def test_without_casadi_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    quadratic_programme.cache_clear()
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(ValueError, match=r"pip install 'shaftline\[mpc\]'"):
        ModelPredictive(SHIP)


def test_the_baselines_are_imported_without_casadi() -> None:
    code = "import sys, shaftline.baselines; sys.exit('casadi' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"horizon_s": 0.2}, "horizon_s = 0.2 s: must be 1 to 60 control intervals"),
        ({"horizon_s": math.nan}, "horizon_s = nan s"),
        ({"shaft_weight": -1.0}, "shaft_weight = -1.0: must be 0 or more"),
        ({"pitch_change_weight": math.inf}, "pitch_change_weight = inf"),
        ({"wave_memory_s": 0.0}, "wave_memory_s = 0.0 s: must be positive"),
    ],
)
def test_options_out_of_range_are_refused(option: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ModelPredictive(SHIP, **option)


def test_a_fixed_pitch_is_refused() -> None:
    fixed = SHIP.with_values({"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2})
    with pytest.raises(ValueError, match="mpc needs a controllable pitch"):
        ModelPredictive(fixed)


def test_a_task_without_a_preview_refuses_the_variant_that_needs_it() -> None:
    task = get_task("rough-sea")
    with pytest.raises(ControllerError, match=r"'mpc-preview': .* needs the waves ahead"):
        controller_for(task, "mpc-preview", task.load_ship(), 0.5, False)


def fluctuation(name: str) -> float:
    """Return the mean standard deviation of the shaft torque in a rough sea [kN m]."""
    env = FrigateVectorEnv(4, task="wave-preview", sea="state-5", max_episode_steps=240, **CLASSIC)
    law = make_controller(name, env.batch.ship, 0.5)
    observation, _ = env.reset(seed=2, options={"speed_order_m_s": 6.0})
    state, found = None, []
    for _ in range(190):
        action, state = law.predict(observation, state)
        observation, *_, info = env.step(action)
        found.append(info["shaft_torque"] * 1e-3)
    return float(np.std(found[90:], axis=0).mean())


def test_a_preview_of_the_waves_reduces_the_torque_fluctuation() -> None:
    assert fluctuation("mpc-preview") < 0.9 * fluctuation("mpc")
