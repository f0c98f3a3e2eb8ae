"""The card of a policy describes the policy and compares its returns."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from shaftline.agents import load_policy
from shaftline.agents.policy.card import card
from shaftline.agents.policy.policy import packaged_policies

RETURNS = {
    "policy": {"training": 401.23, "held-out": 380.0},
    "combinator": {"training": 333.0, "held-out": 310.55},
}


def head_and_text(name: str) -> tuple[dict[str, Any], str]:
    text = card(name, load_policy(name), RETURNS, "Forty-eight episodes.")
    _, head, rest = text.split("---\n", 2)
    return yaml.safe_load(head), rest


def test_the_head_is_what_the_hub_reads() -> None:
    head, _ = head_and_text("storm")
    assert head["library_name"] == "shaftline"
    assert "reinforcement-learning" in head["tags"]
    (model,) = head["model-index"]
    found = [(one["dataset"]["name"], one["metrics"][0]["value"]) for one in model["results"]]
    assert found == [("storm, training seas", 401.2), ("storm, held-out seas", 380.0)]


def test_the_text_tells_task_recipe_returns_and_use() -> None:
    _, text = head_and_text("storm")
    recipe = load_policy("storm").about["recipe"]
    assert f"n_timesteps {recipe['n_timesteps']:,}" in text
    assert "| combinator | 333.0 | 310.6 |" in text
    assert "Forty-eight episodes." in text
    assert 'env = FrigateEnv(task="storm", **policy.interface)' in text


@pytest.mark.parametrize("name", sorted(packaged_policies()))
def test_what_a_policy_was_learned_on_is_said(name: str) -> None:
    policy = load_policy(name)
    _, text = head_and_text(name)
    base = str(policy.interface["action_mode"]).partition(":")[2]
    assert (f"a classic controller, `{base}`" in text) == bool(base)
    plans = policy.about["recipe"].get("plans", 0)
    assert (f"imitated plans of {plans} episodes" in text) == (plans > 0)
    assert ("trained from random weights" in text) == (not base and not plans)


@pytest.mark.parametrize("name", sorted(packaged_policies()))
def test_every_packaged_policy_has_its_card(name: str) -> None:
    text = packaged_policies()[name].with_suffix(".md").read_text(encoding="utf-8")
    assert f"# {name}\n" in text
    assert f'load_policy("{name}")' in text
