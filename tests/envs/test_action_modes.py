"""What an action means: increments, absolute commands and residuals; rack, limited rack and governor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.baselines import make_controller, make_steering
from shaftline.envs import (
    CLASSIC,
    FrigateEnv,
    FrigateVectorEnv,
    SteeringEnv,
    SteeringVectorEnv,
    get_task,
)
from shaftline.envs.residual import REACH
from shaftline.plant import load_ship

from .by_hand import STILL

TRAVERSE_S = 20.0
GEAR, LOW, HIGH = 7.38, 350.0 * np.pi / 30.0, 1000.0 * np.pi / 30.0
RANGES = {
    "shaft-speed": ("shaft_speed_command", LOW / GEAR, HIGH / GEAR),
    "limited-rack": ("rack_command", 0.0, 40.0),
    "fuel-rack": ("rack_command", 0.0, 40.0),
}
MODERATE: dict[str, Any] = get_task("rough-sea").model_dump() | {
    "seas": ({"hs_m": (2.5, 4.0), "tp_s": (9.0, 11.0), "heading_deg": (165.0, 180.0)},)
}


@pytest.mark.parametrize("interval_s", [0.5, 0.25])
@pytest.mark.parametrize("command", RANGES)
def test_an_increment_of_one_moves_a_command_over_its_range_in_twenty_seconds(
    command: str, interval_s: float
) -> None:
    env = FrigateEnv(command=command, control_interval_s=interval_s, task=STILL)
    env.reset(seed=1)
    episode, (name, low, high) = env.batch.arrays.episodes[0], RANGES[command]
    pitch, second = float(episode["pitch_command"]), float(episode[name])
    for action in ([0.5, 0.25], [-1.0, -0.5], [0.0, 0.0]):
        share = np.array(action) * interval_s / TRAVERSE_S
        pitch, second = pitch + share[0] * 0.8, second + share[1] * (high - low)
        env.step(action)
        assert episode["pitch_command"] == pytest.approx(pitch, rel=1e-9)
        assert episode[name] == pytest.approx(second, rel=1e-9)


@pytest.mark.parametrize("command", RANGES)
def test_increments_stop_at_the_ends_of_the_range_and_leave_them_at_once(command: str) -> None:
    env = FrigateEnv(command=command, task=STILL)
    env.reset(seed=1)
    episode, (name, low, high) = env.batch.arrays.episodes[0], RANGES[command]
    ends = {1.0: (1.4, high), -1.0: (0.6, low)}
    for sign in (1.0, -1.0):
        for _ in range(45):
            if env._needs_reset:  # the engine stalls without fuel, but the command runs on
                env._needs_reset = False
            env.step([sign, sign])
        found = float(episode["pitch_command"]), float(episode[name])
        assert found == pytest.approx(ends[sign], rel=1e-12)
        env._needs_reset = False
        env.step([-sign, -sign])
        share = sign * 0.5 / TRAVERSE_S
        assert episode["pitch_command"] == pytest.approx(ends[sign][0] - 0.8 * share)
        assert episode[name] == pytest.approx(ends[sign][1] - (high - low) * share)


@pytest.mark.parametrize("command", RANGES)
def test_an_increment_of_zero_holds_the_commands_of_the_beginning(command: str) -> None:
    env = FrigateEnv(command=command, task=STILL, sensor_noise=0.0, normalised=False)
    first, _ = env.reset(seed=3, options={"initial_speed_m_s": 7.0})
    for _ in range(60):
        seen, *_ = env.step([0.0, 0.0])
    assert seen[9] == first[9]
    assert seen[14] == first[14]
    assert seen[5] == pytest.approx(7.0, abs=0.02)
    assert seen[1] == pytest.approx(first[1], rel=3e-3)


@pytest.mark.parametrize("command", RANGES)
def test_absolute_actions_are_commands_over_the_range(command: str) -> None:
    env = FrigateEnv(command=command, task=STILL, action_mode="absolute", normalised=False)
    episode, (name, low, high) = env.batch.arrays.episodes[0], RANGES[command]
    for action, share in ((-1.0, 0.0), (0.0, 0.5), (0.5, 0.75), (1.0, 1.0)):
        env.reset(seed=1)
        seen, *_ = env.step([-action, action])
        assert episode["pitch_command"] == pytest.approx(0.6 + 0.8 * (1.0 - share))
        assert episode[name] == pytest.approx(low + share * (high - low))
        assert seen[9] == pytest.approx(episode["pitch_command"], rel=1e-6)
        assert seen[14] == pytest.approx(episode[name], rel=1e-6, abs=1e-9)


def test_the_rudder_is_absolute_in_every_mode_but_a_residual() -> None:
    for mode in ("increment", "absolute"):
        env = SteeringEnv(action_mode=mode)
        env.reset(seed=1)
        env.step([0.0, 0.0, 0.5])
        most = env.batch.ship.rudder.angle_max_rad
        assert env.batch.arrays.episodes[0]["rudder_command"] == pytest.approx(0.5 * most)


def endings(command: str, mode: str) -> list[Any]:
    """Return the endings of the engine in 24 episodes under random and extreme actions."""
    n, found = 24, []
    env = FrigateVectorEnv(
        n, task=MODERATE, command=command, action_mode=mode, max_episode_steps=240, threads=1
    )
    env.reset(seed=2)
    rng, corners = np.random.default_rng(0), np.array([[-1, 1], [1, -1], [1, 1], [-1, -1]])
    held = np.zeros((n, 2))
    for k in range(240):
        if k % 20 == 0:  # extreme actions, held for 10 s
            held = corners[rng.integers(4, size=n)]
        held[n // 2 :] = rng.uniform(-1.0, 1.0, (n - n // 2, 2))
        info = env.step(held)[4]
        last = info.get("final_info", {})
        found += [reason for reason in last.get("ended", []) if reason is not None]
    return found


@pytest.mark.parametrize("mode", ["absolute", "increment", "residual"])
def test_the_limited_rack_keeps_the_engine_running_where_the_plain_rack_does_not(mode: str) -> None:
    assert endings("limited-rack", mode) == []
    if mode != "residual":
        plain = endings("fuel-rack", mode)
        assert len(plain) > 10
        assert set(plain) == {"stalled", "overspeed trip"}


BASES = ["speed-pilot", "combinator", "combinator-trimmed", "va-pitch", "combinator:trim_s=20"]


@pytest.mark.parametrize("base", BASES)
def test_a_residual_of_zero_is_its_base_controller_to_the_bit(base: str) -> None:
    """Over autoresets, whose episodes end at different times."""
    common: dict[str, Any] = {"task": "transit", "max_episode_steps": 9, "normalised": False}
    residual = FrigateVectorEnv(
        3, action_mode=f"residual:{base}", command="fuel-rack", threads=1, **common
    )
    classic = FrigateVectorEnv(3, threads=1, **common | CLASSIC)
    alone = FrigateEnv(action_mode=f"residual:{base}", command="fuel-rack", **common)
    controller: Any = make_controller(base, classic.batch.ship, 0.5)
    mine, _ = residual.reset(seed=6)
    theirs, _ = classic.reset(seed=6)
    single, _ = alone.reset(seed=6)
    for env in (residual, classic):
        env.batch.elapsed[:] = 0, 4, 6
    state, starts, ends = None, np.ones(3, dtype=bool), 0
    for _ in range(30):
        action, state = controller.predict(theirs, state, starts)
        assert np.array_equal(mine[:, :15], theirs)
        assert np.array_equal(mine[0], single)
        commanded = np.array([0.6, 0.0]) + 0.5 * (action + 1.0) * np.array([0.8, 40.0])
        assert mine[:, 15:] == pytest.approx(commanded, rel=1e-6)
        mine, reward, terminated, truncated, _ = residual.step(np.zeros((3, 2)))
        theirs, due, *_ = classic.step(action)
        single, own, ended, cut, _ = alone.step(np.zeros(2))
        assert np.array_equal(reward, due)
        assert reward[0] == own
        starts = terminated | truncated
        ends += int(starts.sum())
        if ended or cut:
            assert starts[0]
            single, _ = alone.reset()
    assert ends >= 9


@pytest.mark.parametrize("task", ["course-keeping", "track-keeping"])
def test_a_steered_residual_of_zero_is_its_base_controller_to_the_bit(task: str) -> None:
    name = {"course-keeping": "speed-pilot", "track-keeping": "track-keeper+combinator"}[task]
    common: dict[str, Any] = {"task": task, "max_episode_steps": 9, "normalised": False}
    residual = SteeringVectorEnv(
        3, action_mode=f"residual:{name}", command="fuel-rack", threads=1, **common
    )
    classic = SteeringVectorEnv(3, threads=1, **common | CLASSIC)
    text = name if "+" in name else f"{get_task(task).helmsman}+{name}"
    controller: Any = make_steering(text, classic.batch.ship, 0.5)
    mine, _ = residual.reset(seed=6)
    theirs, _ = classic.reset(seed=6)
    state, starts = None, np.ones(3, dtype=bool)
    for _ in range(25):
        action, state = controller.predict(theirs, state, starts)
        assert np.array_equal(mine[:, :23], theirs)
        mine, reward, terminated, truncated, _ = residual.step(np.zeros((3, 3)))
        theirs, due, *_ = classic.step(action)
        assert np.array_equal(reward, due)
        starts = terminated | truncated


def test_a_steered_residual_needs_no_steered_task() -> None:
    env = SteeringEnv(task="transit", ship="frigate-turning", action_mode="residual")
    seen, _ = env.reset(seed=1)
    assert env.action_space.shape == (3,)
    assert np.isfinite(env.step([0.0, 0.0, 0.1])[0]).all()
    assert env.observation_space.contains(seen)


def test_a_residual_adds_a_quarter_of_the_range_at_most_and_stays_inside_it() -> None:
    env = FrigateEnv(
        action_mode="residual", command="fuel-rack", task=STILL, normalised=False, sensor_noise=0.0
    )
    episode = env.batch.arrays.episodes[0]
    assert REACH == 0.25
    for action in ([0.4, -1.0], [-1.0, 0.2], [1.0, 1.0]):
        seen, _ = env.reset(seed=2, options={"speed_order_m_s": 8.0})
        base = seen[15:].astype(float)
        env.step(action)
        span, low = np.array([0.8, 40.0]), np.array([0.6, 0.0])
        expected = np.clip(base + 0.25 * span * np.array(action), low, low + span)
        found = [float(episode["pitch_command"]), float(episode["rack_command"])]
        assert found == pytest.approx(expected, rel=1e-5)


def test_a_residual_is_limited_unless_the_command_is_the_plain_rack() -> None:
    assert FrigateEnv(action_mode="residual", task="transit").batch.command == "limited-rack"
    env = FrigateEnv(action_mode="residual", command="fuel-rack")
    assert env.batch.command == "fuel-rack"
    assert env.observation_space.shape == (17,)
    assert SteeringEnv(action_mode="residual").observation_space.shape == (26,)


@pytest.mark.parametrize("kind", [FrigateEnv, lambda **settings: FrigateVectorEnv(2, **settings)])
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"action_mode": "residual", "command": "shaft-speed"}, "a residual is added to the fuel"),
        ({"action_mode": "lever"}, "unknown action_mode 'lever'; known: increment, absolute,"),
        ({"action_mode": "absolute:combinator"}, "unknown action_mode 'absolute:combinator'"),
        ({"action_mode": "residual:lever"}, "unknown controller 'lever'; known: combinator"),
        ({"action_mode": "residual:combinator:x=1"}, "option 'x' is unknown"),
        ({"command": "lever"}, "unknown command 'lever'; known: shaft-speed, limited-rack"),
    ],
)
def test_modes_and_commands_that_do_not_exist_are_refused(
    kind: Any, settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        kind(**settings)


def test_a_ship_of_fixed_pitch_keeps_it_whatever_the_action() -> None:
    ship = load_ship("frigate").with_values(
        {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
    )
    for mode in ("increment", "absolute", "residual:combinator"):
        env = FrigateEnv(ship=ship, task=STILL, action_mode=mode, sensor_noise=0.0)
        seen, _ = env.reset(seed=0)
        for action in ([1.0, 0.0], [-1.0, 0.1]):
            assert np.isfinite(seen).all()
            assert env.observation_space.contains(seen)
            seen, *_ = env.step(action)
            assert env.batch.arrays.episodes[0]["pitch_command"] == pytest.approx(1.2)
            assert seen[3] == seen[9] == 0.0  # in the middle of a range without width
