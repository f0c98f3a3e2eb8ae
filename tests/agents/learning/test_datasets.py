"""Data sets for offline learning: what stands in them is what the environment did."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents import PolicyError, load_policy
from shaftline.agents.learning.datasets import FIRST_SEED, record

minari = pytest.importorskip("minari")


def loaded(folder: Path, quality: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    return minari.load_dataset(f"shaftline/storm/{quality}-v0")


def test_an_expert_s_episode_is_found_again_in_its_own_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The actions of each recorded episode, played in its own environment, give its rewards."""
    ticks: list[tuple[int, int]] = []
    name = record("storm", "expert", 3, tmp_path, seed=2, tick=lambda *done: ticks.append(done))
    assert name == "shaftline/storm/expert-v0"
    assert ticks[-1] == (3, 3)
    found = loaded(tmp_path, "expert", monkeypatch)
    assert found.total_episodes == 3
    policy = load_policy("storm")
    env = found.recover_environment()
    for k, episode in enumerate(found.iterate_episodes()):
        seed = FIRST_SEED + 2 * 3 + k
        observation, _ = env.reset(seed=seed)
        state = None
        for i, action in enumerate(episode.actions):
            assert np.array_equal(observation, episode.observations[i])
            expected, state = policy.predict(observation, state, np.array([i == 0]))
            assert action == pytest.approx(expected, abs=1e-6)
            observation, reward, terminated, truncated, _ = env.step(action)
            assert reward == episode.rewards[i]
            assert (terminated, truncated) == (episode.terminations[i], episode.truncations[i])
        assert len(episode.observations) == len(episode.actions) + 1
        assert truncated


def test_qualities_differ_by_their_share_of_random_actions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    returns = {}
    for quality in ("expert", "medium", "random"):
        record("storm", quality, 6, tmp_path)
        found = loaded(tmp_path, quality, monkeypatch)
        episodes = list(found.iterate_episodes())
        returns[quality] = float(np.mean([one.rewards.sum() for one in episodes]))
        actions = np.concatenate([one.actions for one in episodes])
        if quality == "random":
            assert np.abs(actions.mean(axis=0)).max() < 0.1
            assert actions.std(axis=0) == pytest.approx(1.0 / np.sqrt(3.0), rel=0.05)
    assert returns["expert"] > returns["medium"] > returns["random"]


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown quality 'best'; known: expert, medium, random"):
        record("storm", "best", 1, tmp_path)
    with pytest.raises(ValueError, match="episodes = 0: must be at least 1"):
        record("storm", "expert", 0, tmp_path)
    with pytest.raises(ValueError, match="recorded intervals"):
        record("storm", "expert", 10**9, tmp_path)
    with pytest.raises(
        PolicyError, match="trained for the task 'flank', the data set is of 'storm'"
    ):
        record("storm", "expert", 1, tmp_path, policy=load_policy("flank"))
    assert not list(tmp_path.iterdir())
    record("storm", "random", 1, tmp_path)
    with pytest.raises(ValueError, match="already exists: remove it, or choose another folder"):
        record("storm", "random", 1, tmp_path)
