"""Pictures of :mod:`.comparison`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...agents.evaluation.statistics import with_interval
from ...display.figures import PALETTE, THESIS, TRUTH, new_figure
from ...plant.drives.diesel import torque_limit
from .comparison import POLICY, Comparison

COLOURS = dict(
    zip(
        (POLICY, "combinator", "cpp-optimiser", "anti-spin", "no-anti-spin", "speed-pilot"),
        PALETTE,
        strict=False,
    )
)
_MARKERS = "osD^v<>P"
_RESAMPLES = 1000
_STORM_S = 60.0


def _per_task(count: int, height: float = 4.0) -> tuple[Figure, list[Axes]]:
    drawn, axes = new_figure(1, count, (4.8 * count + 0.6, height))
    return drawn, list(axes[0])


def _bars(values: pd.Series) -> tuple[float, list[list[float]]]:  # type: ignore[type-arg]
    middle, low, high = with_interval(values)
    return middle, [[max(middle - low, 0.0)], [max(high - middle, 0.0)]]


def pareto(comparisons: Sequence[Comparison]) -> Figure:
    """Fuel against speed error, a point a controller and sea."""
    drawn, axes = _per_task(len(comparisons))
    for axis, one in zip(axes, comparisons, strict=True):
        for controller in one.controllers:
            for marker, sea in zip(_MARKERS, one.seas, strict=False):
                kpis = one.of(controller, sea)
                x, across = _bars(kpis["speed_error_rms_m_s"])
                y, along = _bars(kpis["fuel_kg_nmi"])
                axis.errorbar(x, y, yerr=along, xerr=across, fmt=marker, capsize=2, linewidth=1,
                              markersize=5, color=COLOURS[controller])  # fmt: skip
        for controller in one.controllers:
            axis.plot([], [], color=COLOURS[controller], linewidth=4, label=controller)
        for marker, sea in zip(_MARKERS, one.seas, strict=False):
            axis.plot([], [], marker, color=THESIS, label=sea)
        axis.set_title(one.task, fontsize=10)
        axis.set_xlabel("rms of speed minus order [m/s]", fontsize=9)
        axis.legend(fontsize=7.5, frameon=False)
    axes[0].set_ylabel("fuel per nautical mile [kg]", fontsize=9)
    return drawn


def scores(one: Comparison) -> dict[str, NDArray[np.float64]]:
    """Normalised scores by controller, shape (seas, seeds).

    The combinator's cost in the same episode (minus its reward) over the controller's own: above 1 is
    better than the combinator.
    """

    def cost(controller: str) -> NDArray[np.float64]:
        rewards = [one.of(controller, sea)["reward"].to_numpy(np.float64) for sea in one.seas]
        return np.asarray(np.maximum(-np.array(rewards), 1e-9))

    usual = cost("combinator")
    return {controller: usual / cost(controller) for controller in one.controllers}


def profiles(comparisons: Sequence[Comparison]) -> Figure:
    """Performance profiles (Agarwal et al. 2021): share of episodes that score at least tau."""
    drawn, axes = _per_task(len(comparisons))
    for axis, one in zip(axes, comparisons, strict=True):
        found = scores(one)
        ends = np.quantile(np.concatenate([s.ravel() for s in found.values()]), [0.005, 0.995])
        tau = np.linspace(ends[0] - 0.02, ends[1] + 0.02, 200)
        rng = np.random.default_rng(0)
        picks = rng.integers(one.seeds, size=(_RESAMPLES, one.seeds))
        for controller, score in found.items():
            reached = (score[..., None] >= tau).mean(axis=0)  # of each seed: (seeds, tau)
            # one resample at a time: all at once would hold every pick of every tau
            means = np.array([reached[pick].mean(axis=0) for pick in picks])
            low, high = np.quantile(means, [0.025, 0.975], axis=0)
            axis.plot(tau, reached.mean(axis=0), color=COLOURS[controller], label=controller)
            axis.fill_between(tau, low, high, color=COLOURS[controller], alpha=0.2, linewidth=0)
        axis.set_title(one.task, fontsize=10)
        axis.set_xlabel("score τ: the combinator's cost over one's own", fontsize=9)
        axis.legend(fontsize=7.5, frameon=False)
    axes[0].set_ylabel("share of episodes with score ≥ τ", fontsize=9)
    return drawn


def torque(comparisons: Sequence[Comparison]) -> Figure:
    """Fluctuation of the shaft torque in each sea."""
    drawn, axes = _per_task(len(comparisons), 3.6)
    for axis, one in zip(axes, comparisons, strict=True):
        for i, controller in enumerate(one.controllers):
            shift = 0.12 * (i - 0.5 * (len(one.controllers) - 1))
            for j, sea in enumerate(one.seas):
                middle, along = _bars(one.of(controller, sea)["torque_sd_kN_m"])
                axis.errorbar(j + shift, middle, yerr=along, fmt="o", capsize=3, markersize=5,
                              color=COLOURS[controller], label="" if j else controller)  # fmt: skip
        axis.set_xticks(range(len(one.seas)), one.seas, fontsize=8)
        axis.set_xlim(-0.5, len(one.seas) - 0.5)
        axis.set_ylim(bottom=0.0)
        axis.set_title(one.task, fontsize=10)
        axis.legend(fontsize=7.5, frameon=False)
    axes[0].set_ylabel("standard deviation of shaft torque [kN m]", fontsize=9)
    return drawn


def envelope(comparisons: Sequence[Comparison]) -> Figure:
    """Engine speed and brake torque of one episode in the roughest sea, with the torque limit."""
    widest = max(len(one.controllers) for one in comparisons)
    drawn, axes = new_figure(len(comparisons), widest, (2.7 * widest, 2.6 * len(comparisons) + 0.4))
    for row, one in zip(axes, comparisons, strict=True):
        plant = one.ship.record()
        ends = float(plant["engine_speed_min"]), float(plant["engine_speed_max"])
        speeds = np.linspace(*ends, 50)
        limit = [torque_limit(plant, float(w)) * 1e-3 for w in speeds]
        for axis, controller in zip(row, one.controllers, strict=False):
            trace = one.traces[controller, one.seas[-1]]
            engine = trace["shaft_speed"] * one.ship.transmission.gear_ratio
            axis.plot(engine * 30.0 / np.pi, trace["brake_torque"] * 1e-3, ".", ms=2,
                      color=COLOURS[controller])  # fmt: skip
            axis.plot(speeds * 30.0 / np.pi, limit, color=TRUTH, linewidth=1)
            axis.axvline(ends[1] * 30.0 / np.pi, color=TRUTH, linewidth=1, linestyle=":")
            axis.set_title(f"{one.task}, {one.seas[-1]}: {controller}", fontsize=8)
            axis.set_xlabel("engine speed [rpm]", fontsize=8)
            axis.tick_params(labelsize=7)
            axis.set_xlim(0.8 * ends[0] * 30.0 / np.pi, 1.16 * ends[1] * 30.0 / np.pi)
            axis.set_ylim(0.0, 1.08 * max(limit))
        row[0].set_ylabel("brake torque [kN m]", fontsize=8)
        for axis in row[len(one.controllers) :]:
            axis.set_visible(False)
    return drawn


def storm(one: Comparison) -> Figure:
    """One storm in time, about the time when the controller without anti-spin turns fastest."""
    sea = one.seas[-1]
    shown = [name for name in (POLICY, "anti-spin", "no-anti-spin") if name in one.controllers]
    wildest = one.traces[shown[-1], sea]
    middle = float(wildest["time"].iloc[int(wildest["shaft_speed"].to_numpy().argmax())])
    length = min(_STORM_S, one.episode_s)
    begin = float(np.clip(middle - 0.5 * length, 0.0, one.episode_s - length))
    drawn, axes = new_figure(4, 1, (9.5, 8.5))
    for controller in shown:
        trace = one.traces[controller, sea]
        part = trace[(trace["time"] >= begin) & (trace["time"] <= begin + length)]
        for axis, column, label, scale in zip(
            axes[:, 0],
            ("shaft_speed", "shaft_torque", "pitch_ratio", "fuel_rack"),
            ("shaft speed [rad/s]", "shaft torque [kN m]", "pitch ratio, read [-]", "rack [mm]"),
            (1.0, 1e-3, 1.0, 1.0),
            strict=True,
        ):
            axis.plot(part["time"], part[column] * scale, color=COLOURS[controller],
                      linewidth=1.1, label=controller)  # fmt: skip
            axis.set_ylabel(label, fontsize=9)
    plant = one.ship.record()
    highest = float(plant["engine_speed_max"]) / one.ship.transmission.gear_ratio
    axes[0, 0].axhline(highest, color=TRUTH, linewidth=0.8, linestyle=":", label="highest speed")
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=4)
    axes[0, 0].set_title(f"{one.task}, {sea}, the first seed", fontsize=10)
    axes[-1, 0].set_xlabel("time [s]", fontsize=9)
    return drawn


def training(comparisons: Sequence[Comparison]) -> Figure | None:
    """What each leg of the trainings was judged by; none where no policy holds its curve."""
    taught = [one for one in comparisons if one.policy.curve]
    if not taught:
        return None
    rows = {
        "reward": "reward", "fuel_kg_nmi": "fuel [kg/nmi]",
        "speed_error_rms_m_s": "speed error [m/s]", "torque_sd_kN_m": "torque s.d. [kN m]",
    }  # fmt: skip
    drawn, axes = new_figure(len(rows), len(taught), (4.2 * len(taught) + 0.6, 7.0))
    for column, one in zip(axes.T, taught, strict=True):
        curve, leg = one.policy.curve, one.policy.about.get("leg")
        steps = np.array(curve["steps"]) * 1e-6
        for axis, (name, label) in zip(column, rows.items(), strict=True):
            axis.plot(steps, curve[name], color=COLOURS[POLICY], marker="o", markersize=3)
            if leg is not None:
                axis.plot(steps[leg - 1], curve[name][leg - 1], "o", color=TRUTH, markersize=6)
            axis.set_ylabel(label, fontsize=8)
            axis.tick_params(labelsize=8)
        column[0].set_title(f"{one.task} (dark: the leg that is kept)", fontsize=9)
        column[-1].set_xlabel("control intervals [million]", fontsize=9)
    return drawn
