"""A critic that is told more than the policy (Pinto et al. 2017), in training only.

A policy does not see the resistance of its episode nor the waves and the order that are about to come,
nor does a critic with the same eyes: what a wave or a new order costs then looks like chance, and a low
torque like the sign of a light ship. Told them, the critic takes all that out of what the policy learns
from.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor

from ...envs.batch import Batch
from ...envs.kernel import resistance_angle, waves_ahead
from ...envs.records import MAX_ORDERS
from ...envs.settings import LARGEST_EPISODE

AHEAD_S, EVERY_S = 8.0, 1.0
"""How far ahead the critic is told the waves, about one of them, and how often [s]."""

_COUNT = round(AHEAD_S / EVERY_S) + 1
TOLD = (
    "mean resistance", "swing", "rate of swing", "share of the order's time", "next order",
    "rms of the sea",
    *(f"inflow in {k * EVERY_S:g} s" for k in range(_COUNT)),
)  # fmt: skip
"""What the critic is told beside what the policy sees."""


def told(batch: Batch) -> NDArray[np.float32]:
    """Columns of :data:`TOLD`, shape (n, 15)."""
    episodes = batch.arrays.episodes
    time = batch.elapsed * batch.steps * batch.dt
    angle = resistance_angle(episodes, time)
    swing = episodes["resistance_swing"]
    interval = episodes["order_interval"]
    now = np.floor(time / interval)
    steps = batch.settings.max_episode_steps or LARGEST_EPISODE
    follows = (now + 1.0) * interval < steps * batch.interval_s  # else this order is the last
    coming = np.minimum(now + follows, MAX_ORDERS - 1).astype(np.int64)
    following = episodes["orders"][np.arange(batch.n), coming]
    sea = np.sqrt(0.5 * np.sum(batch.arrays.seas["amplitude"] ** 2, axis=1))
    columns = (
        episodes["resistance_mean"],
        swing * np.sin(angle),
        swing * np.cos(angle),
        time / interval - now,
        following,
        sea,
    )
    inflow = np.empty((batch.n, _COUNT))
    waves_ahead(batch.environments, time.astype(np.float64), EVERY_S, inflow)
    return np.column_stack([*columns, inflow]).astype(np.float32)


class _Extractor(MlpExtractor):
    """Two networks; that of the policy sees the first ``seen`` columns only."""

    def __init__(self, features_dim: int, seen: int, *arguments: Any, **options: Any) -> None:
        super().__init__(features_dim, *arguments, **options)
        self._seen = seen
        if not len(self.policy_net):  # a policy that is linear in what it sees
            self.latent_dim_pi = seen
            return
        first: Any = self.policy_net[0]
        self.policy_net[0] = torch.nn.Linear(seen, first.out_features, device=first.weight.device)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Of the policy: what it sees."""
        return super().forward_actor(features[:, : self._seen])

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Of both."""
        return self.forward_actor(features), self.forward_critic(features)


class PrivilegedCriticPolicy(ActorCriticPolicy):
    """``MlpPolicy`` whose critic sees all columns and whose policy the first ones.

    Args:
        arguments: of ``ActorCriticPolicy``.
        seen: columns that the policy sees.
        options: of ``ActorCriticPolicy``.
    """

    def __init__(self, *arguments: Any, seen: int, **options: Any) -> None:
        self._seen = seen
        super().__init__(*arguments, **options)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _Extractor(
            self.features_dim,
            self._seen,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )
