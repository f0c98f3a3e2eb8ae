"""Scoring one report against the truth that was sealed before it was made."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .reality.effects import BY_KEY, TrueEffect, families
from .recording import Reality
from .scenario import CHANNELS, rms

Row = dict[str, Any]
NAMING = ("explained", "partly-explained")
"""Verdicts that name effects."""

VERDICTS = (*NAMING, "unexplained", "nothing-missing")
WORTH_IT = 0.05  # gain of the oracle below which no fraction of it means anything


def overlap(found: list[list[float]], true: list[float]) -> float:
    """Intersection over union of some windows with a true one [s]."""
    grid = np.arange(0.0, max([true[1], *(w[1] for w in found)], default=true[1]), 0.5)
    inside = (grid >= true[0]) & (grid < true[1])
    named = np.zeros(len(grid), dtype=bool)
    for begin, end in found:
        named |= (grid >= begin) & (grid < end)
    either = int((inside | named).sum())
    return float((inside & named).sum()) / either if either else 0.0


def parameter_of(effect: Row, equivalent: Row) -> Row | None:
    """The reported parameter that an equivalent speaks of, if the report has it."""
    parameters: Row = effect.get("parameters", {})
    for name in equivalent["names"]:
        if name in parameters:
            return dict(parameters[name])
    if len(parameters) == 1:
        return dict(next(iter(parameters.values())))
    return None


def strength_class(strengths: dict[str, float]) -> str:
    """The class that the weakest effect of a case has reached."""
    if not strengths:
        return "none"
    least = min(strengths.values())
    return "weak" if least < 0.35 else "medium" if least < 1.4 else "strong"


def oracle_gains(reality: Reality, held_out: list[list[float]]) -> dict[str, float]:
    """1 - rms(recording - true ship) / rms(recording - true ship without its effects), by channel.

    On the hold-out, open loop from the record's start, calm and without noise: what the true effect in
    its true form brings.
    """
    time = reality.recording["time_s"].to_numpy()
    rows = np.zeros(len(time), dtype=bool)
    for begin, end in held_out:
        rows |= (time >= begin) & (time <= end)
    gains = {}
    for channel in CHANNELS:
        if channel in reality.recording and rows.any():
            measured = reality.recording[channel][rows]
            before = rms(measured - reality.without[channel][rows])
            gains[channel] = 1.0 - rms(measured - reality.concealed[channel][rows]) / before
    return gains


def _gain(reality: Reality, report: Row) -> Row:
    gains = oracle_gains(reality, report.get("recording", {}).get("held_out", []))
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
    """Every id that a named effect stands for: its own, its equivalents', and those of its class."""
    own = effect.get("class") or []
    classes = [own] if isinstance(own, str) else list(own)
    return {effect["id"], *effect.get("equivalent_ids", []), *classes}


def _parameters(report: Row, truth: Row) -> Row:
    """Error and coverage, where an effect is named by its own id and has a comparable parameter."""
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
    """One word: what the report amounts to."""
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
    """How many true ids are named, each by an effect of its own (greedy: exact names first)."""
    left, found = list(effects), 0
    for exact in (True, False):
        for name in list(true_ids):
            match = [e for e in left if (e["id"] == name if exact else name in _names(e))]
            if match:
                left.remove(match[0])
                true_ids = [other for other in true_ids if other != name]
                found += 1
    return found


def score(tool: str, report: Row, truth: Row, reality: Reality) -> Row:
    """Everything that is counted about one report, as a flat row.

    Args:
        tool: whose report.
        report: in the form of ``report.json``; a verdict that is none of :data:`VERDICTS` is a failure.
        truth: opened after the report was written.
        reality: the recording and the oracle's runs.
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
    row: Row = {
        "tool": tool,
        "index": case["index"],
        "kind": case["kind"],
        "ship": case["ship"],
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
        "wrong_and_sure": bool(
            verdict == "explained"
            and outcome in ("wrong name", "false alarm")
            and not effects[0].get("equivalent_ids")
        ),
        "undecided": bool(
            verdict == "unexplained"
            and report.get("balances")
            and all(b["verdict"] == "nothing-missing" for b in report["balances"].values())
        ),
        "class_size": len(_names(effects[0])) if effects else 0,
        "found": _pairs(effects, true_ids),
        "error": report.get("error", ""),
    }
    if concealed:
        row["balance"] = balances[0] if balances else ""
        row["balance_right"] = bool(balances) and balances[0] in {e.balance for e in concealed}
        row["balance_among"] = bool({e.balance for e in concealed} & set(balances))
        row |= _parameters(report, truth) if naming else {}
        row |= _gain(reality, report)
    true_windows = [window for window in truth["windows"].values() if window]
    if true_windows and case["kind"] in ("single", "unknown"):
        row["iou"] = overlap(location.get("windows_s") or [], true_windows[0])
    return row


def table_of(rows: list[Row]) -> pd.DataFrame:
    """Rows of :func:`score` as a table; columns that no row has are there, empty."""
    wanted = ("balance", "balance_right", "balance_among", "parameter_error", "covered",
              "gain_channel", "oracle_gain", "gain", "gain_fraction", "iou", "seconds",
              "wrong_and_sure", "undecided")  # fmt: skip
    table = pd.DataFrame(rows)
    for name in wanted:
        if name not in table:
            table[name] = None
    return table.sort_values(["tool", "index"]).reset_index(drop=True)
