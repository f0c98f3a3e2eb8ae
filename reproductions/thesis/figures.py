"""Draw the figures of the thesis: estimates, trade-offs, Bode plots, fuel rack map and load cases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.core.lazy import control
from shaftline.display.figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.plant import Ship
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.load_cases import CASES

from ..pages import label_axis
from . import observer_transfers
from .observer_transfers import INPUTS, KALMAN, LUENBERGER, OUTPUTS


def _label_edges(axes: Any, x: str, y: str) -> None:
    """Label the lowest axes of a grid, and the first axes of its rows."""
    for axis in axes[-1]:
        axis.set_xlabel(x, fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel(y, fontsize=8)


def observer_traces(title: str, records: dict[str, tuple[Any, Any, Any, float]]) -> Figure:
    """Draw the advance velocity and its estimate in every load case (Figures A-1 to A-11).

    The records have time [s], truth [m/s] and estimate [m/s], shape (n,), and VAF [%].
    """
    figure, axes = new_figure(4, 2, (9.0, 10.0))
    figure.suptitle(title, fontsize=12)
    shown = axes.flat[: len(records)]
    for axis, (name, (time, truth, estimate, score)) in zip(shown, records.items(), strict=True):
        axis.plot(time, truth, color=TRUTH, linewidth=1.2, label="true")
        axis.plot(time, estimate, color=ESTIMATE, linewidth=1.0, linestyle="--", label="estimated")
        spread = max(float(np.ptp(truth)), 0.05)
        axis.set_ylim(truth.min() - 0.6 * spread, truth.max() + 0.6 * spread)
        label_axis(axis, y="v_a [m/s]", title=f"{name.replace('_', ' ')}: VAF {score:.2f} %")
    for axis in axes.flat[len(records) :]:
        axis.set_visible(False)
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis in shown[-2:]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def trade_off(needed: pd.Series, vaf: pd.DataFrame) -> Figure:
    """Draw the mean VAF, with its range, over the SNR [dB] that an observer needs (Figure 4-2)."""
    figure, axes = new_figure(1, 1, (8.5, 5.2))
    axis: Axes = axes[0, 0]
    drawn = [(str(row), float(snr)) for row, snr in needed.dropna().items() if row in vaf.index]
    for i, (row, snr) in enumerate(drawn):
        low, middle, high = (vaf.loc[row].agg(how) for how in ("min", "mean", "max"))
        around, marker = [[middle - low], [high - middle]], "o" if i < len(PALETTE) else "s"
        axis.errorbar(
            snr,
            middle,
            yerr=around,
            fmt=marker,
            color=PALETTE[i % len(PALETTE)],
            capsize=3,
            label=row,
            linewidth=1,
        )
    axis.set_xlabel("SNR needed for 95 % of the noiseless VAF [dB]  (less is better)")
    axis.set_ylabel("mean VAF over the load cases [%], with its range")
    axis.legend(fontsize=7.5, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def gain_sweep(table: pd.DataFrame) -> Figure:
    """Draw VAF [%] and inverse of the required SNR over the gain gamma of I&I (Figure 4-3)."""
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


RACKS_MM = (10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
SAMPLE_TIME_S = 0.01  # of the discrete filter in Figure 3-10
FREQUENCIES = np.geomspace(1e-2, 1e2, 300)  # rad/s, the thesis's range

_BELIEFS = {
    "inertia_minus_10pct": "inertia -10 %",
    "inertia_plus_10pct": "inertia +10 %",
    "open_water_minus_10pct": "KT, KQ -10 %",
    "open_water_plus_10pct": "KT, KQ +10 %",
    "ear_0.6": "EAR 0.6",
    "ear_1.0": "EAR 1.0",
}


def fuel_rack_map(ship: Ship) -> Figure:
    """Draw the engine torque over its speed, one line for each rack, and the limits (Figure 2-4)."""
    plant = ship.record()
    speed = np.linspace(float(plant["engine_speed_min"]), float(plant["engine_speed_max"]), 200)
    rpm = speed * 30.0 / math.pi
    figure, axes = new_figure(1, 1, (7.0, 4.6))
    axis = axes[0, 0]
    for rack in RACKS_MM:
        line = np.array([rack_torque(plant, one, rack) for one in speed]) / 1e3
        axis.plot(rpm, line, color=PALETTE[1], linewidth=1.0)
        axis.annotate(
            f"{rack:g} mm",
            (rpm[-1], line[-1]),
            xytext=(4, -3),
            fontsize=8,
            textcoords="offset points",
        )
    top = np.array([torque_limit(plant, one) for one in speed]) / 1e3
    axis.plot(rpm, top, color=TRUTH, linewidth=1.6, label="torque limit")
    for at in (rpm[0], rpm[-1]):
        axis.axvline(at, color=TRUTH, linewidth=1.0, linestyle=":")
    axis.set_xlim(rpm[0] - 20.0, rpm[-1] + 90.0)
    axis.set_ylim(0.0, None)
    label_axis(axis, "engine speed [rpm]", "brake torque [kN m]", size=10, ticks=None, legend=8)
    return figure


def load_case_overview(ship: Ship) -> Figure:
    """Draw the inputs that change in each load case over time (Figure 4-1)."""
    figure, axes = new_figure(4, 2, (10.0, 9.0))
    for axis, case in zip(axes.flat, CASES.values(), strict=True):
        run, schedule = case.run(ship), case.schedule
        time, title = run["time"], case.name.replace("_", " ")
        if case.noisy:
            clean = run["measured_shaft_speed"]
            noise = np.random.default_rng(0).standard_normal(len(run))
            noisy = clean + noise * np.sqrt(np.mean(clean**2)) * 10.0 ** (-40.0 / 20.0)
            axis.plot(time, noisy, color=THESIS, linewidth=0.6, label="read, SNR 40 dB")
            axis.plot(time, clean, color=TRUTH, linewidth=1.0, label="true")
            label_axis(axis, y="ω [rad/s]", title=title)
            axis.legend(fontsize=7, frameon=False, loc="upper right")
            continue
        inflow = run["advance_velocity"] - run["ship_speed"] * (1.0 - ship.hull.wake_fraction)
        inputs = [
            (run["drive"], "X [mm]", callable(schedule.drive)),
            (run["pitch_command"], "P/D ordered [-]", callable(schedule.pitch_command)),
            (inflow, "u_x [m/s]", callable(schedule.inflow) or case.sea is not None),
            (schedule.resistance_factor, "resistance factor [-]", True),
        ]
        values, label = next((v, name) for v, name, moves in inputs if moves)
        axis.plot(time, values(time) if callable(values) else values, color=TRUTH, linewidth=1.0)
        label_axis(axis, y=label, title=title)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def _gains(
    title: str,
    systems: dict[str, list[control.StateSpace]],
    outputs: Sequence[str],
    inputs: Sequence[str],
    panel: tuple[float, float] = (4.6, 2.9),
    frequency: NDArray[np.float64] = FREQUENCIES,
    interval_s: float = 0.0,
) -> Figure:
    """Draw Bode magnitudes in s, or in z with an interval; outputs by row, inputs by column."""
    points = np.exp(1j * frequency * interval_s) if interval_s else 1j * frequency
    size = (panel[0] * len(inputs), panel[1] * len(outputs))
    figure, axes = new_figure(len(outputs), len(inputs), size)
    figure.suptitle(title, fontsize=11)
    for k, (label, own) in enumerate(systems.items()):
        for one, style in zip(own, ("-", "--"), strict=False):
            response = np.abs(one(points, squeeze=False))
            for i, j in np.ndindex(axes.shape):
                if np.any(response[i, j] >= 1e-12):
                    axes[i, j].semilogx(
                        frequency,
                        20.0 * np.log10(response[i, j]),
                        style,
                        color=PALETTE[k],
                        linewidth=1.2,
                        label=label if style == "-" else None,
                    )
    for i, j in np.ndindex(axes.shape):
        label_axis(axes[i, j], title=f"{inputs[j]} to {outputs[i]}".replace("_", " "))
        axes[i, j].set_visible(bool(axes[i, j].lines))
    _label_edges(axes, "frequency [rad/s]", "gain [dB]")
    axes[0, 0].legend(fontsize=7, frameon=False)
    return figure


def bode(systems: dict[str, control.StateSpace], title: str) -> Figure:
    """Draw the gains from every input to every output (Figures 2-5 and 2-6)."""
    first = next(iter(systems.values()))
    shown = {label: [system] for label, system in systems.items()}
    frequency = np.geomspace(1e-3, 1e2, 300)
    return _gains(title, shown, first.output_labels, first.input_labels, (3.1, 2.2), frequency)


def shaft_observer_bode(ship: Ship) -> Figure:
    """Draw the three Luenberger tunings and the shaft Kalman filter (Figures 3-2 and 3-4)."""
    names = (*LUENBERGER, KALMAN)
    systems = {name: [observer_transfers.linear_observer(name, ship)] for name in names}
    outputs = [f"{name} estimated" for name in OUTPUTS]
    return _gains("Luenberger and shaft Kalman (Figures 3-2 and 3-4)", systems, outputs, INPUTS)


def invariance_bode(ship: Ship) -> Figure:
    """Draw I&I at A and D, gamma 1 and 20, by eq. 3-13 as printed and by the observer (Figure 3-8)."""
    gammas = [ImmersionInvariance.tunings[tuning].gain for tuning in ("low", "high")]
    systems = {
        f"{point}, γ = {gamma:g}": [
            observer_transfers.immersion_invariance(ship, point, gamma, as_printed=choice)
            for choice in (False, True)
        ]
        for point in "AD"
        for gamma in gammas
    }
    title = "I&I: dashed as printed, a pole at 0; full the observer itself (Figure 3-8)"
    return _gains(title, systems, ["v_a estimated"], INPUTS, panel=(5.0, 3.8))


def random_walk_bode(ship: Ship) -> Figure:
    """Draw the printed random-walk Kalman filter at A to D as a discrete filter (Figure 3-10).

    The thesis draws it with s in the place of z; here z = exp(j omega T).
    """
    inertia = observer_transfers.propeller_inertia(ship)
    systems = {
        point: [
            observer_transfers.random_walk_response(
                *observer_transfers.plant_slopes(ship, point), inertia
            )
        ]
        for point in "ABCD"
    }
    title = f"Random-walk Kalman filter, a sample each {SAMPLE_TIME_S:g} s (Figure 3-10)"
    outputs = ["omega estimated", "v_a estimated"]
    return _gains(title, systems, outputs, INPUTS, interval_s=SAMPLE_TIME_S)


def noise_figure(curves: pd.DataFrame, printed: pd.Series, share: float) -> Figure:
    """Draw the VAF over the SNR, one panel for each observer (Figures A-12 to A-22).

    ``curves`` are those of :func:`.snr.snr_curves`, ``printed`` the SNR [dB] of Table 4-2, and
    ``share`` of the noiseless VAF [-] is drawn dashed.
    """
    figure, axes = new_figure(4, 3, (11.0, 11.0))
    for axis, name in zip(axes.flat, curves["row"].unique(), strict=True):
        own = curves[curves["row"] == name]
        snr = own["snr_dB"]
        axis.fill_between(snr, own["least"], own["most"], color=PALETTE[1], alpha=0.25, linewidth=0)
        axis.plot(snr, own["mean"], color=PALETTE[1], linewidth=1.3)
        axis.axhline(share * own["mean"].iloc[-1], color=THESIS, linewidth=0.9, linestyle="--")
        if name in printed.index and np.isfinite(printed[name]):
            axis.axvline(printed[name], color=ESTIMATE, linewidth=0.9, linestyle=":")
        axis.set_ylim(-3.0, 103.0)
        label_axis(axis, title=name)
    _label_edges(axes, "SNR [dB]", "VAF [%]")
    title = (
        "VAF over the noise: mean and range of 20 seeds; dashed 95 % of the noiseless, dotted the "
        "thesis's SNR"
    )
    figure.suptitle(title, fontsize=11)
    return figure


def belief_figure(
    samples: NDArray[Any], estimates: dict[tuple[str, str], NDArray[np.float64]], rows: list[str]
) -> Figure:
    """Draw the estimates with six wrong models, first 10 s at 4 rad/s (Figures A-23 to A-33).

    Samples and estimates [m/s], by observer and model, have the shape (n,).
    """
    figure, axes = new_figure(4, 3, (12.0, 11.5))
    shown = samples["time"] <= 10.0
    time, truth = samples["time"][shown], samples["advance_velocity"][shown]
    spread = float(np.ptp(truth))
    for axis, name in zip(axes.flat, rows, strict=True):
        axis.plot(time, truth, color=TRUTH, linewidth=1.4, label="true")
        for k, (belief, label) in enumerate(_BELIEFS.items()):
            estimate = estimates[name, belief][shown]
            axis.plot(time, estimate, color=PALETTE[k], linewidth=0.8, label=label)
        axis.set_ylim(truth.min() - spread, truth.max() + spread)
        label_axis(axis, title=name)
    _label_edges(axes, "time [s]", "v_a [m/s]")
    axes[0, 0].legend(fontsize=6, frameon=False, ncols=2, loc="upper right")
    figure.suptitle("Advance velocity estimated with wrong knowledge of the ship", fontsize=11)
    return figure
