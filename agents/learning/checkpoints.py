"""The folder of a training: a checkpoint after each evaluation, the curve, and at the end the policy.

Checkpoints are archives of numbers: a checkpoint from somebody else can be resumed and runs no code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from ...core.archives import packed, read_archive, unpacked, write_archive
from ...core.files import read_json, write_json
from ..policy.policy import Policy, load_policy


class Checkpoints:
    """A training's folder.

    Args:
        folder: of the training.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._note = folder / "curve.json"
        self.evaluations: list[dict[str, float]] = []
        if self._note.is_file():
            self.evaluations = read_json(self._note)

    def _at(self, kind: str) -> Path:
        return self.folder / "checkpoints" / f"{kind}-{len(self.evaluations):02d}"

    @property
    def model(self) -> Path:
        """Weights and optimiser after the last evaluation."""
        return self._at("model").with_suffix(".npz")

    @property
    def buffer(self) -> Path:
        """Replay buffer, where the algorithm has one."""
        return self._at("buffer").with_suffix(".npz")

    def _curve(self) -> dict[str, list[float]]:
        return {key: [row[key] for row in self.evaluations] for key in self.evaluations[0]}

    def add(self, row: dict[str, float]) -> None:
        """Add an evaluation; it counts once :meth:`keep` has written it."""
        self.evaluations.append(row)

    def keep(self, model: Any, policy: Policy) -> None:
        """Write the checkpoint, then the curve that says that it is there."""
        write_archive(self.model, packed(_state(model)))
        if isinstance(model, OffPolicyAlgorithm):
            write_archive(self.buffer, packed(_contents(model.replay_buffer)), compressed=False)
        policy.curve = self._curve()
        policy.save(self._at("policy").with_suffix(".npz"))
        write_json(self._note, self.evaluations)
        for old in set(self.buffer.parent.glob("buffer-*.npz")) - {self.buffer}:
            old.unlink()  # hundreds of megabytes each, and only the last is resumed from

    def resume(self, model: Any) -> None:
        """Bring a new model to its state after the last evaluation.

        Raises:
            ArchiveError: a checkpoint is missing, damaged, or larger than this training's can be.
        """
        state = unpacked(read_archive(self.model, _MODEL_BYTES))
        model.set_parameters(_as_tensors(state["parameters"], model.device), device=model.device)
        model.num_timesteps, model._n_updates = state["num_timesteps"], state["n_updates"]
        if isinstance(model, OffPolicyAlgorithm):
            own: Any = model
            if getattr(own, "log_ent_coef", None) is not None:  # learned, but not a parameter
                own.log_ent_coef.data.copy_(torch.as_tensor(state["log_ent_coef"]))
            replay: Any = model.replay_buffer
            room = sum(value.nbytes for value in _contents(replay).values() if _is_array(value))
            for name, value in unpacked(read_archive(self.buffer, 2.0 * room + 1e6)).items():
                setattr(replay, name, value)

    def finish(self) -> Path:
        """Write the last policy as that of the training: the best would be chosen after the fact."""
        policy = load_policy(self._at("policy").with_suffix(".npz"))
        path = self.folder / "policy.npz"
        policy.save(path)
        return path


_MODEL_BYTES = 2e9


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def _state(model: Any) -> dict[str, Any]:
    """Return all of a model that training changes, its replay buffer apart."""
    return {
        "parameters": model.get_parameters(),
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "log_ent_coef": getattr(model, "log_ent_coef", None),
    }


def _contents(replay: Any) -> dict[str, Any]:
    """Return the arrays of a replay buffer, and where it writes next."""
    arrays = {name: value for name, value in vars(replay).items() if _is_array(value)}
    return arrays | {"pos": replay.pos, "full": replay.full}


def _as_tensors(tree: Any, device: Any) -> Any:
    """Return a tree with its arrays as tensors."""
    if isinstance(tree, dict):
        return {key: _as_tensors(part, device) for key, part in tree.items()}
    if isinstance(tree, (list, tuple)):
        return type(tree)(_as_tensors(part, device) for part in tree)
    return torch.as_tensor(tree, device=device) if _is_array(tree) else tree
