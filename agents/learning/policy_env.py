"""Environments as a policy in training sees and commands them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnvWrapper

from ...envs.sb3 import Sb3Frigates
from ..policy.residual import ANSWERS, Form, Residual
from .privileged_critic import TOLD, told


class PolicyEnv(VecEnvWrapper):
    """Environments as a policy sees and commands them: features in, answers out."""

    def __init__(self, venv: Sb3Frigates, form: Form, telling: bool) -> None:
        self.batch = batch = venv.vector.batch
        self.adapter = Residual(batch.ship, batch.interval_s, form)
        self._telling = telling
        width = len(form.features) + telling * len(TOLD)
        unbounded = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        super().__init__(venv, unbounded, spaces.Box(-1.0, 1.0, (len(ANSWERS),), np.float32))
        self.memory: Any = None
        self._seen: Any = None
        self._told: Any = np.zeros((venv.num_envs, 0), np.float32)
        self.acting_s = 0.0  # spent in the environments

    def reset(self) -> Any:
        """Begin everywhere, each at another time of its episode.

        Episodes that run in step would show an update only their beginnings, and the next their ends.
        """
        self._seen = self.venv.reset()
        features, self.memory = self.adapter.see(self._seen)
        share = np.arange(self.num_envs) / self.num_envs
        intervals = self.batch.settings.max_episode_steps or 0
        self.batch.elapsed[:] = (share * intervals).astype(np.int64)
        return self._with_told(features)

    def step_async(self, actions: Any) -> None:
        """Take the answers in."""
        begin = time.perf_counter()
        self.venv.step_async(self.adapter.command(actions, self._seen, self.memory))
        self.acting_s += time.perf_counter() - begin

    def step_wait(self) -> Any:
        """Hold the commands over one control interval."""
        begin = time.perf_counter()
        observation, reward, done, infos = self.venv.step_wait()
        ended = np.flatnonzero(done)
        if len(ended):
            last = np.stack([infos[i]["terminal_observation"] for i in ended])
            seen, _ = self.adapter.see(last, self.memory[ended])
            for i, row in zip(ended, self._with_told(seen, self._told[ended]), strict=True):
                infos[i]["terminal_observation"] = row
        features, self.memory = self.adapter.see(observation, self.memory, done)
        self._seen = observation
        told_too = self._with_told(features)
        self.acting_s += time.perf_counter() - begin
        return told_too, reward, done, infos

    def _with_told(self, features: Any, columns: Any = None) -> Any:
        """Features, and what the critic is told: of now, or columns of an episode that has ended."""
        if not self._telling:
            return features
        if columns is None:
            columns = self._told = told(self.batch)
        return np.hstack([features, columns])
