"""Environments sailed step by step with the plant's kernels, to hold the interval against."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from shaftline.baselines.governor import govern
from shaftline.envs import FrigateEnv, get_task
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.stepping import Disturbance, step

STILL: dict[str, Any] = get_task("transit").model_dump() | {
    "seas": ("calm",), "resistance_rise": (0.0, 0.0), "resistance_swing": 0.0,
}  # fmt: skip
"""A task in which nothing disturbs the ship."""


class Moment(NamedTuple):
    """One plant step: what was so at its beginning, and the few things that are told of its end."""

    order: float
    shaft_speed: float
    ship_speed: float
    log: float
    rack: float
    drive: float
    torque_read: float
    pitch_read: float
    outputs: Any
    fuel: float
    position_after: float
    ventilation_after: float
    shaft_speed_after: float


class ByHand:
    """The ship of an environment that was just reset, without noise."""

    def __init__(self, env: FrigateEnv) -> None:
        batch = env.batch
        self.plant, self.state, self.memory, self.sea, self.episode = (
            rows[0].copy() for rows in (
                batch.arrays.plants, batch.arrays.states, batch.arrays.memories,
                batch.arrays.seas, batch.arrays.episodes,
            )
        )  # fmt: skip
        self.dt, self.steps, self.gains = batch.dt, batch.steps, batch.gains
        self.elapsed = 0
        self.integral = float(self.episode["integral"])
        self.measured = float(self.state["shaft_speed"])

    def disturbance(self, time: float) -> Disturbance:
        e = self.episode
        angle = e["resistance_frequency"] * time + e["resistance_phase"]
        return Disturbance(
            0.0, 0.0, float(e["resistance_mean"] + e["resistance_swing"] * math.sin(angle))
        )

    def order(self, time: float) -> float:
        return float(self.episode["orders"][min(int(time / self.episode["order_interval"]), 63)])

    def interval(self, action: Any) -> list[Moment]:
        """Hold an action over an interval."""
        p = self.plant
        share = 0.5 * (np.asarray(action, np.float32).astype(np.float64) + 1.0)
        pitch = p["pitch_ratio_min"] + share[0] * (p["pitch_ratio_max"] - p["pitch_ratio_min"])
        drive = p["drive_min"] + share[1] * (p["drive_max"] - p["drive_min"])
        low, high = (p[name] / p["gear_ratio"] for name in ("engine_speed_min", "engine_speed_max"))
        found = []
        for k in range(self.steps):
            time = (self.elapsed * self.steps + k) * self.dt
            if self.gains.shape[1]:
                gains = (np.interp(self.measured, self.gains[0], self.gains[i]) for i in (1, 2))
                drive, self.integral = govern(
                    p, low + share[1] * (high - low), self.measured, self.integral, *gains
                )
            omega, speed = float(self.state["shaft_speed"]), float(self.state["ship_speed"])
            log = float(self.memory["speed_log"])
            outputs = step(
                p, self.state, self.memory, self.sea, float(drive), float(pitch), 0.0,
                self.disturbance(time), self.disturbance(time + 0.5 * self.dt),
                self.disturbance(time + self.dt), self.dt,
            )  # fmt: skip
            self.measured = omega
            fuel = 2.0 * fuel_rate(p, p["gear_ratio"] * omega, outputs.brake_torque)
            found.append(
                Moment(
                    self.order(time), omega, speed, log, float(self.memory["rack"]), float(drive),
                    float(self.memory["shaft_torque"]), float(self.memory["pitch_ratio"]), outputs,
                    fuel, float(self.state["position"]), float(self.state["ventilation"]),
                    float(self.state["shaft_speed"]),
                )
            )  # fmt: skip
        self.elapsed += 1
        return found
