"""What a policy was trained with, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...envs.tasks import Task, get_task
from .comparison import OBSERVER, Comparison


def resistance(task: Task) -> str:
    """Mean rises of the resistance and its swing."""
    low, high = task.resistance_rise
    return f"mean resistance {low:+g} to {high:+g} of calm water's, swing {task.resistance_swing:g}"


def trained_in(recipe: Mapping[str, Any]) -> str:
    """Seas and resistances that a recipe's training draws from."""
    task = get_task(recipe["task"])
    seas = recipe.get("env_kwargs", {}).get("sea") or list(task.seas)
    drawn = [_sea(sea) for sea in (seas if isinstance(seas, list) else [seas])]
    return f"{', '.join(drawn)}; {resistance(task)}"


def _sea(sea: Any) -> str:
    """A preset's name, or the ranges of a sea's parameters."""
    if not isinstance(sea, Mapping):
        return str(sea)
    parts = []
    for name, value in sea.items():
        ends = value if isinstance(value, Sequence) else [value]
        parts.append(f"`{name}` {' to '.join(f'{end:g}' for end in ends)}")
    return "seas of " + " and ".join(parts)


def training(one: Comparison) -> str:
    """Everything that is known of a policy's training, with the command, in Markdown."""
    about = one.policy.about
    recipe: dict[str, Any] = about["recipe"]
    env = recipe.get("env_kwargs", {})
    task = get_task(recipe["task"])
    weights = task.weights.model_dump() | recipe.get("weights", {})
    low, high = task.speed_order_m_s
    lines = {
        "algorithm": recipe["algorithm"].upper() + " of stable-baselines3",
        "task": recipe["task"],
        "ship": about["ship_source"],
        "sea and resistance": trained_in(recipe),
        "orders": f"{low:g} to {high:g} m/s, anew every {task.order_interval_s:g} s",
        "instrument noise": f"{env.get('sensor_noise', 1.0)} of the usual",
        "observer": env.get("observer", OBSERVER),
        "weights of the reward": ", ".join(f"`{name}` {w:g}" for name, w in weights.items()),
        "seed": about["seed"],
        "commit": about.get("commit") or "not recorded",
        "torch": about.get("torch", "not recorded"),
    }
    curve = one.policy.curve
    if curve:
        leg = int(about.get("leg", len(curve["steps"])))
        share = curve["environment_share"][-1]
        lines["control intervals"] = (
            f"{curve['steps'][-1]:,.0f}; kept is leg {leg} of {len(curve['steps'])}, after "
            f"{curve['steps'][leg - 1]:,.0f}"
        )
        lines["time"] = (
            f"{seconds(curve['seconds']) / 60.0:.0f} min, {100.0 * share:.0f} % of it in the "
            "environments"
        )
    listed = "\n".join(f"- {key}: {value}" for key, value in lines.items())
    told = ("env_kwargs", "weights", "task", "algorithm")
    rows = "\n".join(f"- `{key}`: {value}" for key, value in recipe.items() if key not in told)
    return f"{listed}\n\n```\n{command(one)}\n```\n\nRecipe:\n\n{rows}"


def command(one: Comparison) -> str:
    """That trains a policy again."""
    about = one.policy.about
    recipe = about["recipe"]
    return (
        f"shaftline train --task {recipe['task']} --algorithm {recipe['algorithm']} "
        f"--seed {about['seed']} --out out/{recipe['task']}"
    )


def reproduce(comparisons: Sequence[Comparison], compared: str) -> str:
    """All commands behind a page, in order, with the time that each training took."""
    lines = []
    for one in comparisons:
        curve = one.policy.curve
        took = f"  # {seconds(curve['seconds']) / 60.0:.0f} min" if curve else ""
        lines.append(command(one) + took)
    return "```\n" + "\n".join([*lines, compared]) + "\n```"


def seconds(clock: Sequence[float]) -> float:
    """All seconds of a training; the clock begins anew where one was interrupted."""
    before = [0.0, *clock[:-1]]
    return sum(b - a if b >= a else b for a, b in zip(before, clock, strict=True))
