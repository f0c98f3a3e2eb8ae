"""Figures of the thesis: observer traces, trade-off of noise and accuracy, gain sweep, Bode plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.display.figures import ESTIMATE, PALETTE, TRUTH, new_figure

if TYPE_CHECKING:
    import control


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
        needed: SNR [dB] by observer, from :func:`reproductions.thesis.snr.snr_at`.
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
