"""The thesis's figures that have no numbers: Figures 2-4, 3-2, 3-4, 3-8, 3-10, 4-1, A-12 to A-33."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.core.lazy import control
from shaftline.display.figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure
from shaftline.observers import follow, get_observer, readings_of
from shaftline.observers.following import variance_accounted_for, with_noise
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.plant import Ship
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.load_cases import CASES

from . import dead_beat, observer_transfers
from .observer_transfers import INPUTS, KALMAN, LUENBERGER, OUTPUTS
from .sensitivity import wrong_estimates
from .snr import SAMPLE_TIME_S, SEEDS, SHARE
from .vaf import ROWS

Tick = Callable[[], None]

RACKS_MM = (10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
SNRS_DB = np.arange(0.0, 101.0, 2.0)
FREQUENCIES = np.geomspace(1e-2, 1e2, 300)  # rad/s, the thesis's range

_BELIEFS = {
    "inertia_minus_10pct": "inertia -10 %", "inertia_plus_10pct": "inertia +10 %",
    "open_water_minus_10pct": "KT, KQ -10 %", "open_water_plus_10pct": "KT, KQ +10 %",
    "ear_0.6": "EAR 0.6", "ear_1.0": "EAR 1.0",
}  # fmt: skip


def fuel_rack_map(ship: Ship) -> Figure:
    """Engine torque over its speed, a line a rack, with the operating limits (Figure 2-4).

    Args:
        ship: with a diesel.
    """
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
    """What changes in each load case, over time (Figure 4-1).

    Args:
        ship: the thesis's frigate.
    """
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
    """Bode magnitude of several systems, an output a row, an input a column; s or z at FREQUENCIES."""
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


def shaft_observers(ship: Ship) -> Figure:
    """Luenberger's three tunings and the shaft Kalman filter (Figures 3-2 and 3-4).

    Args:
        ship: the thesis's frigate.
    """
    systems = {
        name: observer_transfers.linear_observer(name, ship) for name in (*LUENBERGER, KALMAN)
    }
    outputs = tuple(f"{name} estimated" for name in OUTPUTS)
    title = "Luenberger and shaft Kalman (Figures 3-2 and 3-4)"
    return _gains(systems, 1j * FREQUENCIES, outputs, INPUTS, title)


def invariance(ship: Ship) -> Figure:
    """I&I at A and D, gamma 1 and 20, as eq. 3-13 is printed and as the observer is (Figure 3-8).

    Args:
        ship: the thesis's frigate.
    """
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


def random_walk(ship: Ship) -> Figure:
    """The printed random-walk Kalman filter at A to D, as the discrete filter it is (Figure 3-10).

    The thesis draws it with s in the place of z, which means nothing; here z = exp(j omega T).

    Args:
        ship: the thesis's frigate.
    """
    systems = {
        point: dead_beat.response(*dead_beat.slopes(ship, point), dead_beat.behind(ship))
        for point in "ABCD"
    }
    points = np.exp(1j * FREQUENCIES * SAMPLE_TIME_S)
    outputs = ("omega estimated", "v_a estimated")
    title = f"Random-walk Kalman filter, a sample each {SAMPLE_TIME_S:g} s (Figure 3-10)"
    return _gains(systems, points, outputs, INPUTS, title)


def snr_curves(ship: Ship, tick: Tick) -> pd.DataFrame:
    """Mean, lowest and highest VAF [%] over the seeds, by observer and SNR (Figures A-12 to A-22).

    Args:
        ship: the thesis's frigate.
        tick: called once for each observer.
    """
    samples = CASES["measurement_noise"].run(ship, dt=SAMPLE_TIME_S)
    readings, truth = readings_of(samples), samples["advance_velocity"]
    noises = [np.random.default_rng(seed).standard_normal(readings.shape) for seed in range(SEEDS)]

    def scored(observer: str, snr: float, noise: NDArray[np.float64]) -> float:
        noisy = with_noise(readings, snr, noise)
        estimate, _ = follow(get_observer(observer), ship, noisy, SAMPLE_TIME_S)
        return variance_accounted_for(truth, estimate)

    def one(name: str) -> list[dict[str, float | str]]:
        rows: list[dict[str, float | str]] = []
        for snr in SNRS_DB:
            found = [scored(ROWS[name], float(snr), noise) for noise in noises]
            rows.append({"row": name, "snr_dB": float(snr), "mean": float(np.mean(found)),
                         "least": min(found), "most": max(found)})  # fmt: skip
        tick()
        return rows

    # threads: the kernels release the interpreter lock
    found = Parallel(n_jobs=-1, prefer="threads")(delayed(one)(name) for name in ROWS)
    return pd.DataFrame([row for rows in found for row in rows])


def noise_figure(curves: pd.DataFrame, printed: pd.Series) -> Figure:
    """VAF over the SNR, a panel an observer (Figures A-12 to A-22).

    Args:
        curves: from :func:`snr_curves`.
        printed: SNR [dB] of Table 4-2 by row.
    """
    names = list(dict.fromkeys(curves["row"]))
    figure, axes = new_figure(4, 3, (11.0, 11.0))
    for axis, name in zip(axes.flat, names, strict=True):
        own = curves[curves["row"] == name]
        axis.fill_between(own["snr_dB"], own["least"], own["most"], color=PALETTE[1], alpha=0.25,
                          linewidth=0)  # fmt: skip
        axis.plot(own["snr_dB"], own["mean"], color=PALETTE[1], linewidth=1.3)
        axis.axhline(SHARE * own["mean"].iloc[-1], color=THESIS, linewidth=0.9, linestyle="--")
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


def belief_figure(ship: Ship) -> Figure:
    """Estimates with six wrong beliefs, first 10 s at 4 rad/s, a panel an observer (A-23 to A-33).

    Args:
        ship: the thesis's frigate.
    """
    figure, axes = new_figure(4, 3, (12.0, 11.5))
    samples, found = wrong_estimates(ship)
    shown = samples["time"] <= 10.0
    time, truth = samples["time"][shown], samples["advance_velocity"][shown]
    spread = float(np.ptp(truth))
    for axis, name in zip(axes.flat, ROWS, strict=True):
        axis.plot(time, truth, color=TRUTH, linewidth=1.4, label="true")
        for k, (belief, label) in enumerate(_BELIEFS.items()):
            axis.plot(
                time, found[name, belief][shown], color=PALETTE[k], linewidth=0.8, label=label
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
