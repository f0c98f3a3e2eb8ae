"""Plans of a known episode: their gradient is the environment's, and they gain what a law cannot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents.evaluation.clairvoyant import Clairvoyant, Plan
from shaftline.baselines.registry import make_controller
from shaftline.envs import CLASSIC, FrigateVectorEnv, Settings, get_task

TASK = get_task("rough-sea")
SETTINGS: dict[str, Any] = {"task": TASK, "max_episode_steps": 50}
SEED = 7
LAW = make_controller("va-pitch", TASK.load_ship(), 0.5)


@pytest.fixture(scope="module")
def episode() -> Clairvoyant:
    return Clairvoyant(Settings.of(SETTINGS), SEED)


@pytest.fixture(scope="module")
def begun(episode: Clairvoyant) -> Any:
    return episode.commands_of(LAW)


def test_the_episode_is_the_environment_s(episode: Clairvoyant, begun: Any) -> None:
    """What a controller is followed to do gives its rewards, in the environment of the same seed."""
    _, rewards, actions = episode.simulate(begun)
    env = FrigateVectorEnv(1, threads=1, sensor_noise=0.0, observer="none", **SETTINGS, **CLASSIC)
    env.reset(seed=SEED)
    for reward, action in zip(rewards, actions, strict=True):
        _, found, *_ = env.step(action[None])
        assert found[0] == pytest.approx(reward, abs=1e-9)


def test_the_gradient_is_that_of_the_sum_of_rewards(episode: Clairvoyant, begun: Any) -> None:
    """Within what the kinks of the absolute values allow; mostly far closer."""
    before, _, _ = episode.simulate(begun)
    slope = episode.gradient(begun, before)
    rng = np.random.default_rng(0)
    for _ in range(3):  # along directions, in which single kinks weigh little
        along = rng.standard_normal(begun.shape) * [1e-5, 1e-3]
        ends = [episode.simulate(begun + sign * along)[1].sum() for sign in (1.0, -1.0)]
        assert float((slope * along).sum()) == pytest.approx(0.5 * (ends[0] - ends[1]), rel=0.1)


def test_a_fixed_pitch_is_refused() -> None:
    fixed = TASK.load_ship().with_values(
        {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
    )
    with pytest.raises(ValueError, match="frigate-at-sea: a plan needs a controllable pitch"):
        Clairvoyant(Settings.of(SETTINGS | {"ship": fixed}), SEED)


def test_a_plan_gains_and_stays_within_bounds(episode: Clairvoyant, begun: Any) -> None:
    plan = episode.plan(LAW, rounds=25)
    _, before, _ = episode.simulate(begun)
    assert plan.rewards.sum() > 1.02 * before.sum()
    assert plan.rounds <= 30
    assert np.abs(plan.actions).max() <= 1.0
    assert plan.actions.shape == (episode.intervals, 2)
    again = Clairvoyant(Settings.of(SETTINGS), SEED).plan(LAW, rounds=25)
    assert np.array_equal(again.actions, plan.actions)


def test_an_order_is_not_known_before_it_is_given() -> None:
    """Two episodes that differ only in an order have the same commands until it is given."""

    def planned(second: float) -> Plan:
        task = TASK.model_copy(update={"order_interval_s": 12.0})
        episode = Clairvoyant(Settings.of(SETTINGS | {"task": task}), SEED)
        episode._first["episode"]["orders"][0, 1] = second
        return episode.plan(LAW, rounds=12)

    slow, fast = planned(4.5), planned(7.5)
    first = round(12.0 / 0.5)
    assert np.array_equal(slow.actions[:first], fast.actions[:first])
    assert np.mean(slow.actions[first:, 1]) < np.mean(fast.actions[first:, 1])
