"""The figures of the rig's tests, as Figures 3 to 6 of the paper."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shaftline.baselines.thrust_control import ThrustControlTuning
from shaftline.display.figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure

from .experiment import Programme, TankRun
from .results import Results


def _line(
    axis: Axes, test: TankRun, values: Any, label: str, colour: str, style: str = "-"
) -> None:
    axis.plot(test.times, values, color=colour, linewidth=0.9, linestyle=style, label=label)


def _named(axis: Axes, words: str) -> None:
    axis.set_ylabel(words, fontsize=8)
    axis.tick_params(labelsize=8)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize=7, loc="upper right", ncols=2)


def _thrust(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["thrust"], "T_p", TRUTH)
    _line(axis, test, test.thrust_order, "T_pd", ESTIMATE, "--")
    speed = axis.twinx()
    speed.plot(test.times, test.samples["advance_velocity"], color=THESIS, linewidth=0.9)
    speed.set_ylabel("u_a [m/s] (grey)", fontsize=8)
    speed.tick_params(labelsize=8)
    _named(axis, "thrust [N]")


def _speed(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["shaft_speed"], "omega", TRUTH)
    _line(axis, test, test.reference, "omega_d", ESTIMATE, "--")
    _named(axis, "shaft speed [rad/s]")


def _errors(thrust: Axes, speed: Axes, test: TankRun) -> None:
    _line(thrust, test, test.samples["thrust"] - test.thrust_order, "", TRUTH)
    _named(thrust, "T_p - T_pd [N]")
    _line(speed, test, test.samples["shaft_speed"] - test.reference, "", TRUTH)
    _named(speed, "omega - omega_d [rad/s]")


def _torque(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["brake_torque"], "", TRUTH)
    _named(axis, "motor torque Q_md [N m]")


def without_panels(test: TankRun) -> Figure:
    """Five panels, as Figures 3 and 5."""
    figure, axes = new_figure(5, 1, (8.0, 9.5))
    a, b, c, d, e = axes.flat
    _thrust(a, test)
    _errors(b, d, test)
    _speed(c, test)
    _torque(e, test)
    e.set_xlabel("time [s]", fontsize=8)
    return figure


def with_panels(test: TankRun, programme: Programme) -> Figure:
    """Eight panels, as Figure 4."""
    figure, axes = new_figure(4, 2, (11.0, 9.5))
    a, e, b, f, c, g, d, h = axes.flat
    _line(a, test, test.samples["propeller_torque"], "Q_p", TRUTH)
    _line(a, test, test.torque_estimate, "estimated", ESTIMATE, "--")
    _named(a, "propeller torque [N m]")
    _line(b, test, np.clip(test.torque_ratio, -0.5, 2.0), "", TRUTH)
    for level in (
        ThrustControlTuning().detector.on_below,
        ThrustControlTuning().detector.off_above,
    ):
        b.axhline(level, color=ESTIMATE, linewidth=0.7, linestyle=":")
    _named(b, "beta_Q (cut at -0.5 and 2)")
    _line(c, test, programme.submergence(test.times), "h/R", TRUTH)
    _line(c, test, test.detected, "nu", ESTIMATE)
    _line(c, test, test.samples["ventilation"], "air", PALETTE[1], ":")
    _named(c, "submergence, ventilation [-]")
    _torque(d, test)
    _thrust(e, test)
    _errors(f, h, test)
    _speed(g, test)
    for axis in (d, h):
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def power_panels(found: Results) -> Figure:
    """As Figure 6."""
    figure, axes = new_figure(3, 1, (8.0, 6.5))
    tests = {"calm water": found.calm, "with anti-spin": found.on, "without": found.off}
    for axis, (name, test) in zip(axes.flat, tests.items(), strict=True):
        _line(axis, test, test.motor_power, name, TRUTH)
        axis.set_ylim(-100.0, 1.05 * max(t.motor_power.max() for t in tests.values()))
        _named(axis, "P_m [W]")
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
