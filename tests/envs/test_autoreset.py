"""What happens where an episode ends, and Gymnasium's own wrappers around the vector environment."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import (
    DictInfoToList,
    NormalizeObservation,
    RecordEpisodeStatistics,
)

from shaftline.envs import TERMS, FrigateEnv, FrigateVectorEnv, SteeringEnv

SHORT: dict[str, Any] = {"max_episode_steps": 4, "task": "transit"}


def simulated(mode: str, steps: int, **settings: Any) -> list[Any]:
    """Return what reset and steps return under random actions."""
    env = FrigateVectorEnv(2, threads=1, autoreset_mode=mode, **(SHORT | settings))
    rows: list[Any] = [env.reset(seed=3)]
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (steps, 2, 2))
    for action in actions:
        rows.append(env.step(action))
    return rows


def test_modes_are_gymnasiums_by_name_or_member() -> None:
    for mode in AutoresetMode:
        for given in (mode, mode.value):
            assert FrigateVectorEnv(2, autoreset_mode=given).metadata["autoreset_mode"] is mode
    assert FrigateVectorEnv.metadata.get("autoreset_mode") is None  # it is an instance's
    with pytest.raises(
        ValueError, match="unknown autoreset_mode 'never'; known: NextStep, SameStep, Disabled"
    ):
        FrigateVectorEnv(2, autoreset_mode="never")


def test_next_step_is_the_same_step_one_later() -> None:
    """The next episode's first observation comes in a step of its own, with no reward."""
    same, following = simulated("SameStep", 5), simulated("NextStep", 6)
    for k in range(4):
        assert np.array_equal(same[k][0], following[k][0])
    ended = same[4]
    assert ended[3].all()
    assert np.array_equal(np.stack(list(ended[4]["final_obs"])), following[4][0])
    assert following[4][3].all()
    assert np.array_equal(ended[0], following[5][0])  # begun anew
    assert not following[5][2].any()
    assert not following[5][3].any()
    assert following[5][1].tolist() == [0.0, 0.0]
    assert (following[6][1] > 0.0).all()


def test_disabled_waits_for_a_mask() -> None:
    env = FrigateVectorEnv(3, autoreset_mode="Disabled", **SHORT)
    env.reset(seed=1)
    for _ in range(4):
        last, *_ = env.step(np.zeros((3, 2)))
    with pytest.raises(ResetNeeded, match=r"\[0, 1, 2\]"):
        env.step(np.zeros((3, 2)))
    mask = np.array([True, False, True])
    seen, _ = env.reset(seed=[7, 8, 9], options={"reset_mask": mask})
    assert np.array_equal(seen[1], last[1])
    alone, _ = FrigateEnv(**SHORT).reset(seed=7)
    assert np.array_equal(seen[0], alone)
    for bad in ([True, False], np.zeros(3, dtype=bool), np.ones(3)):
        with pytest.raises(ValueError, match="reset_mask"):
            env.reset(options={"reset_mask": bad})


def test_a_step_before_a_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        FrigateEnv(**SHORT).step(np.zeros(2))
    with pytest.raises(ResetNeeded):
        FrigateVectorEnv(2, **SHORT).step(np.zeros((2, 2)))


@pytest.mark.parametrize("kind", [FrigateEnv, SteeringEnv])
@pytest.mark.parametrize("ends", ["truncated", "terminated"])
def test_a_step_after_the_end_is_refused_and_changes_nothing(kind: Any, ends: str) -> None:
    env = kind(max_episode_steps=4)
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape)
    if ends == "terminated":
        env.batch.arrays.states["shaft_speed"] *= 3.0
        assert env.step(action)[2:4] == (True, False)
    else:
        assert [env.step(action)[3] for _ in range(4)] == [False, False, False, True]
    before = env.batch.environments.tobytes()
    for _ in range(2):
        with pytest.raises(ResetNeeded, match=r"it has ended: call reset\(\) before step\(\)"):
            env.step(action)
    assert env.batch.environments.tobytes() == before
    env.reset()
    env.step(action)


@pytest.mark.parametrize("mask", [[True, False, True], [False, False, True]])
def test_the_first_reset_begins_every_environment(mask: list[bool]) -> None:
    """A mask would leave observations of zeros."""
    env = FrigateVectorEnv(3, **SHORT)
    missing = [i for i, begins in enumerate(mask) if not begins]
    with pytest.raises(ValueError, match=re.escape(f"sub-environments {missing} have no episode")):
        env.reset(seed=1, options={"reset_mask": np.array(mask)})
    with pytest.raises(ResetNeeded):
        env.step(np.zeros((3, 2)))
    seen, _ = env.reset(seed=1, options={"reset_mask": np.ones(3, dtype=bool)})
    assert np.array_equal(seen, FrigateVectorEnv(3, **SHORT).reset(seed=1)[0])
    following, _ = env.reset(options={"reset_mask": np.array(mask)})
    changed = (following != seen).any(axis=1)
    assert changed.tolist() == mask


@pytest.mark.parametrize("threads", [-3, 0, 2.0, True, "2", 1.5])
def test_a_number_of_threads_that_is_none_is_refused(threads: Any) -> None:
    with pytest.raises(ValueError, match=re.escape(f"threads = {threads!r}: must be a whole")):
        FrigateVectorEnv(2, threads=threads)


def stepped(env: FrigateVectorEnv, results: Any) -> None:
    results.put(env.step(np.full((4, 2), 0.1))[0])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.parametrize("used", [False, True])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_makes_threads_of_its_own(used: bool) -> None:
    """The parent's threads do not exist in the child: a step that waits for them never returns."""
    env, other = (FrigateVectorEnv(4, threads=2, max_episode_steps=120) for _ in range(2))
    for one in (env, other):
        one.reset(seed=2)
        if used:
            one.step(np.zeros((4, 2)))
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    child = context.Process(target=stepped, args=(env, results), daemon=True)
    child.start()
    try:
        found = results.get(timeout=60.0)
    finally:
        child.join(timeout=10.0)
        hung = child.is_alive()
        child.kill()
    assert not hung
    assert np.array_equal(found, other.step(np.full((4, 2), 0.1))[0])
    assert np.array_equal(
        found, env.step(np.full((4, 2), 0.1))[0]
    )  # the parent process is not affected
    env.close()


def test_gymnasiums_vector_wrappers_take_it() -> None:
    made = gymnasium.make_vec(
        "shaftline/Frigate-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        autoreset_mode="NextStep",
        **SHORT,
    )
    env: Any = RecordEpisodeStatistics(NormalizeObservation(made))
    env.reset(seed=1)
    lengths: list[int] = []
    for _ in range(12):
        seen, _, _, _, info = env.step(np.zeros((3, 2), np.float32))
        assert np.isfinite(seen).all()
        lengths += info["episode"]["l"][info["_episode"]].tolist() if "episode" in info else []
    assert lengths
    assert set(lengths) == {4}


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_gymnasiums_statistics_are_the_returns_in_every_autoreset_mode(mode: str) -> None:
    env: Any = RecordEpisodeStatistics(FrigateVectorEnv(2, threads=1, autoreset_mode=mode, **SHORT))
    env.reset(seed=1)
    returned, episodes = np.zeros(2), 0
    for _ in range(11):
        _, reward, _, _, info = env.step(np.zeros((2, 2), np.float32))
        returned += reward
        if "episode" in info:
            assert info["episode"]["r"] == pytest.approx(returned)
            assert info["episode"]["l"].tolist() == [4, 4]
            returned[:] = 0.0
            episodes += 1
    assert episodes == 2


def test_gymnasiums_wrapper_makes_a_dictionary_of_each_sub_environments_info() -> None:
    env: Any = DictInfoToList(FrigateVectorEnv(2, threads=1, **SHORT))
    plain = FrigateVectorEnv(2, threads=1, **SHORT)
    _, rows = env.reset(seed=1)
    _, columns = plain.reset(seed=1)
    for _ in range(4):
        for i, row in enumerate(rows):
            assert row["fuel_flow"] == columns["fuel_flow"][i]
            assert set(row["reward_terms"]) == set(TERMS)
        *_, rows = env.step(np.zeros((2, 2), np.float32))
        *_, columns = plain.step(np.zeros((2, 2), np.float32))
    for i, row in enumerate(rows):
        last = columns["final_info"]["reward_terms"]["fuel_kg_s"][i]
        assert row["final_info"]["reward_terms"]["fuel_kg_s"] == last > 0.0


def test_it_is_pickled_without_its_threads() -> None:
    env = FrigateVectorEnv(3, threads=2, **SHORT)
    env.reset(seed=5)
    env.step(np.zeros((3, 2)))
    twin = pickle.loads(pickle.dumps(env))
    for one, other in zip(env.step(np.ones((3, 2))), twin.step(np.ones((3, 2))), strict=True):
        if isinstance(one, np.ndarray):
            assert np.array_equal(one, other)


def test_every_sub_environment_is_drawn() -> None:
    env = FrigateVectorEnv(2, render_mode="rgb_array", **SHORT)
    env.reset(seed=1)
    for _ in range(3):
        env.step(np.array([[0.5, 0.9], [0.5, -0.9]]))
    first, second = env.render() or ()
    assert first.shape == second.shape == (600, 960, 3)
    assert not np.array_equal(first, second)
    assert FrigateVectorEnv(2, **SHORT).render() is None


def test_the_spec_of_any_ship_goes_through_json() -> None:
    env = gymnasium.make(
        "shaftline/Frigate-v0", ship="ferry", task="transit", control_interval_s=1.0
    )
    assert env.spec is not None
    twin = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert np.array_equal(env.reset(seed=4)[0], twin.reset(seed=4)[0])
