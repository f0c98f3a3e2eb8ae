"""Bounds of observations and actions; actions that are clipped, and those that are refused."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from shaftline.envs import FrigateEnv
from shaftline.plant.signals import get_signal

from .plans import SHORT


def test_bounds_are_three_normalised_and_those_of_the_signals_in_units() -> None:
    normalised = FrigateEnv().observation_space
    assert isinstance(normalised, gymnasium.spaces.Box)
    assert (set(normalised.low.tolist()), set(normalised.high.tolist())) == ({-3.0}, {3.0})
    env = FrigateEnv(normalised=False)
    space = env.observation_space
    assert isinstance(space, gymnasium.spaces.Box)
    for i, name in enumerate(env.batch.observed):
        assert space.high[i] == np.float32(get_signal(name).high)
        assert space.low[i] == np.float32(get_signal(name).low)
    action = FrigateEnv().action_space
    assert isinstance(action, gymnasium.spaces.Box)
    assert (action.low.tolist(), action.high.tolist()) == ([-1.0, -1.0], [1.0, 1.0])


def test_actions_beyond_the_box_are_clipped() -> None:
    runs = []
    for action in ([1.0, -1.0], [1.7, -30.0], [1e300, -1e300], [10**30, -(2**70)]):
        env = FrigateEnv(**SHORT)
        env.reset(seed=2)
        runs.append(env.step(action)[0])
    assert all(np.array_equal(runs[0], run) for run in runs[1:])


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ([np.nan, 0.0], "must be finite"),
        ([0.0, np.inf], "must be finite"),
        ([0.0], r"action has shape \(1,\); expected is shape \(2,\)"),
        ("ahead", r"action 'ahead': must be finite numbers of shape \(2,\)"),
        ([10**400, 0], r"must be finite numbers of shape \(2,\)"),
        ([[0.0], [0.0, 0.0]], r"must be finite numbers of shape \(2,\)"),
        ([0.5j, 0.0], r"must be finite numbers of shape \(2,\)"),
        (None, r"action has shape \(\); expected is shape \(2,\)"),
        ([[0.0, 0.0]], r"shape \(1, 2\); expected is shape \(2,\)"),
    ],
)
def test_unusable_actions_are_refused(bad: list[Any], words: str) -> None:
    env = FrigateEnv()
    env.reset(seed=0)
    before = env.batch.arrays.states.copy()
    with pytest.raises(ValueError, match=words):
        env.step(bad)
    assert np.array_equal(env.batch.arrays.states, before)
