"""What a training leaves on disk after each leg, and in the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from stable_baselines3 import SAC

from shaftline.agents import Policy, load_policy
from shaftline.agents.learning.checkpoints import Checkpoints

from ..tiny import plain_policy


class Noted:
    """Stands for a model or a normaliser: writes a word."""

    def __init__(self, word: str) -> None:
        self.word = word

    def save(self, file: Any) -> None:
        Path(file).write_text(self.word)


class NotedSac(SAC):
    """The same with a replay buffer."""

    def __init__(self, word: str) -> None:
        self.word = word

    def save(self, file: Any) -> None:  # type: ignore[override]
        Path(file).write_text(self.word)

    def save_replay_buffer(self, file: Any) -> None:
        Path(file).write_text("buffer " + self.word)


@pytest.fixture
def policy() -> Policy:
    return plain_policy()


def kept(folder: Path, policy: Policy, *legs: tuple[float, float], model: Any = Noted) -> Any:
    progress = Checkpoints(folder)
    for reward, failed in legs:
        count = len(progress.legs) + 1
        progress.add({"reward": reward, "failed": failed})
        policy.about["made"] = count
        venv: Any = Noted(f"normaliser {count}")
        progress.keep(model(f"model {count}"), venv, policy)
    return progress


def test_a_leg_is_kept_and_found_again(tmp_path: Path, policy: Policy) -> None:
    kept(tmp_path, policy, (-9.0, 0.0), (-7.0, 0.0))
    names = sorted(file.name for file in (tmp_path / "checkpoints").iterdir())
    assert names == [
        "model-01.zip", "model-02.zip", "normaliser-01.pkl", "normaliser-02.pkl", "policy-01.npz",
        "policy-02.npz",
    ]  # fmt: skip
    assert json.loads((tmp_path / "curve.json").read_text()) == [
        {"reward": -9.0, "failed": 0.0}, {"reward": -7.0, "failed": 0.0},
    ]  # fmt: skip
    again = Checkpoints(tmp_path)
    assert len(again.legs) == 2
    assert again.model.read_text() == "model 2"
    assert again.normaliser.read_text() == "normaliser 2"
    assert load_policy(tmp_path / "checkpoints/policy-01.npz").curve == {
        "reward": [-9.0], "failed": [0.0],
    }  # fmt: skip
    assert again.folder == tmp_path


def test_a_training_that_has_not_begun_has_no_legs(tmp_path: Path) -> None:
    assert Checkpoints(tmp_path).legs == []


def test_the_last_leg_is_the_trainings_whatever_the_others_were(
    tmp_path: Path, policy: Policy
) -> None:
    path = kept(tmp_path, policy, (-9.0, 0.0), (-7.0, 0.0), (-8.0, 0.1)).finish()
    assert path == tmp_path / "policy.npz"
    found = load_policy(path)
    assert found.about["made"] == 3
    assert found.curve["reward"] == [-9.0, -7.0, -8.0]


def test_only_the_last_replay_buffer_is_kept(tmp_path: Path, policy: Policy) -> None:
    progress = kept(tmp_path, policy, (-9.0, 0.0), (-8.0, 0.0), model=NotedSac)
    (buffer,) = (tmp_path / "checkpoints").glob("buffer-*")
    assert buffer == progress.buffer
    assert buffer.name == "buffer-02.pkl"
    assert buffer.read_text() == "buffer model 2"
