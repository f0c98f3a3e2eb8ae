"""What a training leaves on disk after each evaluation, and at the end."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import SAC

from shaftline.agents import Policy, load_policy
from shaftline.agents.learning.checkpoints import Checkpoints
from shaftline.core.archives import read_archive, unpack_tree

from ..tiny import plain_policy


class Noted:
    """Stand for a model whose numbers are the number of its part of the training."""

    def __init__(self, part: int) -> None:
        self.num_timesteps, self._n_updates = part, part

    def get_parameters(self) -> dict[str, Any]:
        return {"policy": {"weight": torch.full((2, 2), float(self.num_timesteps))}}


class NotedSac(Noted, SAC):
    """The same with a replay buffer."""

    def __init__(self, part: int) -> None:
        Noted.__init__(self, part)
        self.replay_buffer = SimpleNamespace(rewards=np.full(3, part), pos=part, full=False)  # type: ignore[assignment]


@pytest.fixture
def policy() -> Policy:
    return plain_policy()


def kept(
    folder: Path, policy: Policy, *evaluations: tuple[float, float], model: Any = Noted
) -> Any:
    progress = Checkpoints(folder)
    for reward, failed in evaluations:
        count = len(progress.evaluations) + 1
        progress.evaluations.append({"reward": reward, "failed": failed})
        policy.about["made"] = count
        progress.keep(model(count), policy)
    return progress


def test_an_evaluation_is_kept_and_read_again(tmp_path: Path, policy: Policy) -> None:
    kept(tmp_path, policy, (-9.0, 0.0), (-7.0, 0.0))
    names = sorted(file.name for file in (tmp_path / "checkpoints").iterdir())
    assert names == [
        "model-01.npz",
        "model-02.npz",
        "policy-01.npz",
        "policy-02.npz",
    ]
    assert json.loads((tmp_path / "curve.json").read_text()) == [
        {"reward": -9.0, "failed": 0.0},
        {"reward": -7.0, "failed": 0.0},
    ]
    again = Checkpoints(tmp_path)
    assert len(again.evaluations) == 2
    assert (
        unpack_tree(read_archive(again.model))["parameters"]["policy"]["weight"].tolist()
        == [[2.0, 2.0]] * 2
    )
    assert load_policy(tmp_path / "checkpoints/policy-01.npz").curve == {
        "reward": [-9.0],
        "failed": [0.0],
    }
    assert again.folder == tmp_path


def test_a_training_that_has_not_begun_has_no_evaluations(tmp_path: Path) -> None:
    assert Checkpoints(tmp_path).evaluations == []


def test_the_last_policy_is_that_of_the_training_whatever_the_others_were(
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
    assert buffer.name == "buffer-02.npz"
    assert unpack_tree(read_archive(buffer))["rewards"].tolist() == [2, 2, 2]


def test_no_code_is_run_by_a_checkpoint(tmp_path: Path, policy: Policy) -> None:
    """One that was replaced by a pickle is refused and not unpickled."""
    progress = kept(tmp_path, policy, (-9.0, 0.0))
    mark = tmp_path / "mark"

    class Bomb:
        def __reduce__(self) -> Any:
            return (Path.touch, (mark,))

    progress.model.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(ValueError, match="not a NumPy archive of numbers"):
        progress.resume(Noted(1))
    np.savez(progress.model, np.array([Bomb()], dtype=object))
    with pytest.raises(ValueError, match="not a NumPy archive of numbers"):
        progress.resume(Noted(1))
    assert not mark.exists()
