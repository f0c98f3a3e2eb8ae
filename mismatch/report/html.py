"""``report.html``: a diagnosis as one self-contained page with embedded figures.

``report.html`` of an identification: one self-contained page with embedded figures.
"""

from __future__ import annotations

import functools
import importlib.resources
import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator

from ...plant.ship import Ship, ShipError
from ..estimate import HALF_95
from ..judge.verdict import NOTHING
from ..outcome import Outcome
from ..search.catalogue import SizedEffect, catalogue, confusable_ids
from . import figures
from .figures import AFTER, HEIGHT, MEASURED, equation, panel, svg, trace_panels
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

if TYPE_CHECKING:
    from ..identify import Identification


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


def identification_html(identification: Identification) -> str:
    """Return the page with its style sheet and figures."""
    drawn = {
        "parameters": [_change_panel(identification), *_correlation_panels(identification)],
        "traces": trace_panels(identification) if identification.fit_before else [],
        "search": _search_panels(identification),
    }
    return template("identified.html.j2").render(
        i=identification,
        sentence=_sentence(identification),
        rows=_rows(identification),
        fits=[
            {"name": channel_name(c)[0], "before": f"{before:.1f}",
             "after": f"{identification.fit_after[c]:.1f}"}
            for c, before in identification.fit_before.items()
        ],
        figures={key: [Markup(one) for one in panels] for key, panels in drawn.items()},
        version=version("shaftline"),
        style=style(),
    )  # fmt: skip


def _sentence(identification: Identification) -> str:
    """Return which parameters were identified, and the channel whose fit improves most."""
    count = len(identification.estimates)
    words = (
        f"{identification.ship.name}: {count} parameter{'s' if count > 1 else ''} identified by "
        f"{identification.method}"
    )
    if not identification.fit_before:
        return words + "."
    gains = {
        column: identification.fit_after[column] - before
        for column, before in identification.fit_before.items()
    }
    best = max(gains, key=lambda column: gains[column])
    return (
        f"{words}; FitPercent of {channel_name(best)[0]} changes from "
        f"{identification.fit_before[best]:.1f} to {identification.fit_after[best]:.1f} %."
    )


def _rows(identification: Identification) -> list[dict[str, Any]]:
    rows = []
    for estimate in identification.estimates:
        low, high = estimate.ci95
        before = estimate.neutral
        change = f"{100.0 * (estimate.value / before - 1.0):+.1f} %" if before else "new"
        rows.append(
            {
                "key": breakable_key(estimate.key),
                "before": number(before, 4),
                "value": number(estimate.value, 4),
                "interval": f"{number(low, 4)} … {number(high, 4)}",
                "change": change.replace("-", "−"),
                "unit": superscript(estimate.unit) or "–",
            }
        )
    return rows


def _change_panel(identification: Identification) -> str:
    """Draw each estimate with its 95 % interval, as a change from the ship file's value."""
    shown = [e for e in identification.estimates if e.neutral != 0.0]
    height = max(HEIGHT, 0.9 + 0.3 * len(shown))
    figure, axes = panel(
        "Change of each parameter", "estimate / ship file − 1 [%]", "", height, 2.2
    )
    for place, estimate in enumerate(shown):
        change = 100.0 * (estimate.value / estimate.neutral - 1.0)
        half = 100.0 * HALF_95 * estimate.standard_error / abs(estimate.neutral)
        axes.errorbar(change, place, xerr=half, fmt="o", color=AFTER, markersize=4, capsize=3)
    axes.axvline(0.0, color=MEASURED, linewidth=0.7)
    axes.set_yticks(range(len(shown)), [parameter_words(e.name, e.unit) for e in shown], fontsize=7)
    axes.set_ylim(len(shown) - 0.5, -0.5)
    return svg(figure, "change of each parameter with its 95 % interval", "n0")


def _correlation_panels(identification: Identification) -> list[str]:
    """Draw the correlation matrix of the estimates; nothing for a single parameter."""
    if len(identification.estimates) < 2:
        return []
    count = len(identification.estimates)
    height = max(HEIGHT, 0.9 + 0.3 * count)
    figure, axes = panel("Correlation of the estimates", "", "", height, 2.2)
    axes.imshow(identification.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r", aspect="auto")
    for (i, j), value in np.ndenumerate(identification.correlation):
        dark = abs(value) > 0.6
        axes.text(j, i, f"{value:.2f}".replace("-", "−"), ha="center", va="center",
                  fontsize=7, color="white" if dark else MEASURED)  # fmt: skip
    names = [parameter_words(e.name, e.unit) for e in identification.estimates]
    axes.set_yticks(range(count), names, fontsize=7)
    axes.set_xticks(range(count), [str(i + 1) for i in range(count)], fontsize=7)
    axes.grid(visible=False)
    return [svg(figure, "correlation of the estimates", "n1")]


def _search_panels(identification: Identification) -> list[str]:
    """Draw the distance of 2 log L from its maximum and the parameters, by step of the search."""
    table = identification.tables.get("search")
    if table is None or len(table) < 2:
        return []
    if "cost" in table:  # the method has a cost function and no likelihood
        return [_cost_panel(table)]
    bands = table.get("highest_Hz", pd.Series(0.0, table.index))
    searches = table["2logL"].groupby(bands, sort=False)
    left = (searches.transform("last") - table["2logL"]).to_numpy()
    figure, axes = panel("Distance from the maximum", "step", "2 log L below the maximum")
    axes.semilogy(np.maximum(left, 1e-3), "o-", color=AFTER, markersize=4)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    drawn = [svg(figure, "2 log L over the steps of the search", "s0")]
    figure, axes = panel("Parameters by step", "step", "share of the final change [%]")
    units = {estimate.key: estimate.unit for estimate in identification.estimates}
    for key in units:
        values = table[key].to_numpy()
        change = values[-1] - values[0]
        if change != 0.0 and math.isfinite(change):
            axes.plot(100.0 * (values - values[0]) / change, "o-", markersize=3,
                      label=parameter_words(key.split(".")[-1], units[key]))  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=6, frameon=False, loc="upper right", ncols=2)
    drawn.append(svg(figure, "parameters over the steps of the search", "s1"))
    return drawn


def _cost_panel(table: pd.DataFrame) -> str:
    """Draw the weighted sum of squared errors by evaluation of the search."""
    figure, axes = panel("Cost function", "evaluation", "weighted sum of squared errors")
    axes.semilogy(np.maximum(table["cost"], 1e-3), color=AFTER)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return svg(figure, "weighted sum of squared errors over the evaluations of the search", "s0")
