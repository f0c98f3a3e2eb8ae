"""What a correction changes in the ship's file, for the page.

``report.html``: a diagnosis as one page that needs nothing else, its figures drawn into it.
"""

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
from ..search.catalogue import Placed, catalogue, mistaken_for
from . import figures
from .figures import equation
from .text import CONSTANT, VERDICT_WORDS, headline, remarks, sentence, status
from .wording import (
    DAY_S,
    breakable,
    capital,
    channel_name,
    effect_words,
    formula_for_page,
    measure,
    number,
    page_rows,
    parameter_words,
    scaled,
    span,
    spans,
    superscript,
    time_unit,
    wrong_of,
    wrong_words,
)

_ABSENT = "absent"


def changed_keys(diagnosis: Outcome) -> list[tuple[Markup, str, str]]:
    """Keys of the ship's file that differ: key, nominal and corrected value."""
    old, new = (_numbers_of(ship) for ship in (diagnosis.ship, diagnosis.corrected))
    return [
        (
            breakable(key),
            _value(old.get(key), key, diagnosis.corrected),
            _value(value, key, diagnosis.corrected),
        )
        for key, value in new.items()
        if value != old.get(key)
    ]


def _numbers_of(ship: Ship) -> dict[str, Any]:
    """What stands in a ship's file, by dotted key; of a term also what it adds, in a line."""
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
        unit = ship.number(key).info.unit if key else "-"
    except (ShipError, KeyError, ValueError):
        unit = "-"
    return f"{number(float(value), 5)} {superscript(unit)}".strip()


def report_html(diagnosis: Outcome) -> str:
    """The page, self-contained: styles, equations and figures stand in it."""
    drawn = {
        "traces": figures.traces(diagnosis),
        "residuals": figures.residuals(diagnosis),
        "regimes": figures.regimes(diagnosis),
        "spectra": figures.spectra(diagnosis),
        "ranking": figures.ranking(diagnosis),
        "shape": figures.shape_panel(diagnosis),
    }
    return template("report.html.j2").render(
        d=diagnosis,
        status=status(diagnosis),
        verdict=VERDICT_WORDS[status(diagnosis)],
        headline=headline(diagnosis),
        sentence=sentence(diagnosis),
        changed=figures.changed(diagnosis),
        facts=_facts(diagnosis),
        fits=_fits(diagnosis),
        findings=[_finding(diagnosis, i) for i in range(len(diagnosis.findings))],
        shape=_shape(diagnosis),
        balances=_balances(diagnosis),
        formula=formula_for_page(diagnosis.formula),
        located=[diagnosis.balances[row][0] for row in figures.located_rows(diagnosis)[:2]],
        figures={key: [Markup(panel) for panel in panels] for key, panels in drawn.items()},
        shown=min(figures.RANKED, len(diagnosis.ranking)),
        detectable=_detectable(diagnosis),
        untold=_untold(diagnosis),
        numbers=page_rows(diagnosis),
        remarks=remarks(diagnosis),
        keys=changed_keys(diagnosis),
        version=version("shaftline"),
        style=style(),
    )


@functools.cache
def template(name: str) -> Template:
    """A page's template, from this folder."""
    return Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).from_string(_text(name))


def style() -> Markup:
    """The style sheet that stands in every page."""
    return Markup(_text("style.css"))


def _text(name: str) -> str:
    return importlib.resources.files("shaftline.mismatch.report").joinpath(name).read_text("utf-8")


def _balances(diagnosis: Outcome) -> list[dict[str, str]]:
    """Each balance for itself, as a row."""
    rows = []
    for balance in diagnosis.balance_verdicts:
        left = balance.left
        rows.append(
            {
                "name": balance.name,
                "verdict": VERDICT_WORDS[balance.verdict],
                "share": "–" if left is None and balance.verdict == NOTHING
                else f"{100.0 * max(balance.explained, 0.0):.0f} %",
                "left": "noise" if left is None
                else f"{number(left.ratio, 2)} times the noise's power between "
                f"{number(left.low_Hz, 2)} and {number(left.high_Hz, 2)} Hz",
            }
        )  # fmt: skip
    return rows


def _finding(diagnosis: Outcome, place: int) -> dict[str, Any]:
    finding, ship = diagnosis.findings[place], diagnosis.ship
    effect = finding.effect
    rows = []
    for estimate in finding.estimates:
        low, high = estimate.ci95
        factor, shown = scaled(abs(estimate.value), estimate.unit)
        rows.append(
            {
                "name": parameter_words(estimate.name, estimate.unit),
                "key": breakable(estimate.key),
                "value": number(estimate.value / factor),
                "interval": "not measured"
                if finding.unmeasured
                else f"{number(low / factor)} … {number(high / factor)}",
                "unit": shown or "–",
            }
        )
    rivals = [_rival(c.placed, ship) for c in finding.rivals]
    wrong = wrong_of(diagnosis, place)
    return {
        "name": capital(effect_words(effect)),
        "effect": effect,
        "mistaken_for": mistaken_for(effect, ship),
        "place": place + 1,
        "equation": Markup(equation(effect.latex, effect.equation, f"e{place}")),
        "parameters": rows,
        "rivals": rivals,
        "wrong": "" if wrong is None else wrong_words(wrong),
        "score": number(finding.score),
        "threshold": number(finding.threshold),
        "when": spans(finding.windows, float(diagnosis.time_s[-1])),
        "regime": finding.regime.replace("_", " "),
    }


def _rival(placed: Placed, ship: Ship) -> str:
    """A name that does as well, with its value."""
    parameter, value = placed.pairs[0]
    unit = parameter.number(ship).info.unit
    words = parameter_words(parameter.name, unit)
    return f"{placed.effect.label} with {words} {measure(value, unit)}"


def _facts(diagnosis: Outcome) -> list[tuple[str, str]]:
    time, held = diagnosis.time_s, diagnosis.held_out
    duration, step = float(time[-1]), figures.interval(diagnosis)
    minutes = f" ({duration / 60.0:.0f} min)" if duration >= 120.0 else ""
    if time_unit(duration)[1] != "s":
        minutes = f" ({duration / DAY_S:.1f} days)"
    facts = [
        ("Ship", diagnosis.ship.name),
        ("Recording", f"{duration:.0f} s{minutes}, {len(time)} rows, one every {step:.3g} s"),
        ("Set aside, never fitted", ", ".join(span(a, b) for a, b in held)),
        ("Balances checked", ", ".join(name for name, _ in diagnosis.balances)),
        ("Effects tried", f"{len(diagnosis.ranking)} of {len(catalogue())} in the catalogue"),
    ]
    if diagnosis.findings:
        share = f"{100.0 * diagnosis.explained:.0f} % of the slow difference beyond noise"
        facts.append(("Explained", share))
        gain = f"{number(diagnosis.held_out_gain)} in 2 log L"
        facts.append(("Gain on what was set aside", gain))
    return facts


def _fits(diagnosis: Outcome) -> list[dict[str, Any]]:
    """FitPercent by channel, with the widths of its bars."""

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
    factor, unit = scaled(float(np.abs(shape.values).max()), shape.unit)
    return {
        "signal": shape.signal.replace("_", " "),
        "unit": unit,
        "rows": [
            (number(float(x)), number(float(y) / factor))
            for x, y in zip(shape.knots, shape.values, strict=True)
        ],
        "gain": number(shape.gain),
        "threshold": number(shape.threshold),
        "windows": spans(diagnosis.shape_windows, float(diagnosis.time_s[-1])),
        "regime": diagnosis.shape_regime.replace("_", " "),
    }


def _detectable(diagnosis: Outcome) -> list[dict[str, str]]:
    return [
        {
            "effect": capital(effect_words(item.effect)),
            "balance": item.effect.balance,
            "parameter": parameter_words(item.effect.parameters[0].name, item.unit),
            "size": measure(item.value, item.unit),
            "needs": item.effect.excitation,
        }
        for item in sorted(
            diagnosis.detectable, key=lambda item: (item.effect.balance, item.effect.id)
        )
    ]


def _untold(diagnosis: Outcome) -> dict[str, list[str]]:
    """Entries of the catalogue without a smallest size: not tried at all, or not of one number."""
    tried = {c.effect.label for c, _ in diagnosis.ranking}
    sized = {item.effect.label for item in diagnosis.detectable}
    labels = [effect.label for effect in catalogue()]
    return {
        "untried": [x for x in labels if x not in tried],
        "unsized": [x for x in labels if x in tried and x not in sized],
    }
