"""Write the programme of a planned trial: table, figure and data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...core.files import FileError, read_json, write_atomically, write_json
from ...display.figures import PALETTE, new_figure, save
from ...plant.columns import RUDDER_COMMAND, TIME
from ...plant.ship import Ship
from ...plant.ship_files import load_ship
from ..planning.evidence import Noise
from ..planning.manoeuvres import INTERVAL_S, PlanError
from ..planning.plan import DECIDED, TrialPlan
from .data import replace_non_finite
from .index import SHIP

TABLE, DATA, FIGURE = "plan.csv", "plan.json", "plan.png"
"""File names of the commands, the expected evidence and the picture."""

CORRECTED = "corrected ship"
"""Name of the model that a diagnosis reports."""

MOST_SAID = 10
"""Number of pairs of models up to which each has its own sentence."""


class Question(NamedTuple):
    """What a diagnosis left open: the arguments of :func:`.planning.plan.plan_trial`."""

    models: dict[str, Ship]
    noise: dict[str, Noise]
    uncertain: dict[str, float]
    text: str  # in words, a sentence


def read_question(report: str | Path) -> Question:
    """Return what the diagnosis of a report left open.

    These are its alternatives, and the effects that the recording may hide, each at its detection limit;
    or else the parameters of the effects that it identified.

    Args:
        report: ``report.json`` in the folder of the results.

    Raises:
        PlanError: the file is no report of a diagnosis, or the diagnosis left nothing open.
    """
    report = Path(report)
    try:
        content = read_json(report)
    except FileError as error:
        raise PlanError(f"{report}: is no report.json of `shaftline diagnose` ({error})") from None
    if not isinstance(content, dict) or not {"alternatives", "hidden", "noise"} <= set(content):
        raise PlanError(
            f"{report}: is no report.json of `shaftline diagnose` of this version; diagnose again"
        )
    uncertain = {
        one["key"]: float(one["se"])
        for effect in content["effects"]
        for one in effect["parameters"].values()
        if one["ci95"] and one["se"]
    }
    others = {**content["alternatives"], **content["hidden"]}
    if not others and not uncertain:
        raise PlanError(
            f"{report}: the diagnosis left nothing open (verdict {content.get('verdict')}): it has no "
            "alternatives, no effect with an interval, and enough excitation; no trial is needed"
        )
    files = {CORRECTED: SHIP, **others}
    models = {name: load_ship(report.parent / file) for name, file in files.items()}
    noise = {
        column: Noise(float(one["sd"]), float(one["correlation_s"]))
        for column, one in content["noise"].items()
        if one["sd"]
    }
    alike, hidden = len(content["alternatives"]), len(content["hidden"])
    if alike:
        text = f"The programme is to decide between {1 + alike} models that fit alike."
        if hidden:
            text = (
                f"{text[:-1]}, and to distinguish them from {hidden} effects that can be confused "
                "with them, each at its detection limit."
            )
    elif hidden:
        text = (
            f"The recording cannot decide whether anything is missing. The programme is to show each of "
            f"{hidden} effects that it may hide, at its detection limit."
        )
    else:
        text = "One model fits best. The programme is to narrow the intervals of its parameters."
    return Question(models, noise, uncertain, text)


def plan_as_dict(plan: TrialPlan) -> dict[str, Any]:
    """Return the steps, the pairs of models and the noise as JSON allows."""
    noise = zip(plan.channels, plan.noise, strict=True)
    found: dict[str, Any] = replace_non_finite(
        {
            "minutes": len(plan.table) * INTERVAL_S / 60.0,
            "decided_at_2logL": DECIDED,
            "steps": plan.steps.to_dict("records"),
            "pairs": plan.pairs.to_dict("records"),
            "intervals": plan.intervals.to_dict("records"),
            "noise": {c: {"sd": one.sd, "correlation_s": one.time_s} for c, one in noise},
        }
    )
    return found


def plan_figure(plan: TrialPlan) -> Figure:
    """Draw the commands, what each model predicts, and the expected evidence."""
    commands = [c for c in plan.table if c != TIME]
    minutes = plan.table[TIME] / 60.0
    count = len(commands) + len(plan.channels) + 1
    figure, axes = new_figure(count, 1, (8.0, 1.5 * count + 0.6))
    for axis, column in zip(axes.flat, commands, strict=False):
        values = plan.table[column]
        scale, name = (1.0, column) if column != RUDDER_COMMAND else (180.0 / math.pi, "rudder_deg")
        axis.plot(minutes, scale * values, color="black", drawstyle="steps-post")
        axis.set_ylabel(name, fontsize=7)
    drawn = axes.flat[len(commands) : -1]
    for k, (axis, column) in enumerate(zip(drawn, plan.channels, strict=True)):
        for color, (name, own) in zip(PALETTE, plan.predicted.items(), strict=False):
            axis.plot(minutes, own[k], color=color, label=name, linewidth=1.0)
        axis.set_ylabel(column, fontsize=7)
    figure.legend(
        *drawn[0].get_legend_handles_labels(), loc="outside upper center", fontsize=7, ncols=2
    )
    last = axes.flat[-1]
    hardest = plan.history.iloc[-1].nsmallest(len(PALETTE)).index
    for color, pair in zip(PALETTE[::-1], hardest, strict=False):
        last.plot(plan.history.index, np.maximum(plan.history[pair], 0.01), color=color, label=pair)
    last.axhline(DECIDED, color="black", linestyle=":", linewidth=0.8)
    last.set(yscale="log", xlabel="time [min]")
    last.set_ylabel("expected 2 log L", fontsize=7)
    if len(hardest):
        last.legend(fontsize=6, frameon=False, ncols=2)
    for axis in axes.flat:
        axis.set_xlim(0.0, len(plan.table) * INTERVAL_S / 60.0)
    return figure


def save_plan(plan: TrialPlan, folder: str | Path) -> Path:
    """Write the commands, the data and the figure of a plan into a folder, and return it."""
    folder = Path(folder)
    rounded: pd.DataFrame = plan.table.round(6)
    write_atomically(folder / TABLE, lambda file: rounded.to_csv(file, index=False))
    write_json(folder / DATA, plan_as_dict(plan))
    save(plan_figure(plan), folder / FIGURE)
    return folder


def pairs_in_words(plan: TrialPlan) -> list[str]:
    """Return a sentence for each pair of models; of many pairs, for those that are not decided."""
    rows = plan.pairs.to_dict("records")
    if len(rows) <= MOST_SAID:
        return [_pair_in_words(row) for row in rows]
    undecided = [row for row in rows if math.isnan(row["minutes"])]
    said = [f"{len(rows) - len(undecided)} of {len(rows)} pairs of models are decided by the end"]
    rivals: dict[str, list[str]] = {}
    for row in undecided:
        rivals.setdefault(row["model"], []).append(row["rival"])
    return [*said, *(f"not decided: {one} or {', '.join(them)}" for one, them in rivals.items())]


def intervals_in_words(plan: TrialPlan) -> list[str]:
    """Return a sentence for each uncertain parameter."""
    return [
        f"{row['key']} = {row['value']:.4g}: 95 % interval from noise +- {row['half_95_before']:.2g} "
        f"now, +- {row['half_95_after']:.2g} after the trial"
        for row in plan.intervals.to_dict("records")
    ]


def _pair_in_words(row: Mapping[Any, Any]) -> str:
    both = f"{row['model']} or {row['rival']}"
    if math.isnan(row["minutes"]):
        text = f"{both}: not decided (expected 2 log L {row['expected_2logL']:.1f})"
    else:
        text = f"{both}: decided after {row['minutes']:.1f} min"
    sensors = {
        str(name).removeprefix("minutes_with_"): value
        for name, value in row.items()
        if str(name).startswith("minutes_with_") and np.isfinite(value)
    }
    if sensors:
        best = min(sensors, key=lambda name: sensors[name])
        if not sensors[best] >= row["minutes"]:
            text += f"; with {best} after {sensors[best]:.1f} min"
    return text
