from __future__ import annotations

import math
import pickle
import warnings
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from shaftline.baselines.controller import OBSERVED
from shaftline.envs import CLASSIC, TERMS, FrigateEnv, FrigateVectorEnv, tasks
from shaftline.envs.records import TRUTHS
from shaftline.observers import observer_names
from shaftline.plant.fuel import fuel_rate

from .plans import SHORT, actions

NAME = "shaftline.envs:shaftline/Frigate-v0"
FORMS: dict[str, dict[str, Any]] = {name: {} for name in observer_names()} | {
    "none": {"action_mode": "residual"},
    "oracle": {"command": "limited-rack"},
    "luenberger": {"action_mode": "absolute", "command": "fuel-rack"},
    "shaft-kalman": {"action_mode": "residual:combinator", "command": "fuel-rack"},
    "power-balance": {"normalised": False},
}


@pytest.mark.parametrize("task", tasks())
@pytest.mark.parametrize("observer", observer_names())
def test_checker_has_nothing_to_say(observer: str, task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(FrigateEnv(observer=observer, task=task, **SHORT), skip_render_check=True)


@pytest.mark.parametrize("observer", observer_names())
def test_vector_is_the_single_environment_bit_for_bit(observer: str) -> None:
    n, steps = 5, 20
    options = {
        "observer": observer,
        "task": "storm",
        "randomise": {"hull.mass_kg": 0.2},
        **FORMS[observer],
        **SHORT,
    }
    vector = FrigateVectorEnv(n, threads=2, **options)
    batch, _ = vector.reset(seed=7)
    plans = actions(steps, n)
    singles = [FrigateEnv(**options) for _ in range(n)]
    alone = [env.reset(seed=7 + i)[0] for i, env in enumerate(singles)]
    for k in range(steps):
        assert np.array_equal(batch, np.stack(alone))
        batch, reward, terminated, truncated, info = vector.step(plans[k])
        for i, env in enumerate(singles):
            alone[i], own, term, trunc, _ = env.step(plans[k, i])
            assert (own, term, trunc) == (reward[i], terminated[i], truncated[i])
            if term or trunc:
                assert np.array_equal(info["final_obs"][i], alone[i])
                alone[i] = env.reset()[0]
    assert vector.batch.elapsed.max() < steps  # episodes ended and began again


def test_same_seed_same_episode() -> None:
    def episode(seed: int) -> np.ndarray[Any, Any]:
        env = FrigateEnv(task="speed-keeping", **SHORT)
        seen = [env.reset(seed=seed)[0]]
        seen += [env.step(action[0])[0] for action in actions(8)]
        return np.stack(seen)

    assert np.array_equal(episode(3), episode(3))
    assert not np.array_equal(episode(3), episode(4))


def test_time_out_truncates_and_a_stall_terminates() -> None:
    env = FrigateEnv(sea="calm", **SHORT)
    env.reset(seed=1)
    ends = [env.step(a[0])[2:4] for a in actions(8)]
    assert ends == [(False, False)] * 7 + [(False, True)]
    env = FrigateEnv(sea="calm", **CLASSIC)
    env.reset(seed=1)
    for _ in range(600):
        _, _, terminated, truncated, info = env.step(np.array([1.0, -1.0], np.float32))
        if terminated or truncated:
            break
    assert terminated
    assert info["ended"] == "stalled"


@pytest.mark.parametrize("task", tasks())
def test_the_reward_follows_from_the_terms_and_the_goals(task: str) -> None:
    env = FrigateEnv(task=task, **SHORT)
    env.reset(seed=1)
    goals = tasks()[task].goals.used
    for action in actions(5):
        _, reward, _, _, info = env.step(action[0])
        terms = info["reward_terms"]
        assert list(terms) == list(TERMS)
        factors, missed = 1.0, 0.0
        for name, goal in goals.items():
            beyond = max(terms[name] - goal.within, 0.0) / goal.margin
            value = 1.0 / (1.0 + 9.0 * beyond**2)
            if goal.weight is None:
                factors *= value
            else:
                missed += goal.weight * (1.0 - value)
        assert reward == pytest.approx(factors * (1.0 - missed))
        assert 0.0 < reward < 1.0


def test_a_reset_tells_the_truth_of_the_state() -> None:
    env, vector = FrigateEnv(task="storm"), FrigateVectorEnv(2, task="storm")
    _, info = env.reset(seed=3)
    _, columns = vector.reset(seed=3)
    state = env.batch.arrays.states[0]
    assert set(info) == {*TRUTHS, "reward_terms"}
    for name, field in {
        "ship_speed": "ship_speed",
        "shaft_speed": "shaft_speed",
        "blade_pitch": "pitch_ratio",
        "ventilation": "ventilation",
        "position": "position",
    }.items():
        assert info[name] == pytest.approx(float(state[field]), rel=1e-12), name
    plant = env.batch.arrays.plants[0]
    fuel = 2.0 * fuel_rate(plant, plant["gear_ratio"] * state["shaft_speed"], info["brake_torque"])
    assert info["fuel_flow"] == pytest.approx(fuel)
    assert info["thrust"] > 0.0
    assert info["reward_terms"] == dict.fromkeys(TERMS, 0.0)
    for name in TRUTHS:
        assert columns[name][0] == info[name]
        assert columns["_" + name].tolist() == [True, True]
    for name in TERMS:
        assert columns["reward_terms"][name].tolist() == [0.0, 0.0]
    _, masked = vector.reset(options={"reset_mask": np.array([False, True])})
    assert masked["_ship_speed"].tolist() == masked["_reward_terms"].tolist() == [False, True]


@pytest.mark.parametrize("steps", [50, 600, 1200])
def test_gymnasiums_limit_of_steps_is_the_length_of_an_episode(steps: int) -> None:
    limit: dict[str, Any] = {} if steps == 600 else {"max_episode_steps": steps}
    made = gymnasium.make(NAME, task="transit", **limit)
    assert made.spec is not None
    assert made.spec.max_episode_steps == steps
    env = FrigateEnv(task="transit", max_episode_steps=steps)
    hold = np.zeros(2, np.float32)
    for one in (made, env):
        one.reset(seed=1)
        ends = [one.step(hold)[2:4] for _ in range(steps)]
        assert ends == [(False, False)] * (steps - 1) + [(False, True)]
    with pytest.raises(ResetNeeded, match="it has ended: call reset"):
        env.step(hold)
    for mode in ("vector_entry_point", "sync"):
        vector = gymnasium.make_vec(
            NAME, num_envs=2, vectorization_mode=mode, task="transit", **limit
        )
        vector.reset(seed=1)
        cut = [vector.step(np.zeros((2, 2), np.float32))[3].tolist() for _ in range(steps)]
        assert cut == [[False] * 2] * (steps - 1) + [[True] * 2]


def test_an_episode_without_a_limit_goes_on() -> None:
    env = FrigateEnv(max_episode_steps=None, control_interval_s=1.0, sea="calm")
    vector = FrigateVectorEnv(2, max_episode_steps=None, control_interval_s=1.0, sea="calm")
    env.reset(seed=1)
    vector.reset(seed=1)
    for _ in range(700):
        assert not env.step(np.zeros(2))[3]
        assert not vector.step(np.zeros((2, 2)))[3].any()
    assert vector.batch.elapsed.tolist() == [700, 700]


def test_a_step_after_a_failure_is_refused_under_gymnasiums_limit_too() -> None:
    env: Any = gymnasium.make(NAME, command="fuel-rack", action_mode="absolute")
    env.reset(seed=1)
    env.unwrapped.batch.arrays.states["shaft_speed"] *= 50.0
    assert env.step(np.zeros(2, np.float32))[1:3] == (0.0, True)
    with pytest.raises(ResetNeeded, match="it has ended"):
        env.step(np.zeros(2, np.float32))


def test_observation_follows_the_plant_within_its_noise() -> None:
    env = FrigateEnv(sea="state-4", sensor_noise=0.0, normalised=False)
    env.reset(seed=2)
    for action in actions(20):
        seen, *_, info = env.step(action[0])
    column = {name: float(seen[i]) for i, name in enumerate(OBSERVED)}
    assert column["estimated_advance_velocity"] == pytest.approx(info["advance_velocity"], abs=0.15)
    assert column["estimate_valid"] == 1.0
    assert column["measured_ship_speed"] == pytest.approx(
        float(env.batch.arrays.states[0]["ship_speed"]), abs=0.05
    )


def test_a_single_environment_is_drawn_where_asked_and_a_vector_holds_one_by_default() -> None:
    assert FrigateEnv(render_mode="rgb_array").render_mode == "rgb_array"
    assert FrigateEnv().render_mode is None
    assert FrigateVectorEnv().num_envs == 1


def _step_at_random(n: int, intervals: int, seed: int, **options: Any) -> None:
    """Step with random actions; observations and rewards must keep their bounds, truths be finite."""
    env = FrigateVectorEnv(n, max_episode_steps=120, **options)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(intervals):
        observation, reward, _, _, info = env.step(rng.uniform(-1.5, 1.5, (n, 2)))
        assert np.isfinite(observation).all()
        assert (np.abs(observation) <= 3.0).all()
        assert ((reward >= 0.0) & (reward <= 1.0)).all()
        assert all(np.isfinite(info[name]).all() for name in TRUTHS)
    env.close()


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**20), st.sampled_from(sorted(tasks())), st.sampled_from(observer_names()))
def test_random_actions_never_give_a_non_finite_observation(
    seed: int, task: str, observer: str
) -> None:
    _step_at_random(32, 150, seed, task=task, observer=observer)


@pytest.mark.slow
@pytest.mark.parametrize("observer", observer_names())
def test_ten_million_random_steps_stay_finite(observer: str) -> None:
    # 1024 environments, over all observers together more than ten million steps
    seas: list[Any] = [
        "calm",
        {"hs_m": (0.5, 12.0), "tp_s": (5.0, 18.0), "heading_deg": (0.0, 180.0)},
    ]
    each = math.ceil(1e7 / len(observer_names()) / 1024 / len(tasks()))
    for seed, task in enumerate(sorted(tasks())):
        _step_at_random(
            1024,
            each,
            seed,
            task=task,
            observer=observer,
            sea=seas,
            randomise={
                "hull.resistance_coefficient_N_s2_m2": 0.3,
                "hull.mass_kg": 0.3,
                "prime_mover.torque_per_rack_N_m_mm": 0.1,
            },
        )


def test_a_sea_can_be_a_range_from_which_each_episode_draws() -> None:
    env = FrigateVectorEnv(64, sea={"hs_m": (1.0, 4.0), "tp_s": 9.0})
    env.reset(seed=0)
    heights = 4.0 * np.sqrt(0.5 * np.sum(env.batch.arrays.seas["amplitude"] ** 2, axis=1))
    assert heights.min() > 0.9
    assert heights.max() < 4.1
    assert np.ptp(heights) > 2.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"task": "dancing"}, "unknown task 'dancing'"),
        ({"observer": "eyes"}, "unknown observer 'eyes'"),
        ({"sea": "state-9"}, "unknown sea 'state-9'"),
        ({"sea": {"hs_m": (4.0, 1.0), "tp_s": 9.0}}, "must be a number, or a pair"),
        ({"ship": "dinghy"}, "unknown ship 'dinghy'"),
        ({"control_interval_s": 0.12}, "multiple"),
        ({"sensor_noise": -1.0}, "sensor_noise"),
        ({"randomise": {"colour": 0.1}}, "colour"),
        ({"action_mode": "sail"}, "action_mode"),
        ({"render_mode": "human"}, "unknown render_mode 'human'; known: rgb_array"),
        ({"max_episode_steps": 0}, "max_episode_steps = 0: must be a whole number"),
        ({"fog": 1}, "unexpected keyword argument 'fog'"),
    ],
)
def test_bad_keywords_are_named(options: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        FrigateEnv(**options)
    if "render_mode" not in options:
        with pytest.raises((TypeError, ValueError), match=words):
            FrigateVectorEnv(2, **options)


def test_make_vec_and_subprocesses_by_id() -> None:
    vector = gymnasium.make_vec(NAME, num_envs=3, vectorization_mode="vector_entry_point", **SHORT)
    assert isinstance(vector.unwrapped, FrigateVectorEnv)
    workers = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode="async", **SHORT)
    observation, _ = workers.reset(seed=7)
    assert np.array_equal(observation[1], FrigateEnv(**SHORT).reset(seed=8)[0])
    workers.close()
    vector.close()


def test_the_governor_holds_the_shaft_speed_that_is_asked() -> None:
    env = FrigateEnv(action_mode="absolute", sea="calm", sensor_noise=0.0)
    env.reset(seed=1)
    ship = env.batch.ship
    for action in (0.0, 0.4):
        for _ in range(240):
            env.step(np.array([0.3, action], np.float32))
        asked = np.interp(action, [-1, 1], [350.0, 1000.0]) * np.pi / 30.0
        held = float(env.batch.arrays.states[0]["shaft_speed"]) * ship.transmission.gear_ratio
        assert held == pytest.approx(asked, rel=0.01)


def content(result: Any) -> Any:
    """Return the bytes of all numbers in a result of ``step`` or ``reset``."""
    if isinstance(result, dict):
        return {name: content(value) for name, value in result.items()}
    if isinstance(result, tuple) or (isinstance(result, np.ndarray) and result.dtype.hasobject):
        return [content(value) for value in result]
    return np.asarray(result).tobytes()


@pytest.mark.parametrize("mode", ["absolute", "increment", "residual:combinator-trimmed"])
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("copied", [lambda env: pickle.loads(pickle.dumps(env)), deepcopy])
def test_a_copy_keeps_the_episode(copied: Callable[[Any], Any], mode: str, n: int) -> None:
    """With noise, waves, the observer's memory and the draws of the episodes that follow."""
    options: dict[str, Any] = {"task": "storm", "action_mode": mode, **SHORT}
    env: Any = FrigateEnv(**options) if n == 1 else FrigateVectorEnv(n, threads=1, **options)
    env.reset(seed=5, options={"speed_order_m_s": 6.0})
    plans = actions(7, n)[:, 0] if n == 1 else actions(12, n)
    env.step(plans[0])
    copy = copied(env)
    for plan in plans[1:]:
        assert content(env.step(plan)) == content(copy.step(plan))
    assert content(env.reset()) == content(copy.reset())
