"""Figures of a feedback loop: gain and phase with margins, S and T, and the step response."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..plant.loops import Loop, Margins
from .figures import PALETTE, THESIS, TRUTH, new_figure

_LEAST_DB = -90.0  # lowest gain in the figure


def loop_figure(
    loop: Loop, title: str, unit: str = "s", asked: tuple[float, float] | None = None
) -> Figure:
    """Return a figure of a stable loop, whose unit of time is ``unit``, in four panels.

    ``asked`` is the frequency below which |L| should exceed a gain, and that gain [dB].
    """
    margins = loop.margins()
    grid = _grid(loop, margins)
    response = loop.response(grid)
    figure, axes = new_figure(2, 2, (11.5, 7.0))
    figure.suptitle(title, fontsize=12)
    gain, closed, phase, step = axes.flat
    level = 20.0 * np.log10(np.abs(response))
    gain.semilogx(grid, level, color=PALETTE[1])
    gain.axhline(0.0, color=THESIS, linewidth=0.7)
    lowest = max(level.min(), _LEAST_DB)
    gain.set(ylabel="|L| [dB]", ylim=(lowest, min(level.max(), 80.0) + 5.0))
    if asked is not None:
        gain.hlines(asked[1], grid[0], asked[0], color=PALETTE[0], linewidth=2.0)
        gain.annotate(
            f"at least {asked[1]:g} dB",
            (asked[0], asked[1]),
            (6, -3),
            fontsize=8,
            textcoords="offset points",
            color=PALETTE[0],
            va="top",
        )
    degrees = np.degrees(np.unwrap(np.angle(response)))
    if np.isfinite(margins.crossover):  # A loop with a gain below 1 has no crossover.
        at = float(np.interp(margins.crossover, grid, degrees))
        degrees += 360.0 * round((margins.phase_margin_deg - 180.0 - at) / 360.0)
    phase.semilogx(grid, degrees, color=PALETTE[1])
    phase.axhline(-180.0, color=THESIS, linewidth=0.7)
    phase.set_ylim(max(min(degrees.min(), -180.0) - 10.0, -450.0), max(degrees.max(), -90.0) + 15.0)
    phase.set(ylabel="phase of L [deg]", xlabel=f"frequency [rad/{unit}]")
    if np.isfinite(margins.crossover):
        top = margins.phase_margin_deg - 180.0
        phase.vlines(margins.crossover, -180.0, top, color=PALETTE[0], lw=2)
        phase.annotate(
            f"{margins.phase_margin_deg:.1f}°",
            (margins.crossover, -175.0),
            (6, 0),
            fontsize=9,
            textcoords="offset points",
            color=PALETTE[0],
        )
    if np.isfinite(margins.gain_margin_dB):
        gain.vlines(margins.phase_crossover, -margins.gain_margin_dB, 0.0, color=PALETTE[0], lw=2)
        gain.annotate(
            f"{margins.gain_margin_dB:.1f} dB",
            (margins.phase_crossover, 0.0),
            (6, -12),
            fontsize=9,
            textcoords="offset points",
            color=PALETTE[0],
        )
    sensitivity = 1.0 / (1.0 + response)
    for values, name, colour in (
        (sensitivity, "S, from a disturbance", PALETTE[1]),
        (response * sensitivity, "T, from the noise", PALETTE[2]),
    ):
        closed.semilogx(grid, 20.0 * np.log10(np.abs(values)), color=colour, label=name)
    closed.axhline(0.0, color=THESIS, linewidth=0.7)
    closed.set(ylim=(-60.0, 20.0), ylabel="|S|, |T| [dB]")
    closed.legend(fontsize=8, frameon=False, loc="lower center")
    _draw_step(step, loop, unit)
    return figure


def _grid(loop: Loop, margins: Margins) -> NDArray[np.float64]:
    """Return frequencies two decades around the crossover and beyond the gain margin."""
    crossover, turn = margins.crossover, margins.phase_crossover
    if not np.isfinite(crossover):
        return loop.frequencies()
    top = np.pi / loop.interval if loop.interval else np.inf
    far = max(120.0 * crossover, 2.0 * turn if np.isfinite(turn) else 0.0)
    return np.geomspace(crossover / 120.0, min(far, top), 2000)


def _draw_step(axis: Axes, loop: Loop, unit: str) -> None:
    """Draw the response to a step of the set-point, with overshoot and settling time."""
    time, output = loop.step()
    measures = loop.step_measures()
    last = measures.last_value
    shown = time <= 2.5 * measures.settling if np.isfinite(measures.settling) else time >= 0.0
    draw = "steps-post" if loop.interval else "default"
    axis.plot(time[shown], output[shown], color=TRUTH, drawstyle=draw)
    axis.axhspan(0.98 * last, 1.02 * last, color=PALETTE[3], alpha=0.25, lw=0)
    axis.axvline(measures.settling, color=PALETTE[0], linewidth=0.9, linestyle="--")
    settled = f"within 2 % after {measures.settling:.3g} {unit}"
    axis.annotate(
        f"overshoot {measures.overshoot_percent:.1f} %, {settled}",
        (0.97, 0.06),
        xycoords="axes fraction",
        ha="right",
        fontsize=9,
    )
    axis.set(ylabel="response to a step of the set-point", xlabel=f"time [{unit}]")
