"""Animation of controllers in the same waves, side by side, for ``shaftline video``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

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
_PARTS = (
    (_DARK, "-0.475,-0.6 -0.447,-0.6 -0.45,-3.9 -0.47,-3.9"),  # rudder
    (_DARK, "-0.43,-2.75 -0.43,-3.25 -0.3,-3.5 -0.3,-2.9"),  # shaft
    (
        _RED,
        "-0.5,0.6 -0.48,-0.6 -0.4,-1.6 -0.3,-4.2 0.4,-4.2 0.47,-3.9 0.485,-3 0.462,-2 0.466,0.6",
    ),  # hull
    (
        _GREY,
        "-0.5,0.6 -0.508,4.8 -0.25,4.8 0,5.2 0.25,6.2 0.4,7.4 0.505,8.8 0.485,5 0.466,0.6",
    ),  # topsides
    (_LIGHT, "-0.29,4.8 -0.28,10 -0.14,10.4 -0.14,5"),  # hangar
    (_LIGHT, "-0.13,5 -0.12,8 0.02,8.2 0.03,12.6 0.15,12.6 0.185,5.8"),  # bridge
    (_DARK, "0.125,11.1 0.156,11.1 0.16,12 0.125,12"),  # windows of the bridge
    (_GREY, "-0.1,8 -0.092,14 -0.035,14 -0.03,8"),  # funnel
    (_DARK, "-0.092,13.2 -0.092,14 -0.035,14 -0.035,13.2"),
    (_GREY, "0.04,12.6 0.062,24 0.07,24 0.096,12.6"),  # mast
    (_DARK, "0.046,17.6 0.098,17.6 0.098,18.1 0.046,18.1"),
    (_LIGHT, "0.285,6.4 0.292,8.6 0.325,8.8 0.335,6.8"),  # gun
    (_DARK, "0.325,8.3 0.385,9.1 0.385,9.35 0.325,8.7"),
)
"""Colour and corners of each part: distance ahead of midship over the length, and height [m]."""

_PROPELLER = (-0.432, -3.0, 3.0)  # position as in _PARTS, and diameter [m]
_ROWS = (
    ("shaft_torque", "shaft\n[kN m]", 1e-3),
    ("brake_torque", "engine\n[kN m]", 1e-3),
    ("blade_pitch", "P/D [-]", 1.0),
)


class Run(NamedTuple):
    """Simulated episode of a controller."""

    words: str  # controller as given by the user
    trace: pd.DataFrame  # columns TRACE, time as index [s]
    fluctuations: tuple[float, float]  # wave torque of shaft and engine, whole episode [kN m]


class Span(NamedTuple):
    """Part of an episode that is shown."""

    begin: float  # start [s]
    seconds: float  # length [s]
    shown: float = 20.0  # time range of the curves before now [s]


def simulate_episode(text: str, task: str, seed: int, observer: str) -> Run:
    """Simulate an episode; ``text`` is a controller as of ``shaftline evaluate``."""
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
    """Return a figure with a column for each episode, the function that draws a frame, and the number of
    frames; ``sea`` is a SEA record.
    """
    figure = Figure(figsize=(4.2 * len(runs), 5.2), dpi=80, layout="constrained")
    axes = figure.subplots(
        1 + len(_ROWS),
        len(runs),
        sharex="row",
        sharey="row",
        height_ratios=[1.5, 1, 1, 1],
        squeeze=False,
    )
    offsets = np.linspace(-_AROUND_M, _AROUND_M, 90)
    moving: list[Any] = []
    for column, run in enumerate(runs):
        top = axes[0, column]
        water = {"color": "#3f7fae", "zorder": 3, "alpha": 0.6, "lw": 0.0}
        surface = top.fill_between(offsets, -14.0, 0.0, **water)
        for colour, corners in _PARTS:
            ahead, height = np.array([c.split(",") for c in corners.split()], dtype=float).T
            top.fill(_LENGTH_M * ahead, height, color=colour, lw=0.0, zorder=2)
        (blade,) = top.plot([], [], color="#b8862b", lw=2.0, zorder=2)
        top.set(xlim=(-_AROUND_M, _AROUND_M), ylim=(-14.0, 26.0), xticks=[], yticks=[])
        top.set_facecolor("#e9f1f7")
        shaft, engine = run.fluctuations
        words = f"fluctuation in waves: shaft {shaft:.1f}, engine {engine:.2f} kN m"
        top.set_title(f"{run.words}\n{words}", fontsize=9)
        lines = []
        for row, (name, words, factor) in enumerate(_ROWS, start=1):
            axis = axes[row, column]
            (line,) = axis.plot([], [], color=PALETTE[column])
            axis.set_xlim(-span.shown, 0.0)
            axis.tick_params(labelsize=7, labelbottom=row == len(_ROWS))
            if column == 0:
                axis.set_ylabel(words, fontsize=8)
            lines.append((line, factor * run.trace[name]))
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
            index = run.trace.index
            place = float(np.interp(now, index, run.trace["position"]))
            heights = [wave_field(sea, now, place + x)[1] for x in offsets]
            floor = np.array([[offsets[-1], -14.0], [offsets[0], -14.0]])
            surface.set_verts([np.vstack([np.column_stack([offsets, heights]), floor])])
            angles = np.cumsum(run.trace["shaft_speed"]) * (index[1] - index[0])
            ahead, height, diameter = _PROPELLER
            half = 0.5 * diameter * np.cos(np.interp(now, index, angles))
            blade.set_data([_LENGTH_M * ahead] * 2, [height - half, height + half])
            times = now + np.arange(-span.shown, 0.5 * EVERY_S, EVERY_S)
            for line, values in lines:
                line.set_data(times - now, np.interp(times, values.index, values))
        return []

    return figure, draw, round(span.seconds / EVERY_S)


def write_animation(
    path: Path, runs: list[Run], sea: Any, span: Span, tick: Callable[[int, int], None]
) -> None:
    """Write an animated GIF; ``tick`` receives the number of finished frames and of all frames."""
    figure, draw, frames = build_animation(runs, sea, span)
    film = FuncAnimation(figure, draw, frames=frames, blit=False)
    writer = PillowWriter(fps=PER_SECOND)
    write_atomically(path, lambda file: film.save(file, writer=writer, progress_callback=tick))
