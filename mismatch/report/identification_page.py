"""``report.html`` of an identification: one self-contained page with embedded figures."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.ticker import MaxNLocator

from ..estimate import HALF_95
from .figures import AFTER, HEIGHT, MEASURED, panel, svg, trace_panels
from .html import style, template
from .wording import (
    breakable_key,
    channel_name,
    number,
    parameter_words,
    superscript,
)

if TYPE_CHECKING:
    from ..identify import Identification


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
