"""Tables and the figure of a proof, from one row a case and tool."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import display
from .cases import KINDS, STRENGTHS

GOOD_UNNAMED = ("unexplained", "class", "family")
RIGHT = ("named", "class")


def wilson(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if count == 0:
        return 0.0, 1.0
    share = hits / count
    centre = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    half *= z / (1 + z * z / count)
    return max(centre - half, 0.0), min(centre + half, 1.0)


def _share(tool: str, figure: str, hits: Any, target: str) -> dict[str, Any]:
    flags = pd.Series(hits).dropna().astype(bool)
    low, high = wilson(int(flags.sum()), len(flags))
    value = float(flags.mean()) if len(flags) else float("nan")
    return {"tool": tool, "figure": figure, "value": value, "low": low, "high": high,
            "cases": len(flags), "target": target}  # fmt: skip


def _median(tool: str, figure: str, values: Any, target: str) -> dict[str, Any]:
    numbers = pd.to_numeric(pd.Series(values), errors="coerce").dropna()
    low, high = (
        numbers.quantile([0.25, 0.75]) if len(numbers) else (float("nan"), float("nan"))
    )  # the quartiles
    value = float(numbers.median()) if len(numbers) else float("nan")
    return {"tool": tool, "figure": figure, "value": value, "low": float(low), "high": float(high),
            "cases": len(numbers), "target": target}  # fmt: skip


def summary(cases: pd.DataFrame) -> pd.DataFrame:
    """Every figure of the issue with its target; ``low`` and ``high`` of medians are quartiles."""
    rows = []
    for tool, own in cases.groupby("tool", sort=False):
        name = str(tool)
        null = own[own["kind"].str.startswith("null")]
        one, two = own[own["kind"] == "single"], own[own["kind"] == "two"]
        absent = own[own["kind"].isin(["unknown", "ablated"])]
        for kind, part in [("all", null), *null.groupby("kind")]:
            label = f"effects named on null data: {kind}"
            alarms = part["outcome"] == "false alarm"
            rows.append(_share(name, label, alarms, "at most 0.02" if kind == "all" else ""))
        unexplained = null["outcome"] == "unexplained"
        rows += [
            _share(name, "null data called unexplained", unexplained, ""),
            _share(name, "null data called unexplained, without too little excitation being why",
                   unexplained & ~null["undecided"].astype(bool), ""),
            _share(name, "true id or its class first", one["outcome"].isin(RIGHT), "0.92"),
            _share(name, "true id first", one["outcome"] == "named", ""),
            _share(name, "balance right", one["balance_right"], "0.97"),
            _share(name, "balance among those located", one["balance_among"], ""),
            _median(name, "IoU of an episode's window", one["iou"], "0.8"),
            _median(name, "parameter error, median", one["parameter_error"], "0.04"),
            _share(name, "95 % interval covers", one["covered"], "0.90 to 0.98"),
            _median(name, "hold-out gain over the oracle's, median", one["gain_fraction"], "0.9"),
            _share(name, "effect absent from the catalogue: unexplained or its class",
                   absent["outcome"].isin(GOOD_UNNAMED), "0.85"),
            _share(name, "effect absent from the catalogue: unexplained",
                   absent["outcome"] == "unexplained", ""),
            _share(name, "effect absent from the catalogue: a wrong name",
                   absent["outcome"] == "wrong name", ""),
            _share(name, "two effects: both named", two["found"] == 2, "0.70"),
            _share(name, "two effects: at least one named", two["found"] >= 1, ""),
            _share(name, "dull and confounded: not a wrong name",
                   ~own.loc[own["kind"] == "confounded", "outcome"].isin(["wrong name", "family"]),
                   ""),
            _share(name, "wrong confident name: explained, first name neither true nor of its "
                   "class or family, none beside it", own["wrong_and_sure"], "at most 0.05"),
            _median(name, "seconds a diagnosis", own["seconds"], "60"),
        ]  # fmt: skip
    return pd.DataFrame(rows)


def by_strength(cases: pd.DataFrame) -> pd.DataFrame:
    """Rates of single effects by strength."""
    rows = []
    single = cases[cases["kind"] == "single"]
    for tool in single["tool"].unique():
        for strength in STRENGTHS:
            part = single[(single["tool"] == tool) & (single["strength"] == strength)]
            if len(part):
                rows.append({
                    "tool": tool, "strength": strength, "cases": len(part),
                    "true id first": (part["outcome"] == "named").mean(),
                    "id or class first": part["outcome"].isin(RIGHT).mean(),
                    "names in the class": part["class_size"].mean(),
                    "balance right": part["balance_right"].astype(float).mean(),
                    "nothing missing": (part["outcome"] == "nothing-missing").mean(),
                    "unexplained": (part["outcome"] == "unexplained").mean(),
                    "wrong name": part["outcome"].isin(["wrong name", "family"]).mean(),
                })  # fmt: skip
    return pd.DataFrame(rows)


def by_kind(cases: pd.DataFrame) -> pd.DataFrame:
    """How many cases of each kind came to which outcome."""
    table = pd.crosstab([cases["tool"], cases["kind"]], cases["outcome"])
    place = {kind: k for k, kind in enumerate(KINDS)}
    table = table.reset_index()
    table.columns.name = None
    order = table["kind"].map(place).fillna(len(KINDS))
    return table.assign(order=order).sort_values(["tool", "order"]).drop(columns="order")


def by_effect(cases: pd.DataFrame) -> pd.DataFrame:
    """Each single effect: how often named, and what was named instead."""
    rows = []
    single = cases[cases["kind"] == "single"]
    for (tool, true), part in single.groupby(["tool", "true"]):
        wrong = part.loc[~part["outcome"].isin(RIGHT), "first"]
        rows.append({
            "tool": tool, "effect": true, "cases": len(part),
            "id or class first": part["outcome"].isin(RIGHT).mean(),
            "balance right": part["balance_right"].astype(float).mean(),
            "parameter error": pd.to_numeric(part["parameter_error"]).median(),
            "instead": ", ".join(f"{n}× {name}" for name, n in wrong.value_counts().items()),
        })  # fmt: skip
    return pd.DataFrame(rows)


def by_parameter(cases: pd.DataFrame) -> pd.DataFrame:
    """Parameter error and coverage by strength, where forms have a parameter in common."""
    rows = []
    single = cases[cases["kind"] == "single"].assign(
        error=lambda t: pd.to_numeric(t["parameter_error"], errors="coerce")
    )
    for (tool, strength), part in single.dropna(subset="error").groupby(["tool", "strength"]):
        rows.append({
            "tool": tool, "strength": strength, "cases": len(part),
            "median error": part["error"].median(),
            "90th percentile": part["error"].quantile(0.9),
            "interval covers": pd.to_numeric(part["covered"], errors="coerce").mean(),
        })  # fmt: skip
    return pd.DataFrame(rows)


def confusion(cases: pd.DataFrame, tool: str) -> pd.DataFrame:
    """True effect against what was named first, counts, singles only."""
    own = cases[(cases["tool"] == tool) & (cases["kind"] == "single")]
    return pd.crosstab(own["true"], own["first"]) if len(own) else pd.DataFrame()


def tables_of(cases: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """All tables of a proof."""
    return {
        "cases": cases,
        "summary": summary(cases),
        "strength": by_strength(cases),
        "kinds": by_kind(cases),
        "effects": by_effect(cases),
        "parameters": by_parameter(cases),
    }


def draw_confusion(grid: pd.DataFrame, path: Path) -> None:
    """Heat map of a confusion matrix: rows are true, columns are named, shares of each row."""
    plain = [name for name in grid.columns if name in {row.split("/")[0] for row in grid.index}]
    others = [name for name in grid.columns if name not in plain]
    order = sorted(grid.index)
    ids = list(dict.fromkeys(row.split("/")[0] for row in order))
    columns = [name for name in ids if name in plain] + others
    counts = grid.loc[order, columns].to_numpy(dtype=float)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    size = 3.5 + 0.32 * len(columns), 2.5 + 0.26 * len(order)
    figure, axes = display.figures.new_figure(1, 1, size)
    axis = axes[0, 0]
    axis.grid(False)
    axis.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for i, k in zip(*np.nonzero(counts), strict=True):
        colour = "white" if shares[i, k] > 0.6 else "#1f2a44"
        axis.text(k, i, f"{counts[i, k]:.0f}", ha="center", va="center", fontsize=7, color=colour)
    axis.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=7)
    axis.set_yticks(range(len(order)), order, fontsize=7)
    axis.set_xlabel("named first")
    axis.set_ylabel("concealed")
    display.figures.save(figure, path)
