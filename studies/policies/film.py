"""A minute of a rough sea, a classic controller and a learned one side by side, as an animated picture.

Run ``python -m shaftline.studies.policies.film --out docs/results/policies/film.gif``; a minute.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...agents.evaluation.controllers import load_controller
from ...agents.evaluation.episodes import TRACE, Setting, run_episodes
from ...core.files import write_atomically
from ...display.figures import PALETTE
from ...envs import FrigateVectorEnv
from ...envs.settings import DEFAULTS
from ...envs.tasks import HELD_OUT, get_task
from ...plant.waves import field
from .comparison import FIRST_SEED, HELD, OBSERVER

NAME = "film.gif"
WORDS = (
    "The same sea, 6.4 m high, at two and a half times its pace: on the left the combinator, on the "
    "right a policy. The ship surges only, so she is drawn level."
)

SEED = FIRST_SEED + 2
"""Of the episode: the first of the held-out ones whose waves are of the highest kind (6.4 m)."""

BEGIN_S, SECONDS, EVERY_S = 60.0, 40.0, 0.25
PER_SECOND = 10  # frames: two and a half times as fast as the sea
SHOWN_S = 20.0
_LENGTH_M, _DRAUGHT_M, _AROUND_M = 110.0, 4.2, 130.0  # of the silhouette, and how far one looks
_ROWS = (
    ("shaft_torque", "gauge\n[kN m]", 1e-3),
    ("brake_torque", "engine\n[kN m]", 1e-3),
    ("blade_pitch", "P/D [-]", 1.0),
)


class Run(NamedTuple):
    """One episode."""

    words: str
    trace: pd.DataFrame  # columns TRACE, time as index [s]
    swings: tuple[float, float]  # wave torque at gauge and engine over all of it [kN m]


def sailed(text: str, words: str, task: str, seed: int) -> Run:
    """An episode of the task's held-out seas."""
    made = load_controller(text, get_task(task).sailed(), DEFAULTS.control_interval_s)
    setting = Setting(words, f"{task}:{HELD_OUT}", "task", OBSERVER, 1, first_seed=seed)
    kpis, rows = run_episodes(setting, made)
    trace = pd.DataFrame(rows, columns=list(TRACE)).set_index("time")
    one = kpis.iloc[0]
    return Run(words, trace, (one["wave_torque_kN_m"], one["wave_engine_torque_kN_m"]))


def sea_of(task: str, seed: int) -> Any:
    """SEA record that the seed draws."""
    env = FrigateVectorEnv(1, task=f"{task}:{HELD_OUT}", observer=OBSERVER, threads=1)
    env.reset(seed=seed)
    return env.batch.arrays.seas[0].copy()


def drawn(runs: tuple[Run, Run], sea: Any) -> tuple[Figure, Any, int]:
    """The figure, the function that draws a frame of it, and how many there are."""
    figure = Figure(figsize=(8.4, 5.2), dpi=80, layout="constrained")
    axes = figure.subplots(
        1 + len(_ROWS), 2, sharex="row", sharey="row", height_ratios=[1.5, 1, 1, 1]
    )
    offsets = np.linspace(-_AROUND_M, _AROUND_M, 90)
    hull = _LENGTH_M * np.array([-0.5, -0.5, -0.2, -0.2, 0.1, 0.14, 0.5, 0.43, -0.46])
    height = np.array([0.0, 5.0, 5.0, 11.0, 11.0, 5.0, 7.0, -_DRAUGHT_M, -_DRAUGHT_M])
    moving: list[Any] = []
    for column, run in enumerate(runs):
        top = axes[0, column]
        surface = top.fill_between(offsets, -14.0, 0.0, color="#8fb8d8", zorder=3, alpha=0.9)
        top.fill(hull, height, color="#4a4e57", zorder=2)
        top.set(xlim=(-_AROUND_M, _AROUND_M), ylim=(-14.0, 16.0), xticks=[], yticks=[])
        gauge, engine = run.swings
        top.set_title(
            f"{run.words}\nswing in waves: gauge {gauge:.1f}, engine {engine:.2f} kN m", fontsize=9
        )
        lines = []
        for row, (name, words, factor) in enumerate(_ROWS, start=1):
            axis = axes[row, column]
            values = factor * run.trace[name]
            (line,) = axis.plot([], [], color=PALETTE[column])
            axis.set_xlim(-SHOWN_S, 0.0)
            axis.tick_params(labelsize=7, labelbottom=row == len(_ROWS))
            if column == 0:
                axis.set_ylabel(words, fontsize=8)
            lines.append((line, values))
        axes[-1, column].set_xlabel("time before now [s]", fontsize=8)
        moving.append((run, surface, lines))
    for row, (name, _, factor) in enumerate(_ROWS, start=1):
        shown = [
            factor * run.trace.loc[BEGIN_S - SHOWN_S : BEGIN_S + SECONDS, name] for run in runs
        ]
        least, most = min(s.min() for s in shown), max(s.max() for s in shown)
        axes[row, 0].set_ylim(least - 0.1 * (most - least), most + 0.1 * (most - least))

    def draw(frame: int) -> list[Any]:
        now = BEGIN_S + frame * EVERY_S
        for run, surface, lines in moving:
            _surface(surface, run, sea, now, offsets)
            times = now + np.arange(-SHOWN_S, 0.5 * EVERY_S, EVERY_S)
            for line, values in lines:
                line.set_data(times - now, np.interp(times, values.index, values))
        return []

    return figure, draw, round(SECONDS / EVERY_S)


def _surface(surface: Any, run: Run, sea: Any, now: float, offsets: NDArray[np.float64]) -> None:
    place = float(np.interp(now, run.trace.index, run.trace["position"]))
    heights = [field(sea, now, place + x)[1] for x in offsets]
    corners = np.column_stack([offsets, heights])
    floor = np.array([[offsets[-1], -14.0], [offsets[0], -14.0]])
    surface.set_verts([np.vstack([corners, floor])])


def main(arguments: list[str] | None = None) -> None:
    """Sail and draw."""
    parser = argparse.ArgumentParser(
        "python -m shaftline.studies.policies.film", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/film.gif"), help="file, .gif")
    add("--task", default="rough-sea", help="whose held-out seas and packaged policy are taken")
    add("--policy", help="file; the packaged one of the task by default")
    add("--seed", type=int, default=SEED, help="of the episode")
    options = parser.parse_args(arguments)
    if options.out.suffix != ".gif":
        parser.error(f"--out {options.out}: must end in .gif")
    texts = {HELD: HELD, "learned policy": f"policy:{options.policy or options.task}"}
    one, other = (sailed(text, name, options.task, options.seed) for name, text in texts.items())
    figure, draw, frames = drawn((one, other), sea_of(options.task, options.seed))
    film = FuncAnimation(figure, draw, frames=frames, blit=False)

    def write(path: Path) -> None:
        film.save(path, writer=PillowWriter(fps=PER_SECOND))

    write_atomically(options.out, write)
    print(f"film: {options.out}")


if __name__ == "__main__":
    main()
