"""``report.json``: a diagnosis as data."""

from __future__ import annotations

import math
from typing import Any

from ..judge.held_out import rms_errors
from ..judge.shapes import Shape
from ..judge.verdict import EXPLAINED
from ..outcome import Outcome
from ..search.selection import p_value
from ..simulate.balances import BALANCE_OF_RESIDUAL
from .first_page import first_page
from .text import finding_sentence, headline, sentence
from .wording import biased_parameters, formula_as_dict, parameters_as_dict

ALTERNATIVES, HIDDEN = "alternatives", "hidden"
"""Folders of ships in the folder of results: of alternative models, and with an effect that a recording
with too little excitation may hide."""


def model_file(folder: str, name: str) -> str:
    """Return the file of a model's ship in the folder of results.

    >>> model_file(ALTERNATIVES, "hull-fouling (hull)")
    'alternatives/hull-fouling-hull.toml'
    """
    letters = "".join(c if c.isalnum() else "-" for c in name)
    return f"{folder}/{'-'.join(filter(None, letters.split('-')))}.toml"


def _location(diagnosis: Outcome) -> dict[str, Any]:
    balances: list[str] = []
    windows: list[list[float]] = []
    regime, findings, shape = "", diagnosis.findings, diagnosis.shape
    if findings:
        balances = list(dict.fromkeys(f.effect.balance for f in findings))
        windows = merge_windows([w for f in findings for w in f.windows])
        regime = "; ".join(f.regime for f in findings if f.regime)
    elif shape is not None:
        balances = [BALANCE_OF_RESIDUAL.get(shape.balance, shape.balance)]
        regime = diagnosis.shape_regime
        windows = [list(w) for w in diagnosis.shape_windows] or [[0.0, float(diagnosis.time_s[-1])]]
    return {"balances": balances, "windows_s": windows, "regime": regime}


def _shape(shape: Shape) -> dict[str, Any]:
    """Return signal, units and points of a shape."""
    return {
        "signal": shape.signal,
        "signal_unit": shape.signal_unit,
        "unit": shape.unit,
        "knots": shape.knots.tolist(),
        "values": shape.values.tolist(),
    }


def _balances(diagnosis: Outcome) -> dict[str, Any]:
    """Return the verdict, the explained share and the residual of each balance."""
    found: dict[str, Any] = {}
    shape = diagnosis.shape
    for balance in diagnosis.balance_verdicts:
        left: dict[str, Any] | None = None
        if balance.left is not None and balance.verdict != EXPLAINED:
            own = shape if shape is not None and shape.balance == balance.name else None
            left = {
                "share": 1.0 - balance.explained,
                "low_Hz": balance.left.low_Hz,
                "high_Hz": balance.left.high_Hz,
                "times_noise": balance.left.ratio,
                "shape": None if own is None else _shape(own),
            }
        found[balance.name] = {
            "verdict": balance.verdict,
            "explained_share": balance.explained,
            "left": left,
        }
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
    for f, biased in zip(diagnosis.findings, biased_parameters(diagnosis), strict=True):
        effect, none = f.effect, {"ci95": None} if f.unmeasured else {}
        equivalent = dict.fromkeys(c.effect.id for c in f.rivals if c.effect.id != effect.id)
        wrong = None
        if biased is not None:
            wrong = {k: getattr(biased, k) for k in ("key", "file", "value", "gain")}
        effects.append(
            {
                "id": effect.id,
                "balance": effect.balance,
                "form": effect.form,
                "equivalent_ids": list(equivalent),
                "equation": effect.equation,
                "sentence": finding_sentence(f),
                "parameters": {e.name: e.to_dict() | none for e in f.estimates},
                "unmeasured": f.unmeasured,
                "implausible": f.implausible,
                "evidence": {"score": f.score, "threshold": f.threshold, "p_value": f.p_value},
                "windows_s": [list(w) for w in f.windows],
                "split_by": effect.split_by,
                "wrong_number": wrong,
            }
        )
    measured, held = diagnosis.measured, diagnosis.held_rows
    report: dict[str, Any] = {
        "verdict": diagnosis.verdict,
        "headline": headline(diagnosis),
        "summary": first_page(diagnosis).to_dict(),
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
                "rms_before": rms_errors(measured, diagnosis.before, held),
                "rms_after": rms_errors(measured, diagnosis.after, held),
                "gain_2logL": diagnosis.held_out_gain,
            }
        },
        "alternatives": {name: model_file(ALTERNATIVES, name) for name in diagnosis.alternatives},
        "hidden": {name: model_file(HIDDEN, name) for name in diagnosis.hidden},
        "noise": {
            column: {"sd": sd, "correlation_s": time_s}
            for column, (sd, time_s) in diagnosis.noise.items()
        },
        "formula": formula_as_dict(diagnosis.formula),
        "explained_power": diagnosis.explained,
        "detectable": [
            {
                "id": d.effect.id,
                "balance": d.effect.balance,
                "parameter": d.effect.parameters[0].name,
                "smallest": d.value,
            }
            for d in diagnosis.detectable
        ],
        "ranking": [
            {
                "id": c.effect.id,
                "balance": c.effect.balance,
                "form": c.effect.form,
                "score": c.gain,
                "threshold": threshold,
                "p_value": p_value(c.effect, c.gain, threshold),
            }
            for c, threshold in diagnosis.ranking
        ],
        "numbers": parameters_as_dict(diagnosis),
        "demands_between_rows": "lines" if diagnosis.line else "held",
        "highest_Hz": diagnosis.highest_Hz,
        "limits": diagnosis.limits,
        "warnings": diagnosis.warnings,
    }
    if diagnosis.shape is not None:
        evidence = {"score": diagnosis.shape.gain, "threshold": diagnosis.shape.threshold}
        balance = diagnosis.shape.balance
        report["unexplained"] = {
            "balance": balance,
            **_shape(diagnosis.shape),
            "evidence": evidence,
        }
    plain: dict[str, Any] = replace_non_finite(report)
    return plain
