"""The steered environment: rudder, course, what pushes; single and batched; baselines."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from shaftline.baselines import make_steering
from shaftline.baselines.steering import OBSERVED_STEERED
from shaftline.envs import CLASSIC, FrigateEnv, SteeringEnv, SteeringVectorEnv
from shaftline.envs.batch import DRIFT_ARM, add_drift_force
from shaftline.envs.kernel import DRIFT_SWING
from shaftline.envs.sensing import wrap_angle
from shaftline.envs.tasks import get_task, tasks
from shaftline.plant import approach, load_ship, nomoto
from shaftline.plant.manoeuvres import criteria, trials

CALM: dict[str, Any] = {
    "sea": "calm",
    "speed_order_m_s": 8.0,
    "cross_current_m_s": 0.0,
    "drift_force_kN": 0.0,
    "resistance_rise": 0.0,
    "heading_order_deg": 0.0,
    "track_order_m": 0.0,
}
SEEN = {name: k for k, name in enumerate(OBSERVED_STEERED)}


def test_registered_and_sound() -> None:
    env: Any = gymnasium.make("shaftline/Steering-v0")
    assert env.observation_space.shape == (23,)
    assert env.action_space.shape == (3,)
    check_env(env.unwrapped, skip_render_check=True)
    assert env.unwrapped.batch.ship.name == "frigate-turning"


def test_the_ship_of_the_tasks_keeps_imo_s_limits_and_her_course() -> None:
    ship = load_ship("frigate-turning")
    point = approach(ship, 8.5)
    table = criteria(trials(ship, point))
    assert table["met"].tolist() == ["yes"] * len(table)
    found = nomoto(ship, point)
    assert found.gain == pytest.approx(0.911, abs=0.005)
    assert all(pole.real < 0.0 for pole in found.poles)


def test_the_rudder_turns_her_to_its_side() -> None:
    for side in (-1.0, 1.0):
        env = SteeringEnv(sensor_noise=0.0, **CLASSIC)
        first, _ = env.reset(seed=1, options=CALM)
        held = env.batch.environments[0]["episode"]
        pitch, rack = float(held["pitch_command"]), float(held["drive"])
        plant = env.batch.arrays.plants[0]
        low, high = float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])
        action = np.array(
            [2.0 * (pitch - low) / (high - low) - 1.0, 2.0 * rack / 40.0 - 1.0, 0.3 * side],
            np.float32,
        )
        for _ in range(60):
            seen, _, _, _, info = env.step(action)
        most = env.batch.ship.rudder.angle_max_rad
        assert seen[SEEN["rudder_angle"]] == pytest.approx(0.3 * side * most, rel=1e-3)
        assert side * seen[SEEN["heading"]] > 0.2
        assert side * seen[SEEN["yaw_rate"]] > 0.005
        assert info["heading"] == pytest.approx(seen[SEEN["heading"]], rel=1e-5)
        assert info["rudder_angle"] == pytest.approx(seen[SEEN["rudder_angle"]], rel=1e-5)
        assert (
            seen[SEEN["measured_ship_speed"]] < first[SEEN["measured_ship_speed"]]
        )  # turns cost speed


def test_orders_current_and_side_force_are_those_asked_for() -> None:
    env = SteeringEnv(sensor_noise=0.0, normalised=False)
    options = CALM | {
        "heading_order_deg": (10.0, -20.0),
        "track_order_m": 50.0,
        "order_interval_s": 2.0,
    }
    seen, _ = env.reset(seed=1, options=options)
    assert seen[SEEN["heading_order"]] == pytest.approx(math.radians(10.0))
    assert seen[SEEN["cross_track_order"]] == 50.0
    for _ in range(5):
        seen, _, _, _, info = env.step(np.zeros(3, np.float32))
    assert seen[SEEN["heading_order"]] == pytest.approx(math.radians(-20.0))
    terms = info["reward_terms"]
    assert terms["track_error_m"] == pytest.approx(50.0, abs=0.5)
    env.reset(seed=1, options=CALM | {"cross_current_m_s": 1.0})
    for _ in range(40):
        _, _, _, _, info = env.step(np.zeros(3, np.float32))
    assert info["cross_track"] == pytest.approx(19.95, abs=0.3)  # carried 1 m/s over 19.95 s
    assert abs(info["heading"]) < 1e-3
    for bad in (
        {"heading_order_deg": 500.0},
        {"drift_force_kN": math.nan},
        {"cross_current_m_s": 6.0},
    ):
        with pytest.raises(ValueError, match=next(iter(bad))):
            env.reset(options=bad)


def test_the_side_force_accelerates_her_as_newton_says() -> None:
    """A ship at rest across, just let go: (m - Y_vdot ...) dv/dt = F, with its moment in yaw."""
    env = SteeringEnv(sensor_noise=0.0, control_interval_s=0.05)
    env.reset(seed=1, options=CALM | {"drift_force_kN": 50.0})
    state = env.batch.arrays.states
    env.step(np.zeros(3, np.float32))
    phase = float(env.batch.arrays.episodes["resistance_phase"][0])
    force = 50e3 * (1.0 + DRIFT_SWING * math.cos(phase))
    ship = env.batch.ship.manoeuvring
    scale = 0.5 * 1025.0 * ship.length_m**3
    mass = ship.displacement_kg - ship.Y_vdot * scale
    coupled = -ship.Y_rdot * scale * ship.length_m
    turning = (
        ship.displacement_kg * ship.radius_of_gyration_m**2 - ship.N_rdot * scale * ship.length_m**2
    )
    matrix = np.array([[mass, coupled], [-ship.N_vdot * scale * ship.length_m, turning]])
    moment = DRIFT_ARM * ship.length_m * force
    sway, yaw = np.linalg.solve(matrix, [force, moment]) * 0.05
    assert float(state["sway_speed"][0]) == pytest.approx(sway, rel=0.02)
    assert float(state["yaw_rate"][0]) == pytest.approx(yaw, rel=0.02)
    assert [term.id for term in add_drift_force(env.batch.ship).term] == ["drift-force"]


def test_batched_as_one_by_one() -> None:
    many = SteeringVectorEnv(3, task="track-keeping")
    together, _ = many.reset(seed=5)
    single = [SteeringEnv(task="track-keeping") for _ in range(3)]
    alone = [env.reset(seed=5 + i)[0] for i, env in enumerate(single)]
    assert np.array_equal(together, np.array(alone))
    rng = np.random.default_rng(0)
    for _ in range(8):
        actions = rng.uniform(-1.0, 1.0, (3, 3)).astype(np.float32)
        together, rewards, *_ = many.step(actions)
        rows = [env.step(action) for env, action in zip(single, actions, strict=True)]
        assert np.array_equal(together, np.array([row[0] for row in rows]))
        assert rewards.tolist() == [row[1] for row in rows]


@pytest.mark.parametrize(
    ("task", "text"),
    [
        ("course-keeping", "autopilot:gain=2,turn_deg=15"),
        ("track-keeping", "track-keeper:change_lengths=8,reset_lengths=20"),
    ],
)
def test_helmsmen_keep_what_they_are_ordered(task: str, text: str) -> None:
    env = SteeringVectorEnv(4, task=f"{task}:held-out", max_episode_steps=280, **CLASSIC)
    controller = make_steering(text, env.batch.ship, 0.5)
    observation, _ = env.reset(seed=2)
    state, starting = None, np.ones(4, bool)
    for _ in range(270):
        action, state = controller.predict(observation, state, starting)
        observation, _, terminated, truncated, info = env.step(action)
        starting = terminated | truncated
        assert not terminated.any()
    terms = info["reward_terms"]
    if task == "course-keeping":
        assert terms["heading_error_deg"].max() < 6.0
    else:
        assert terms["track_error_m"].max() < 40.0
    action, _ = controller.predict(observation[0])
    assert action.shape == (3,)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"frigate cannot be steered.*manoeuvring.length_m"):
        SteeringEnv(ship="frigate")
    with pytest.raises(ValueError, match="kvlcc2: the environment needs a ship with a diesel"):
        SteeringEnv(ship="kvlcc2")
    with pytest.raises(ValueError, match="use shaftline/Steering-v0"):
        FrigateEnv(task="course-keeping")
    env = SteeringEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action has shape \(2,\); expected is shape \(3,\)"):
        env.step(np.zeros(2))
    with pytest.raises(ValueError, match="unknown option 'heading_order_deg'"):
        FrigateEnv().reset(options={"heading_order_deg": 3.0})
    frigate, turning = load_ship("frigate"), load_ship("frigate-turning")
    pilot = make_steering("autopilot", turning, 0.5)
    from shaftline.baselines import SpeedPilot, SteeringController

    with pytest.raises(ValueError, match=r"frigate every 0\.5 s, the helmsman for frigate-turning"):
        SteeringController(SpeedPilot(frigate, 0.5), pilot.helmsman)


def test_tasks_are_apart_and_held_out_lies_beyond() -> None:
    assert list(tasks(steered=True)) == ["course-keeping", "track-keeping"]
    assert not set(tasks()) & set(tasks(steered=True))
    held = get_task("track-keeping:held-out")
    assert held.cross_current_m_s == (-1.5, 1.5)
    assert held.drift_force_kN == (-80.0, 80.0)
    assert held.track_order_m == tasks(steered=True)["track-keeping"].track_order_m


def test_the_shorter_way_round() -> None:
    for turns in (-3, 0, 2):
        for angle in (-3.0, 0.0, 1.0, 3.1):
            assert wrap_angle(angle + 2.0 * math.pi * turns) == pytest.approx(angle, abs=1e-12)
