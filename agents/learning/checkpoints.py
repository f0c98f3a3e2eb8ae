"""What a training has on disk: a checkpoint a leg, the curve, and in the end the policy.

Checkpoints are archives of numbers: one that comes from somebody else can be gone on from and runs no
code of theirs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecNormalize

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
        self.legs: list[dict[str, float]] = []
        if self._note.is_file():
            self.legs = read_json(self._note)

    def _at(self, kind: str) -> Path:
        return self.folder / "checkpoints" / f"{kind}-{len(self.legs):02d}"

    @property
    def model(self) -> Path:
        """Weights, optimiser and normalisation after the last whole leg."""
        return self._at("model").with_suffix(".npz")

    @property
    def buffer(self) -> Path:
        """Replay buffer, where the algorithm has one."""
        return self._at("buffer").with_suffix(".npz")

    def _curve(self) -> dict[str, list[float]]:
        return {key: [leg[key] for leg in self.legs] for key in self.legs[0]}

    def add(self, row: dict[str, float]) -> None:
        """A leg more; it counts once it is kept."""
        self.legs.append(row)

    def keep(self, model: Any, venv: VecNormalize, policy: Policy) -> None:
        """Write the checkpoint, then the curve that says that it is there."""
        write_archive(self.model, packed(_state(model, venv)))
        if isinstance(model, SAC):
            write_archive(self.buffer, packed(_contents(model.replay_buffer)), compressed=False)
        policy.curve = self._curve()
        policy.save(self._at("policy").with_suffix(".npz"))
        write_json(self._note, self.legs)
        for old in set(self.buffer.parent.glob("buffer-*.npz")) - {self.buffer}:
            old.unlink()  # hundreds of megabytes each, and only the last is gone on from

    def go_on(self, model: Any, venv: VecNormalize) -> None:
        """Bring a model that was built anew to where the last whole leg ended.

        Raises:
            ArchiveError: a checkpoint is missing, damaged, or larger than this training's can be.
        """
        state = unpacked(read_archive(self.model, _MODEL_BYTES))
        model.set_parameters(_as_tensors(state["parameters"], model.device), device=model.device)
        model.num_timesteps, model._n_updates = state["num_timesteps"], state["n_updates"]
        for name, rms in state["normaliser"].items():
            own: Any = getattr(venv, name)
            own.mean, own.var, own.count = rms["mean"], rms["var"], rms["count"]
        if isinstance(model, SAC):
            if model.log_ent_coef is not None:  # not among the parameters, though it is learned
                model.log_ent_coef.data.copy_(torch.as_tensor(state["log_ent_coef"]))
            replay: Any = model.replay_buffer
            room = sum(value.nbytes for value in _contents(replay).values() if _is_array(value))
            for name, value in unpacked(read_archive(self.buffer, 2.0 * room + 1e6)).items():
                setattr(replay, name, value)

    def finish(self) -> Path:
        """The last leg's policy as the training's: the best would be chosen after the fact."""
        policy = load_policy(self._at("policy").with_suffix(".npz"))
        path = self.folder / "policy.npz"
        policy.save(path)
        return path


_MODEL_BYTES = 2e9


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def _state(model: Any, venv: VecNormalize) -> dict[str, Any]:
    """All of a model that a leg changes, its replay buffer apart, and of the normalisation."""
    normaliser = {}
    for name in ("obs_rms", "ret_rms"):
        rms: Any = getattr(venv, name)
        normaliser[name] = {"mean": rms.mean, "var": rms.var, "count": rms.count}
    return {
        "parameters": model.get_parameters(),
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "log_ent_coef": getattr(model, "log_ent_coef", None),
        "normaliser": normaliser,
    }


def _contents(replay: Any) -> dict[str, Any]:
    """What a replay buffer holds, and where it writes next."""
    arrays = {name: value for name, value in vars(replay).items() if _is_array(value)}
    return arrays | {"pos": replay.pos, "full": replay.full}


def _as_tensors(tree: Any, device: Any) -> Any:
    """A tree with its arrays as tensors."""
    if isinstance(tree, dict):
        return {key: _as_tensors(part, device) for key, part in tree.items()}
    if isinstance(tree, (list, tuple)):
        return type(tree)(_as_tensors(part, device) for part in tree)
    return torch.as_tensor(tree, device=device) if _is_array(tree) else tree
