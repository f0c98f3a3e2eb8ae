from __future__ import annotations

import math
import pickle
import threading
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo
from hypothesis import given, settings
from hypothesis import strategies as st

import shaftline.envs
from shaftline.baselines.controller import OBSERVED
from shaftline.envs import TERMS, FrigateEnv, FrigateVectorEnv, tasks
from shaftline.envs.records import TRUTHS
from shaftline.observers import observer_names
from shaftline.plant.signals import get_signal

NAME = "shaftline.envs:shaftline/Frigate-v0"
SHORT: dict[str, Any] = {"episode_s": 4.0}


def actions(steps: int, n: int = 1, seed: int = 0) -> np.ndarray[Any, Any]:
    # ahead of the stall, so that episodes last
    raw = np.random.default_rng(seed).uniform(-0.2, 0.6, (steps, n, 2))
    return raw.astype(np.float32)


@pytest.mark.parametrize("task", tasks())
@pytest.mark.parametrize("observer", observer_names())
def test_checker_has_nothing_to_say(observer: str, task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(NAME, observer=observer, task=task, **SHORT)
        check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("observer", observer_names())
def test_vector_is_the_single_environment_bit_for_bit(observer: str) -> None:
    n, steps = 5, 20
    options = {"observer": observer, "task": "storm", "randomise": {"hull.mass_kg": 0.2}, **SHORT}
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
    env = FrigateEnv(sea="calm")
    env.reset(seed=1)
    for _ in range(600):
        _, _, terminated, truncated, info = env.step(np.array([1.0, -1.0], np.float32))
        if terminated or truncated:
            break
    assert terminated
    assert info["ended"] == "stalled"


def test_reward_is_the_weighted_sum_of_its_terms() -> None:
    env = FrigateEnv(task="transit", **SHORT)
    env.reset(seed=1)
    weights = tasks()["transit"].weights
    for action in actions(5):
        _, reward, _, _, info = env.step(action[0])
        assert list(info["reward_terms"]) == list(TERMS)
        expected = -sum(getattr(weights, k) * v for k, v in info["reward_terms"].items())
        assert reward == pytest.approx(expected)
        assert info["fuel_flow"] > 0.0


def test_observation_follows_the_plant_within_its_noise() -> None:
    env = FrigateEnv(sea="state-4", sensor_noise=0.0)
    env.reset(seed=2)
    for action in actions(20):
        seen, *_, info = env.step(action[0])
    column = {name: float(seen[i]) for i, name in enumerate(OBSERVED)}
    assert column["estimated_advance_velocity"] == pytest.approx(info["advance_velocity"], abs=0.15)
    assert column["estimate_valid"] == 1.0
    assert column["measured_ship_speed"] == pytest.approx(
        float(env.batch.arrays.states[0]["ship_speed"]), abs=0.05
    )


def test_bounds_are_the_registrys() -> None:
    space = FrigateEnv().observation_space
    assert isinstance(space, gymnasium.spaces.Box)
    for i, name in enumerate(OBSERVED):
        assert space.high[i] == np.float32(get_signal(name).high)
        assert space.low[i] == np.float32(get_signal(name).low)
    action = FrigateEnv().action_space
    assert isinstance(action, gymnasium.spaces.Box)
    assert (action.low.tolist(), action.high.tolist()) == ([-1.0, -1.0], [1.0, 1.0])


def test_actions_beyond_the_box_are_clipped() -> None:
    runs = []
    for action in ([1.0, -1.0], [1.7, -30.0]):
        env = FrigateEnv(**SHORT)
        env.reset(seed=2)
        runs.append(env.step(action)[0])
    assert np.array_equal(runs[0], runs[1])


def _step_at_random(n: int, intervals: int, seed: int, **options: Any) -> None:
    """Step with wild actions; every observation, reward and truth must be finite."""
    env = FrigateVectorEnv(n, episode_s=60.0, **options)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(intervals):
        observation, reward, _, _, info = env.step(rng.uniform(-1.5, 1.5, (n, 2)))
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()
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
            1024, each, seed, task=task, observer=observer, sea=seas,
            randomise={"hull.resistance_coefficient_N_s2_m2": 0.3, "hull.mass_kg": 0.3,
                       "prime_mover.torque_per_rack_N_m_mm": 0.1},
        )  # fmt: skip


def test_a_sea_can_be_a_range_from_which_each_episode_draws() -> None:
    env = FrigateVectorEnv(64, sea={"hs_m": (1.0, 4.0), "tp_s": 9.0})
    env.reset(seed=0)
    heights = 4.0 * np.sqrt(0.5 * np.sum(env.batch.arrays.seas["amplitude"] ** 2, axis=1))
    assert heights.min() > 0.9
    assert heights.max() < 4.1
    assert np.ptp(heights) > 2.0


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ([np.nan, 0.0], "not finite"),
        ([0.0, np.inf], "not finite"),
        ([0.0], r"action has shape \(1,\), \(2,\) is needed"),
        ([[0.0, 0.0]], r"shape \(1, 2\), \(2,\) is needed"),
    ],
)
def test_unusable_actions_are_refused(bad: list[Any], words: str) -> None:
    env = FrigateEnv()
    env.reset(seed=0)
    before = env.batch.arrays.states.copy()
    with pytest.raises(ValueError, match=words):
        env.step(bad)
    assert np.array_equal(env.batch.arrays.states, before)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"task": "dancing"}, "unknown task 'dancing'"),
        ({"observer": "eyes"}, "unknown observer 'eyes'"),
        ({"sea": "state-9"}, "unknown sea 'state-9'"),
        ({"sea": {"hs_m": (4.0, 1.0), "tp_s": 9.0}}, "a lowest and a highest"),
        ({"ship": "dinghy"}, "unknown ship 'dinghy'"),
        ({"control_interval_s": 0.12}, "multiple"),
        ({"sensor_noise": -1.0}, "sensor_noise"),
        ({"randomise": {"colour": 0.1}}, "colour"),
        ({"action_mode": "sail"}, "action_mode"),
        ({"render_mode": "human"}, "unknown render_mode 'human'; known: rgb_array"),
        ({"episode_s": 0.0}, "episode_s"),
        ({"fog": 1}, "unknown keyword 'fog'"),
    ],
)
def test_bad_keywords_are_named(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        FrigateEnv(**options)
    if "render_mode" not in options:
        with pytest.raises(ValueError, match=words):
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
    env = FrigateEnv(action_mode="shaft-speed", sea="calm", sensor_noise=0.0)
    env.reset(seed=1)
    ship = env.batch.ship
    for action in (0.0, 0.4):
        for _ in range(240):
            env.step(np.array([0.3, action], np.float32))
        asked = np.interp(action, [-1, 1], [350.0, 1000.0]) * np.pi / 30.0
        held = float(env.batch.arrays.states[0]["shaft_speed"]) * ship.transmission.gear_ratio
        assert held == pytest.approx(asked, rel=0.01)


@pytest.mark.parametrize("mode", ["rack", "shaft-speed"])
@pytest.mark.parametrize("n", [1, 3])
def test_pickling_keeps_the_episode(mode: str, n: int) -> None:
    """With noise, waves, the observer's memory and the draws of the episodes that follow."""
    options: dict[str, Any] = {"task": "storm", "action_mode": mode, **SHORT}
    env: Any = FrigateEnv(**options) if n == 1 else FrigateVectorEnv(n, threads=1, **options)
    env.reset(seed=5, options={"speed_order_m_s": 6.0})
    plans = actions(12, n)[:, 0] if n == 1 else actions(12, n)
    env.step(plans[0])
    copy = pickle.loads(pickle.dumps(env))
    for plan in plans:
        assert np.array_equal(env.step(plan)[0], copy.step(plan)[0])
    assert np.array_equal(env.reset()[0], copy.reset()[0])


def test_infos_of_the_vector_form_are_columns() -> None:
    vector, singles = FrigateVectorEnv(3, **SHORT), [FrigateEnv(**SHORT) for _ in range(3)]
    vector.reset(seed=7)
    for i, env in enumerate(singles):
        env.reset(seed=7 + i)
    for plan in actions(3, 3):
        info = vector.step(plan)[4]
        alone = [env.step(one)[4] for env, one in zip(singles, plan, strict=True)]
        assert set(info) == {*TRUTHS, "reward_terms"}
        for name in TRUTHS:
            assert info[name].tolist() == [one[name] for one in alone]
        for term in TERMS:
            assert info["reward_terms"][term].tolist() == [o["reward_terms"][term] for o in alone]


def test_the_vector_form_says_which_ended_how_and_what_was_last_seen() -> None:
    limit = 1000.0 * math.pi / 30.0 / 7.38
    env = FrigateVectorEnv(4, control_interval_s=0.05, episode_s=0.2, sea="calm")
    env.reset(seed=1)
    for _ in range(3):
        info = env.step(np.zeros((4, 2)))[4]
        assert not {"ended", "final_info", "final_obs"} & set(info)
    env.batch.elapsed[3] = 0  # the other three are at their last interval
    env.batch.arrays.states["shaft_speed"][:2] = 0.2, 1.3 * limit
    seen, reward, terminated, truncated, info = env.step(np.zeros((4, 2)))
    assert terminated.tolist() == [True, True, False, False]
    assert truncated.tolist() == [True, True, True, False]
    assert info["ended"].tolist() == ["stalled", "overspeed trip", None, None]
    assert info["_ended"].tolist() == terminated.tolist()
    assert info["_final_obs"].tolist() == info["_final_info"].tolist() == [True, True, True, False]
    last = info["final_info"]
    for name in (*TRUTHS, "ended", "_ended"):
        assert np.array_equal(last[name], info[name]), name
    assert last["reward_terms"]["failure"].tolist() == [1.0, 1.0, 0.0, 0.0]
    assert (reward[:2] < -500.0).all()
    for i in range(3):
        assert info["final_obs"][i][1] == pytest.approx(info["shaft_speed"][i], abs=0.1)
        assert not np.array_equal(info["final_obs"][i], seen[i])
    assert info["final_obs"][3] is None
    assert env.batch.elapsed.tolist() == [0, 0, 0, 1]
    assert seen[0, 1] > 5.0  # another episode has begun
    # what was handed out stays as it was
    kept = last["shaft_speed"].copy()
    env.step(np.zeros((4, 2)))
    assert np.array_equal(last["shaft_speed"], kept)


def test_options_hold_until_the_next_reset() -> None:
    vector = FrigateVectorEnv(2, episode_s=1.0, task="transit")
    vector.reset(seed=0, options={"speed_order_m_s": 6.0, "sea": "calm"})
    for _ in range(3):
        seen = vector.step(np.zeros((2, 2)))[0]
    assert seen[:, 0].tolist() == [6.0, 6.0]
    assert not vector.batch.arrays.seas["present"].any()
    seen, _ = vector.reset()
    assert (seen[:, 0] >= 7.0).all()
    assert vector.batch.arrays.seas["present"].all()


def test_one_seed_for_each_environment() -> None:
    vector = FrigateVectorEnv(3, **SHORT)
    seen, _ = vector.reset(seed=[9, 4, 9])
    assert np.array_equal(seen[0], seen[2])
    assert np.array_equal(seen[1], FrigateEnv(**SHORT).reset(seed=4)[0])
    following, _ = vector.reset()  # without a seed the streams go on
    assert np.array_equal(following[0], following[2])
    assert not np.array_equal(following[0], seen[0])
    with pytest.raises(ValueError, match="2 seeds are given for 3 environments"):
        vector.reset(seed=[1, 2])


def test_what_is_handed_out_is_not_changed_later() -> None:
    env, vector = FrigateEnv(**SHORT), FrigateVectorEnv(2, **SHORT)
    for one, action in ((env, np.zeros(2)), (vector, np.zeros((2, 2)))):
        first, _ = one.reset(seed=0)  # type: ignore[attr-defined]
        kept = first.copy()
        second, reward, *_ = one.step(action)  # type: ignore[attr-defined]
        held = second.copy(), np.copy(reward)
        one.step(action)  # type: ignore[attr-defined]
        assert np.array_equal(first, kept)
        assert np.array_equal(second, held[0])
        assert np.array_equal(reward, held[1])


def test_a_picture_is_drawn_where_it_is_asked_for() -> None:
    env = FrigateEnv(render_mode="rgb_array", **SHORT)
    env.reset(seed=0)
    empty = env.render()
    env.step(np.zeros(2))
    env.step(np.zeros(2))
    assert env.render().shape == empty.shape == (480, 800, 3)
    assert not np.array_equal(env.render(), empty)
    env.reset(seed=0)
    assert np.array_equal(env.render(), empty)
    assert FrigateEnv(**SHORT).render() is None
    assert FrigateVectorEnv(2, render_mode=None).num_envs == 2  # Gymnasium hands it on


def test_closing_lets_the_threads_go() -> None:
    env = FrigateVectorEnv(4, threads=2, **SHORT)
    env.reset(seed=0)
    before = threading.active_count()
    env.step(np.zeros((4, 2)))
    assert threading.active_count() > before
    env.close()
    assert threading.active_count() <= before
    alone = FrigateVectorEnv(4, threads=1, **SHORT)
    alone.reset(seed=0)
    alone.step(np.zeros((4, 2)))
    assert threading.active_count() <= before
    alone.close()


def test_importing_registers_once() -> None:
    assert "shaftline/Frigate-v0" in gymnasium.registry
    with pytest.raises(AttributeError, match=r"'shaftline\.envs' has no attribute 'Ketch'"):
        shaftline.envs.Ketch  # noqa: B018
    assert shaftline.envs.FrigateEnv is FrigateEnv
    assert RecordEpisodeStatistics(gymnasium.make(NAME)).reset(seed=0)


def test_a_video_can_be_recorded(tmp_path: Path) -> None:
    env: Any = RecordVideo(
        FrigateEnv(render_mode="rgb_array", episode_s=2.0),
        str(tmp_path / "videos"),
        disable_logger=True,
    )
    env.reset(seed=0)
    for action in actions(4):
        env.step(action[0])
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000
