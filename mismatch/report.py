"""A diagnosis as data and as sentences: ``report.json``, and the line on top of the report."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from .balances import PART_OF
from .catalogue import bounds
from .diagnosis import EXPLAINED, NOTHING, Diagnosis
from .findings import Finding

_SI = ((1e6, "M"), (1e3, "k"))


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit, large ones with a prefix: 13900 N m -> 13.9 kN m."""
    factor, prefix = 1.0, ""
    if unit.startswith("N"):
        for size, name in _SI:
            if abs(value) >= size:
                factor, prefix = size, name
                break
    text = f"{value / factor:.{digits}g}"
    return f"{text} {prefix}{unit}" if unit not in ("-", "") else text


def parameter_words(name: str, unit: str) -> str:
    """Name of a ship's key without the unit that it ends in."""
    suffix = "_" + re.sub(r"[ /]", "_", unit)
    return name.removesuffix(suffix).replace("_", " ")


def seconds(windows: list[tuple[float, float]]) -> str:
    """Windows in words."""
    if not windows:
        return ""
    parts = [f"{a:.0f} and {b:.0f} s" for a, b in windows[:3]]
    more = f", and in {len(windows) - 3} more windows" if len(windows) > 3 else ""
    return "between " + ", between ".join(parts) + more


def finding_sentence(finding: Finding, ship: Any) -> str:
    """What an effect means, with its parameters and their intervals."""
    effect = finding.effect
    sizes = []
    for parameter, value, (low, high) in zip(
        effect.parameters, finding.placed.values, finding.intervals, strict=True
    ):
        unit = bounds(parameter, ship)[3]
        size = f"{quantity(value, unit)} (95 %: {quantity(low, unit)} to {quantity(high, unit)})"
        alone = len(effect.parameters) == 1
        sizes.append(size if alone else f"{parameter_words(parameter.name, unit)} {size}")
    subject = "instrument" if effect.balance == "sensor" else f"{effect.balance} balance"
    where = f", {finding.regime}," if finding.regime else ""
    when = seconds(finding.windows)
    return f"{when[:1].upper()}{when[1:]}{where} the {subject} lacks {effect.lacks}, {', '.join(sizes)}."


def sentence(diagnosis: Diagnosis) -> str:
    """The answer in one sentence."""
    limits = "; ".join(diagnosis.limits)
    if diagnosis.verdict == EXPLAINED:
        return " ".join(finding_sentence(f, diagnosis.ship) for f in diagnosis.findings)
    if diagnosis.verdict == NOTHING:
        if limits:
            return f"Cannot be decided, because {limits}."
        return (
            "Nothing is missing: the simulation differs from the recording by no more than noise and "
            "the tolerances of the ship's numbers allow."
        )
    shape = diagnosis.shape
    if limits and not diagnosis.excited:
        return f"Something differs; which effect it is cannot be decided, because {limits}."
    if shape is None:
        return "Something is missing that the catalogue does not name."
    signal = shape.signal.replace("_", " ")
    low, high = float(np.min(shape.values)), float(np.max(shape.values))
    return (
        f"Something is missing that has no name: the {shape.balance} balance lacks "
        f"{quantity(low, shape.unit)} to {quantity(high, shape.unit)}, depending on {signal}."
    )


def _location(diagnosis: Diagnosis) -> dict[str, Any]:
    duration = float(diagnosis.time_s[-1])
    if diagnosis.findings:
        balances = list(dict.fromkeys(f.effect.balance for f in diagnosis.findings))
        windows = sorted({w for f in diagnosis.findings for w in f.windows})
        words = [f.regime for f in diagnosis.findings if f.regime]
        return {"balances": balances, "windows_s": merged(windows), "regime": "; ".join(words)}
    if diagnosis.shape is not None:
        shape = diagnosis.shape
        return {
            "balances": [PART_OF.get(shape.balance, shape.balance)],
            "windows_s": [list(w) for w in diagnosis.shape_windows] or [[0.0, duration]],
            "regime": diagnosis.shape_regime,
        }
    return {"balances": [], "windows_s": [], "regime": ""}


def merged(windows: list[tuple[float, float]]) -> list[list[float]]:
    """Windows sorted, those that touch joined."""
    found: list[list[float]] = []
    for a, b in sorted(windows):
        if found and a <= found[-1][1]:
            found[-1][1] = max(found[-1][1], b)
        else:
            found.append([a, b])
    return found


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """``report.json``; numbers in the units that their names carry."""
    effects = []
    for f in diagnosis.findings:
        effect = f.effect
        parameters = {
            p.name: {"value": value, "ci95": [low, high]}
            for p, value, (low, high) in zip(
                effect.parameters, f.placed.values, f.intervals, strict=True
            )
        }
        effects.append(
            {
                "id": effect.id,
                "balance": effect.balance,
                "equivalent_ids": list(
                    dict.fromkeys(c.effect.id for c in f.rivals if c.effect.id != effect.id)
                ),
                "equation": effect.equation,
                "sentence": finding_sentence(f, diagnosis.ship),
                "parameters": parameters,
                "evidence": {"score": f.score, "threshold": f.threshold},
                "windows_s": [list(w) for w in f.windows],
                "split_by": effect.split_by,
            }
        )
    report: dict[str, Any] = {
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis),
        "ship": diagnosis.ship.name,
        "recording": {
            "rows": len(diagnosis.time_s),
            "seconds": float(diagnosis.time_s[-1]),
            "held_out": [list(w) for w in diagnosis.held_out],
        },
        "location": _location(diagnosis),
        "effects": effects,
        "fit": {
            "held_out": {
                "before": {c: _finite(x) for c, x in diagnosis.fit_before.items()},
                "after": {c: _finite(x) for c, x in diagnosis.fit_after.items()},
                "gain_2logL": diagnosis.held_out_gain,
            }
        },
        "explained_power": diagnosis.explained,
        "detectable": [
            {"id": d.effect.id, "balance": d.effect.balance, "parameter": d.effect.parameters[0].name,
             "smallest": d.value}
            for d in diagnosis.detectable
        ],
        "limits": diagnosis.limits,
        "warnings": diagnosis.warnings,
    }  # fmt: skip
    if diagnosis.shape is not None:
        shape = diagnosis.shape
        report["unexplained"] = {
            "balance": shape.balance,
            "signal": shape.signal,
            "signal_unit": shape.signal_unit,
            "knots": shape.knots.tolist(),
            "values": shape.values.tolist(),
            "unit": shape.unit,
            "evidence": {"score": shape.gain, "threshold": shape.threshold},
        }
    return report
