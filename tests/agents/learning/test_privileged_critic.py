"""What the critic is told is what the ship meets, and the policy does not see it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from shaftline.agents.learning.privileged_critic import (
    AHEAD_S,
    EVERY_S,
    TOLD,
    PrivilegedCriticPolicy,
    told,
)
from shaftline.agents.policy.residual import ANSWERS
from shaftline.envs import CLASSIC, FrigateVectorEnv
from shaftline.envs.kernel import disturbance
from shaftline.plant.waves import field

SEEN = 9


def test_no_order_comes_after_the_last() -> None:
    env = FrigateVectorEnv(3, task="transit", max_episode_steps=60, **CLASSIC)
    env.reset(seed=2, options={"order_interval_s": 20.0})
    column = TOLD.index("next order")
    orders = env.batch.arrays.episodes["orders"].copy()
    assert told(env.batch)[:, column] == pytest.approx(orders[:, 1])
    for _ in range(45):
        env.step(np.tile([0.5, 0.1], (3, 1)))
    assert told(env.batch)[:, column] == pytest.approx(orders[:, 1])  # the second is the last


def test_the_critic_is_told_the_disturbance() -> None:
    env = FrigateVectorEnv(5, task="transit", sea={"hs_m": (1.0, 5.0), "tp_s": 9.0}, **CLASSIC)
    env.reset(seed=2, options={"order_interval_s": 20.0})
    rows = env.batch.arrays.episodes
    for step in range(60):
        if step in (0, 10, 59):
            table = told(env.batch)
            assert table.shape == (5, len(TOLD))
            assert table.dtype == np.float32
            time = 0.5 * step
            for i, row in enumerate(table):
                factor = disturbance(rows[i], time).resistance_factor
                later = disturbance(rows[i], time + 1e-4).resistance_factor
                rate = (later - factor) / 1e-4 / rows[i]["resistance_frequency"]
                mean, swing, swing_rate, spent, order, sea, *inflow = row.tolist()
                assert mean == pytest.approx(rows[i]["resistance_mean"])
                assert mean + swing == pytest.approx(factor, rel=1e-6)
                assert swing_rate == pytest.approx(rate, abs=1e-4)
                assert math.hypot(swing, swing_rate) == pytest.approx(0.1, rel=1e-5)
                assert spent == pytest.approx({0: 0.0, 10: 0.25, 59: 0.475}[step])
                coming = {0: 1, 10: 1, 59: 2}[step]
                assert order == pytest.approx(rows[i]["orders"][coming], rel=1e-6)
                height = 4.0 * math.sqrt(0.5 * np.sum(env.batch.arrays.seas["amplitude"][i] ** 2))
                assert sea == pytest.approx(height / 4.0, rel=1e-6)
                assert 1.0 <= height <= 5.0
                state, waves = env.batch.arrays.states[i], env.batch.arrays.seas[i]
                for ahead, told_inflow in zip(
                    np.arange(0.0, AHEAD_S + EVERY_S, EVERY_S), inflow, strict=True
                ):
                    where = state["position"] + ahead * state["ship_speed"]
                    assert told_inflow == pytest.approx(
                        field(waves, time + ahead, where)[0], abs=1e-5
                    )
            assert len({*table[:, 5].tolist()}) == 5
        env.step(np.tile([0.5, 0.1], (5, 1)))


@pytest.fixture(scope="module")
def policy() -> Any:
    torch.manual_seed(0)
    wide = spaces.Box(-np.inf, np.inf, (SEEN + len(TOLD),), np.float32)
    answers = spaces.Box(-1.0, 1.0, (len(ANSWERS),), np.float32)
    return PrivilegedCriticPolicy(wide, answers, lambda _: 1e-3, seen=SEEN, net_arch=[8, 6])


def test_the_policy_sees_the_features_and_the_critic_everything(policy: Any) -> None:
    rows = torch.randn(4, SEEN + len(TOLD))
    other = rows.clone()
    other[:, SEEN:] += 1.0
    for first, second, moves in ((rows, other, False), (rows, rows + 1.0, True)):
        same = torch.equal(
            policy._predict(first, deterministic=True), policy._predict(second, deterministic=True)
        )
        assert same is not moves
        assert not torch.equal(policy.predict_values(first), policy.predict_values(second))
    together = policy(rows, deterministic=True)
    assert torch.equal(together[0], policy._predict(rows, deterministic=True))
    assert torch.equal(together[1], policy.predict_values(rows))


def test_the_networks_are_as_the_recipe_has_them(policy: Any) -> None:
    def widths(layers: Any) -> list[tuple[int, int]]:
        return [(m.in_features, m.out_features) for m in layers if isinstance(m, torch.nn.Linear)]

    assert widths(policy.mlp_extractor.policy_net) == [(SEEN, 8), (8, 6)]
    assert widths(policy.mlp_extractor.value_net) == [(SEEN + len(TOLD), 8), (8, 6)]
    relu = PrivilegedCriticPolicy(
        policy.observation_space, policy.action_space, lambda _: 1e-3, seen=SEEN, net_arch=[4],
        activation_fn=torch.nn.ReLU,
    )  # fmt: skip
    assert isinstance(relu.mlp_extractor.policy_net[1], torch.nn.ReLU)
    spaces_of = (policy.observation_space, policy.action_space, lambda _: 1e-3)
    linear = PrivilegedCriticPolicy(*spaces_of, seen=SEEN, net_arch={"pi": [], "vf": [4]})
    assert linear.action_net.in_features == SEEN
    assert widths(linear.mlp_extractor.value_net) == [(SEEN + len(TOLD), 4)]
    rows = torch.randn(3, SEEN + len(TOLD))
    answers = linear(rows, deterministic=True)[0]
    assert torch.equal(answers, linear.action_net(rows[:, :SEEN]))
