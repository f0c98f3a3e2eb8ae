"""The picture of a run: what a bridge would want to see of the last minutes."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .batch import Fleet

_SHOWN_S = 120.0
_DARK, _RED, _GREY = "#1f2a44", "#d1495b", "#8d99ae"


class Dashboard:
    """Keeps the last two minutes of an environment and draws them.

    Args:
        fleet: of one environment.
        interval_s: control interval [s].
    """

    def __init__(self, fleet: Fleet, interval_s: float) -> None:
        self.fleet = fleet
        self.interval_s = interval_s
        self.rows: deque[list[float]] = deque(maxlen=max(2, round(_SHOWN_S / interval_s)))

    def clear(self) -> None:
        """Forget the last episode."""
        self.rows.clear()

    def record(self) -> None:
        """Remember the present instant."""
        time = float(self.fleet.episodes[0]["elapsed"]) * self.interval_s
        seen = self.fleet.observation[0].tolist()
        self.rows.append([time, *seen, *self.fleet.truth[0].tolist()])

    def draw(self) -> NDArray[np.uint8]:
        """RGB array of shape (480, 800, 3)."""
        figure = Figure(figsize=(8.0, 4.8), dpi=100, layout="constrained")
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.subplots(2, 3)
        table = np.array(self.rows) if self.rows else np.zeros((1, 13))
        time = table[:, 0]
        panels: tuple[tuple[str, list[tuple[Any, str]]], ...] = (
            ("ship speed and order [m/s]", [(table[:, 1], _GREY), (table[:, 6], _DARK)]),
            ("shaft speed [rad/s]", [(table[:, 2], _DARK)]),
            ("shaft torque [kN m]", [(table[:, 3] * 1e-3, _DARK)]),
            ("pitch ratio [-]", [(table[:, 4], _DARK)]),
            ("fuel rack [mm]", [(table[:, 5], _DARK)]),
            ("v_a true, estimated [m/s]", [(table[:, 9], _DARK), (table[:, 7], _RED)]),
        )
        for axis, (title, lines) in zip(axes.flat, panels, strict=True):
            for values, color in lines:
                axis.plot(time, values, color=color, linewidth=1)
            axis.set_title(title, fontsize=8)
            axis.tick_params(labelsize=7)
            axis.set_xlim(time[-1] - _SHOWN_S, max(time[-1], 1.0))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()
