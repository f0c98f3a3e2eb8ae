"""``report.html``: a diagnosis as one self-contained page with embedded figures."""

from __future__ import annotations

import functools
import importlib.resources
import math
from importlib.metadata import version
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from ...plant.ship import Ship, ShipError
from ..judge.verdict import NOTHING
from ..outcome import Outcome
from ..search.catalogue import SizedEffect, catalogue, confusable_ids
from . import figures
from .figures import equation
from .text import CONSTANT, VERDICT_WORDS, headline, lacking_or_excess, remarks, sentence, status
from .wording import (
    DAY_S,
    biased_parameter_of,
    biased_parameter_sentence,
    breakable_key,
    capitalise,
    channel_name,
    effect_words,
    formula_for_page,
    number,
    parameter_rows_for_page,
    parameter_words,
    scale_unit,
    superscript,
    time_span,
    time_unit,
    value_with_unit,
    windows_in_words,
)

_ABSENT = "absent"


def changed_keys(diagnosis: Outcome) -> list[tuple[Markup, str, str]]:
    """Return the keys of the ship file that the correction changes, with old and new value."""
    old, new = (_values_by_key(ship) for ship in (diagnosis.ship, diagnosis.corrected))
    return [
        (
            breakable_key(key),
            _value(old.get(key), key, diagnosis.corrected),
            _value(value, key, diagnosis.corrected),
        )
        for key, value in new.items()
        if value != old.get(key)
    ]


def _values_by_key(ship: Ship) -> dict[str, Any]:
    """Return the values of a ship file by dotted key, and the expressions of its terms by id."""
    tree = ship.model_dump()
    found = _flat({key: value for key, value in tree.items() if key != "term"})
    for term in ship.term:
        found[f"term.{term.id}"] = "; ".join(f"{where}: {what}" for where, what in term.expressions)
        for name, parameter in term.parameters.items():
            found[f"term.{term.id}.{name}"] = parameter.value
    return found


def _flat(tree: dict[str, Any], above: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        found |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {above + key: value}
    return found


def _value(value: Any, key: str, ship: Ship) -> str:
    if value is None:
        return _ABSENT
    if isinstance(value, list | tuple):
        return ", ".join(_value(item, "", ship) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    try:
        unit = ship.parameter(key).info.unit if key else "-"
    except (ShipError, KeyError, ValueError):
        unit = "-"
    return f"{number(float(value), 5)} {superscript(unit)}".strip()


def report_html(diagnosis: Outcome) -> str:
    """Return the page with its style sheet, equations and figures."""
    drawn = {
        "traces": figures.trace_panels(diagnosis),
        "residuals": figures.residual_panels(diagnosis),
        "regimes": figures.regime_panels(diagnosis),
        "spectra": figures.spectrum_panels(diagnosis),
        "ranking": figures.ranking_panels(diagnosis),
        "shape": figures.shape_panel(diagnosis),
    }
    return template("report.html.j2").render(
        d=diagnosis,
        status=status(diagnosis),
        verdict=VERDICT_WORDS[status(diagnosis)],
        headline=headline(diagnosis),
        sentence=sentence(diagnosis),
        changed=figures.is_corrected(diagnosis),
        facts=_facts(diagnosis),
        fits=_fits(diagnosis),
        findings=[_finding(diagnosis, i) for i in range(len(diagnosis.findings))],
        shape=_shape(diagnosis),
        balances=_balances(diagnosis),
        formula=formula_for_page(diagnosis.formula),
        located=[diagnosis.balances[row][0] for row in figures.balances_to_show(diagnosis)[:2]],
        figures={key: [Markup(panel) for panel in panels] for key, panels in drawn.items()},
        shown=min(figures.RANKED, len(diagnosis.ranking)),
        detectable=_detectable_rows(diagnosis),
        without_size=_without_size(diagnosis),
        parameters=parameter_rows_for_page(diagnosis),
        remarks=remarks(diagnosis),
        keys=changed_keys(diagnosis),
        version=version("shaftline"),
        style=style(),
    )


@functools.cache
def template(name: str) -> Template:
    """Return a template of this package by file name."""
    return Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).from_string(_text(name))


def style() -> Markup:
    """Return the style sheet of the pages."""
    return Markup(_text("style.css"))


def _text(name: str) -> str:
    return importlib.resources.files("shaftline.mismatch.report").joinpath(name).read_text("utf-8")


def _balances(diagnosis: Outcome) -> list[dict[str, str]]:
    """Return one table row for each balance."""
    rows = []
    for balance in diagnosis.balance_verdicts:
        left = balance.left
        rows.append(
            {
                "name": balance.name,
                "verdict": VERDICT_WORDS[balance.verdict],
                "share": "–" if left is None and balance.verdict == NOTHING
                else f"{100.0 * max(balance.explained, 0.0):.0f} %",
                "residual": "noise" if left is None
                else f"{number(left.ratio, 2)} times the noise's power between "
                f"{number(left.low_Hz, 2)} and {number(left.high_Hz, 2)} Hz",
            }
        )  # fmt: skip
    return rows


def _finding(diagnosis: Outcome, index: int) -> dict[str, Any]:
    """Return the fields of a finding for the page."""
    finding, ship = diagnosis.findings[index], diagnosis.ship
    effect = finding.effect
    rows = []
    for estimate in finding.estimates:
        low, high = estimate.ci95
        factor, shown = scale_unit(abs(estimate.value), estimate.unit)
        rows.append(
            {
                "name": parameter_words(estimate.name, estimate.unit),
                "key": breakable_key(estimate.key),
                "value": number(estimate.value / factor),
                "interval": "not measured"
                if finding.unmeasured
                else f"{number(low / factor)} … {number(high / factor)}",
                "unit": shown or "–",
            }
        )
    rivals = [_rival(c.sized_effect, ship) for c in finding.rivals]
    biased = biased_parameter_of(diagnosis, index)
    return {
        "name": capitalise(effect_words(effect)),
        "effect": effect,
        "mistaken_for": confusable_ids(effect, ship),
        "index": index + 1,
        "lacks": lacking_or_excess(finding),
        "equation": Markup(equation(effect.latex, effect.equation, f"e{index}")),
        "parameters": rows,
        "rivals": rivals,
        "biased": "" if biased is None else biased_parameter_sentence(biased),
        "score": number(finding.score),
        "threshold": number(finding.threshold),
        "when": windows_in_words(finding.windows, float(diagnosis.time_s[-1])),
        "regime": finding.regime.replace("_", " "),
    }


def _rival(placed: SizedEffect, ship: Ship) -> str:
    """Return an indistinguishable effect with the value of its first parameter."""
    parameter, value = placed.pairs[0]
    unit = parameter.in_ship(ship).info.unit
    words = parameter_words(parameter.name, unit)
    return f"{placed.effect.label} with {words} {value_with_unit(value, unit)}"


def _facts(diagnosis: Outcome) -> list[tuple[str, str]]:
    time, held = diagnosis.time_s, diagnosis.held_out
    duration, step = float(time[-1]), figures.sampling_interval(diagnosis)
    minutes = f" ({duration / 60.0:.0f} min)" if duration >= 120.0 else ""
    if time_unit(duration)[1] != "s":
        minutes = f" ({duration / DAY_S:.1f} days)"
    facts = [
        ("Ship", diagnosis.ship.name),
        ("Recording", f"{duration:.0f} s{minutes}, {len(time)} rows, one every {step:.3g} s"),
        ("Held-out data, never fitted", ", ".join(time_span(a, b) for a, b in held)),
        ("Balances checked", ", ".join(name for name, _ in diagnosis.balances)),
        ("Effects tried", f"{len(diagnosis.ranking)} of {len(catalogue())} in the catalogue"),
    ]
    if diagnosis.findings:
        share = (
            f"{100.0 * diagnosis.explained:.0f} % of the low-frequency residual power beyond noise"
        )
        facts.append(("Explained", share))
        facts.append(("2 Δ log L on held-out data", number(diagnosis.held_out_gain)))
    return facts


def _fits(diagnosis: Outcome) -> list[dict[str, Any]]:
    """Return FitPercent of each channel, with the widths of its bars."""

    def width(value: float) -> str:
        return f"{min(max(value, 0.0), 100.0):.1f}" if math.isfinite(value) else "0"

    def percent(value: float) -> str:
        text = f"{value:.{1 if abs(value) < 200.0 else 0}f}"
        return "0.0" if text == "-0.0" else text.replace("-", "−")

    rows: list[dict[str, Any]] = []
    for column in diagnosis.measured:
        name = channel_name(column)[0]
        if column not in diagnosis.fit_before:
            rows.append({"name": name, "none": CONSTANT})
            continue
        before, after = diagnosis.fit_before[column], diagnosis.fit_after[column]
        rows.append(
            {
                "name": name,
                "none": "",
                "before": percent(before),
                "after": percent(after),
                "wide_before": width(before),
                "wide_after": width(after),
            }
        )
    return rows


def _shape(diagnosis: Outcome) -> dict[str, Any] | None:
    shape = diagnosis.shape
    if shape is None:
        return None
    factor, unit = scale_unit(float(np.abs(shape.values).max()), shape.unit)
    return {
        "signal": shape.signal.replace("_", " "),
        "unit": unit,
        "rows": [
            (number(float(x)), number(float(y) / factor))
            for x, y in zip(shape.knots, shape.values, strict=True)
        ],
        "gain": number(shape.gain),
        "threshold": number(shape.threshold),
        "windows": windows_in_words(diagnosis.shape_windows, float(diagnosis.time_s[-1])),
        "regime": diagnosis.shape_regime.replace("_", " "),
    }


def _detectable_rows(diagnosis: Outcome) -> list[dict[str, str]]:
    return [
        {
            "effect": capitalise(effect_words(item.effect)),
            "balance": item.effect.balance,
            "parameter": parameter_words(item.effect.parameters[0].name, item.unit),
            "size": value_with_unit(item.value, item.unit),
            "needs": item.effect.excitation,
        }
        for item in sorted(
            diagnosis.detectable, key=lambda item: (item.effect.balance, item.effect.id)
        )
    ]


def _without_size(diagnosis: Outcome) -> dict[str, list[str]]:
    """Return the effects without a smallest detectable size: untried, or with several parameters."""
    tried = {c.effect.label for c, _ in diagnosis.ranking}
    sized = {item.effect.label for item in diagnosis.detectable}
    labels = [effect.label for effect in catalogue()]
    return {
        "untried": [x for x in labels if x not in tried],
        "unsized": [x for x in labels if x in tried and x not in sized],
    }
