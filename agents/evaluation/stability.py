"""Instability of a controller: oscillation of its commands in calm water, and its stability margins.

In waves every controller moves its commands. The controller is therefore simulated in calm water with
perfect instruments, constant orders and a constant resistance. A stable loop comes to rest there. The
loop is unstable where a command still oscillates in the last third of the run, by at least 1 % of its
range, and the oscillation has not decayed since the third before: it grows, or it is a limit cycle
between limits.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...baselines.controller import Controller, Predictor
from ...baselines.loops import controller_loop, helmsman_loop
from ...baselines.steering import SteeringController
from ...core.sweep import sweep
from ...envs.steering import environment_classes
from ...observers.records import Floats
from .episodes import Setting
from .sweeps import version_of_cells

RUNS, DURATION_S = 4, 900.0  # number of runs, each with its own order, and their length
LEAST_SWING = 0.01  # least peak-to-peak amplitude over the range of the command [-]
LASTING = 0.9  # least amplitude over that of the third before [-]
CYCLES = 3  # least number of cycles in a third of the run
COMMANDS = {"pitch_command": "pitch", "drive": "fuel rack", "rudder_command": "rudder"}
"""Commands of an environment, each with its name in a message."""

_DEAD_BAND = 0.1  # share of the amplitude within which crossings of the mean do not count
_FOREVER_S = 1e9
_LEAST = 1e-9  # amplitude that counts as none [-]


class Oscillation(NamedTuple):
    """Oscillation of a command that does not decay in calm water."""

    command: str  # of COMMANDS
    speed_order_m_s: float
    swing: float  # peak-to-peak amplitude over the range of the command [-]
    period_s: float
    growth: float  # amplitude over that of the third before [-]

    @property
    def sentence(self) -> str:
        """Description of the oscillation."""
        kind = "and grows" if self.growth > 1.0 / LASTING else "and does not decay"
        return (
            f"at an order of {self.speed_order_m_s:.2f} m/s in calm water the {COMMANDS[self.command]} "
            f"command oscillates by {self.swing:.0%} of its range with a period of {self.period_s:.3g} "
            f"s {kind}"
        )


def calm_setting(setting: Setting) -> Setting:
    """Return a setting in calm water: perfect instruments, constant orders, constant resistance."""
    task = setting.model
    orders, vessel = task.speed_order_m_s, task.vessel
    if setting.order_profile is not None:
        speeds = [speed for _, speed in setting.order_profile]
        orders, vessel = (min(speeds), max(speeds)), setting.vessel  # These orders are not scaled.
    calm = task.model_copy(
        update={
            "seas": ("calm",),
            "vessel": vessel,
            "speed_order_m_s": orders,
            "order_interval_s": _FOREVER_S,
            "resistance_swing": 0.0,
            "drift_force_kN": (0.0, 0.0),
            "randomise": {},
        }
    )
    return replace(
        setting,
        sea="task",
        task_model=calm,
        seeds=RUNS,
        first_seed=0,
        sensor_noise=0.0,
        episode_s=DURATION_S,
        randomise=None,
        order_profile=None,
    )


def find_oscillation(setting: Setting, controller: Predictor) -> Oscillation | None:
    """Simulate a controller in calm water and return its largest lasting oscillation, if any.

    Args:
        setting: cell of an evaluation; its task, ship, observer and interval apply, and the range of its
            orders.
        controller: controller of the cell.

    Examples:
        >>> from shaftline.baselines import make_controller
        >>> from shaftline.plant import load_ship
        >>> cell = Setting("combinator", "transit", "task", "none", seeds=1)
        >>> find_oscillation(cell, make_controller("combinator", load_ship("frigate"), 0.5)) is None
        True
    """
    calm = calm_setting(setting)
    env = environment_classes(calm.model.steered).vector(
        RUNS, threads=1, **calm.environment(controller), autoreset_mode="NextStep"
    )
    observation, _ = env.reset(seed=0)
    episodes, plant = env.batch.arrays.episodes, env.batch.ship.record()
    orders = episodes["orders"][:, 0].copy()
    ranges = {
        "pitch_command": float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"]),
        "drive": float(plant["drive_max"] - plant["drive_min"]),
        "rudder_command": 2.0 * float(plant["rudder_max"]),
    }
    state: Any = None
    alive = np.ones(RUNS, dtype=bool)
    starting, ends = alive.copy(), np.zeros(RUNS, dtype=int)
    commands = []
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        commands.append([episodes[name] / (ranges[name] or 1.0) for name in COMMANDS])
        ends += alive
        starting = terminated | truncated
        alive &= ~starting
    env.close()
    table = np.array(commands)  # (intervals, commands, runs)
    found = [
        Oscillation(name, float(orders[run]), *lasting)
        for run in range(RUNS)
        for column, name in enumerate(COMMANDS)
        if (lasting := _lasting(table[: ends[run], column, run], calm.interval_s)) is not None
    ]
    return max(found, key=lambda one: one.swing, default=None)


def _lasting(values: Floats, interval_s: float) -> tuple[float, float, float] | None:
    """Return amplitude [-], period [s] and growth [-] of an oscillation that lasts; None without one."""
    third = len(values) // 3
    if third < 2 * CYCLES:
        return None
    time = np.arange(third) - 0.5 * (third - 1)
    parts = np.array([values[-2 * third : -third], values[-third:]])
    slopes = parts @ time / (time @ time)
    parts = parts - parts.mean(axis=1, keepdims=True) - slopes[:, None] * time
    before, swing = np.ptp(parts, axis=1)
    if swing < LEAST_SWING or swing < LASTING * before:
        return None
    beyond = parts[1][np.abs(parts[1]) > _DEAD_BAND * swing]
    cycles = 0.5 * np.count_nonzero(np.diff(np.sign(beyond)))
    if cycles < CYCLES:
        return None
    return float(swing), float(third * interval_s / cycles), float(swing / max(before, _LEAST))


def margins(controller: Predictor, found: Oscillation) -> tuple[dict[str, float | None], str]:
    """Return the stability margins of the loop of the oscillating command, and a sentence about them.

    Gain margin [dB], phase margin [deg] and delay margin [s] come from the linearised loop, as from
    ``shaftline loop``. Those of an unstable loop are negative or None.

    Args:
        controller: controller that oscillates.
        found: its oscillation.
    """
    none: dict[str, float | None] = dict.fromkeys(
        ("gain_margin_dB", "phase_margin_deg", "delay_margin_s")
    )
    try:
        if isinstance(controller, SteeringController) and found.command == "rudder_command":
            loop = helmsman_loop(controller.helmsman)
        else:
            drive = getattr(controller, "propulsion", controller)
            if not isinstance(drive, Controller):
                return (
                    none,
                    "margins: not known, because only a classic controller can be linearised",
                )
            loop = controller_loop(drive, found.speed_order_m_s, found.command)
        if loop.stable:
            known = loop.margins()
            values = (known.gain_margin_dB, known.phase_margin_deg, known.delay_margin)
            about = "the linear loop is stable: limits, rates or dead times cause the oscillation"
        else:
            lacking = loop.lacking_margins()
            values = (lacking.gain_margin_dB, lacking.phase_margin_deg, math.nan)
            about = "the linear loop is unstable"
    except ValueError as error:
        return none, f"margins: not known: {error}"
    finite = {
        name: value if math.isfinite(value) else None
        for name, value in zip(none, values, strict=True)
    }
    texts = [
        f"{words} {'none' if value is None else f'{value:.1f} {unit}'}"
        for (words, unit), value in zip(
            (("gain margin", "dB"), ("phase margin", "deg"), ("delay margin", "s")),
            finite.values(),
            strict=True,
        )
    ]
    return finite, f"{', '.join(texts)} ({about})"


class Verdict(NamedTuple):
    """Stability of a controller in calm water."""

    sentence: str  # description of the oscillation and the margins; empty for a stable controller
    numbers: dict[str, Any]  # JSON values: fields of Oscillation and margins; empty as well

    @property
    def stable(self) -> bool:
        """Whether all commands come to rest."""
        return not self.sentence


def check_stability(
    settings: Sequence[Setting], make: Callable[[Setting], Predictor], folder: Path, **spread: Any
) -> list[Verdict]:
    """Return the verdict of every setting; verdicts that the folder already contains are kept.

    Args:
        settings: cells, all different; their seas have no effect.
        make: function that returns the controller of a cell; other processes call it too.
        folder: verdicts are kept in ``folder/cells/stability`` as JSON.
        spread: options of :func:`shaftline.core.sweep.sweep`.
    """
    cells = {
        f"{(own := replace(one, sea='calm')).name}_{version_of_cells(one.vessel, one.observer)}": own
        for one in settings
    }
    found = sweep(
        functools.partial(_verdict, make), cells, folder / "cells" / "stability", **spread
    )
    return [Verdict(**kept) for kept in found.values()]


def _verdict(make: Callable[[Setting], Predictor], setting: Setting) -> dict[str, Any]:
    """Return the stored form of a verdict."""
    controller = make(setting)
    found = find_oscillation(setting, controller)
    if found is None:
        return Verdict("", {})._asdict()
    numbers, sentence = margins(controller, found)
    return Verdict(f"{found.sentence}; {sentence}", found._asdict() | numbers)._asdict()
