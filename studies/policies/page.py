"""The page of the comparison, its tables and figures, and a model card a policy that is packaged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...core.files import write_text
from ...display import figures as drawing
from ...display.tables import markdown, write_csv
from ...envs.tasks import HELD_OUT, get_task
from . import figures, targets
from .bound import length_of
from .comparison import (
    FIRST_SEED,
    HELD,
    MEANINGS,
    OBSERVER,
    POLICY,
    SHOWN,
    TUNED,
    Comparison,
    Difference,
)

COMMAND = "python -m shaftline.studies.policies --trained out/policies --out docs/results/policies"

INTRODUCTION = f"""\
Policies sail beside classic controllers through seas that training never draws: higher and longer,
shorter and steeper, or from the side of the bow. Equal seeds (from {FIRST_SEED:,}) meet equal seas,
orders and resistances; observer `{OBSERVER}`, usual noise. A recipe is judged, not one policy: figures
are means over all its trainings and episodes, with 95 % bootstrap intervals over both. Of each training
the last state counts, and nothing was chosen among trainings. `{HELD}` is the combinator with its lever
trimmed to the ordered speed: the plain one sails slower in waves than is ordered, which alone calms the
shaft. `{TUNED}` is what the policy is added to: a classic law whose constants `shaftline tune` has
searched on the training's seas. The reward that is shown is the one that was trained."""

_BOUND = f"""\
The clairvoyant plan knows the waves and the resistance that come, and chooses all commands of an order
together ([how](../../evaluate.md#the-bound)). *Share*: of the gap in the task's reward between `{HELD}`
and the plan. The policy is that of the first training. Episodes of"""

_WORTH = (
    "reward",
    "wave_torque_kN_m",
    "wave_engine_torque_kN_m",
    "outside_bucket_s",
    "fuel_kg_nmi",
)

_CARD = """\
For simulation: a baseline to compare with and a start for one's own training, on ship and task above.
It is not for a real ship: nothing about its stability is proven, and beyond the speeds, seas and
resistances of its task its behaviour is unknown. Of protections of the engine it has the speed pilot's
limiters alone. It refuses a ship with other ranges of pitch, rack or engine speed, and another form of
policy."""

FILM = "film.gif"
FILM_WORDS = (
    "The same sea, 6.4 m high, at two and a half times its pace: on the left the combinator, on the "
    "right a policy. The ship surges only, so she is drawn level."
)


def write(
    folder: Path, comparisons: Sequence[Comparison], bounds: Mapping[str, pd.DataFrame]
) -> None:
    """Write ``policies.md``, its tables and its figures."""
    found = [one for comparison in comparisons for one in comparison.differences]
    write_csv(folder, "policies", pd.concat([one.table for one in comparisons]))
    write_csv(folder, "differences", pd.DataFrame(found, columns=list(Difference._fields)))
    drawing.save(figures.changes(comparisons), folder / "changes.png")
    drawing.save(figures.curves(comparisons), folder / "curves.png")
    for one in comparisons:
        drawing.save(figures.traces(one), folder / f"{one.task}.png")
    for task, table in bounds.items():
        write_csv(folder, f"bound-{task}", table)
    asked = targets.rows(found)
    parts = ["# Learned policies", f"Made by `{COMMAND}`.", INTRODUCTION]
    if asked:
        parts += ["## What was asked for", markdown(pd.DataFrame(asked))]
    parts += ["![Changes](changes.png)"]
    if (folder / FILM).is_file():
        parts += [FILM_WORDS, f"![Film]({FILM})"]
    for one in comparisons:
        parts += _task(one, bounds.get(one.task))
    parts += ["## While they were trained", "![Curves](curves.png)", "## Columns"]
    parts.append("\n".join(f"- `{name}`: {words}" for name, words in MEANINGS.items()))
    write_text(folder / "policies.md", "\n\n".join(parts) + "\n")


def _task(one: Comparison, bound: pd.DataFrame | None) -> list[str]:
    parts = [
        f"## {one.task}",
        f"{get_task(one.task).description[0].upper()}{get_task(one.task).description[1:]}. "
        f"{len(one.policies)} trainings, {one.seeds} episodes of {one.episode_s:g} s each. "
        f"{TUNED[0].upper()}{TUNED[1:]}: `{one.policies[0].adapter.form.base}`.",
        _added(one),
        markdown(_shown(one.table)),
    ]
    if bound is not None:
        columns = ["controller", "share", "reward", "wave_torque_kN_m", "wave_engine_torque_kN_m",
                   "power_peak_kW", "wave_attack_deg", "outside_bucket_s", "limit_s", "rise_s",
                   "speed_mean_m_s", "fuel_kg_nmi"]  # fmt: skip
        parts += [f"{_BOUND} {length_of(one.task):g} s.", markdown(bound[columns])]
    return [*parts, f"![{one.task}]({one.task}.png)"]


def _added(one: Comparison) -> str:
    """What the learned part is worth, in words."""
    said = [
        f"`{d.quantity}` {d.percent:+.1f} % ({d.percent_low:+.1f} to {d.percent_high:+.1f})"
        for d in one.differences
        if d.baseline == TUNED and d.quantity in _WORTH and np.isfinite(d.percent)
    ]
    return f"What learning adds to the {TUNED} (the reward is a cost): {', '.join(said)}."


def _shown(table: pd.DataFrame) -> pd.DataFrame:
    """Controllers as columns, quantities as rows, with intervals."""
    rows: list[dict[str, Any]] = []
    for name in SHOWN:
        row = {"": f"`{name}`"}
        for _, one in table.iterrows():
            text = f"{one[name]:.4g}"
            if one["controller"] == POLICY:
                text += f" ({one[f'{name}_low']:.4g} to {one[f'{name}_high']:.4g})"
            row[one["controller"]] = text
        rows.append(row)
    return pd.DataFrame(rows)


def card(one: Comparison, source: Path) -> str:
    """The model card of a packaged policy, in Markdown."""
    policy = one.policies[one.sources.index(source)]
    about = policy.about
    recipe = about["recipe"]
    seconds = policy.curve["seconds"][-1]
    lines = {
        "task": f"{one.task}: {get_task(one.task).description}", "ship": about["ship_source"],
        "algorithm": f"{recipe['algorithm'].upper()} of stable-baselines3, "
                     f"{policy.curve['steps'][-1]:,.0f} control intervals in {seconds:.0f} s",
        "seed": about["seed"], "commit": about.get("commit") or "not recorded",
        "torch": about.get("torch", "not recorded"),
    }  # fmt: skip
    listed = "\n".join(f"- {key}: {value}" for key, value in lines.items())
    goals = ", ".join(get_task(one.task).goals.used)
    command = (
        f"shaftline train --task {one.task} --algorithm {recipe['algorithm']} --seed "
        f"{about['seed']} --out out/{one.task}"
    )
    told = ("weights", "task", "algorithm")
    rows = "\n".join(f"- `{key}`: {value}" for key, value in recipe.items() if key not in told)
    return "\n\n".join(
        [
            f"# Policy `{one.task}`", listed, f"```\n{command}\n```",
            f"Goals of the reward: {goals}.",
            f"Recipe:\n\n{rows}",
            f"## On the held-out seas (`{one.task}:{HELD_OUT}`)",
            f"The recipe's {len(one.policies)} trainings, of which this is one; "
            f"{one.seeds} episodes of {one.episode_s:g} s.",
            markdown(_shown(one.table)), "## Use and limits", _CARD,
        ]
    ) + "\n"  # fmt: skip
