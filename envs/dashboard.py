"""The picture of a run: what a bridge would want to see of the last minutes."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .batch import Batch

_SHOWN_S = 120.0
_DARK, _RED, _GREY = "#1f2a44", "#d1495b", "#8d99ae"
_PANELS = (
    ("ship speed and order [m/s]", (("speed_order", _GREY), ("measured_ship_speed", _DARK)), 1.0),
    ("shaft speed [rad/s]", (("shaft_speed", _DARK),), 1.0),
    ("shaft torque [kN m]", (("measured_shaft_torque", _DARK),), 1e-3),
    ("pitch ratio [-]", (("measured_pitch_ratio", _DARK),), 1.0),
    ("fuel rack [mm]", (("fuel_rack", _DARK),), 1.0),
    ("v_a true, estimated [m/s]",
     (("true_advance_velocity", _DARK), ("estimated_advance_velocity", _RED)), 1.0),
)  # fmt: skip
"""Title, signals of the observation (or the true inflow) with their colours, and factor."""


class Dashboard:
    """Keeps the last two minutes of an environment and draws them.

    Args:
        batch: of environments.
        which: of them.
    """

    def __init__(self, batch: Batch, which: int = 0) -> None:
        self.batch, self.which = batch, which
        rows = max(2, round(_SHOWN_S / batch.interval_s))
        self.rows: deque[dict[str, float]] = deque(maxlen=rows)

    def clear(self) -> None:
        """Forget the last episode."""
        self.rows.clear()

    def record(self) -> None:
        """Remember the present instant."""
        arrays = self.batch.arrays
        seen = arrays.observations[self.which]
        row = {name: float(seen[name]) for name in seen.dtype.names}
        row["time"] = float(self.batch.elapsed[self.which]) * self.batch.interval_s
        row["true_advance_velocity"] = float(arrays.truths[self.which]["advance_velocity"])
        self.rows.append(row)

    def draw(self) -> NDArray[np.uint8]:
        """RGB array of shape (480, 800, 3)."""
        figure = Figure(figsize=(8.0, 4.8), dpi=100, layout="constrained")
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.subplots(2, 3)
        time = [row["time"] for row in self.rows] or [0.0]
        for axis, (title, lines, factor) in zip(axes.flat, _PANELS, strict=True):
            for name, color in lines:
                values = [factor * row[name] for row in self.rows] or [0.0]
                axis.plot(time, values, color=color, linewidth=1)
            axis.set_title(title, fontsize=8)
            axis.tick_params(labelsize=7)
            axis.set_xlim(time[-1] - _SHOWN_S, max(time[-1], 1.0))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()
