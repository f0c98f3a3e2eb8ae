"""Figures without global plotting state: signals over time, and controllers compared."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave
from numpy.typing import NDArray

from ..core.files import FileError, write_atomically
from ..plant import Ship
from ..plant.drives.diesel import torque_limit

TRUTH, ESTIMATE, THESIS = "#1f2a44", "#d1495b", "#8d99ae"
ESTIMATED = "estimated_advance_velocity_m_s"
PALETTE = ("#d1495b", "#00798c", "#edae49", "#66a182", "#2e4057", "#8d6a9f", "#b07d62", "#5f9ed1")


def new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, Any]:
    """Return a figure with a grid of axes, shape (rows, columns)."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    style(*axes.flat)
    return figure, axes


def style(*axes: Any) -> None:
    """Give axes a light grid and only the spines at the left and at the bottom."""
    for axis in axes:
        axis.grid(alpha=0.25, linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)


def check_picture(path: Path) -> None:
    """Refuse a path whose ending is no picture format; a FileError names the known endings."""
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    if path.suffix[1:].lower() not in known:
        raise FileError(f"{path}: a picture file must end in .{', .'.join(known)}")


def save(figure: Figure, path: Path, dpi: int = 110) -> None:
    """Write a figure in the format of the path's ending; an unknown one raises a FileError."""
    check_picture(path)
    write_atomically(path, lambda file: figure.savefig(file, dpi=dpi))


def save_frame(frame: NDArray[np.uint8], path: Path) -> None:
    """Write an image that an environment rendered, shape (height, width, 3), as a PNG file."""
    write_atomically(path, lambda file: imsave(file, frame))


def signals_figure(table: pd.DataFrame, title: str) -> Figure:
    """Return a figure of the main signals of a simulation over time, from the columns of recordings."""
    panels = (
        ("advance_velocity_m_s", "advance velocity [m/s]", 1.0),
        ("shaft_speed_rad_s", "shaft speed [rad/s]", 1.0),
        ("shaft_torque_N_m", "shaft torque [kN m]", 1e-3),
        ("ship_speed_m_s", "ship speed [m/s]", 1.0),
        ("pitch_ratio", "pitch ratio [-]", 1.0),
        ("fuel_rack_mm", "fuel rack [mm]", 1.0),
        ("motor_voltage_V", "motor voltage [V]", 1.0),
        ("motor_torque_N_m", "motor torque [N m]", 1.0),
        ("motor_current_A", "motor current [A]", 1.0),
    )
    drawn = [p for p in panels if p[0] in table and not (table[p[0]] == 0.0).all()]
    figure, axes = new_figure(-(-len(drawn) // 2), 2, (9.5, 2.3 * -(-len(drawn) // 2) + 0.6))
    figure.suptitle(title, fontsize=12)
    for axis, (name, label, scale) in zip(axes.flat, drawn, strict=False):
        axis.plot(table["time_s"], table[name] * scale, color=TRUTH, linewidth=1)
        axis.set_ylabel(label, fontsize=8)
        axis.tick_params(labelsize=8)
        axis.ticklabel_format(useOffset=False, axis="y")
        if name == "advance_velocity_m_s" and ESTIMATED in table:
            axis.plot(table["time_s"], table[ESTIMATED], color=ESTIMATE, linewidth=0.8)
            axis.set_title("true (dark) and estimated (red)", fontsize=8)
    for axis in axes.flat[len(drawn) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def controllers_figure(traces: dict[str, pd.DataFrame], ship: Ship) -> Figure:
    """Return a figure of one episode of each controller on a ship.

    Its panels show speed and torque over time, the ship's engine envelope, and pitch over shaft speed.
    The traces have columns of :data:`shaftline.agents.evaluation.episodes.TRACE`.
    """
    plant = ship.record()
    gear = ship.transmission.gear_ratio
    figure, axes = new_figure(2, 2, (11.0, 7.5))
    speed, torque, envelope, pitch = axes.flat
    for i, (name, trace) in enumerate(traces.items()):
        color = PALETTE[i % len(PALETTE)]
        speed.plot(trace["time"], trace["ship_speed"], color=color, linewidth=1, label=name)
        torque.plot(trace["time"], trace["shaft_torque"] * 1e-3, color=color, linewidth=0.6)
        engine = trace["shaft_speed"] * gear
        envelope.plot(engine * 30.0 / np.pi, trace["brake_torque"] * 1e-3, ".", color=color, ms=2)
        pitch.plot(trace["shaft_speed"], trace["pitch_ratio"], ".", color=color, markersize=2)
    first = next(iter(traces.values()))
    speed.plot(first["time"], first["speed_order"], color=THESIS, linestyle="--", label="order")
    range_ = np.linspace(float(plant["engine_speed_min"]), float(plant["engine_speed_max"]), 50)
    limit = [torque_limit(plant, float(w)) * 1e-3 for w in range_]
    envelope.plot(range_ * 30.0 / np.pi, limit, color=TRUTH, linewidth=1)
    for axis, x, y in (
        (speed, "time [s]", "ship speed [m/s]"),
        (torque, "time [s]", "shaft torque [kN m]"),
        (envelope, "engine speed [rpm]", "brake torque [kN m], with the envelope"),
        (pitch, "shaft speed [rad/s]", "pitch ratio [-]"),
    ):
        axis.set_xlabel(x, fontsize=9)
        axis.set_ylabel(y, fontsize=9)
        axis.tick_params(labelsize=8)
    figure.legend(loc="outside upper center", ncols=2, fontsize=8, frameon=False)
    return figure
