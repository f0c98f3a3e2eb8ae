"""Dashboard of an environment: time series and engine diagram of the last two minutes."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..plant.drives.diesel import torque_limit
from .batch import Batch

_SHOWN_S, _LEAST_S = 120.0, 30.0
_DARK, _RED, _GREY, _PALE = "#1f2a44", "#d1495b", "#8d99ae", "#e7ebf2"
_ENVELOPE = "engine"
_PANELS = (
    ("ship speed [m/s]", (("speed_order", "order", _RED), ("measured_ship_speed", "", _DARK)), 1.0),
    (_ENVELOPE, (), 1.0),
    ("shaft torque [kN m]", (("measured_shaft_torque", "", _DARK),), 1e-3),
    ("pitch ratio P/D [-]", (("measured_pitch_ratio", "", _DARK),), 1.0),
    ("fuel rack [mm]", (("fuel_rack", "", _DARK),), 1.0),
    (
        "advance velocity [m/s]",
        (
            ("true_advance_velocity", "true", _DARK),
            ("estimated_advance_velocity", "estimated", _RED),
        ),
        1.0,
    ),
)
"""Panels: title; signals with label and colour; factor from the signal's unit to that of the title."""
_STEERED = (
    "heading [deg]",
    (("heading_order", "order", _RED), ("heading", "", _DARK)),
    180.0 / np.pi,
)
"""Panel that replaces the fuel rack where the rudder is an action."""


class Dashboard:
    """Record the last two minutes of an environment, by its index in a batch, and draw them."""

    def __init__(self, batch: Batch, which: int = 0) -> None:
        self.batch, self.which = batch, which
        rows = max(2, round(_SHOWN_S / batch.interval_s))
        self.rows: deque[dict[str, float]] = deque(maxlen=rows)
        self.rewarded = 0.0

    def clear(self) -> None:
        """Remove the recorded samples of the last episode."""
        self.rows.clear()
        self.rewarded = 0.0

    def record(self) -> None:
        """Record a sample of the present state."""
        arrays = self.batch.arrays
        seen, truth = arrays.observations[self.which], arrays.truths[self.which]
        row = {name: float(seen[name]) for name in seen.dtype.names}
        row["time"] = float(self.batch.elapsed[self.which]) * self.batch.interval_s
        row["true_advance_velocity"] = float(truth["advance_velocity"])
        row["brake_torque"] = float(truth["brake_torque"])
        self.rewarded += float(arrays.rewards[self.which])
        self.rows.append(row)

    def draw(self) -> NDArray[np.uint8]:
        """Return the dashboard as an RGB array of shape (600, 960, 3)."""
        figure = Figure(figsize=(9.6, 6.0), dpi=100, layout="constrained")
        canvas: Any = FigureCanvasAgg(figure)
        panels = [_STEERED if self.batch.steered and "rack" in p[0] else p for p in _PANELS]
        for axis, (title, lines, factor) in zip(figure.subplots(2, 3).flat, panels, strict=True):
            axis.set_title(title, fontsize=9, loc="left", color=_DARK)
            axis.tick_params(labelsize=8)
            axis.spines[["top", "right"]].set_visible(False)
            axis.grid(color=_PALE, linewidth=0.6)
            if title == _ENVELOPE:
                self._draw_envelope(axis)
            else:
                self._draw_lines(axis, lines, factor)
        now = self.rows[-1]["time"] if self.rows else 0.0
        settings = self.batch.settings
        task = settings.task if isinstance(settings.task, str) else "user-defined task"
        figure.suptitle(
            f"{self.batch.ship.name} · {task} · {settings.observer} · {now:.0f} s · "
            f"reward {self.rewarded:.1f}",
            fontsize=10,
            x=0.01,
            ha="left",
            color=_DARK,
        )
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _draw_lines(self, axis: Axes, lines: Any, factor: float) -> None:
        time = [row["time"] for row in self.rows] or [0.0]
        for name, label, color in lines:
            values = [factor * row[name] for row in self.rows] or [0.0]
            axis.plot(time, values, color=color, linewidth=1.2, label=label or "measured")
        axis.set_xlim(time[0], max(time[-1], time[0] + _LEAST_S))
        axis.set_xlabel("time [s]", fontsize=8)
        if len(lines) > 1:
            axis.legend(fontsize=7, frameon=False, ncols=2, loc="upper left", handlelength=1.2)
            axis.margins(y=0.2)

    def _draw_envelope(self, axis: Axes) -> None:
        """Draw the brake torque over the engine speed inside the engine envelope."""
        plant = self.batch.ship.record()
        gear, rpm = float(plant["gear_ratio"]), 30.0 / np.pi
        speeds = np.linspace(float(plant["engine_speed_min"]), float(plant["engine_speed_max"]), 40)
        limit = [1e-3 * float(torque_limit(plant, float(speed))) for speed in speeds]
        axis.fill_between(rpm * speeds, 0.0, limit, color=_PALE, linewidth=0)
        axis.plot(rpm * speeds, limit, color=_GREY, linewidth=1.2, label="limit")
        engine = np.array([gear * rpm * row["shaft_speed"] for row in self.rows])
        torque = np.array([1e-3 * row["brake_torque"] for row in self.rows])
        axis.plot(engine, torque, color=_DARK, linewidth=0.8, label="last two minutes")
        axis.plot(engine[-1:], torque[-1:], "o", color=_RED, markersize=5, label="now")
        axis.set_ylim(0.0, 1.15 * max(limit))
        axis.set_title("engine torque [kN m]", fontsize=9, loc="left", color=_DARK)
        axis.set_xlabel("engine speed [rpm]", fontsize=8)
        axis.legend(fontsize=7, frameon=False, loc="upper left", handlelength=1.2)
