"""The public API of the package; torch is imported for training only."""

from __future__ import annotations

import subprocess
import sys

import pytest

import shaftline.agents
from shaftline.agents.learning import recipe, training


def test_the_door_has_what_users_need() -> None:
    assert {
        "KPIS",
        "Evaluation",
        "Policy",
        "Setting",
        "evaluate",
        "load_controller",
        "load_policy",
        "read_recipe",
        "run_episodes",
        "summary",
        "train",
    } <= set(shaftline.agents.__all__)
    for name in shaftline.agents.__all__:
        assert getattr(shaftline.agents, name) is not None
    assert shaftline.agents.train is training.train
    assert shaftline.agents.read_recipe is recipe.read_recipe
    with pytest.raises(AttributeError, match=r"'shaftline\.agents' has no attribute 'sleep'"):
        shaftline.agents.sleep  # noqa: B018


def test_policies_sail_without_torch() -> None:
    lines = (
        "import sys",
        "from shaftline.agents import evaluate, load_policy",
        "from shaftline.envs import FrigateEnv",
        "policy = load_policy('rough-sea')",
        "policy.predict([0.1] * (policy.network.shape[0] // policy.frames))",
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True)
