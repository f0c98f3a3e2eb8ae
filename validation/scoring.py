"""Score reports against the sealed truth, and make the tables and the figure of a validation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import display
from ..core.statistics import wilson_interval
from .cases import KINDS, STRENGTHS
from .recording import CHANNELS, SimulatedCase, rms
from .simulator.effects import BY_KEY, TrueEffect, families

Row = dict[str, Any]
NAMING = ("explained", "partly-explained")
"""Verdicts that report effects."""

VERDICTS = (*NAMING, "unexplained", "nothing-missing")
WORTH_IT = 0.05  # gain of the oracle below which a fraction of this gain is not meaningful


def overlap(found: list[list[float]], true: list[float]) -> float:
    """Return the intersection over union of reported windows with the true window [s]."""
    grid = np.arange(0.0, max([true[1], *(w[1] for w in found)], default=true[1]), 0.5)
    inside = (grid >= true[0]) & (grid < true[1])
    named = np.zeros(len(grid), dtype=bool)
    for begin, end in found:
        named |= (grid >= begin) & (grid < end)
    either = int((inside | named).sum())
    return float((inside & named).sum()) / either if either else 0.0


def parameter_of(effect: Row, equivalent: Row) -> Row | None:
    """Return the reported parameter of an equivalent; None if the report has none."""
    parameters: Row = effect.get("parameters", {})
    for name in equivalent["names"]:
        if name in parameters:
            return dict(parameters[name])
    if len(parameters) == 1:
        return dict(next(iter(parameters.values())))
    return None


def strength_class(strengths: dict[str, float]) -> str:
    """Return the strength class of the weakest effect of a case."""
    if not strengths:
        return "none"
    least = min(strengths.values())
    return "weak" if least < 0.35 else "medium" if least < 1.4 else "strong"


def oracle_gains(simulated: SimulatedCase, held_out: list[list[float]]) -> dict[str, float]:
    """Return 1 - rms(recording - true ship) / rms(recording - true ship without its effects) by channel.

    This is the gain of an oracle that knows the true effect in its true form, on the held-out data. The
    ships are simulated in calm water without noise.
    """
    time = simulated.recording["time_s"].to_numpy()
    rows = np.zeros(len(time), dtype=bool)
    for begin, end in held_out:
        rows |= (time >= begin) & (time <= end)
    gains = {}
    for channel in CHANNELS:
        if channel in simulated.recording and rows.any():
            measured = simulated.recording[channel][rows]
            before = rms(measured - simulated.without[channel][rows])
            gains[channel] = 1.0 - rms(measured - simulated.concealed[channel][rows]) / before
    return gains


def _gain(gains: Mapping[str, float], report: Row) -> Row:
    if not gains:
        return {}
    channel = max(gains, key=lambda name: gains[name])
    fit = report.get("fit", {}).get("held_out", {})
    before, after = fit.get("before", {}).get(channel), fit.get("after", {}).get(channel)
    row: Row = {"gain_channel": channel, "oracle_gain": gains[channel]}
    if before is not None and after is not None and before < 100.0:
        row["gain"] = (after - before) / (100.0 - before)
        if gains[channel] > WORTH_IT:
            row["gain_fraction"] = row["gain"] / gains[channel]
    return row


def _names(effect: Row) -> set[str]:
    """Return all ids that a reported effect covers: its own, its equivalents and its class."""
    own = effect.get("class") or []
    classes = [own] if isinstance(own, str) else list(own)
    return {effect["id"], *effect.get("equivalent_ids", []), *classes}


def _parameters(report: Row, truth: Row) -> Row:
    """Return error and coverage of the comparable parameters of correctly reported effects."""
    errors, covered = [], []
    for key, equivalent in truth["equivalents"].items():
        if equivalent is None:
            continue
        own = [e for e in report.get("effects", []) if e["id"] == BY_KEY[key].id]
        parameter = parameter_of(own[0], equivalent) if own else None
        if parameter is None or parameter.get("value") is None:
            continue
        value = equivalent["value"]
        size = abs(value - equivalent["neutral"])
        errors.append(abs(parameter["value"] - value) / size)
        low, high = parameter.get("ci95") or (None, None)
        if low is not None and high is not None:
            covered.append(bool(low <= value <= high))
    row: Row = {"parameter_error": float(np.mean(errors))} if errors else {}
    return row | ({"covered": float(np.mean(covered))} if covered else {})


def _outcome(
    kind: str, verdict: str, ship: str, effects: list[Row], concealed: list[TrueEffect]
) -> str:
    """Return the outcome of a report, such as ``named`` or ``false alarm``."""
    if verdict not in VERDICTS:
        return "failed"
    if verdict == "partly-explained" and not effects:
        return "unexplained"
    if verdict not in NAMING or not effects:
        return "unexplained" if verdict == "unexplained" else "nothing-missing"
    if kind.startswith("null"):
        return "false alarm"
    first, true_ids = effects[0], {effect.id for effect in concealed}
    if first["id"] in true_ids:
        return "named"
    if true_ids & _names(first):
        return "class"
    related = families(ship, first["id"]) & {effect.family for effect in concealed}
    return "family" if related else "wrong name"


def _pairs(effects: list[Row], true_ids: list[str]) -> int:
    """Return the number of true ids that different effects of a report cover (greedy, exact first)."""
    left, found = list(effects), 0
    for exact in (True, False):
        for name in list(true_ids):
            match = [e for e in left if (e["id"] == name if exact else name in _names(e))]
            if match:
                left.remove(match[0])
                true_ids = [other for other in true_ids if other != name]
                found += 1
    return found


def score(tool: str, report: Row, truth: Row, simulated: SimulatedCase) -> Row:
    """Return the scores of one report as a flat row.

    Args:
        tool: name of the tool.
        report: report like ``report.json``; a verdict not in :data:`VERDICTS` counts as a failure.
        truth: sealed truth.
        simulated: simulated case, with reference simulations.
    """
    held_out = report.get("recording", {}).get("held_out", [])
    gains = oracle_gains(simulated, held_out) if truth["case"]["effects"] else {}
    return score_with_gains(tool, report, truth, gains)


def score_with_gains(tool: str, report: Row, truth: Row, gains: Mapping[str, float]) -> Row:
    """Return the scores of one report as :func:`score` does, for known gains of the oracle.

    Args:
        tool: name of the tool.
        report: report like ``report.json``.
        truth: sealed truth.
        gains: gains of the oracle by channel, of :func:`oracle_gains`.
    """
    case = truth["case"]
    concealed = [BY_KEY[one["key"]] for one in case["effects"]]
    true_ids = [effect.id for effect in concealed]
    effects = list(report.get("effects", []))
    verdict = str(report.get("verdict", "failed"))
    naming = verdict in NAMING
    outcome = _outcome(case["kind"], verdict, case["ship"], effects, concealed)
    location = report.get("location") or {}
    balances = list(location.get("balances") or [])
    own = {b["verdict"] for b in (report.get("balances") or {}).values()}
    row: Row = {
        "tool": tool,
        **{key: case[key] for key in ("index", "kind", "ship")},
        "strength": strength_class(truth["beyond_tolerances"]),
        "programme": case["programme"],
        "waves": case["wave_height"] > 0.0,
        "true": " + ".join(effect.key for effect in concealed),
        "ratio": min(truth["ratios"].values(), default=0.0),
        "beyond": min(truth["beyond_tolerances"].values(), default=0.0),
        "verdict": verdict,
        "outcome": outcome,
        "named": " + ".join(effect["id"] for effect in effects) if naming else "",
        "first": effects[0]["id"] if effects and naming else verdict,
        "wrong_and_sure": verdict == "explained"
        and outcome in ("wrong name", "false alarm")
        and not effects[0].get("equivalent_ids"),
        "undecided": verdict == "unexplained" and bool(own) and own == {"nothing-missing"},
        "class_size": len(_names(effects[0])) if effects else 0,
        "found": _pairs(effects, true_ids),
        "error": report.get("error", ""),
    }
    if concealed:
        row["balance"] = balances[0] if balances else ""
        row["balance_right"] = bool(balances) and balances[0] in {e.balance for e in concealed}
        row["balance_among"] = bool({e.balance for e in concealed} & set(balances))
        row |= _parameters(report, truth) if naming else {}
        row |= _gain(gains, report)
    true_windows = [window for window in truth["windows"].values() if window]
    if true_windows and case["kind"] in ("single", "unknown"):
        row["iou"] = overlap(location.get("windows_s") or [], true_windows[0])
    return row


def table_of(rows: list[Row]) -> pd.DataFrame:
    """Return rows of :func:`score` as a table with all columns."""
    wanted = (
        "balance",
        "balance_right",
        "balance_among",
        "parameter_error",
        "covered",
        "gain_channel",
        "oracle_gain",
        "gain",
        "gain_fraction",
        "iou",
        "seconds",
        "wrong_and_sure",
        "undecided",
    )
    table = pd.DataFrame(rows)
    for name in wanted:
        if name not in table:
            table[name] = None
    return table.sort_values(["tool", "index"]).reset_index(drop=True)


GOOD_UNNAMED = ("unexplained", "class", "family")
RIGHT = ("named", "class")


def share_figure(figure: str, hits: Any, target: str = "") -> Row:
    """Return a share with its interval by :func:`.wilson_interval`."""
    flags = pd.Series(hits).dropna().astype(bool)
    low, high = wilson_interval(int(flags.sum()), len(flags))
    return {
        "figure": figure,
        "value": float(flags.mean()) if len(flags) else math.nan,
        "low": low,
        "high": high,
        "cases": len(flags),
        "target": target,
    }


def median_figure(figure: str, values: Any, target: str = "") -> Row:
    """Return the median with the quartiles as ``low`` and ``high``."""
    numbers = pd.to_numeric(pd.Series(values), errors="coerce").dropna()
    low, middle, high = (float(numbers.quantile(share)) for share in (0.25, 0.5, 0.75))
    return {
        "figure": figure,
        "value": middle,
        "low": low,
        "high": high,
        "cases": len(numbers),
        "target": target,
    }


def summary(cases: pd.DataFrame) -> pd.DataFrame:
    """Return all figures with their targets; ``low`` and ``high`` of medians are quartiles."""
    rows = []
    for tool, own in cases.groupby("tool", sort=False):
        null = own[own["kind"].str.startswith("null")]
        one, two = own[own["kind"] == "single"], own[own["kind"] == "two"]
        absent = own.loc[own["kind"].isin(["unknown", "ablated"]), "outcome"]
        confounded = own.loc[own["kind"] == "confounded", "outcome"]
        unexplained = null["outcome"] == "unexplained"
        figures = [
            share_figure(
                f"effects reported in null cases: {kind}",
                part["outcome"] == "false alarm",
                "at most 0.02" if kind == "all" else "",
            )
            for kind, part in [("all", null), *null.groupby("kind")]
        ]
        figures += [
            share_figure("null cases called unexplained", unexplained),
            share_figure(
                "null cases called unexplained despite sufficient excitation",
                unexplained & ~null["undecided"].astype(bool),
            ),
            share_figure("true id or its class first", one["outcome"].isin(RIGHT), "0.92"),
            share_figure("true id first", one["outcome"] == "named"),
            share_figure("balance right", one["balance_right"], "0.97"),
            share_figure("balance among those located", one["balance_among"]),
            median_figure("IoU of an episode's window", one["iou"], "0.8"),
            median_figure("parameter error, median", one["parameter_error"], "0.04"),
            share_figure("95 % interval covers", one["covered"], "0.90 to 0.98"),
            median_figure("hold-out gain over the oracle's, median", one["gain_fraction"], "0.9"),
            share_figure(
                "effect absent from the catalogue: unexplained or its class",
                absent.isin(GOOD_UNNAMED),
                "0.85",
            ),
            share_figure("effect absent from the catalogue: unexplained", absent == "unexplained"),
            share_figure("effect absent from the catalogue: a wrong name", absent == "wrong name"),
            share_figure("two effects: both named", two["found"] == 2, "0.70"),
            share_figure("two effects: at least one named", two["found"] >= 1),
            share_figure(
                "insufficient excitation and confounded: not a wrong effect",
                ~confounded.isin(["wrong name", "family"]),
            ),
            share_figure(
                "wrong confident name: explained, first name neither true nor of its class or "
                "family, none beside it",
                own["wrong_and_sure"],
                "at most 0.05",
            ),
            median_figure("seconds a diagnosis", own["seconds"], "60"),
        ]
        rows += [{"tool": str(tool)} | figure for figure in figures]
    return pd.DataFrame(rows)


def by_strength(cases: pd.DataFrame) -> pd.DataFrame:
    """Return the rates of single effects by strength."""
    rows = []
    single = cases[cases["kind"] == "single"]
    for tool in single["tool"].unique():
        for strength in STRENGTHS:
            part = single[(single["tool"] == tool) & (single["strength"] == strength)]
            outcome = part["outcome"]
            if len(part):
                rows.append(
                    {
                        "tool": tool,
                        "strength": strength,
                        "cases": len(part),
                        "true id first": (outcome == "named").mean(),
                        "id or class first": outcome.isin(RIGHT).mean(),
                        "names in the class": part["class_size"].mean(),
                        "balance right": part["balance_right"].astype(float).mean(),
                        "nothing missing": (outcome == "nothing-missing").mean(),
                        "unexplained": (outcome == "unexplained").mean(),
                        "wrong name": outcome.isin(["wrong name", "family"]).mean(),
                    }
                )
    return pd.DataFrame(rows)


def by_kind(cases: pd.DataFrame) -> pd.DataFrame:
    """Return the number of cases by kind and outcome."""
    table = pd.crosstab([cases["tool"], cases["kind"]], cases["outcome"]).reset_index()
    table.columns.name = None
    order = table["kind"].map({kind: k for k, kind in enumerate(KINDS)}).fillna(len(KINDS))
    return table.assign(order=order).sort_values(["tool", "order"]).drop(columns="order")


def by_effect(cases: pd.DataFrame) -> pd.DataFrame:
    """Return for each single effect how often it was reported, and the effects reported in its place."""
    rows = []
    single = cases[cases["kind"] == "single"]
    for (tool, true), part in single.groupby(["tool", "true"]):
        wrong = part.loc[~part["outcome"].isin(RIGHT), "first"]
        rows.append(
            {
                "tool": tool,
                "effect": true,
                "cases": len(part),
                "id or class first": part["outcome"].isin(RIGHT).mean(),
                "balance right": part["balance_right"].astype(float).mean(),
                "parameter error": pd.to_numeric(part["parameter_error"]).median(),
                "instead": ", ".join(f"{n}× {name}" for name, n in wrong.value_counts().items()),
            }
        )
    return pd.DataFrame(rows)


def by_parameter(cases: pd.DataFrame) -> pd.DataFrame:
    """Return parameter error and coverage by strength, for forms with a common parameter."""
    rows = []
    single = cases[cases["kind"] == "single"]
    single = single.assign(error=pd.to_numeric(single["parameter_error"], errors="coerce"))
    for (tool, strength), part in single.dropna(subset="error").groupby(["tool", "strength"]):
        rows.append(
            {
                "tool": tool,
                "strength": strength,
                "cases": len(part),
                "median error": part["error"].median(),
                "90th percentile": part["error"].quantile(0.9),
                "interval covers": pd.to_numeric(part["covered"], errors="coerce").mean(),
            }
        )
    return pd.DataFrame(rows)


def confusion(cases: pd.DataFrame, tool: str) -> pd.DataFrame:
    """Return the counts of first reported effects by true effect, for single effects."""
    own = cases[(cases["tool"] == tool) & (cases["kind"] == "single")]
    return pd.crosstab(own["true"], own["first"]) if len(own) else pd.DataFrame()


def tables_of(cases: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return all tables of a validation."""
    made = {
        "summary": summary,
        "strength": by_strength,
        "kinds": by_kind,
        "effects": by_effect,
        "parameters": by_parameter,
    }
    return {"cases": cases} | {name: make(cases) for name, make in made.items()}


def draw_confusion(grid: pd.DataFrame, path: Path) -> None:
    """Draw a confusion matrix: rows are true, columns are reported effects, as shares of each row."""
    order = sorted(grid.index)
    ids = list(dict.fromkeys(row.split("/")[0] for row in order))
    columns = [name for name in ids if name in grid] + [n for n in grid.columns if n not in ids]
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
