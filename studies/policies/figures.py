"""Pictures of :mod:`.comparison`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...agents.evaluation.statistics import relative_to
from ...display.figures import PALETTE, new_figure
from .comparison import HELD, POLICY, TUNED, Comparison

COLOURS = {POLICY: PALETTE[0], HELD: PALETTE[1], TUNED: PALETTE[2]}
_BARS = ("wave_torque_kN_m", "wave_engine_torque_kN_m", "power_peak_kW", "wave_attack_deg",
         "fuel_kg_nmi")  # fmt: skip
_ACROSS = 3  # panels
_FROM_S, _TO_S = 100.0, 160.0
_TRACES = {
    "shaft_torque": ("torque at the gauge [kN m]", 1e-3),
    "brake_torque": ("torque of one engine [kN m]", 1e-3),
    "blade_pitch": ("P/D [-]", 1.0),
    "angle_of_attack": ("angle of attack [deg]", 1.0),
    "ship_speed": ("ship speed [m/s]", 1.0),
}


def changes(comparisons: Sequence[Comparison]) -> Figure:
    """Each controller against the combinator with a trimmed lever, in percent."""
    drawn, panels = _panels(len(comparisons), (4.2, 3.4))
    for axis, one in zip(panels, comparisons, strict=True):
        base = one.kpis[HELD]
        for offset, name in ((-0.18, POLICY), (0.18, TUNED)):
            found = [relative_to(one.kpis[name][kpi], base[kpi][0]) for kpi in _BARS]
            middles = np.array([f[0] for f in found])
            ends = np.abs(np.array([f[1:] for f in found]).T - middles)
            places = np.arange(len(_BARS)) + offset
            axis.barh(places, middles, 0.34, xerr=ends, color=COLOURS[name], label=name,
                      error_kw={"linewidth": 1.0})  # fmt: skip
        axis.axvline(0.0, color="0.3", linewidth=0.8)
        axis.set_yticks(np.arange(len(_BARS)), [name.replace("_", " ") for name in _BARS])
        axis.tick_params(labelsize=8)
        axis.invert_yaxis()
        axis.set_xlabel(f"change against {HELD} [%]", fontsize=8)
        axis.set_title(one.task, fontsize=10)
    panels[0].legend(fontsize=8, frameon=False)
    return drawn


def _panels(count: int, size: tuple[float, float]) -> tuple[Figure, list[Any]]:
    """A figure with so many panels of a size [inch], a few in a row."""
    across = min(count, _ACROSS)
    rows = -(-count // across)
    drawn, axes = new_figure(rows, across, (size[0] * across, size[1] * rows))
    for spare in axes.flat[count:]:
        spare.set_visible(False)
    return drawn, list(axes.flat[:count])


def traces(one: Comparison) -> Figure:
    """A minute of the first held-out episode."""
    drawn, axes = new_figure(len(_TRACES), 1, (9.0, 1.7 * len(_TRACES)))
    for axis, (name, (words, factor)) in zip(axes[:, 0], _TRACES.items(), strict=True):
        for controller in (HELD, TUNED, POLICY):
            trace = one.traces[controller]
            shown = trace[(trace["time"] >= _FROM_S) & (trace["time"] <= _TO_S)]
            axis.plot(
                shown["time"], factor * shown[name], color=COLOURS[controller], label=controller
            )
        axis.set_ylabel(words, fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=9)
    axes[0, 0].set_title(one.task, fontsize=10)
    return drawn


def curves(comparisons: Sequence[Comparison]) -> Figure:
    """Rewards while they were trained, a line a training."""
    drawn, panels = _panels(len(comparisons), (3.6, 3.0))
    for axis, one in zip(panels, comparisons, strict=True):
        for policy in one.policies:
            steps = np.array(policy.curve["steps"]) * 1e-3
            axis.plot(steps, policy.curve["reward"], color=PALETTE[0], alpha=0.6, marker=".")
        axis.set_title(f"{one.task}, {len(one.policies)} trainings", fontsize=10)
        axis.set_xlabel("control intervals [thousand]", fontsize=8)
        axis.tick_params(labelsize=8)
    panels[0].set_ylabel("reward of an episode", fontsize=9)
    return drawn
