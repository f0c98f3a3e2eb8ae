"""Folder of a training: a checkpoint after each evaluation, the curve, and at the end the policy.

Checkpoints are archives of numbers, so resuming from a checkpoint of another person runs no code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from ...core.archives import pack_tree, read_archive, unpack_tree, write_archive
from ...core.files import read_json, write_json
from ..policy.policy import Policy, load_policy


class Checkpoints:
    """Checkpoints of a training in its folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._note = folder, folder / "curve.json"
        self.evaluations: list[dict[str, float]] = []
        if self._note.is_file():
            self.evaluations = read_json(self._note)

    def _at(self, kind: str) -> Path:
        return self.folder / "checkpoints" / f"{kind}-{len(self.evaluations):02d}.npz"

    @property
    def model(self) -> Path:
        """File of weights and optimiser state after the last evaluation."""
        return self._at("model")

    @property
    def buffer(self) -> Path:
        """File of the replay buffer, where the algorithm has one."""
        return self._at("buffer")

    def keep(self, model: Any, policy: Policy) -> None:
        """Write the checkpoint, and then the curve, which marks the checkpoint as complete."""
        write_archive(self.model, pack_tree(_state(model)))
        if isinstance(model, OffPolicyAlgorithm):
            write_archive(self.buffer, pack_tree(_contents(model.replay_buffer)), compressed=False)
        rows = self.evaluations
        policy.curve = {key: [row[key] for row in rows] for key in rows[0]}
        policy.save(self._at("policy"))
        write_json(self._note, self.evaluations)
        for old in set(self.buffer.parent.glob("buffer-*.npz")) - {self.buffer}:
            old.unlink()  # Only the last one is needed, and each takes hundreds of megabytes.

    def resume(self, model: Any) -> None:
        """Set a new model of stable-baselines3 to its state after the last evaluation.

        Raises:
            ArchiveError: a checkpoint is missing, damaged, or larger than one of this training can be.
        """
        state = unpack_tree(read_archive(self.model, _MODEL_BYTES))
        model.set_parameters(_as_tensors(state["parameters"], model.device), device=model.device)
        model.num_timesteps, model._n_updates = state["num_timesteps"], state["n_updates"]
        if isinstance(model, OffPolicyAlgorithm):
            own: Any = model
            # This coefficient is learned, but not among the parameters.
            if getattr(own, "log_ent_coef", None) is not None:
                own.log_ent_coef.data.copy_(torch.as_tensor(state["log_ent_coef"]))
            replay: Any = model.replay_buffer
            size = sum(value.nbytes for value in _contents(replay).values() if _is_array(value))
            for name, value in unpack_tree(read_archive(self.buffer, 2.0 * size + 1e6)).items():
                setattr(replay, name, value)

    def finish(self) -> Path:
        """Write the last policy as that of the training; choosing the best would bias its evaluation."""
        path = self.folder / "policy.npz"
        load_policy(self._at("policy")).save(path)
        return path


_MODEL_BYTES = 2e9


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def _state(model: Any) -> dict[str, Any]:
    """Return all of a model that training changes, without its replay buffer."""
    return {
        "parameters": model.get_parameters(),
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "log_ent_coef": getattr(model, "log_ent_coef", None),
    }


def _contents(replay: Any) -> dict[str, Any]:
    """Return the arrays of a replay buffer and its write position."""
    arrays = {name: value for name, value in vars(replay).items() if _is_array(value)}
    return arrays | {"pos": replay.pos, "full": replay.full}


def _as_tensors(tree: Any, device: Any) -> Any:
    """Return a tree with its arrays as tensors."""
    if isinstance(tree, dict):
        return {key: _as_tensors(part, device) for key, part in tree.items()}
    if isinstance(tree, (list, tuple)):
        return type(tree)(_as_tensors(part, device) for part in tree)
    return torch.as_tensor(tree, device=device) if _is_array(tree) else tree
