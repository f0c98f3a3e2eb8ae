"""Figures of the reports: over time, frequency and operating regime, by effect, and power over speed.

The pages are read on wide and on narrow screens. Each figure is therefore a list of small panels, drawn
at their final size, that the page wraps into rows. A panel is a matplotlib figure whose label describes
it; pages contain it as an SVG element, the PDF as it is.
"""

from __future__ import annotations

import functools
import io
import re
from html import escape
from typing import Any, Protocol

import matplotlib
import matplotlib.mlab
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from ...core.statistics import HALF_95
from ...plant.columns import drive_column
from ...plant.ship import Ship
from ...plant.surroundings import KNOT
from ..outcome import Outcome, block_statistics
from ..search.catalogue import Window
from .service import ENGINE_POWER, Service
from .wording import axis_label, channel_name, number, scale_unit, superscript, time_unit

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER, QUIET, HELD_OUT, WINDOW = (
    "#1f2a44",
    "#d1495b",
    "#00798c",
    "#8d99ae",
    "#e9ecf1",
    "#f6e3b4",
)
"""Colours of the recording, the nominal ship, the corrected ship, the background and two shadings."""

BEFORE_LINE: dict[str, Any] = {"color": BEFORE, "linewidth": 1.25, "linestyle": (0, (3.5, 1.6))}
AFTER_LINE: dict[str, Any] = {"color": AFTER, "linewidth": 1.5}
"""Line styles of the nominal and the corrected ship; the dashed line is drawn last to show both."""

WIDTH, HEIGHT = 5.4, 2.35  # Size of a panel [inch]; the page shows it about 550 pixels wide

_SMALL, _NORMAL = 8.0, 8.8
TITLE_OF_PANEL = _NORMAL  # size of letters [pt]
_POINTS = 420
_BINS = 12
SHOWN = 0.72, 1.1  # range of speed of the figure of power, in service speeds
LEAST_SPECTRUM = 64  # smallest number of rows in each segment whose spectra are averaged
RANKED = 12  # number of candidates that the ranking shows
_SEA_Hz = (0.04, 0.4)
_HUMP = 3.0

QUANTITY = {
    "engine": "torque",
    "motor": "torque",
    "propeller": "torque",
    "load": "torque",
    "hull": "force",
    "sway": "force",
    "yaw": "moment",
    "thrust": "force",
    "pitch-actuator": "pitch ratio",
}
"""Quantity of each balance's residual."""

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
    """Return an empty panel with a title and axis labels; height and left margin are in inches."""
    figure = Figure(figsize=(WIDTH, height))
    above, below = 0.3, 0.46
    width, inner = (WIDTH - left - 0.2) / WIDTH, (height - above - below) / height
    axes = figure.add_axes((left / WIDTH, below / height, width, inner))
    axes.set_title(
        title, fontsize=_NORMAL, loc="left", color=MEASURED, fontweight="bold", pad=5, y=1.0
    )  # with y given, matplotlib need not measure all labels
    axes.set_xlabel(x, fontsize=_NORMAL, labelpad=2)
    axes.set_ylabel(y, fontsize=_NORMAL, labelpad=3)
    axes.tick_params(labelsize=_SMALL, length=3)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)
    return figure, axes


@functools.lru_cache(maxsize=20000)
def text_width(words: str, size: float, bold: bool = False) -> float:
    """Return the width of a line [inch] at a size of letters [pt].

    >>> text_width("two", 20.0) / text_width("two", 10.0)
    2.0
    """
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    width, _, _ = text_to_path.get_text_width_height_descent(words, font, False)
    return float(width) / 72.0


def with_label(figure: Figure, label: str) -> Figure:
    """Return a figure with a description for screen readers."""
    figure.set_label(label)
    return figure


def svg(figure: Figure, prefix: str) -> str:
    """Return a figure as an SVG element; the prefix of the element's ids is unique on the page."""
    label = str(figure.get_label())
    buffer = io.StringIO()
    no_metadata: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    # A fixed salt makes the ids, and thereby the page, reproducible.
    with matplotlib.rc_context({"svg.hashsalt": "shaftline", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", transparent=True, metadata=no_metadata)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{prefix}-", text)
    # Curves need hundredths of a point; glyphs are scaled and keep their digits.
    text = re.sub(r'(?<= d=")[^"]*', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    text = text.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "", 1)
    text = text.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1).replace("xlink:href", "href")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)


def equation(latex: str, plain: str, prefix: str) -> str:
    """Return an equation (LaTeX without dollar signs) as an SVG element.

    It is plain text where matplotlib cannot typeset it.
    """
    figure = equation_figure(latex)
    if figure is None:
        return f"<code>{escape(plain)}</code>"
    return svg(with_label(figure, plain), prefix)


def equation_figure(latex: str) -> Figure | None:
    """Return an equation as a figure of its size; None where matplotlib cannot typeset it."""
    spaced = latex + " "
    for unknown, known in _UNKNOWN_TO_MATHTEXT.items():
        spaced = spaced.replace(unknown, known)
    figure = Figure(figsize=(0.01, 0.01))
    figure.text(0.0, 0.0, f"${spaced.strip()}$", fontsize=13, color=MEASURED, math_fontfamily="cm")
    buffer = io.BytesIO()
    try:
        figure.savefig(buffer, format="svg")  # raises ValueError if mathtext lacks a command
    except ValueError:
        return None
    box = figure.get_tightbbox().padded(0.03)  # type: ignore[no-untyped-call]
    figure.set_size_inches(box.width, box.height)
    figure.texts[0].set_position((-box.x0 / box.width, -box.y0 / box.height))
    return figure


def outline(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the lowest and highest value of each of some hundred sections of a long trace, in turn."""
    size = len(values) // _POINTS
    if size < 3:
        return time, values
    count = len(values) // size
    cut, at = (trace[: count * size].reshape(count, size) for trace in (values, time))
    pairs = np.column_stack([cut.min(axis=1), cut.max(axis=1)]).ravel()
    return np.column_stack([at[:, 0], at[:, size // 2]]).ravel(), pairs


def thin(time: Array, values: Array) -> tuple[Array, Array]:
    """Return some hundred evenly spaced points of a smooth trace."""
    step = max(1, len(values) // (3 * _POINTS))
    return time[::step], values[::step]


def balances_to_show(diagnosis: Outcome) -> list[int]:
    """Return the rows of the balances with findings, else of the one with the largest slow variation."""
    if diagnosis.findings:
        return list(dict.fromkeys(f.row for f in diagnosis.findings))
    names = [name for name, _ in diagnosis.balances]
    if diagnosis.shape is not None and diagnosis.shape.balance in names:
        return [names.index(diagnosis.shape.balance)]
    if diagnosis.left_over is not None:
        return [diagnosis.left_over.balance]
    size, before = diagnosis.rows_of_a_block, diagnosis.residual_before
    slow = [float(np.std(block_statistics(r, size)) / (np.std(r) + 1e-300)) for r in before]
    return [int(np.argmax(slow))]


def signals_to_show(diagnosis: Outcome) -> dict[str, tuple[Array, str, str]]:
    """Return the signals over which residuals are drawn: values, name and unit.

    They are simulated with the corrected ship, because the noise of measured signals is also in the
    residual.
    """
    columns = {
        "shaft_speed": "shaft_speed_rad_s",
        "ship_speed": "ship_speed_m_s",
        "pitch_ratio": "pitch_ratio",
    }
    after = diagnosis.after
    found = {k: (after[c], *channel_name(c)) for k, c in columns.items() if c in after}
    found["drive"] = (diagnosis.drive, *channel_name(drive_column(diagnosis.ship)))
    return {k: v for k, v in found.items() if np.ptp(v[0]) > 0.02 * np.abs(v[0]).max()}


def bin_means(signal: Array, residual: Array, size: int) -> tuple[Array, Array, Array]:
    """Return bin centres, means and half the 95 % intervals of a residual in bins of equal count."""
    x, y = block_statistics(signal, size), block_statistics(residual, size)
    order = np.argsort(x)
    parts = [p for p in np.array_split(order, min(_BINS, max(1, len(order) // 5))) if len(p) > 1]
    centres, means = ([values[p].mean() for p in parts] for values in (x, y))
    error = [HALF_95 * np.std(y[p], ddof=1) / np.sqrt(len(p)) for p in parts]
    return np.array(centres), np.array(means), np.array(error)


def regime_panels(diagnosis: Outcome) -> list[Figure]:
    """Draw the residuals of the located balances over the operating regime, before and after."""
    drawn: list[Figure] = []
    size, shape = diagnosis.rows_of_a_block, diagnosis.shape
    for row in balances_to_show(diagnosis)[:2]:
        name, unit = diagnosis.balances[row]
        lines = [(diagnosis.residual_before[row], BEFORE)]
        if is_corrected(diagnosis):
            lines.append((diagnosis.residual_after[row], AFTER))
        for key, (signal, words, signal_unit) in signals_to_show(diagnosis).items():
            stats = [(*bin_means(signal, values, size), colour) for values, colour in lines]
            factor, shown = scale_unit(max(float(np.abs(s[1]).max()) for s in stats), unit)
            figure, axes = panel(
                f"{name} balance over {words}",
                axis_label(words, signal_unit),
                axis_label(f"missing {QUANTITY.get(name, '')}", shown),
            )
            axes.axhline(0.0, color=MEASURED, linewidth=0.6)
            if shape is not None and shape.signal == key and shape.balance == name:
                axes.plot(shape.knots, shape.values / factor, color=MEASURED, lw=1.2, ls="--")
            for x, mean, error, colour in stats:
                axes.errorbar(
                    x,
                    mean / factor,
                    yerr=error / factor,
                    color=colour,
                    markersize=3.2,
                    fmt="o--" if colour == BEFORE else "o-",
                    linewidth=1.0,
                    capsize=2,
                )
            drawn.append(with_label(figure, f"residual of the {name} balance over {words}"))
    return drawn


def shape_panel(diagnosis: Outcome) -> list[Figure]:
    """Draw a shape over the signal that it depends on."""
    shape = diagnosis.shape
    if shape is None:
        return []
    factor, unit = scale_unit(float(np.abs(shape.values).max()), shape.unit)
    words = {"drive": "drive command"}.get(shape.signal, shape.signal.replace("_", " "))
    label = axis_label(f"missing {QUANTITY.get(shape.balance, '')}", unit)
    figure, axes = panel(
        f"residual of the {shape.balance} balance", axis_label(words, shape.signal_unit), label, 3.0
    )
    if shape.signal == "time":
        for a, b in diagnosis.held_out:
            axes.axvspan(a, b, color=HELD_OUT, linewidth=0)
    axes.axhline(0.0, color=MEASURED, linewidth=0.6)
    names = [name for name, _ in diagnosis.balances]
    signals = {"time": (diagnosis.time_s, "", ""), **signals_to_show(diagnosis)}
    if shape.signal in signals and shape.balance in names:
        size = diagnosis.rows_of_a_block
        residual = diagnosis.residual_before[names.index(shape.balance)]
        # The shape was fitted over the signal of the nominal simulation.
        nominal = {"shaft_speed": "shaft_speed_rad_s", "ship_speed": "ship_speed_m_s"}
        signal = diagnosis.before.get(nominal.get(shape.signal, ""), signals[shape.signal][0])
        x, y = block_statistics(signal, size), block_statistics(residual, size) / factor
        axes.plot(x, y, ".", color=QUIET, markersize=3.0)
    axes.plot(shape.knots, shape.values / factor, "o-", color=BEFORE, linewidth=1.8, markersize=4.5)
    return [with_label(figure, f"shape of the residual of the {shape.balance} balance")]


class Comparison(Protocol):
    """A recording with simulations before and after a correction: a diagnosis or an identification."""

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


def is_corrected(diagnosis: Comparison) -> bool:
    """Return whether the corrected ship differs from the nominal one."""
    return diagnosis.corrected != diagnosis.ship


def nominal_line(diagnosis: Comparison) -> dict[str, Any]:
    """Return the line style of the nominal ship: dashed where the corrected ship has a line as well."""
    return BEFORE_LINE if is_corrected(diagnosis) else {**BEFORE_LINE, "linestyle": "-"}


def trace_panels(diagnosis: Comparison) -> list[Figure]:
    """Draw each channel measured and simulated: the whole recording, then the held-out data."""
    clock, seconds = time_unit(float(diagnosis.time_s[-1]))
    time = diagnosis.time_s / clock
    held_out = [(a / clock, b / clock) for a, b in diagnosis.held_out]
    drawn: list[Figure] = []
    rows = [(diagnosis.before, nominal_line(diagnosis))]
    if is_corrected(diagnosis):
        rows.insert(0, (diagnosis.after, AFTER_LINE))
    for column, measured in diagnosis.measured.items():
        name, unit = channel_name(column)
        factor, unit = scale_unit(float(np.abs(measured).max()), unit)
        for start, end in [(0.0, float(time[-1])), *held_out[:1]]:
            whole = start == 0.0 and end == time[-1]
            part = (time >= start - 1e-9) & (time <= end + 1e-9)
            where = "" if whole else ", held-out data"
            figure, axes = panel(f"{name}{where}", f"time [{seconds}]", axis_label(name, unit))
            if whole:
                for a, b in held_out:
                    axes.axvspan(a, b, color=HELD_OUT, linewidth=0)
            points = outline(time[part], measured[part] / factor)
            axes.plot(*points, color=MEASURED, linewidth=0.7, alpha=0.45)
            for channels, style in rows:
                axes.plot(*thin(time[part], channels[column][part] / factor), **style)
            axes.set_xlim(start, end)
            drawn.append(with_label(figure, f"{name} over time{where}"))
    return drawn


def residual_panels(diagnosis: Outcome) -> list[Figure]:
    """Draw the residual of each balance over time, before and after."""
    time, size = diagnosis.time_s, diagnosis.rows_of_a_block
    drawn: list[Figure] = []
    clock, seconds = time_unit(float(time[-1]))
    at = block_statistics(time, size) / clock
    for row, (name, unit) in enumerate(diagnosis.balances):
        before, after = diagnosis.residual_before[row], diagnosis.residual_after[row]
        means = [(block_statistics(before, size), nominal_line(diagnosis))]
        if is_corrected(diagnosis):
            means.insert(0, (block_statistics(after, size), AFTER_LINE))
        factor, shown = scale_unit(max(float(np.abs(m).max()) for m, _ in means), unit)
        label = axis_label(f"missing {QUANTITY.get(name, '')}", shown)
        figure, axes = panel(f"{name} balance", f"time [{seconds}]", label)
        for a, b in diagnosis.held_out:
            axes.axvspan(a / clock, b / clock, color=HELD_OUT, linewidth=0)
        for a, b in _windows(diagnosis, row):
            axes.axvspan(a / clock, b / clock, color=WINDOW, alpha=0.6, linewidth=0)
        spread = block_statistics(before, size, np.std)
        usual = float(np.median(spread))
        low, high = _range([values for values, _ in means], usual)
        if usual < high - low:
            band = ((means[-1][0] - spread) / factor, (means[-1][0] + spread) / factor)
            axes.fill_between(at, *band, color=QUIET, alpha=0.35, linewidth=0)
        else:
            prefix, in_unit = scale_unit(usual, unit)
            text = f"standard deviation of samples {number(usual / prefix, 2)} {in_unit}".strip()
            axes.text(0.99, 0.96, text, transform=axes.transAxes, ha="right", va="top", fontsize=8)
        axes.axhline(0.0, color=MEASURED, linewidth=0.6)
        for values, style in means:
            axes.plot(at, values / factor, **style)
        axes.set_ylim(low / factor, high / factor)
        axes.set_xlim(0.0, time[-1] / clock)
        drawn.append(with_label(figure, f"residual of the {name} balance over time"))
    return drawn


def _range(means: list[Array], spread: float) -> tuple[float, float]:
    """Return the limits of an axis that shows the means, and as much of their spread as fits."""
    low = min(0.0, *(float(m.min()) for m in means))
    high = max(0.0, *(float(m.max()) for m in means))
    margin = min(1.3 * spread, 0.6 * (high - low)) + 0.05 * (high - low) + 1e-12
    return low - margin, high + margin


def _windows(diagnosis: Outcome, row: int) -> list[tuple[float, float]]:
    """Return the windows of the findings in a balance, except those of the whole recording."""
    found = [w for f in diagnosis.findings if f.row == row for w in f.windows]
    if diagnosis.shape is not None and diagnosis.shape.balance == diagnosis.balances[row][0]:
        found += diagnosis.shape_windows
    return [w for w in found if w[1] - w[0] < 0.98 * float(diagnosis.time_s[-1])]


def spectrum_panels(diagnosis: Outcome) -> list[Figure]:
    """Draw the spectrum of the residual of each balance, before and after."""
    drawn = []
    rate, quarter = 1.0 / diagnosis.interval_s, len(diagnosis.time_s) // 4
    length = max(min(quarter, LEAST_SPECTRUM), min(quarter, round(120.0 * rate)))
    for row, (name, unit) in enumerate(diagnosis.balances):
        lines = [(diagnosis.residual_before[row], nominal_line(diagnosis))]
        if is_corrected(diagnosis):
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
        waves = sea_band(frequency, power) if diagnosis.ship.moves else None
        if waves is not None:
            axes.axvspan(*waves, color=WINDOW, alpha=0.6, linewidth=0)
            axes.text(
                float(np.sqrt(waves[0] * waves[1])),
                0.03,
                "waves",
                transform=axes.get_xaxis_transform(),
                ha="center",
                fontsize=8,
                color=MEASURED,
            )
        per_root = f"{superscript(unit)}/√Hz" if superscript(unit) else "1/√Hz"
        axes.set_ylabel(f"amplitude [{per_root}]", fontsize=8.8, labelpad=3)
        axes.set_xlim(frequency[0], frequency[-1])
        drawn.append(with_label(figure, f"spectrum of the {name} balance's residual"))
    return drawn


def smooth_spectrum(values: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Return the one-sided power density, averaged over 24 bands in each decade."""
    rows = min(max(8, length), len(values))
    hann, psd = np.hanning(rows + 1)[:-1], matplotlib.mlab.psd
    found = psd(values, rows, rate, window=hann, noverlap=rows // 2)  # type: ignore[arg-type]
    power, frequency = (np.asarray(values, np.float64)[1:] for values in found)
    band = np.floor(24.0 * np.log10(frequency / frequency[0]) + 1e-9).astype(int)
    _, which = np.unique(band, return_inverse=True)
    count = np.bincount(which)
    return (
        np.asarray(np.exp(np.bincount(which, np.log(frequency)) / count)),
        np.asarray(np.bincount(which, power) / count + 1e-300),
    )


def sea_band(frequency: Array, power: Array) -> tuple[float, float] | None:
    """Return the band in which waves raise a spectrum above the line between its neighbours, or None."""
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


def speed_power_panel(service: Service, mover: str = "engine") -> list[Figure]:
    """Draw power over speed of the nominal and the corrected ship, with the changes at service speed.

    Args:
        service: both ships in service; without curves there is no figure.
        mover: name of the prime mover.
    """
    if service.curves is None or service.speed_m_s is None:
        return []
    nominal, corrected = service.curves
    speed, low, high = service.speed_m_s, SHOWN[0] * service.speed_m_s, SHOWN[1] * service.speed_m_s
    factor = 1e3 if nominal.at("power", speed) >= 1e3 else 1.0
    figure, axes = panel(
        "Power over speed",
        "speed through the water [kn]",
        f"{mover} power [{'kW' if factor > 1.0 else 'W'}]",
        3.3,
        0.8,
    )
    lines = [(nominal, BEFORE_LINE, "ship file")]
    if service.changes:
        lines.insert(0, (corrected, AFTER_LINE, "as diagnosed"))
    else:
        lines = [(nominal, {**BEFORE_LINE, "linestyle": "-"}, "ship file")]
    for curve, style, words in lines:
        at = np.linspace(max(low, curve.speed[0]), min(high, curve.speed[-1]), 80)
        power = np.array([curve.at("power", v) for v in at])
        axes.plot(at / KNOT, power / factor, label=words, **style)
    if service.band is not None and service.changes:
        at, lower, upper = service.band
        axes.fill_between(
            at / KNOT,
            lower / factor,
            upper / factor,
            color=AFTER,
            alpha=0.2,
            linewidth=0,
            label="95 % interval",
        )
    before, after = nominal.at("power", speed), corrected.at("power", speed)
    axes.axvline(speed / KNOT, color=QUIET, linewidth=0.8)
    axes.plot(speed / KNOT, before / factor, "o", color=BEFORE, markersize=4.5)
    if service.sure(ENGINE_POWER) is not None:
        arrow = {"arrowstyle": "-|>", "color": MEASURED, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
        axes.annotate(
            "", (speed / KNOT, after / factor), (speed / KNOT, before / factor), arrowprops=arrow
        )
        equal = corrected.speed_at("power", before)
        axes.annotate(
            "", (equal / KNOT, before / factor), (speed / KNOT, before / factor), arrowprops=arrow
        )
    axes.set_xlim(low / KNOT, high / KNOT)
    top = max(float(curve.at("power", min(high, curve.speed[-1]))) for curve, _, _ in lines)
    least = min(float(curve.at("power", max(low, curve.speed[0]))) for curve, _, _ in lines)
    axes.set_ylim(0.8 * least / factor, 1.05 * top / factor)
    axes.legend(fontsize=_NORMAL, frameon=False, loc="upper left")
    return [with_label(figure, f"{mover} power over speed, before and after the correction")]


def ranking_panels(diagnosis: Outcome) -> list[Figure]:
    """Draw the gain and the threshold of the best candidates of the catalogue."""
    best = diagnosis.ranking[:RANKED]
    if not best:
        return []
    height = 0.75 + 0.24 * len(best)
    label = "2 Δ log L of each effect alone (| threshold)"
    left = max(text_width(c.effect.label, _SMALL) for c, _ in best) + 0.15
    figure, axes = panel("", label, "", height, max(left, 2.15))
    chosen = {f.effect.label for f in diagnosis.findings}
    rivals = {c.effect.label for f in diagnosis.findings for c in f.rivals}
    for place, (candidate, limit) in enumerate(best):
        gain, name = candidate.gain, candidate.effect.label
        colour = AFTER if name in chosen else "#7fbcc5" if name in rivals else QUIET
        alpha = 1.0 if gain > limit else 0.6
        axes.barh(place, max(gain, 0.0), color=colour, alpha=alpha, height=0.62)
        axes.plot([limit, limit], [place - 0.42, place + 0.42], color=BEFORE, linewidth=1.6)
        text, where = f"{gain:.0f}" if gain >= 0.5 else "none", (max(gain, limit), place)
        axes.annotate(text, where, (4, 0), textcoords="offset points", va="center", fontsize=8.0)
    top = max(max(c.gain, limit) for c, limit in best)
    # The scale is linear up to the thresholds, so that effects above and below them are distinguishable.
    axes.set_xscale("symlog", linthresh=max(limit for _, limit in best))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.set_xlim(0.0, top * (1.8 if top > 60.0 else 1.15))
    axes.set_yticks(range(len(best)), [c.effect.label for c, _ in best])
    axes.set_ylim(len(best) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    return [with_label(figure, "ranking of the candidates with their thresholds")]
