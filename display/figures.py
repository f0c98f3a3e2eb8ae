"""Figures, drawn without any global plotting state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave
from numpy.typing import NDArray

from ..core.files import FileError, write_atomically
from ..core.lazy import control
from ..plant import Ship
from ..plant.drives.diesel import torque_limit

TRUTH, ESTIMATE, THESIS = "#1f2a44", "#d1495b", "#8d99ae"
ESTIMATED = "estimated_advance_velocity_m_s"
PALETTE = ("#d1495b", "#00798c", "#edae49", "#66a182", "#2e4057", "#8d6a9f", "#b07d62", "#5f9ed1")


def new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, Any]:
    """A figure with a grid of axes, shape (rows, columns)."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat:
        axis.grid(alpha=0.25, linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def check_picture(path: Path) -> None:
    """Refuse a path whose ending is that of no picture.

    Raises:
        FileError: names the endings that are known.
    """
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    if path.suffix[1:].lower() not in known:
        raise FileError(f"{path}: a picture's file ends in .{', .'.join(known)}")


def save(figure: Figure, path: Path, dpi: int = 110) -> None:
    """Write a figure as PNG, or as the path's ending says.

    Raises:
        FileError: an ending that no picture has.
    """
    check_picture(path)
    write_atomically(path, lambda file: figure.savefig(file, dpi=dpi))


def save_frame(frame: NDArray[np.uint8], path: Path) -> None:
    """Write what an environment rendered.

    Args:
        frame: height, width, three colours.
        path: ending in ``.png``.
    """
    write_atomically(path, lambda file: imsave(file, frame))


def observer_traces(
    title: str, records: dict[str, tuple[NDArray[Any], NDArray[Any], NDArray[Any], float]]
) -> Figure:
    """Advance velocity and its estimate in every load case (thesis Figures A-1 to A-11).

    Args:
        title: of the figure.
        records: by load case: time [s], truth [m/s], estimate [m/s], VAF [%].
    """
    figure, axes = new_figure(4, 2, (9.0, 10.0))
    figure.suptitle(title, fontsize=12)
    for axis, (name, (time, truth, estimate, score)) in zip(
        axes.flat, records.items(), strict=False
    ):
        axis.plot(time, truth, color=TRUTH, linewidth=1.2, label="true")
        axis.plot(time, estimate, color=ESTIMATE, linewidth=1.0, linestyle="--", label="estimated")
        axis.set_title(f"{name.replace('_', ' ')}: VAF {score:.2f} %", fontsize=9)
        spread = max(float(np.ptp(truth)), 0.05)
        axis.set_ylim(truth.min() - 0.6 * spread, truth.max() + 0.6 * spread)
        axis.set_ylabel("v_a [m/s]", fontsize=8)
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(records) :]:
        axis.set_visible(False)
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis in axes.flat[max(0, len(records) - 2) : len(records)]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def trade_off(needed: pd.Series, vaf: pd.DataFrame) -> Figure:
    """Average VAF against the SNR that an observer needs (thesis Figure 4-2), with its range.

    Args:
        needed: SNR [dB] by observer, from :func:`shaftline.studies.thesis.snr.snr_at`.
        vaf: VAF table, rows by observer, columns by load case.
    """
    figure, axes = new_figure(1, 1, (8.5, 5.2))
    axis: Axes = axes[0, 0]
    drawn = [(str(row), float(snr)) for row, snr in needed.dropna().items() if row in vaf.index]
    for i, (row, snr) in enumerate(drawn):
        values = vaf.loc[row]
        color = PALETTE[i % len(PALETTE)]
        low, middle, high = values.min(), values.mean(), values.max()
        axis.errorbar(
            snr,
            middle,
            yerr=[[middle - low], [high - middle]],
            fmt="o" if i < len(PALETTE) else "s",
            color=color,
            capsize=3,
            label=row,
            linewidth=1,
        )
    axis.set_xlabel("SNR needed for 95 % of the noiseless VAF [dB]  (less is better)")
    axis.set_ylabel("mean VAF over the load cases [%], with its range")
    axis.legend(fontsize=7.5, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def gain_sweep(table: pd.DataFrame) -> Figure:
    """VAF and the inverse of the SNR needed over the gain of I&I (thesis Figure 4-3).

    Args:
        table: columns gamma, vaf [%], snr_db.
    """
    figure, axes = new_figure(1, 1, (7.5, 4.4))
    left: Axes = axes[0, 0]
    right = left.twinx()
    left.plot(table["gamma"], table["vaf"], color=TRUTH, marker="o", markersize=3)
    right.plot(table["gamma"], 1.0 / table["snr_db"], color=ESTIMATE, marker="s", markersize=3)
    left.set_xscale("log")
    left.set_xlabel("gain γ of the I&I observer [m/rad]")
    left.set_ylabel("noiseless VAF [%]", color=TRUTH)
    right.set_ylabel("1 / SNR needed [1/dB]", color=ESTIMATE)
    return figure


def bode(systems: dict[str, control.StateSpace], title: str) -> Figure:
    """Gains from every input to every output (thesis Figures 2-5 and 2-6).

    Args:
        systems: linear models by label, all with the same inputs and outputs; names are taken
            from the first.
        title: of the figure.
    """
    first = next(iter(systems.values()))
    outputs, inputs = first.output_labels, first.input_labels
    frequency = np.geomspace(1e-3, 1e2, 300)
    figure, axes = new_figure(len(outputs), len(inputs), (3.1 * len(inputs), 2.2 * len(outputs)))
    figure.suptitle(title, fontsize=12)
    for label, system in systems.items():
        response = np.abs(system(1j * frequency, squeeze=False))
        for i in range(len(outputs)):
            for j in range(len(inputs)):
                gain = response[i, j]
                if np.all(gain < 1e-12):
                    continue
                axes[i, j].semilogx(frequency, 20.0 * np.log10(gain), linewidth=1, label=label)
    for i, output in enumerate(outputs):
        axes[i, 0].set_ylabel(f"{output.replace('_', ' ')}\n[dB]", fontsize=8)
    for j, name in enumerate(inputs):
        top = next(axis for axis in axes[:, j] if axis.lines)
        top.set_title(f"from {name.replace('_', ' ')}", fontsize=9)
        axes[-1, j].set_xlabel("frequency [rad/s]", fontsize=8)
    for axis in axes.flat:
        axis.tick_params(labelsize=7)
        if not axis.lines:
            axis.set_visible(False)
    axes[0, 0].legend(fontsize=7, frameon=False)
    return figure


def columns(table: pd.DataFrame, title: str) -> Figure:
    """The main signals of a simulated run over time.

    Args:
        table: columns as in recordings.
        title: of the figure.
    """
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


def seaway(
    time: NDArray[Any],
    truth: NDArray[Any],
    estimates: dict[str, NDArray[Any]],
    scores: dict[str, float],
    window: tuple[float, float],
) -> Figure:
    """Every observer's estimate beside the truth, one panel each.

    Args:
        time: [s], shape (n,).
        truth: advance velocity [m/s], shape (n,).
        estimates: by observer [m/s].
        scores: VAF [%] by observer.
        window: part of the record to show [s].
    """
    shown = (time >= window[0]) & (time <= window[1])
    columns = 3
    rows = -(-len(estimates) // columns)
    figure, axes = new_figure(rows, columns, (12.0, 2.0 * rows + 0.6))
    figure.suptitle(
        "Advance velocity of the frigate in head seas, Hs 2.9 m: true (dark), estimated from noisy "
        "speed, torque and pitch (red)",
        fontsize=11,
    )
    low, high = truth[shown].min() - 0.6, truth[shown].max() + 0.6
    for axis, (name, estimate) in zip(axes.flat, estimates.items(), strict=False):
        axis.plot(time[shown], truth[shown], color=TRUTH, linewidth=1.3)
        axis.plot(time[shown], estimate[shown], color=ESTIMATE, linewidth=0.8, alpha=0.9)
        axis.set_title(f"{name}: VAF {scores[name]:.1f} %", fontsize=9)
        axis.set_ylim(low, high)
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(estimates) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("v_a [m/s]", fontsize=8)
    for axis in axes.flat[max(0, len(estimates) - columns) : len(estimates)]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def drive_train(points: pd.DataFrame, response: pd.DataFrame, models: Sequence[str]) -> Figure:
    """Tito Neri: measured and simulated operating points and frequency response.

    Args:
        points: from :func:`shaftline.studies.tito_neri.steady_states.operating_points`.
        response: from :func:`shaftline.studies.tito_neri.steady_states.frequency_response`.
        models: names of the parameter sets.
    """
    figure, axes = new_figure(2, 2, (10.0, 7.0))
    figure.suptitle("Tito Neri drive train: measured (black) and simulated", fontsize=12)
    volts = points["voltage_V"].unique()
    for axis, column, label in (
        (axes[0, 0], "motor_speed_rad_s", "motor speed [rad/s]"),
        (axes[0, 1], "motor_current_A", "motor current [A]"),
    ):
        first = points[points["model"] == models[0]]
        axis.plot(volts, first[f"{column}_measured"], "ko", label="measured")
        for i, model in enumerate(models):
            line = points[points["model"] == model]
            axis.plot(volts, line[column], color=PALETTE[i], marker="x", label=model)
        axis.set_xlabel("motor voltage [V]")
        axis.set_ylabel(label)
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis, name, label in (
        (axes[1, 0], "speed", "speed gain [-]"),
        (axes[1, 1], "current", "current gain [-]"),
    ):
        first = response[response["model"] == models[0]]
        axis.loglog(first["frequency_rad_s"], first[f"{name}_gain_measured"].clip(lower=1e-3), "ko")
        for i, model in enumerate(models):
            line = response[response["model"] == model]
            axis.loglog(line["frequency_rad_s"], line[f"{name}_gain"], color=PALETTE[i], marker="x")
        axis.set_xlabel("frequency [rad/s]")
        axis.set_ylabel(label + ", normalised at point C")
        axis.axvspan(700, 7000, color=THESIS, alpha=0.15, linewidth=0)
    return figure


def controllers(traces: dict[str, pd.DataFrame], ship: Ship) -> Figure:
    """One episode of each controller: speed and torque in time, engine envelope, pitch and speed.

    Args:
        traces: by controller, columns of :data:`shaftline.agents.evaluation.episodes.TRACE`.
        ship: whose engine's envelope is drawn.
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
