"""The vector environment: infos, options, seeds, and that what it returns stays as it is."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo

import shaftline.envs
from shaftline.envs import TERMS, FrigateEnv, FrigateVectorEnv
from shaftline.envs.records import ENVIRONMENT, TRUTHS

from .plans import SHORT, actions

NAME = "shaftline.envs:shaftline/Frigate-v0"
PAGE = Path(__file__).parents[2] / "docs" / "environment.md"


def test_infos_of_the_vector_environment_are_columns_with_masks() -> None:
    vector, singles = FrigateVectorEnv(3, **SHORT), [FrigateEnv(**SHORT) for _ in range(3)]
    vector.reset(seed=7)
    for i, env in enumerate(singles):
        env.reset(seed=7 + i)
    for plan in actions(3, 3):
        info = vector.step(plan)[4]
        alone = [env.step(one)[4] for env, one in zip(singles, plan, strict=True)]
        names = {*TRUTHS, "reward_terms"}
        assert set(info) == names | {f"_{name}" for name in names}
        assert set(info["reward_terms"]) == {*TERMS, *(f"_{name}" for name in TERMS)}
        for mask in (info["_ship_speed"], info["_reward_terms"], info["reward_terms"]["_overload"]):
            assert mask.tolist() == [True] * 3
        for name in TRUTHS:
            assert info[name].tolist() == [one[name] for one in alone]
        for term in TERMS:
            assert info["reward_terms"][term].tolist() == [o["reward_terms"][term] for o in alone]


def test_the_last_interval_of_an_episode_is_told_in_final_info() -> None:
    limit = 1000.0 * math.pi / 30.0 / 7.38
    env = FrigateVectorEnv(
        4,
        control_interval_s=0.05,
        max_episode_steps=4,
        sea="calm",
        command="fuel-rack",
        normalised=False,
    )
    env.reset(seed=1)
    for _ in range(3):
        info = env.step(np.zeros((4, 2)))[4]
        assert not {"ended", "final_info", "final_obs"} & set(info)
    env.batch.elapsed[3] = 0  # the other three are at their last interval
    env.batch.arrays.states["shaft_speed"][:2] = 0.2, 1.3 * limit
    seen, reward, terminated, truncated, info = env.step(np.zeros((4, 2)))
    assert terminated.tolist() == [True, True, False, False]
    assert truncated.tolist() == [True, True, True, False]
    assert info["_final_obs"].tolist() == info["_final_info"].tolist() == [True, True, True, False]
    last = info["final_info"]
    assert last["ended"].tolist() == ["stalled", "overspeed trip", None, None]
    assert last["_ended"].tolist() == terminated.tolist()
    assert "ended" not in info
    for name in (*TRUTHS, "reward_terms"):
        assert last["_" + name].tolist() == [True, True, True, False]
        assert info["_" + name].tolist() == [True] * 4
    for name in TERMS:
        assert last["reward_terms"]["_" + name].tolist() == [True, True, True, False]
        # the next episodes have not had an interval yet
        assert info["reward_terms"][name][:3].tolist() == [0.0] * 3
    assert info["reward_terms"]["fuel_kg_s"][3] > 0.0
    assert (last["reward_terms"]["speed_error_m_s"][:3] > 0.0).all()
    assert reward[:2].tolist() == [0.0, 0.0]
    assert (reward[2:] > 0.0).all()
    states = env.batch.arrays.states
    for name in ("ship_speed", "shaft_speed"):
        assert info[name][:3].tolist() == states[name][:3].tolist()
    for i in range(3):
        assert info["final_obs"][i][1] == pytest.approx(last["shaft_speed"][i], abs=0.1)
        assert not np.array_equal(info["final_obs"][i], seen[i])
    assert info["final_obs"][3] is None
    assert env.batch.elapsed.tolist() == [0, 0, 0, 1]
    assert seen[0, 1] > 5.0  # another episode has begun
    # returned arrays stay as they were
    kept = last["shaft_speed"].copy()
    env.step(np.zeros((4, 2)))
    assert np.array_equal(last["shaft_speed"], kept)


def test_options_hold_until_the_next_reset() -> None:
    vector = FrigateVectorEnv(2, max_episode_steps=2, task="transit", normalised=False)
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
    with pytest.raises(ValueError, match="seed has 2 entries for 3 environments"):
        vector.reset(seed=[1, 2])


def test_returned_arrays_are_not_changed_later() -> None:
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


def test_torch_shares_the_memory_of_observations_and_gives_actions() -> None:
    torch = pytest.importorskip("torch")
    vector, other = (FrigateVectorEnv(2, **SHORT) for _ in range(2))
    for one in (vector, other):
        one.reset(seed=0)
    moves = actions(1, 2)[0]
    seen, *_ = vector.step(torch.from_numpy(moves))
    tensor = torch.from_dlpack(seen)
    assert tensor.data_ptr() == seen.ctypes.data  # no copy
    assert np.array_equal(seen, other.step(moves)[0])
    vector.step(moves)
    assert np.array_equal(tensor.numpy(), seen)  # it is not written again


def test_a_picture_is_drawn_where_it_is_asked_for() -> None:
    env = FrigateEnv(render_mode="rgb_array", **SHORT)
    env.reset(seed=0)
    empty = env.render()
    env.step(np.zeros(2))
    env.step(np.zeros(2))
    assert env.render().shape == empty.shape == (600, 960, 3)
    assert not np.array_equal(env.render(), empty)
    env.reset(seed=0)
    assert np.array_equal(env.render(), empty)
    assert FrigateEnv(**SHORT).render() is None
    assert FrigateVectorEnv(2, render_mode=None).num_envs == 2  # Gymnasium hands it on


def test_closing_ends_the_threads() -> None:
    env = FrigateVectorEnv(64, threads=2, **SHORT)
    before = threading.active_count()
    env.reset(seed=0)
    env.step(np.zeros((64, 2)))
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
        FrigateEnv(render_mode="rgb_array", max_episode_steps=4),
        str(tmp_path / "videos"),
        disable_logger=True,
    )
    env.reset(seed=0)
    for action in actions(4):
        env.step(action[0])
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_the_page_states_the_memory_of_the_records() -> None:
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    size = {name: ENVIRONMENT[name].itemsize for name in ENVIRONMENT.names or ()}
    each = ENVIRONMENT.itemsize
    assert f"takes {each / 1e3:.0f} kB of memory, 1024 of them {1024 * each / 1e6:.0f} MB" in page
    assert f"{size['observer'] / 1e3:.0f} kB hold the observer" in page
    assert f"{size['plant'] / 1e3:.0f} kB the ship" in page
    assert f"{size['memory'] / 1e3:.0f} kB actuators and instruments" in page
    assert f"{size['sea'] / 1e3:.0f} kB the sea" in page
    rest = each - sum(size[name] for name in ("observer", "plant", "memory", "sea"))
    assert f"{rest / 1e3:.0f} kB the episode" in page
    assert FrigateVectorEnv(3).batch.environments.nbytes == 3 * each


@pytest.mark.parametrize("seed", ["a", (1, 2), 1.5])
def test_a_seed_of_another_type_is_refused(seed: Any) -> None:
    with pytest.raises(TypeError, match=r"seed = .*: must be a whole number, or a list"):
        FrigateVectorEnv(2, **SHORT).reset(seed=seed)


def test_closed_environments_are_not_stepped() -> None:
    env = FrigateVectorEnv(2, **SHORT)
    env.reset(seed=1)
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="create new ones"):
        env.step(np.zeros((2, 2)))


def test_an_action_that_is_not_finite_is_named_by_its_place() -> None:
    env = FrigateVectorEnv(40, **SHORT)
    env.reset(seed=1)
    action = np.zeros((40, 2))
    action[17, 1] = np.nan
    with pytest.raises(ValueError, match=r"^action\[17, 1\] = nan: must be finite"):
        env.step(action)
