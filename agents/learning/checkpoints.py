"""What a training has on disk: a checkpoint a leg, the curve, and in the end the policy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecNormalize

from ...core.files import write_atomically, write_json
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
            self.legs = json.loads(self._note.read_text(encoding="utf-8"))

    def _at(self, kind: str) -> Path:
        return self.folder / "checkpoints" / f"{kind}-{len(self.legs):02d}"

    @property
    def model(self) -> Path:
        """Weights and optimiser after the last whole leg."""
        return self._at("model").with_suffix(".zip")

    @property
    def normaliser(self) -> Path:
        """Running mean and deviation of features and rewards."""
        return self._at("normaliser").with_suffix(".pkl")

    @property
    def buffer(self) -> Path:
        """Replay buffer, where the algorithm has one."""
        return self._at("buffer").with_suffix(".pkl")

    def _curve(self) -> dict[str, list[float]]:
        return {key: [leg[key] for leg in self.legs] for key in self.legs[0]}

    def add(self, row: dict[str, float]) -> None:
        """A leg more; it counts once it is kept."""
        self.legs.append(row)

    def keep(self, model: Any, venv: VecNormalize, policy: Policy) -> None:
        """Write the checkpoint, then the curve that says that it is there."""
        write_atomically(self.model, lambda file: model.save(file))
        write_atomically(self.normaliser, lambda file: venv.save(str(file)))
        if isinstance(model, SAC):
            write_atomically(self.buffer, lambda file: model.save_replay_buffer(file))
        policy.curve = self._curve()
        policy.save(self._at("policy").with_suffix(".npz"))
        write_json(self._note, self.legs)
        for old in set(self.buffer.parent.glob("buffer-*.pkl")) - {self.buffer}:
            old.unlink()  # hundreds of megabytes each, and only the last is gone on from

    def finish(self) -> Path:
        """The last leg's policy as the training's: the best would be chosen after the fact."""
        policy = load_policy(self._at("policy").with_suffix(".npz"))
        path = self.folder / "policy.npz"
        policy.save(path)
        return path
