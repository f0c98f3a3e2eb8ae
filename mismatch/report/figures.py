"""Figures of a diagnosis over time, over frequency and by name, each a list of :mod:`.panels`."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy
from matplotlib.ticker import FuncFormatter, NullFormatter

from ...plant.ship import Ship
from ..outcome import Outcome
from ..search.placed import Window
from .panels import (
    AFTER,
    AFTER_LINE,
    BEFORE,
    BEFORE_LINE,
    HELD_OUT,
    MEASURED,
    QUIET,
    WINDOW,
    Array,
    block_rows,
    blocks,
    outline,
    panel,
    svg,
    thinned,
)
from .wording import channel_name, number, scaled, superscript, time_unit, with_unit

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
