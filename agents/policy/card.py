"""Model card of a policy, in the format of the Hugging Face Hub."""

from __future__ import annotations

from collections.abc import Mapping

import yaml

from ...envs.steering import environment_classes
from ...envs.tasks import get_task
from .policy import Policy

_KEYS = ("n_timesteps", "n_envs", "frame_stack")


def card(name: str, policy: Policy, returns: Mapping[str, Mapping[str, float]], notes: str) -> str:
    """Return the card as Markdown with a YAML head.

    Args:
        name: name of the policy.
        policy: policy to describe.
        returns: mean return by controller and by seas (``training``, ``held-out``); those of the policy
            under ``policy``.
        notes: how the returns were measured.
    """
    about = policy.about
    recipe, task = about["recipe"], get_task(about["recipe"]["task"])
    results = [
        {
            "task": {"type": "reinforcement-learning", "name": recipe["task"]},
            "dataset": {"type": "shaftline", "name": f"{recipe['task']}, {seas} seas"},
            "metrics": [{"type": "mean_return", "value": round(value, 1)}],
        }
        for seas, value in returns["policy"].items()
    ]
    head = {
        "library_name": "shaftline",
        "license": "mit",
        "tags": ["reinforcement-learning", "ship-propulsion", "gymnasium", recipe["algorithm"]],
        "model-index": [{"name": f"shaftline-{name}", "results": results}],
    }
    seas = list(returns["policy"])
    table = [
        "| | " + " | ".join(f"{one} seas" for one in seas) + " |",
        "|---" * (1 + len(seas)) + "|",
    ]
    table += [
        f"| {controller} | " + " | ".join(f"{row[one]:.1f}" for one in seas) + " |"
        for controller, row in returns.items()
    ]
    environment = environment_classes(task.steered).single.__name__
    origin = "It was trained from random weights, without a classic base controller."
    parts = []
    if policy.base_controller:
        parts.append(
            f"It adds to the commands of a classic controller, `{policy.base_controller}`, so compare "
            "its return with that of the controller."
        )
    if plans := recipe.get("plans", 0):
        parts.append(
            f"It imitated plans of {plans} episodes, optimised with known waves and resistance, before "
            "reinforcement learning."
        )
    sizes = ", ".join(f"{key} {recipe[key]:,}" for key in _KEYS)
    return f"""---
{yaml.safe_dump(head, sort_keys=False).rstrip()}
---
# {name}

A policy of [shaftline](https://pypi.org/project/shaftline/) for the task `{recipe["task"]}`: \
{task.description}. Ship: `{about["layout"]["ship"]}`; a command every {policy.interval_s:g} s. \
{" ".join(parts) or origin}

{recipe["algorithm"].upper()} of stable-baselines3, {sizes}, seed {about["seed"]}; the file contains \
the whole recipe.

## Mean returns (at most 600)

{chr(10).join(table)}

{notes}

## Use

```python
from shaftline.agents import load_policy
from shaftline.envs import {environment}

policy = load_policy("{name}")
env = {environment}(task="{recipe["task"]}", **policy.interface)
observation, info = env.reset(seed=1)
action, state = policy.predict(observation)
```

It is valid for the ship, the seas and the instruments of its training only. It is made for research on \
the simulated ship and has never been used on a real one.
"""
