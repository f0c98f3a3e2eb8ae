"""``report.json``: a diagnosis as data."""

from __future__ import annotations

import math
from typing import Any

from ..judge.held_out import rms_errors
from ..judge.verdict import EXPLAINED
from ..outcome import Outcome
from ..simulate.balances import BALANCE_OF_RESIDUAL
from .text import finding_sentence, headline, sentence
from .wording import (
    biased_parameter_as_dict,
    biased_parameter_of,
    formula_as_dict,
    parameters_as_dict,
)


def _location(diagnosis: Outcome) -> dict[str, Any]:
    duration = float(diagnosis.time_s[-1])
    if diagnosis.findings:
        balances = list(dict.fromkeys(f.effect.balance for f in diagnosis.findings))
        windows = sorted({w for f in diagnosis.findings for w in f.windows})
        words = [f.regime for f in diagnosis.findings if f.regime]
        return {
            "balances": balances,
            "windows_s": merge_windows(windows),
            "regime": "; ".join(words),
        }
    if diagnosis.shape is not None:
        shape = diagnosis.shape
        return {
            "balances": [BALANCE_OF_RESIDUAL.get(shape.balance, shape.balance)],
            "windows_s": [list(w) for w in diagnosis.shape_windows] or [[0.0, duration]],
            "regime": diagnosis.shape_regime,
        }
    return {"balances": [], "windows_s": [], "regime": ""}


def _balances(diagnosis: Outcome) -> dict[str, Any]:
    """Return the verdict, the explained share and the residual of each balance."""
    found: dict[str, Any] = {}
    shape = diagnosis.shape
    for balance in diagnosis.balance_verdicts:
        left: dict[str, Any] | None = None
        if balance.left is not None and balance.verdict != EXPLAINED:
            left = {
                "share": 1.0 - balance.explained,
                "low_Hz": balance.left.low_Hz,
                "high_Hz": balance.left.high_Hz,
                "times_noise": balance.left.ratio,
                "shape": None,
            }
            if shape is not None and shape.balance == balance.name:
                left["shape"] = {
                    "signal": shape.signal, "signal_unit": shape.signal_unit, "unit": shape.unit,
                    "knots": shape.knots.tolist(), "values": shape.values.tolist(),
                }  # fmt: skip
        found[balance.name] = {
            "verdict": balance.verdict, "explained_share": balance.explained, "left": left,
        }  # fmt: skip
    return found


def merge_windows(windows: list[tuple[float, float]]) -> list[list[float]]:
    """Return sorted windows of time, overlapping and adjacent ones merged.

    >>> merge_windows([(30.0, 40.0), (0.0, 10.0), (10.0, 20.0)])
    [[0.0, 20.0], [30.0, 40.0]]
    """
    found: list[list[float]] = []
    for a, b in sorted(windows):
        if found and a <= found[-1][1]:
            found[-1][1] = max(found[-1][1], b)
        else:
            found.append([a, b])
    return found


def replace_non_finite(value: Any) -> Any:
    """Return data for JSON with infinities and NaN as None: an interval may have no end.

    >>> replace_non_finite({"ci95": [0.5, float("inf")]})
    {'ci95': [0.5, None]}
    """
    if isinstance(value, dict):
        return {key: replace_non_finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [replace_non_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def diagnosis_as_dict(diagnosis: Outcome) -> dict[str, Any]:
    """Return ``report.json`` of a diagnosis; values in the units that their names state."""
    effects = []
    for place, f in enumerate(diagnosis.findings):
        effect = f.effect
        effects.append(
            {
                "id": effect.id,
                "balance": effect.balance,
                "form": effect.form,
                "equivalent_ids": list(
                    dict.fromkeys(c.effect.id for c in f.rivals if c.effect.id != effect.id)
                ),
                "equation": effect.equation,
                "sentence": finding_sentence(f),
                "parameters": {
                    e.name: e.to_dict() | ({"ci95": None} if f.unmeasured else {})
                    for e in f.estimates
                },
                "unmeasured": f.unmeasured,
                "implausible": f.implausible,
                "evidence": {"score": f.score, "threshold": f.threshold},
                "windows_s": [list(w) for w in f.windows],
                "split_by": effect.split_by,
                "wrong_number": biased_parameter_as_dict(biased_parameter_of(diagnosis, place)),
            }
        )
    report: dict[str, Any] = {
        "verdict": diagnosis.verdict,
        "headline": headline(diagnosis),
        "sentence": sentence(diagnosis),
        "ship": diagnosis.ship.name,
        "recording": {
            "rows": len(diagnosis.time_s) * diagnosis.rows_averaged,
            "seconds": float(diagnosis.time_s[-1]),
            "held_out": [list(w) for w in diagnosis.held_out],
        },
        "location": _location(diagnosis),
        "effects": effects,
        "balances": _balances(diagnosis),
        "fit": {
            "held_out": {
                "before": diagnosis.fit_before,
                "after": diagnosis.fit_after,
                "rms_before": rms_errors(diagnosis.measured, diagnosis.before, diagnosis.held_rows),
                "rms_after": rms_errors(diagnosis.measured, diagnosis.after, diagnosis.held_rows),
                "gain_2logL": diagnosis.held_out_gain,
            }
        },
        "formula": formula_as_dict(diagnosis.formula),
        "explained_power": diagnosis.explained,
        "detectable": [
            {"id": d.effect.id, "balance": d.effect.balance, "parameter": d.effect.parameters[0].name,
             "smallest": d.value}
            for d in diagnosis.detectable
        ],
        "ranking": [
            {"id": c.effect.id, "balance": c.effect.balance, "form": c.effect.form, "score": c.gain,
             "threshold": threshold}
            for c, threshold in diagnosis.ranking
        ],
        "numbers": parameters_as_dict(diagnosis),
        "demands_between_rows": "lines" if diagnosis.line else "held",
        "highest_Hz": diagnosis.highest_Hz,
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
    plain: dict[str, Any] = replace_non_finite(report)
    return plain
