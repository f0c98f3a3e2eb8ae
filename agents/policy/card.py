"""The card of a policy: what it is, for what, and how it compares, as Hugging Face's hub reads it."""

from __future__ import annotations

from collections.abc import Mapping

import yaml

from ...envs.steering import kinds
from ...envs.tasks import get_task
from .policy import Policy

_KEYS = ("n_timesteps", "n_envs", "frame_stack")


def card(name: str, policy: Policy, returns: Mapping[str, Mapping[str, float]], notes: str) -> str:
    """Return the card as Markdown with a YAML head.

    Args:
        name: of the policy.
        policy: that the card tells of.
        returns: mean return by controller and by seas (``training``, ``held-out``); the policy's own
            under ``policy``.
        notes: how the returns were measured.
    """
    about = policy.about
    recipe, task = about["recipe"], get_task(about["recipe"]["task"])
    head = {
        "library_name": "shaftline",
        "license": "mit",
        "tags": ["reinforcement-learning", "ship-propulsion", "gymnasium", recipe["algorithm"]],
        "model-index": [
            {
                "name": f"shaftline-{name}",
                "results": [
                    {
                        "task": {"type": "reinforcement-learning", "name": recipe["task"]},
                        "dataset": {"type": "shaftline", "name": f"{recipe['task']}, {seas} seas"},
                        "metrics": [{"type": "mean_return", "value": round(value, 1)}],
                    }
                    for seas, value in returns["policy"].items()
                ],
            }
        ],
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
    environment = kinds(task.steered).single.__name__
    mode = str(policy.interface.get("action_mode"))
    base = mode.partition(":")[2]
    plans = recipe.get("plans", 0)
    began = []
    if base:
        began.append(
            f"It adds to the commands of a classic controller, `{base}`, so its worth is what stands "
            "above that row."
        )
    if plans:
        began.append(
            f"It imitated plans of {plans} episodes, made with waves and resistance known, before it "
            "learned on."
        )
    if not began:
        began.append("It was learned from nothing, with no classic controller underneath.")
    return "\n".join(
        [
            "---",
            yaml.safe_dump(head, sort_keys=False).rstrip(),
            "---",
            f"# {name}",
            "",
            f"A policy of [shaftline](https://pypi.org/project/shaftline/) for the task "
            f"`{recipe['task']}`: {task.description}. Ship: `{about['layout']['ship']}`; a command "
            f"every {policy.interval_s:g} s. {' '.join(began)}",
            "",
            f"{recipe['algorithm'].upper()} of stable-baselines3, "
            + ", ".join(f"{key} {recipe[key]:,}" for key in _KEYS)
            + f", seed {about['seed']}; the whole recipe stands in the file.",
            "",
            "## Mean returns (600 at the most)",
            "",
            *table,
            "",
            notes,
            "",
            "## Use",
            "",
            "```python",
            "from shaftline.agents import load_policy",
            f"from shaftline.envs import {environment}",
            "",
            f'policy = load_policy("{name}")',
            f'env = {environment}(task="{recipe["task"]}", **policy.interface)',
            "observation, info = env.reset(seed=1)",
            "action, state = policy.predict(observation)",
            "```",
            "",
            "It knows the ship, the seas and the instruments of its training alone. It is made for "
            "research on the simulated ship and has never been on a real one.",
            "",
        ]
    )
