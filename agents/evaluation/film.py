"""Animation of controllers in the same waves, side by side, for ``shaftline video``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...core.files import write_atomically
from ...display.figures import PALETTE
from ...envs.settings import DEFAULTS
from ...envs.steering import environment_classes
from ...envs.tasks import get_task
from ...plant.waves import wave_field
from .episodes import TRACE, Setting, load_controller, run_episodes

EVERY_S = 0.25
"""Simulated time between two frames [s]."""

PER_SECOND = 10
"""Frames of the animation per second: it runs 2.5 times faster than the simulation."""

_LENGTH_M, _AROUND_M = 110.0, 80.0  # length of the drawn ship, half width of the view
_GREY, _LIGHT, _DARK, _RED = "#7d858c", "#a3abb1", "#3d4349", "#9c3b34"
_PARTS: tuple[tuple[str, tuple[tuple[float, float], ...]], ...] = (
    (_DARK, ((-0.475, -0.6), (-0.447, -0.6), (-0.450, -3.9), (-0.470, -3.9))),  # rudder
    (_DARK, ((-0.430, -2.75), (-0.430, -3.25), (-0.300, -3.5), (-0.300, -2.9))),  # shaft
    (
        _RED,
        (
            (-0.500, 0.6),
            (-0.480, -0.6),
            (-0.400, -1.6),
            (-0.300, -4.2),
            (0.400, -4.2),
            (0.470, -3.9),
            (0.485, -3.0),
            (0.462, -2.0),
            (0.466, 0.6),
        ),
    ),
    (
        _GREY,
        (
            (-0.500, 0.6),
            (-0.508, 4.8),
            (-0.250, 4.8),
            (0.000, 5.2),
            (0.250, 6.2),
            (0.400, 7.4),
            (0.505, 8.8),
            (0.485, 5.0),
            (0.466, 0.6),
        ),
    ),
    (_LIGHT, ((-0.290, 4.8), (-0.280, 10.0), (-0.140, 10.4), (-0.140, 5.0))),  # hangar
    (
        _LIGHT,
        ((-0.130, 5.0), (-0.120, 8.0), (0.020, 8.2), (0.030, 12.6), (0.150, 12.6), (0.185, 5.8)),
    ),
    (_DARK, ((0.125, 11.1), (0.156, 11.1), (0.160, 12.0), (0.125, 12.0))),  # windows of the bridge
    (_GREY, ((-0.100, 8.0), (-0.092, 14.0), (-0.035, 14.0), (-0.030, 8.0))),  # funnel
    (_DARK, ((-0.092, 13.2), (-0.092, 14.0), (-0.035, 14.0), (-0.035, 13.2))),
    (_GREY, ((0.040, 12.6), (0.062, 24.0), (0.070, 24.0), (0.096, 12.6))),  # mast
    (_DARK, ((0.046, 17.6), (0.098, 17.6), (0.098, 18.1), (0.046, 18.1))),
    (_LIGHT, ((0.285, 6.4), (0.292, 8.6), (0.325, 8.8), (0.335, 6.8))),  # gun
    (_DARK, ((0.325, 8.3), (0.385, 9.1), (0.385, 9.35), (0.325, 8.7))),
)
"""Colour and corners of each part: distance ahead of midship over the length, height [m]."""

_PROPELLER = (-0.432, -3.0, 3.0)  # position as in _PARTS, and diameter [m]
_ROWS = (
    ("shaft_torque", "shaft\n[kN m]", 1e-3),
    ("brake_torque", "engine\n[kN m]", 1e-3),
    ("blade_pitch", "P/D [-]", 1.0),
)


class Run(NamedTuple):
    """One simulated episode of a controller."""

    words: str  # controller as given by the user
    trace: pd.DataFrame  # columns TRACE, time as index [s]
    fluctuations: tuple[float, float]  # wave torque of shaft and engine, whole episode [kN m]


class Span(NamedTuple):
    """Part of an episode that is shown."""

    begin: float  # start [s]
    seconds: float  # length [s]
    shown: float = 20.0  # time range of the curves before now [s]


def simulate_episode(text: str, task: str, seed: int, observer: str) -> Run:
    """Simulate an episode.

    Args:
        text: controller as of ``shaftline evaluate``.
        task: task of the episode.
        seed: seed of the episode.
        observer: observer whose estimate the controller receives.
    """
    model = get_task(task)
    made = load_controller(text, model.load_ship(), DEFAULTS.control_interval_s, model)
    kpis, rows = run_episodes(Setting(text, task, "task", observer, 1, first_seed=seed), made)
    trace = pd.DataFrame(rows, columns=list(TRACE)).set_index("time")
    one = kpis.iloc[0]
    return Run(text, trace, (one["wave_torque_kN_m"], one["wave_engine_torque_kN_m"]))


def draw_sea(task: str, seed: int, observer: str) -> Any:
    """Return the SEA record that the seed draws."""
    steered = get_task(task).steered
    env = environment_classes(steered).vector(1, task=task, observer=observer, threads=1)
    env.reset(seed=seed)
    return env.batch.arrays.seas[0].copy()


def build_animation(runs: list[Run], sea: Any, span: Span) -> tuple[Figure, Any, int]:
    """Return the figure, the function that draws a frame of it, and the number of frames.

    Args:
        runs: episodes, one for each column.
        sea: SEA record.
        span: shown part of the episode.
    """
    figure = Figure(figsize=(4.2 * len(runs), 5.2), dpi=80, layout="constrained")
    axes = figure.subplots(
        1 + len(_ROWS), len(runs), sharex="row", sharey="row", height_ratios=[1.5, 1, 1, 1],
        squeeze=False,
    )  # fmt: skip
    offsets = np.linspace(-_AROUND_M, _AROUND_M, 90)
    moving: list[Any] = []
    for column, run in enumerate(runs):
        top = axes[0, column]
        surface = top.fill_between(
            offsets, -14.0, 0.0, color="#3f7fae", zorder=3, alpha=0.6, lw=0.0
        )
        for colour, corners in _PARTS:
            ahead, height = np.array(corners).T
            top.fill(_LENGTH_M * ahead, height, color=colour, lw=0.0, zorder=2)
        (blade,) = top.plot([], [], color="#b8862b", lw=2.0, zorder=2)
        top.set(xlim=(-_AROUND_M, _AROUND_M), ylim=(-14.0, 26.0), xticks=[], yticks=[])
        top.set_facecolor("#e9f1f7")
        shaft, engine = run.fluctuations
        top.set_title(
            f"{run.words}\nfluctuation in waves: shaft {shaft:.1f}, engine {engine:.2f} kN m",
            fontsize=9,
        )
        lines = []
        for row, (name, words, factor) in enumerate(_ROWS, start=1):
            axis = axes[row, column]
            values = factor * run.trace[name]
            (line,) = axis.plot([], [], color=PALETTE[column])
            axis.set_xlim(-span.shown, 0.0)
            axis.tick_params(labelsize=7, labelbottom=row == len(_ROWS))
            if column == 0:
                axis.set_ylabel(words, fontsize=8)
            lines.append((line, values))
        axes[-1, column].set_xlabel("time before now [s]", fontsize=8)
        moving.append((run, surface, blade, lines))
    for row, (name, _, factor) in enumerate(_ROWS, start=1):
        ends = slice(span.begin - span.shown, span.begin + span.seconds)
        shown = [factor * run.trace.loc[ends, name] for run in runs]
        least, most = min(s.min() for s in shown), max(s.max() for s in shown)
        axes[row, 0].set_ylim(least - 0.1 * (most - least), most + 0.1 * (most - least))

    def draw(frame: int) -> list[Any]:
        now = span.begin + frame * EVERY_S
        for run, surface, blade, lines in moving:
            _surface(surface, run, sea, now, offsets)
            _blade(blade, run, now)
            times = now + np.arange(-span.shown, 0.5 * EVERY_S, EVERY_S)
            for line, values in lines:
                line.set_data(times - now, np.interp(times, values.index, values))
        return []

    return figure, draw, round(span.seconds / EVERY_S)


def _surface(surface: Any, run: Run, sea: Any, now: float, offsets: NDArray[np.float64]) -> None:
    place = float(np.interp(now, run.trace.index, run.trace["position"]))
    heights = [wave_field(sea, now, place + x)[1] for x in offsets]
    corners = np.column_stack([offsets, heights])
    floor = np.array([[offsets[-1], -14.0], [offsets[0], -14.0]])
    surface.set_verts([np.vstack([corners, floor])])


def _blade(blade: Any, run: Run, now: float) -> None:
    """Turn the drawn blade with the shaft."""
    index = run.trace.index
    turned = np.interp(now, index, np.cumsum(run.trace["shaft_speed"]) * (index[1] - index[0]))
    ahead, height, diameter = _PROPELLER
    half = 0.5 * diameter * np.cos(turned)
    blade.set_data([_LENGTH_M * ahead] * 2, [height - half, height + half])


def write_animation(
    path: Path, runs: list[Run], sea: Any, span: Span, tick: Callable[[int, int], None]
) -> None:
    """Draw the frames and write an animated GIF.

    Args:
        path: file that ends in ``.gif``.
        runs: episodes, one for each column.
        sea: SEA record.
        span: shown part of the episode.
        tick: function that receives the number of finished frames and of all frames.
    """
    figure, draw, frames = build_animation(runs, sea, span)
    film = FuncAnimation(figure, draw, frames=frames, blit=False)
    writer = PillowWriter(fps=PER_SECOND)
    write_atomically(path, lambda file: film.save(file, writer=writer, progress_callback=tick))
