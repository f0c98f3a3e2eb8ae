"""Draw the figures of the thesis: estimates, trade-offs, Bode plots, fuel rack map and load cases."""

from __future__ import annotations

import math
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

from . import observer_transfers
from .observer_transfers import INPUTS, KALMAN, LUENBERGER, OUTPUTS


def observer_traces(
    title: str, records: dict[str, tuple[NDArray[Any], NDArray[Any], NDArray[Any], float]]
) -> Figure:
    """Draw the advance velocity and its estimate in every load case (Figures A-1 to A-11).

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
    """Draw the mean VAF, with its range, over the SNR that an observer needs (Figure 4-2).

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
    """Draw the VAF and the inverse of the required SNR over the gain of I&I (Figure 4-3).

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
    """Draw the gains from every input to every output (Figures 2-5 and 2-6)."""
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


RACKS_MM = (10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
SAMPLE_TIME_S = 0.01  # of the discrete filter in Figure 3-10
FREQUENCIES = np.geomspace(1e-2, 1e2, 300)  # rad/s, the thesis's range

_BELIEFS = {
    "inertia_minus_10pct": "inertia -10 %", "inertia_plus_10pct": "inertia +10 %",
    "open_water_minus_10pct": "KT, KQ -10 %", "open_water_plus_10pct": "KT, KQ +10 %",
    "ear_0.6": "EAR 0.6", "ear_1.0": "EAR 1.0",
}  # fmt: skip


def fuel_rack_map(ship: Ship) -> Figure:
    """Draw the engine torque over its speed, one line for each rack, and the limits (Figure 2-4)."""
    plant = ship.record()
    low, high = float(plant["engine_speed_min"]), float(plant["engine_speed_max"])
    speed = np.linspace(low, high, 200)
    rpm = speed * 30.0 / math.pi
    top = np.array([torque_limit(plant, one) for one in speed])
    figure, axes = new_figure(1, 1, (7.0, 4.6))
    axis = axes[0, 0]
    for rack in RACKS_MM:
        line = np.array([rack_torque(plant, one, rack) for one in speed])
        axis.plot(rpm, line / 1e3, color=PALETTE[1], linewidth=1.0)
        axis.annotate(f"{rack:g} mm", (rpm[-1], line[-1] / 1e3), xytext=(4, -3), fontsize=8,
                      textcoords="offset points")  # fmt: skip
    axis.plot(rpm, top / 1e3, color=TRUTH, linewidth=1.6, label="torque limit")
    for at in (rpm[0], rpm[-1]):
        axis.axvline(at, color=TRUTH, linewidth=1.0, linestyle=":")
    axis.set_xlim(rpm[0] - 20.0, rpm[-1] + 90.0)
    axis.set_ylim(0.0, None)
    axis.set_xlabel("engine speed [rpm]")
    axis.set_ylabel("brake torque [kN m]")
    axis.legend(fontsize=8, frameon=False)
    return figure


def load_case_overview(ship: Ship) -> Figure:
    """Draw the inputs that change in each load case over time (Figure 4-1)."""
    cases = list(CASES.values())
    figure, axes = new_figure(4, 2, (10.0, 9.0))
    for axis, case in zip(axes.flat, cases, strict=True):
        run = case.run(ship)
        time = run["time"]
        if case.noisy:
            clean = run["measured_shaft_speed"]
            noise = np.random.default_rng(0).standard_normal(len(run))
            noisy = clean + noise * np.sqrt(np.mean(clean**2)) * 10.0 ** (-40.0 / 20.0)
            axis.plot(time, noisy, color=THESIS, linewidth=0.6, label="read, SNR 40 dB")
            axis.plot(time, clean, color=TRUTH, linewidth=1.0, label="true")
            axis.set_ylabel("ω [rad/s]", fontsize=8)
            axis.legend(fontsize=7, frameon=False, loc="upper right")
        else:
            schedule, inflow = case.schedule, run["advance_velocity"]
            inflow = inflow - run["ship_speed"] * (1.0 - ship.hull.wake_fraction)
            told = [
                (run["drive"], "X [mm]", callable(schedule.drive)),
                (run["pitch_command"], "P/D ordered [-]", callable(schedule.pitch_command)),
                (inflow, "u_x [m/s]", callable(schedule.inflow) or case.sea is not None),
            ]
            shown = next(((v, n) for v, n, moves in told if moves), None)
            if shown is None:
                factor = schedule.resistance_factor(time)
                shown = (factor, "resistance factor [-]")
            axis.plot(time, shown[0], color=TRUTH, linewidth=1.0)
            axis.set_ylabel(shown[1], fontsize=8)
        axis.set_title(case.name.replace("_", " "), fontsize=9)
        axis.tick_params(labelsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def _gains(
    systems: dict[str, control.StateSpace],
    points: NDArray[Any],
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    title: str,
) -> Figure:
    """Draw the Bode magnitude of systems, outputs by row, inputs by column, at the points s or z."""
    figure, axes = new_figure(len(outputs), len(inputs), (4.6 * len(inputs), 2.9 * len(outputs)))
    figure.suptitle(title, fontsize=11)
    for k, (label, system) in enumerate(systems.items()):
        response = np.abs(system(points, squeeze=False))
        for i in range(len(outputs)):
            for j in range(len(inputs)):
                level = 20.0 * np.log10(np.maximum(response[i, j], 1e-300))
                axes[i, j].semilogx(
                    FREQUENCIES, level, color=PALETTE[k], linewidth=1.2, label=label,
                    linestyle=("-", "--", ":", "-.")[k % 4],
                )  # fmt: skip
    for i, output in enumerate(outputs):
        for j, source in enumerate(inputs):
            axes[i, j].set_title(f"{source} to {output}", fontsize=9)
            axes[i, j].tick_params(labelsize=8)
        axes[i, 0].set_ylabel("gain [dB]", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("frequency [rad/s]", fontsize=8)
    axes[0, 0].legend(fontsize=7, frameon=False)
    return figure


def shaft_observer_bode(ship: Ship) -> Figure:
    """Draw the three Luenberger tunings and the shaft Kalman filter (Figures 3-2 and 3-4)."""
    systems = {
        name: observer_transfers.linear_observer(name, ship) for name in (*LUENBERGER, KALMAN)
    }
    outputs = tuple(f"{name} estimated" for name in OUTPUTS)
    title = "Luenberger and shaft Kalman (Figures 3-2 and 3-4)"
    return _gains(systems, 1j * FREQUENCIES, outputs, INPUTS, title)


def invariance_bode(ship: Ship) -> Figure:
    """Draw I&I at A and D, gamma 1 and 20, by eq. 3-13 as printed and by the observer (Figure 3-8)."""
    figure, axes = new_figure(1, 2, (10.0, 3.8))
    figure.suptitle("I&I: dashed as printed, a pole at 0; full the observer itself (Figure 3-8)",
                    fontsize=11)  # fmt: skip
    k = 0
    for point in "AD":
        for tuning in ("low", "high"):
            gamma = ImmersionInvariance.tunings[tuning].gain
            for as_printed, style in ((True, "--"), (False, "-")):
                system = observer_transfers.immersion_invariance(
                    ship, point, gamma, as_printed=as_printed
                )
                level = 20.0 * np.log10(np.abs(system(1j * FREQUENCIES, squeeze=False)))
                for j in range(2):
                    axes[0, j].semilogx(
                        FREQUENCIES, level[0, j], style, color=PALETTE[k], linewidth=1.1,
                        label=None if as_printed else f"{point}, γ = {gamma:g}",
                    )  # fmt: skip
            k += 1
    for axis, source in zip(axes[0], ("ω to v_a estimated", "M_m to v_a estimated"), strict=True):
        axis.set_title(source, fontsize=9)
        axis.set_xlabel("frequency [rad/s]", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].set_ylabel("gain [dB]", fontsize=8)
    axes[0, 0].legend(fontsize=7, frameon=False)
    return figure


def random_walk_bode(ship: Ship) -> Figure:
    """Draw the printed random-walk Kalman filter at A to D as a discrete filter (Figure 3-10).

    The thesis draws it with s in the place of z; here z = exp(j omega T).
    """
    systems = {
        point: observer_transfers.random_walk_response(
            *observer_transfers.plant_slopes(ship, point),
            observer_transfers.propeller_inertia(ship),
        )
        for point in "ABCD"
    }
    points = np.exp(1j * FREQUENCIES * SAMPLE_TIME_S)
    outputs = ("omega estimated", "v_a estimated")
    title = f"Random-walk Kalman filter, a sample each {SAMPLE_TIME_S:g} s (Figure 3-10)"
    return _gains(systems, points, outputs, INPUTS, title)


def noise_figure(curves: pd.DataFrame, printed: pd.Series, share: float) -> Figure:
    """Draw the VAF over the SNR, one panel for each observer (Figures A-12 to A-22).

    Args:
        curves: from :func:`.snr.snr_curves`.
        printed: SNR [dB] of Table 4-2 by row.
        share: of the noiseless VAF [-], drawn dashed.
    """
    names = list(dict.fromkeys(curves["row"]))
    figure, axes = new_figure(4, 3, (11.0, 11.0))
    for axis, name in zip(axes.flat, names, strict=True):
        own = curves[curves["row"] == name]
        axis.fill_between(own["snr_dB"], own["least"], own["most"], color=PALETTE[1], alpha=0.25,
                          linewidth=0)  # fmt: skip
        axis.plot(own["snr_dB"], own["mean"], color=PALETTE[1], linewidth=1.3)
        axis.axhline(share * own["mean"].iloc[-1], color=THESIS, linewidth=0.9, linestyle="--")
        if name in printed.index and np.isfinite(printed[name]):
            axis.axvline(printed[name], color=ESTIMATE, linewidth=0.9, linestyle=":")
        axis.set_ylim(-3.0, 103.0)
        axis.set_title(name, fontsize=9)
        axis.tick_params(labelsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("SNR [dB]", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("VAF [%]", fontsize=8)
    figure.suptitle(
        "VAF over the noise: mean and range of 20 seeds; dashed 95 % of the noiseless, dotted the "
        "thesis's SNR",
        fontsize=11,
    )
    return figure


def belief_figure(
    samples: NDArray[Any], estimates: dict[tuple[str, str], NDArray[np.float64]], rows: list[str]
) -> Figure:
    """Return the estimates with six wrong models, first 10 s at 4 rad/s (Figures A-23 to A-33).

    Args:
        samples: of the load case, with time [s] and advance velocity [m/s], shape (n,).
        estimates: advance velocity [m/s] by observer and model, shape (n,) each.
        rows: observers, one panel each.
    """
    figure, axes = new_figure(4, 3, (12.0, 11.5))
    shown = samples["time"] <= 10.0
    time, truth = samples["time"][shown], samples["advance_velocity"][shown]
    spread = float(np.ptp(truth))
    for axis, name in zip(axes.flat, rows, strict=True):
        axis.plot(time, truth, color=TRUTH, linewidth=1.4, label="true")
        for k, (belief, label) in enumerate(_BELIEFS.items()):
            axis.plot(
                time, estimates[name, belief][shown], color=PALETTE[k], linewidth=0.8, label=label
            )
        axis.set_ylim(truth.min() - spread, truth.max() + spread)
        axis.set_title(name, fontsize=9)
        axis.tick_params(labelsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("v_a [m/s]", fontsize=8)
    axes[0, 0].legend(fontsize=6, frameon=False, ncols=2, loc="upper right")
    figure.suptitle("Advance velocity estimated with wrong knowledge of the ship", fontsize=11)
    return figure
