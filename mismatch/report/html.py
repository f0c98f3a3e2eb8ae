"""``report.html`` of a diagnosis or an identification: a self-contained page with embedded figures."""

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
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...core.statistics import HALF_95
from ...plant.ship import Ship, ShipError
from ..judge.verdict import NOTHING
from ..outcome import Outcome
from ..search.catalogue import SizedEffect, catalogue, confusable_ids
from . import figures
from .figures import AFTER, HEIGHT, MEASURED, equation, panel, svg, with_label
from .first_page import FirstPage, first_page
from .text import CONSTANT, VERDICT_WORDS, headline, lacking_or_excess, remarks, sentence, status
from .wording import (
    DAY_S,
    biased_parameter_sentence,
    biased_parameters,
    breakable_key,
    capitalise,
    channel_name,
    effect_words,
    formula_for_page,
    number,
    numbers,
    p_value_in_words,
    parameter_rows_for_page,
    parameter_words,
    percent,
    scale_unit,
    superscript,
    time_span,
    time_unit,
    unbroken,
    value_with_unit,
    values_by_key,
    windows_in_words,
)

if TYPE_CHECKING:
    from ..identify import Identification


def report_html(diagnosis: Outcome) -> str:
    """Return the page of a diagnosis with its style sheet, equations and figures."""
    fields = report_fields(diagnosis)
    for finding, card in zip(diagnosis.findings, fields["findings"], strict=True):
        effect = finding.effect
        card["equation"] = Markup(equation(effect.latex, effect.equation, f"e{card['index']}"))
    return _render("report.html.j2", report_panels(diagnosis, fields["first"]), **fields)


def report_panels(diagnosis: Outcome, first: FirstPage) -> dict[str, list[Figure]]:
    """Return the figures of a diagnosis by the part of the report to which they belong."""
    mover = "engine" if diagnosis.ship.has_diesel else "drive"
    return {
        "speed-power": figures.speed_power_panel(first.service, mover),
        "traces": figures.trace_panels(diagnosis),
        "residuals": figures.residual_panels(diagnosis),
        "regimes": figures.regime_panels(diagnosis),
        "spectra": figures.spectrum_panels(diagnosis),
        "ranking": figures.ranking_panels(diagnosis),
        "shape": figures.shape_panel(diagnosis),
    }


def report_fields(diagnosis: Outcome) -> dict[str, Any]:
    """Return the content of the report other than figures, as text and tables."""
    return {
        "d": diagnosis,
        "first": first_page(diagnosis),
        "status": status(diagnosis),
        "verdict": VERDICT_WORDS[status(diagnosis)],
        "headline": headline(diagnosis),
        "sentence": sentence(diagnosis),
        "changed": figures.is_corrected(diagnosis),
        "facts": _facts(diagnosis),
        "fits": _fits(diagnosis),
        "findings": [_finding(diagnosis, i) for i in range(len(diagnosis.findings))],
        "shape": _shape(diagnosis),
        "balances": _balances(diagnosis),
        "formula": formula_for_page(diagnosis.formula),
        "located": [diagnosis.balances[row][0] for row in figures.balances_to_show(diagnosis)[:2]],
        "shown": min(figures.RANKED, len(diagnosis.ranking)),
        "detectable": _detectable_rows(diagnosis),
        "without_size": _without_size(diagnosis),
        "parameters": parameter_rows_for_page(diagnosis),
        "remarks": remarks(diagnosis),
        "keys": changed_keys(diagnosis),
    }


def _render(template: str, drawn: dict[str, list[Figure]], **fields: Any) -> str:
    """Return a page from a template of this package, its figures and its fields."""
    elements = {
        key: [Markup(svg(figure, f"{key}{place}")) for place, figure in enumerate(panels)]
        for key, panels in drawn.items()
    }
    return _template(template).render(
        figures=elements, version=version("shaftline"), style=Markup(_text("style.css")), **fields
    )


@functools.cache
def _template(name: str) -> Template:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["unbroken"] = unbroken
    return environment.from_string(_text(name))


def _text(name: str) -> str:
    return importlib.resources.files("shaftline.mismatch.report").joinpath(name).read_text("utf-8")


def changed_keys(diagnosis: Outcome) -> list[tuple[Markup, str, str]]:
    """Return the keys of the ship file that the correction changes, with old and new value."""
    ship = diagnosis.corrected
    old, new = values_by_key(diagnosis.ship), values_by_key(ship)
    return [
        (breakable_key(key), _value(old.get(key), key, ship), _value(value, key, ship))
        for key, value in new.items()
        if value != old.get(key)
    ]


def _value(value: Any, key: str, ship: Ship) -> str:
    if value is None:
        return "absent"
    if isinstance(value, list | tuple):
        return ", ".join(_value(item, "", ship) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    try:
        unit = ship.parameter(key).info.unit if key else "-"
    except (ShipError, KeyError, ValueError):
        unit = "-"
    return f"{number(float(value), 5)} {superscript(unit)}".strip()


def _balances(diagnosis: Outcome) -> list[dict[str, str]]:
    """Return one table row for each balance."""
    rows = []
    for balance in diagnosis.balance_verdicts:
        left, share, residual = balance.left, percent(balance.explained), "noise"
        if left is not None:
            ratio, low, high = (number(x, 2) for x in (left.ratio, left.low_Hz, left.high_Hz))
            residual = f"{ratio} times the noise's power between {low} and {high} Hz"
        elif balance.verdict == NOTHING:
            share = "–"
        verdict = VERDICT_WORDS[balance.verdict]
        row = {"name": balance.name, "verdict": verdict, "share": share, "residual": residual}
        rows.append(row)
    return rows


def _finding(diagnosis: Outcome, index: int) -> dict[str, Any]:
    """Return the fields of a finding for the page."""
    finding, ship = diagnosis.findings[index], diagnosis.ship
    effect = finding.effect
    rows = []
    for estimate in finding.estimates:
        factor, shown = scale_unit(abs(estimate.value), estimate.unit)
        value, *ends = numbers([one / factor for one in (estimate.value, *estimate.ci95)])
        interval = " … ".join(ends)
        if estimate.is_undetermined:
            interval = "not determined"
        if finding.unmeasured:
            interval = "not measured"
        rows.append(
            {
                "name": parameter_words(estimate.name, estimate.unit),
                "key": breakable_key(estimate.key),
                "value": value,
                "interval": interval,
                "unit": shown or "–",
            }
        )
    biased = biased_parameters(diagnosis)[index]
    return {
        "name": capitalise(effect_words(effect)),
        "effect": effect,
        "mistaken_for": confusable_ids(effect, ship),
        "index": index + 1,
        "lacks": lacking_or_excess(finding),
        "parameters": rows,
        "rivals": [_rival(c.sized_effect, ship) for c in finding.rivals],
        "biased": "" if biased is None else biased_parameter_sentence(biased),
        "score": number(finding.score),
        "threshold": number(finding.threshold),
        "p_value": p_value_in_words(finding.p_value),
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
    duration, step = float(time[-1]), diagnosis.interval_s
    minutes = f" ({duration / 60.0:.0f} min)" if duration >= 120.0 else ""
    if time_unit(duration)[1] != "s":
        minutes = f" ({duration / DAY_S:.1f} days)"
    facts = [
        ("Ship", diagnosis.ship.name),
        ("Recording", f"{duration:.0f} s{minutes}, {len(time)} rows, one every {step:.3g} s"),
        ("Held-out data, never fitted", ", ".join(time_span(a, b) for a, b in held)),
        ("Balances checked", ", ".join(name for name, _ in diagnosis.balances)),
        ("Effects tried", f"{len(diagnosis.tried)} of {len(catalogue())} in the catalogue"),
    ]
    if diagnosis.findings:
        share = percent(diagnosis.explained)
        facts += [
            ("Explained", f"{share} of the mean square of the difference beyond noise"),
            ("2 Δ log L on held-out data", number(diagnosis.held_out_gain)),
        ]
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
        row = {"name": channel_name(column)[0], "none": CONSTANT}
        if column in diagnosis.fit_before:
            before, after = diagnosis.fit_before[column], diagnosis.fit_after[column]
            row |= {"none": "", "before": percent(before), "after": percent(after)}
            row |= {"wide_before": width(before), "wide_after": width(after)}
        rows.append(row)
    return rows


def _shape(diagnosis: Outcome) -> dict[str, Any] | None:
    shape = diagnosis.shape
    if shape is None:
        return None
    factor, unit = scale_unit(float(np.abs(shape.values).max()), shape.unit)
    points = zip(shape.knots.tolist(), shape.values.tolist(), strict=True)
    return {
        "signal": shape.signal.replace("_", " "),
        "unit": unit,
        "rows": [(number(x), number(y / factor)) for x, y in points],
        "gain": number(shape.gain),
        "threshold": number(shape.threshold),
        "windows": windows_in_words(diagnosis.shape_windows, float(diagnosis.time_s[-1])),
        "regime": diagnosis.shape_regime.replace("_", " "),
    }


def _detectable_rows(diagnosis: Outcome) -> list[dict[str, str]]:
    found = sorted(diagnosis.detectable, key=lambda item: (item.effect.balance, item.effect.id))
    return [
        {
            "effect": capitalise(effect_words(item.effect)),
            "balance": item.effect.balance,
            "parameter": parameter_words(item.effect.parameters[0].name, item.unit),
            "size": value_with_unit(item.value, item.unit),
            "needs": item.effect.excitation,
        }
        for item in found
    ]


def _without_size(diagnosis: Outcome) -> dict[str, list[str]]:
    """Return the effects without a smallest detectable size: untried, or with several parameters."""
    tried = diagnosis.tried
    sized = {item.effect.label for item in diagnosis.detectable}
    labels = [effect.label for effect in catalogue()]
    return {
        "untried": [x for x in labels if x not in tried],
        "unsized": [x for x in labels if x in tried and x not in sized],
    }


def identification_html(identification: Identification) -> str:
    """Return the page of an identification with its style sheet and figures."""
    drawn = {
        "parameters": [*_change_panels(identification), *_correlation_panels(identification)],
        "traces": figures.trace_panels(identification) if identification.fit_before else [],
        "search": _search_panels(identification),
        "noise": _noise_panels(identification),
    }
    before, after = identification.fit_before, identification.fit_after
    fits = [
        {"name": channel_name(c)[0], "before": f"{before[c]:.1f}", "after": f"{after[c]:.1f}"}
        for c in before
    ]
    said, rows = _sentence(identification), _rows(identification)
    return _render(
        "identified.html.j2", drawn, i=identification, sentence=said, rows=rows, fits=fits
    )


def _sentence(identification: Identification) -> str:
    """Return which parameters were identified, and the channel whose fit improves most."""
    count, before, after = (
        len(identification.estimates),
        identification.fit_before,
        identification.fit_after,
    )
    plural = "s" if count > 1 else ""
    name, method = identification.ship.name, identification.method
    words = f"{name}: {count} parameter{plural} identified by {method}"
    if not before:
        return words + "."
    best = max(before, key=lambda column: after[column] - before[column])
    return (
        f"{words}; FitPercent of {channel_name(best)[0]} changes from {before[best]:.1f} to "
        f"{after[best]:.1f} %."
    )


def _rows(identification: Identification) -> list[dict[str, Any]]:
    rows = []
    for estimate in identification.estimates:
        before = estimate.neutral
        change = f"{100.0 * (estimate.value / before - 1.0):+.1f} %" if before else "new"
        rows.append(
            {
                "key": breakable_key(estimate.key),
                "before": number(before, 4),
                "value": number(estimate.value, 4),
                "interval": " … ".join(number(end, 4) for end in estimate.ci95),
                "change": change.replace("-", "−"),
                "unit": superscript(estimate.unit) or "–",
            }
        )
    return rows


def _change_panels(identification: Identification) -> list[Figure]:
    """Draw the change of each estimate from the ship file, unless that is 0, with its 95 % interval."""
    shown = [e for e in identification.estimates if e.neutral != 0.0]
    if not shown:
        return []
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
    return [with_label(figure, "change of each parameter with its 95 % interval")]


def _correlation_panels(identification: Identification) -> list[Figure]:
    """Draw the correlation matrix of the estimates; nothing for a single parameter."""
    if (count := len(identification.estimates)) < 2:
        return []
    height = max(HEIGHT, 0.9 + 0.3 * count)
    figure, axes = panel("Correlation of the estimates", "", "", height, 2.2)
    axes.imshow(identification.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r", aspect="auto")
    for (i, j), value in np.ndenumerate(identification.correlation):
        text, colour = f"{value:.2f}".replace("-", "−"), "white" if abs(value) > 0.6 else MEASURED
        axes.text(j, i, text, ha="center", va="center", fontsize=7, color=colour)
    names = [parameter_words(e.name, e.unit) for e in identification.estimates]
    axes.set_yticks(range(count), names, fontsize=7)
    axes.set_xticks(range(count), [str(i + 1) for i in range(count)], fontsize=7)
    axes.grid(visible=False)
    return [with_label(figure, "correlation of the estimates")]


def _noise_panels(identification: Identification) -> list[Figure]:
    """Draw the adaptive noises of the filter over time, as ratios to those at the beginning."""
    if not identification.adapted_noise:
        return []
    table = identification.tables["noise"]
    title, label = "Noise over that at the beginning", "adaptive noises of the filter over time"
    figure, axes = panel(title, "time [s]", "ratio of standard deviations")
    for name, (first, _) in identification.adapted_noise.items():
        axes.semilogy(table["time_s"], table[name] / first, linewidth=1.0, label=name)
    axes.legend(fontsize=6, frameon=False)
    return [with_label(figure, label)]


def _search_panels(identification: Identification) -> list[Figure]:
    """Draw the distance of 2 log L from its maximum and the parameters, by step of the search."""
    table = identification.tables.get("search")
    if table is None or len(table) < 2:
        return []
    if "cost" in table:  # the method has a cost function and no likelihood
        figure, axes = panel("Cost function", "evaluation", "weighted sum of squared errors")
        axes.semilogy(np.maximum(table["cost"], 1e-3), color=AFTER)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        label = "weighted sum of squared errors over the evaluations of the search"
        return [with_label(figure, label)]
    bands = table.get("highest_Hz", pd.Series(0.0, table.index))
    searches = table["2logL"].groupby(bands, sort=False)
    left = (searches.transform("last") - table["2logL"]).to_numpy()
    figure, axes = panel("Distance from the maximum", "step", "2 log L below the maximum")
    axes.semilogy(np.maximum(left, 1e-3), "o-", color=AFTER, markersize=4)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    drawn = [with_label(figure, "2 log L over the steps of the search")]
    figure, axes = panel("Parameters by step", "step", "share of the final change [%]")
    for e in identification.estimates:
        values = table[e.key].to_numpy()
        change = values[-1] - values[0]
        if change != 0.0 and math.isfinite(change):
            words = parameter_words(e.name, e.unit)
            axes.plot(100.0 * (values - values[0]) / change, "o-", markersize=3, label=words)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=6, frameon=False, loc="upper right", ncols=2)
    return [*drawn, with_label(figure, "parameters over the steps of the search")]
