"""A critic that is told more than the policy (Pinto et al. 2017), in training only.

A policy does not see the resistance of its episode, nor does a critic with the same eyes. Such a critic
takes a low torque for a sign of a light ship, and the policy learns to lower the torque instead of the
cost. Told the disturbance, the critic has no need of signs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor

from ...envs.batch import Batch
from ...envs.kernel import resistance_angle
from ..policy.pilot_adapter import FEATURES

TOLD = (
    "mean resistance", "swing", "rate of swing", "share of the order's time", "rms of the sea",
)  # fmt: skip
"""What the critic is told beside :data:`~shaftline.agents.policy.pilot_adapter.FEATURES`."""


def told(batch: Batch) -> NDArray[np.float32]:
    """Columns of :data:`TOLD`, shape (n, 5)."""
    episodes = batch.arrays.episodes
    time = batch.elapsed * batch.steps * batch.dt
    angle = resistance_angle(episodes, time)
    swing = episodes["resistance_swing"]
    spent = np.mod(time / episodes["order_interval"], 1.0)
    sea = np.sqrt(0.5 * np.sum(batch.arrays.seas["amplitude"] ** 2, axis=1))
    columns = (
        episodes["resistance_mean"],
        swing * np.sin(angle),
        swing * np.cos(angle),
        spent,
        sea,
    )
    return np.column_stack(columns).astype(np.float32)


class _Extractor(MlpExtractor):
    """Two networks; that of the policy sees the first columns only."""

    def __init__(self, features_dim: int, *arguments: Any, **options: Any) -> None:
        super().__init__(features_dim, *arguments, **options)
        first: Any = self.policy_net[0]
        narrow = torch.nn.Linear(len(FEATURES), first.out_features, device=first.weight.device)
        self.policy_net[0] = narrow

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Of the policy: what it sees."""
        return super().forward_actor(features[:, : len(FEATURES)])

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Of both."""
        return self.forward_actor(features), self.forward_critic(features)


class PrivilegedCriticPolicy(ActorCriticPolicy):
    """``MlpPolicy`` whose critic sees all columns and whose policy the first ones."""

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _Extractor(
            self.features_dim,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )
