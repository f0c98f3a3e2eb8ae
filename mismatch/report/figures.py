"""Small drawings for the report: SVG that stands inside the page, and what they have in common.

A report is read on wide and on narrow screens, so a figure is a row of small panels that the page wraps,
each drawn at the size at which it is read.

Figures over the operating regime: where a balance lacks what, and the shape of what has no name.

Figures of a diagnosis over time, over frequency and by name, each a list of :mod:`.panels`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from html import escape
from typing import Any, Protocol

import matplotlib
import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from ..estimate import HALF_95
from ..outcome import Outcome
from ..search.catalogue import Window
from .wording import (
    channel_name,
    number,
    scaled,
    superscript,
    time_unit,
    with_unit,
)

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER, QUIET, HELD_OUT, WINDOW = (
    "#1f2a44", "#d1495b", "#00798c", "#8d99ae", "#e9ecf1", "#f6e3b4",
)  # fmt: skip
"""Colours of recording, nominal ship, corrected ship, what is in the background, and two shadings."""

BEFORE_LINE: dict[str, Any] = {"color": BEFORE, "linewidth": 1.25, "linestyle": (0, (3.5, 1.6))}
AFTER_LINE: dict[str, Any] = {"color": AFTER, "linewidth": 1.5}
"""Lines of the nominal and of the corrected ship; the dashed is drawn last, so both are seen."""

WIDTH, HEIGHT = 5.4, 2.35
"""Of a panel [inch]; the page shows it about 550 pixels wide."""

_SMALL, _NORMAL = 8.0, 8.8
_POINTS = 420

_UNKNOWN_TO_MATHTEXT = {
    r"\le ": r"\leq ",
    r"\ge ": r"\geq ",
    r"\bigl(": "(",
    r"\bigr)": ")",
    r"\bigl|": "|",
    r"\bigr|": "|",
}


def panel(
    title: str, x: str, y: str, height: float = HEIGHT, left: float = 0.7
) -> tuple[Figure, Axes]:
    """An empty panel.

    Args:
        title: above it.
        x: label of the horizontal axis.
        y: label of the vertical axis.
        height: [inch].
        left: margin for the labels of the vertical axis [inch].
    """
    figure = Figure(figsize=(WIDTH, height))
    above, below = 0.3, 0.46
    axes = figure.add_axes(
        (
            left / WIDTH,
            below / height,
            (WIDTH - left - 0.2) / WIDTH,
            (height - above - below) / height,
        )
    )
    axes.set_title(title, fontsize=_NORMAL, loc="left", color=MEASURED, fontweight="bold", pad=5)
    axes.set_xlabel(x, fontsize=_NORMAL, labelpad=2)
    axes.set_ylabel(y, fontsize=_NORMAL, labelpad=3)
    axes.tick_params(labelsize=_SMALL, length=3)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)
    return figure, axes


def svg(figure: Figure, label: str, prefix: str) -> str:
    """A figure as an SVG element.

    Args:
        figure: to draw.
        label: read out where the drawing is not seen.
        prefix: of its ids, which must differ from every other drawing's on the page.
    """
    buffer = io.StringIO()
    nothing: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    # the salt makes the ids, and so the page, the same at every run
    with matplotlib.rc_context({"svg.hashsalt": "shaftline", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{prefix}-", text)
    # a hundredth of a point is enough in what is drawn; letters are scaled and keep theirs
    text = re.sub(r'(?<= d=")[^"]*', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    text = text.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "", 1)
    text = text.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1).replace("xlink:href", "href")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)


def equation(latex: str, plain: str, prefix: str) -> str:
    """An equation as an SVG element, set by matplotlib; its plain text where it cannot be set.

    Args:
        latex: without the dollar signs.
        plain: the same in words and signs.
        prefix: of the drawing's ids.
    """
    spaced = latex + " "
    for unknown, known in _UNKNOWN_TO_MATHTEXT.items():
        spaced = spaced.replace(unknown, known)
    figure = Figure(figsize=(0.01, 0.01))
    figure.text(0.0, 0.0, f"${spaced.strip()}$", fontsize=13, color=MEASURED, math_fontfamily="cm")
    buffer = io.BytesIO()
    try:
        figure.savefig(buffer, format="svg")  # tells whether it can be set
    except ValueError:
        return f"<code>{escape(plain)}</code>"
    box = figure.get_tightbbox().padded(0.03)  # type: ignore[no-untyped-call]
    figure.set_size_inches(box.width, box.height)
    figure.texts[0].set_position((-box.x0 / box.width, -box.y0 / box.height))
    return svg(figure, plain, prefix)


def outline(time: Array, values: Array) -> tuple[Array, Array]:
    """A long trace as the lowest and highest value of each of some hundred stretches, in turn."""
    size = len(values) // _POINTS
    if size < 3:
        return time, values
    count = len(values) // size
    cut = values[: count * size].reshape(count, size)
    at = time[: count * size].reshape(count, size)
    pairs = np.column_stack([cut.min(axis=1), cut.max(axis=1)]).ravel()
    return np.column_stack([at[:, 0], at[:, size // 2]]).ravel(), pairs


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Some hundred evenly spaced points of a smooth trace."""
    step = max(1, len(values) // (3 * _POINTS))
    return time[::step], values[::step]


def block_rows(seconds: float, interval_s: float) -> int:
    """Rows of the blocks over which residuals are averaged: 5 s, less in a short recording."""
    return max(1, round(min(5.0, seconds / 60.0) / interval_s))


def blocks(values: Array, size: int, take: Callable[..., Any] = np.mean) -> Array:
    """A statistic of each block of ``size`` rows."""
    count = len(values) // size
    return np.asarray(take(values[: count * size].reshape(count, size), axis=1))


_BINS = 12


def located_rows(diagnosis: Outcome) -> list[int]:
    """Balances that the findings point to; where there are none, the one that wanders most."""
    if diagnosis.findings:
        return list(dict.fromkeys(f.row for f in diagnosis.findings))
    names = [name for name, _ in diagnosis.balances]
    if diagnosis.shape is not None and diagnosis.shape.balance in names:
        return [names.index(diagnosis.shape.balance)]
    if diagnosis.left_over is not None:
        return [diagnosis.left_over.balance]
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    means = [
        float(np.std(blocks(r, size)) / (np.std(r) + 1e-300)) for r in diagnosis.residual_before
    ]
    return [int(np.argmax(means))]


def signals_shown(diagnosis: Outcome) -> dict[str, tuple[Array, str, str]]:
    """Signals over which a residual is shown: values, name and unit.

    They are simulated, by the corrected ship: measured ones share their noise with the residual.
    """
    found = {}
    columns = {
        "shaft_speed": "shaft_speed_rad_s", "ship_speed": "ship_speed_m_s", "pitch_ratio": "pitch_ratio",
    }  # fmt: skip
    for key, column in columns.items():
        if column in diagnosis.after:
            found[key] = (diagnosis.after[column], *channel_name(column))
    found["drive"] = (diagnosis.drive, *channel_name(drive_column(diagnosis.ship)))
    return {k: v for k, v in found.items() if np.ptp(v[0]) > 0.02 * np.abs(v[0]).max()}


def binned(signal: Array, residual: Array, size: int) -> tuple[Array, Array, Array]:
    """Means of a residual in bins of equal count, and half their 95 % interval, from block means."""
    x, y = blocks(signal, size), blocks(residual, size)
    order = np.argsort(x)
    parts = [p for p in np.array_split(order, min(_BINS, max(1, len(order) // 5))) if len(p) > 1]
    error = [HALF_95 * np.std(y[p], ddof=1) / np.sqrt(len(p)) for p in parts]
    return (
        np.array([x[p].mean() for p in parts]),
        np.array([y[p].mean() for p in parts]),
        np.array(error),
    )


def regimes(diagnosis: Outcome) -> list[str]:
    """What the located balances lack over the operating regime, before and after."""
    drawn: list[str] = []
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    shape = diagnosis.shape
    for row in located_rows(diagnosis)[:2]:
        name, unit = diagnosis.balances[row]
        lines = [(diagnosis.residual_before[row], BEFORE)]
        if changed(diagnosis):
            lines.append((diagnosis.residual_after[row], AFTER))
        for key, (signal, words, signal_unit) in signals_shown(diagnosis).items():
            stats = [(*binned(signal, values, size), colour) for values, colour in lines]
            factor, shown = scaled(max(float(np.abs(s[1]).max()) for s in stats), unit)
            figure, axes = panel(
                f"{name} balance over {words}", with_unit(words, signal_unit),
                with_unit(f"missing {QUANTITY.get(name, '')}", shown),
            )  # fmt: skip
            axes.axhline(0.0, color=MEASURED, linewidth=0.6)
            if shape is not None and shape.signal == key and shape.balance == name:
                axes.plot(shape.knots, shape.values / factor, color=MEASURED, lw=1.2, ls="--")
            for x, mean, error, colour in stats:
                axes.errorbar(
                    x, mean / factor, yerr=error / factor, color=colour, markersize=3.2,
                    fmt="o--" if colour == BEFORE else "o-", linewidth=1.0, capsize=2,
                )  # fmt: skip
            drawn.append(
                svg(figure, f"residual of the {name} balance over {words}", f"g{len(drawn)}")
            )
    return drawn


def shape_panel(diagnosis: Outcome) -> list[str]:
    """What has no name, over the signal that it follows."""
    shape = diagnosis.shape
    if shape is None:
        return []
    factor, unit = scaled(float(np.abs(shape.values).max()), shape.unit)
    words = {"drive": "drive demand"}.get(shape.signal, shape.signal.replace("_", " "))
    label = with_unit(f"missing {QUANTITY.get(shape.balance, '')}", unit)
    figure, axes = panel(
        f"what the {shape.balance} balance lacks", with_unit(words, shape.signal_unit), label, 3.0
    )
    if shape.signal == "time":
        for a, b in diagnosis.held_out:
            axes.axvspan(a, b, color=HELD_OUT, linewidth=0)
    axes.axhline(0.0, color=MEASURED, linewidth=0.6)
    names = [name for name, _ in diagnosis.balances]
    followed = {"time": (diagnosis.time_s, "", ""), **signals_shown(diagnosis)}
    if shape.signal in followed and shape.balance in names:
        size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
        residual = diagnosis.residual_before[names.index(shape.balance)]
        # the nominal simulation's own signal: the shape was found over it
        nominal = {"shaft_speed": "shaft_speed_rad_s", "ship_speed": "ship_speed_m_s"}
        signal = diagnosis.before.get(nominal.get(shape.signal, ""), followed[shape.signal][0])
        axes.plot(
            blocks(signal, size), blocks(residual, size) / factor, ".", color=QUIET, markersize=3.0
        )
    axes.plot(shape.knots, shape.values / factor, "o-", color=BEFORE, linewidth=1.8, markersize=4.5)
    return [svg(figure, f"shape of what the {shape.balance} balance lacks", "s0")]


LEAST_SPECTRUM = 64
"""Rows in each piece of a recording whose spectra are averaged, at least."""

RANKED = 12
"""Candidates that the ranking shows."""

_SEA_Hz = (0.04, 0.4)
_HUMP = 3.0

QUANTITY = {
    "engine": "torque", "motor": "torque", "propeller": "torque", "load": "torque",
    "hull": "force", "sway": "force", "yaw": "moment", "thrust": "force",
    "pitch-actuator": "pitch ratio",
}  # fmt: skip
"""What a balance lacks."""


class Replayed(Protocol):
    """A recording beside two simulations of it: what a diagnosis and an identification both are."""

    @property
    def ship(self) -> Ship: ...  # noqa: D102
    @property
    def corrected(self) -> Ship: ...  # noqa: D102
    @property
    def time_s(self) -> Array: ...  # noqa: D102
    @property
    def held_out(self) -> list[Window]: ...  # noqa: D102
    @property
    def measured(self) -> dict[str, Array]: ...  # noqa: D102
    @property
    def before(self) -> dict[str, Array]: ...  # noqa: D102
    @property
    def after(self) -> dict[str, Array]: ...  # noqa: D102


def changed(diagnosis: Replayed) -> bool:
    """Whether the corrected ship differs from the nominal one."""
    return diagnosis.corrected != diagnosis.ship


def before_line(diagnosis: Replayed) -> dict[str, Any]:
    """Style of the nominal ship's lines: dashed only where another's lie under them."""
    return BEFORE_LINE if changed(diagnosis) else {**BEFORE_LINE, "linestyle": "-"}


def interval(diagnosis: Outcome) -> float:
    """Spacing of the rows [s]."""
    time = diagnosis.time_s
    return float(time[-1] - time[0]) / (len(time) - 1)


def traces(diagnosis: Replayed) -> list[str]:
    """Each channel measured and simulated: the whole recording, then the part set aside."""
    clock, seconds = time_unit(float(diagnosis.time_s[-1]))
    time = diagnosis.time_s / clock
    held_out = [(a / clock, b / clock) for a, b in diagnosis.held_out]
    drawn: list[str] = []
    rows = [(diagnosis.before, before_line(diagnosis))]
    if changed(diagnosis):
        rows.insert(0, (diagnosis.after, AFTER_LINE))
    for column, measured in diagnosis.measured.items():
        name, unit = channel_name(column)
        factor, unit = scaled(float(np.abs(measured).max()), unit)
        for start, end in [(0.0, float(time[-1])), *held_out[:1]]:
            whole = start == 0.0 and end == time[-1]
            part = (time >= start - 1e-9) & (time <= end + 1e-9)
            where = "" if whole else ", on the part set aside"
            figure, axes = panel(f"{name}{where}", f"time [{seconds}]", with_unit(name, unit))
            if whole:
                for a, b in held_out:
                    axes.axvspan(a, b, color=HELD_OUT, linewidth=0)
            axes.plot(
                *outline(time[part], measured[part] / factor),
                color=MEASURED,
                linewidth=0.7,
                alpha=0.45,
            )
            for channels, style in rows:
                axes.plot(*thinned(time[part], channels[column][part] / factor), **style)
            axes.set_xlim(start, end)
            drawn.append(svg(figure, f"{name} over time{where}", f"t{len(drawn)}"))
    return drawn


def residuals(diagnosis: Outcome) -> list[str]:
    """What each balance lacks over time, before and after."""
    time = diagnosis.time_s
    drawn: list[str] = []
    clock, seconds = time_unit(float(time[-1]))
    size = block_rows(float(time[-1]), interval(diagnosis))
    at = blocks(time, size) / clock
    for row, (name, unit) in enumerate(diagnosis.balances):
        before, after = diagnosis.residual_before[row], diagnosis.residual_after[row]
        means = [(blocks(before, size), before_line(diagnosis))]
        if changed(diagnosis):
            means.insert(0, (blocks(after, size), AFTER_LINE))
        largest = max(float(np.abs(m).max()) for m, _ in means)
        factor, shown = scaled(largest, unit)
        label = with_unit(f"missing {QUANTITY.get(name, '')}", shown)
        figure, axes = panel(f"{name} balance", f"time [{seconds}]", label)
        for a, b in diagnosis.held_out:
            axes.axvspan(a / clock, b / clock, color=HELD_OUT, linewidth=0)
        for a, b in _windows(diagnosis, row):
            axes.axvspan(a / clock, b / clock, color=WINDOW, alpha=0.6, linewidth=0)
        spread = blocks(before, size, np.std)
        low, high = _range([values for values, _ in means], float(np.median(spread)))
        if float(np.median(spread)) < high - low:
            band = ((means[-1][0] - spread) / factor, (means[-1][0] + spread) / factor)
            axes.fill_between(at, *band, color=QUIET, alpha=0.35, linewidth=0)
        else:
            prefix, in_unit = scaled(float(np.median(spread)), unit)
            size_of = number(float(np.median(spread)) / prefix, 2)
            text = f"samples spread by ±{size_of} {in_unit}".strip()
            axes.text(0.99, 0.96, text, transform=axes.transAxes, ha="right", va="top", fontsize=8)
        axes.axhline(0.0, color=MEASURED, linewidth=0.6)
        for values, style in means:
            axes.plot(at, values / factor, **style)
        axes.set_ylim(low / factor, high / factor)
        axes.set_xlim(0.0, time[-1] / clock)
        drawn.append(svg(figure, f"residual of the {name} balance over time", f"r{row}"))
    return drawn


def _range(means: list[Array], spread: float) -> tuple[float, float]:
    """Limits that show the means well; of a wide spread about them only what fits."""
    low = min(0.0, *(float(m.min()) for m in means))
    high = max(0.0, *(float(m.max()) for m in means))
    margin = min(1.3 * spread, 0.6 * (high - low)) + 0.05 * (high - low) + 1e-12
    return low - margin, high + margin


def _windows(diagnosis: Outcome, row: int) -> list[tuple[float, float]]:
    """Windows of what was found in a balance, those that hold all of the recording left out."""
    found = [w for f in diagnosis.findings if f.row == row for w in f.windows]
    if diagnosis.shape is not None and diagnosis.shape.balance == diagnosis.balances[row][0]:
        found += diagnosis.shape_windows
    return [w for w in found if w[1] - w[0] < 0.98 * float(diagnosis.time_s[-1])]


def spectra(diagnosis: Outcome) -> list[str]:
    """Spectrum of what each balance lacks, before and after."""
    drawn = []
    rate = 1.0 / interval(diagnosis)
    least = min(len(diagnosis.time_s) // 4, LEAST_SPECTRUM)
    length = max(least, min(len(diagnosis.time_s) // 4, round(120.0 * rate)))
    sails = diagnosis.ship.moves
    for row, (name, unit) in enumerate(diagnosis.balances):
        lines = [(diagnosis.residual_before[row], before_line(diagnosis))]
        if changed(diagnosis):
            lines.insert(0, (diagnosis.residual_after[row], AFTER_LINE))
        figure, axes = panel(f"{name} balance", "frequency [Hz]", "")
        lowest, highest = np.inf, 0.0
        for values, style in lines:
            frequency, power = smooth_spectrum(values, rate, length)
            axes.loglog(frequency, np.sqrt(power), **style)
            lowest, highest = min(lowest, float(power.min())), max(highest, float(power.max()))
        decades = np.floor(0.5 * np.log10(lowest)), np.ceil(0.5 * np.log10(highest))
        axes.set_ylim(10.0 ** decades[0], 10.0 ** decades[1])
        axes.yaxis.set_minor_formatter(NullFormatter())
        hump = sea_band(frequency, power) if sails else None
        if hump is not None:
            axes.axvspan(*hump, color=WINDOW, alpha=0.6, linewidth=0)
            axes.text(
                float(np.sqrt(hump[0] * hump[1])), 0.03, "sea", transform=axes.get_xaxis_transform(),
                ha="center", fontsize=8, color=MEASURED,
            )  # fmt: skip
        per_root = f"{superscript(unit)}/√Hz" if superscript(unit) else "1/√Hz"
        axes.set_ylabel(f"amplitude [{per_root}]", fontsize=8.8, labelpad=3)
        axes.set_xlim(frequency[0], frequency[-1])
        drawn.append(svg(figure, f"spectrum of the {name} balance's residual", f"f{row}"))
    return drawn


def smooth_spectrum(values: Array, rate: float, length: int) -> tuple[Array, Array]:
    """One-sided power density, averaged over 24 bands a decade."""
    frequency, power = scipy.signal.welch(values, rate, nperseg=max(8, length), detrend=False)
    frequency, power = frequency[1:], power[1:]
    band = np.floor(24.0 * np.log10(frequency / frequency[0]) + 1e-9).astype(int)
    _, which = np.unique(band, return_inverse=True)
    count = np.bincount(which)
    return (
        np.asarray(np.exp(np.bincount(which, np.log(frequency)) / count)),
        np.asarray(np.bincount(which, power) / count + 1e-300),
    )


def sea_band(frequency: Array, power: Array) -> tuple[float, float] | None:
    """Band in which waves lift a spectrum above the line between its neighbours, if they do."""
    low, high = _SEA_Hz
    sides = [(frequency >= a) & (frequency <= b) for a, b in ((0.4 * low, low), (high, 2.5 * high))]
    inside = (frequency > low) & (frequency < high)
    if inside.sum() < 5 or any(side.sum() < 2 for side in sides):
        return None
    x, y = np.log(frequency), np.log(power)
    ends = [(float(x[s].mean()), float(np.median(y[s]))) for s in sides]
    excess = y - np.interp(x, [p[0] for p in ends], [p[1] for p in ends])
    if float(excess[inside].max()) < np.log(_HUMP):
        return None
    lifted = frequency[inside & (excess > 0.5 * float(excess[inside].max()))]
    return float(lifted[0]), float(lifted[-1])


def ranking(diagnosis: Outcome) -> list[str]:
    """The catalogue's best candidates and the threshold of each."""
    best = diagnosis.ranking[:RANKED]
    if not best:
        return []
    height = 0.75 + 0.24 * len(best)
    label = "gain in 2 log L of each alone (| its threshold)"
    figure, axes = panel("", label, "", height, left=2.15)
    chosen = {f.effect.label for f in diagnosis.findings}
    rivals = {c.effect.label for f in diagnosis.findings for c in f.rivals}
    for place, (candidate, limit) in enumerate(best):
        gain, name = candidate.gain, candidate.effect.label
        colour = AFTER if name in chosen else "#7fbcc5" if name in rivals else QUIET
        axes.barh(
            place, max(gain, 0.0), color=colour, alpha=1.0 if gain > limit else 0.6, height=0.62
        )
        axes.plot([limit, limit], [place - 0.42, place + 0.42], color=BEFORE, linewidth=1.6)
        text = f"{gain:.0f}" if gain >= 0.5 else "none"
        axes.annotate(
            text,
            (max(gain, limit), place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.0,
        )
    top = max(max(c.gain, limit) for c, limit in best)
    # linear up to the thresholds, so that what passes and what does not are told apart
    axes.set_xscale("symlog", linthresh=max(limit for _, limit in best))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.set_xlim(0.0, top * (1.8 if top > 60.0 else 1.15))
    axes.set_yticks(range(len(best)), [c.effect.label for c, _ in best])
    axes.set_ylim(len(best) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    return [svg(figure, "ranking of the candidates with their thresholds", "k0")]
