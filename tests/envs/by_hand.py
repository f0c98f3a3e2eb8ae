"""Environments simulated step by step with the plant's kernels, as reference of the interval."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from shaftline.baselines.governor import govern, limit_rack
from shaftline.envs import FrigateEnv, get_task
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.stepping import Disturbance, StepInputs, step

STILL: dict[str, Any] = get_task("transit").model_dump() | {
    "seas": ("calm",),
    "resistance_rise": (0.0, 0.0),
    "resistance_swing": 0.0,
}
"""A task in which nothing disturbs the ship."""

TRAVERSE_S = 20.0
"""Time in which an increment of 1 moves a command over its range [s]."""


class Moment(NamedTuple):
    """One plant step: quantities at its beginning, and some at its end."""

    order: float
    shaft_speed: float
    ship_speed: float
    log: float
    rack: float
    drive: float
    measured_torque_of: float
    measured_pitch_of: float
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
            rows[0].copy()
            for rows in (
                batch.arrays.plants,
                batch.arrays.states,
                batch.arrays.memories,
                batch.arrays.seas,
                batch.arrays.episodes,
            )
        )
        self.dt, self.steps, self.gains = batch.dt, batch.steps, batch.gains
        self.command = batch.command
        self.increments = batch.settings.action_mode == "increment"
        self.slope = float(batch.common["limiter_slope"])
        low, high = (
            self.plant[f"engine_speed_{end}"] / self.plant["gear_ratio"] for end in ("min", "max")
        )
        ends = {"shaft-speed": (low, high)}.get(
            self.command, (self.plant["drive_min"], self.plant["drive_max"])
        )
        self.low = np.array([self.plant["pitch_ratio_min"], ends[0]])
        self.high = np.array([self.plant["pitch_ratio_max"], ends[1]])
        begun = "shaft_speed_command" if self.command == "shaft-speed" else "rack_command"
        self.commands = np.array([self.episode["pitch_command"], self.episode[begun]])
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
        """Simulate one control interval under an action and return its plant steps."""
        p = self.plant
        given = np.asarray(action, np.float32).astype(np.float64)
        span = self.high - self.low
        if self.increments:
            moved = self.commands + given * self.steps * self.dt / TRAVERSE_S * span
            self.commands = np.clip(moved, self.low, self.high)
        else:
            self.commands = self.low + 0.5 * (given + 1.0) * span
        pitch, second = map(float, self.commands)
        found = []
        for k in range(self.steps):
            time = (self.elapsed * self.steps + k) * self.dt
            drive = second
            if self.command == "shaft-speed":
                gains = (np.interp(self.measured, self.gains[0], self.gains[i]) for i in (1, 2))
                drive, self.integral = govern(p, second, self.measured, self.integral, *gains)
            elif self.command == "limited-rack":
                drive = limit_rack(p, second, self.measured, self.slope)
            omega, speed = float(self.state["shaft_speed"]), float(self.state["ship_speed"])
            log = float(self.memory["speed_log"])
            times = time, time + 0.5 * self.dt, time + self.dt
            acting = StepInputs(float(drive), pitch, 0.0, *map(self.disturbance, times))
            outputs = step(p, self.state, self.memory, self.sea, acting, self.dt)
            self.measured = omega
            fuel = 2.0 * fuel_rate(p, p["gear_ratio"] * omega, outputs.brake_torque)
            found.append(
                Moment(
                    self.order(time),
                    omega,
                    speed,
                    log,
                    float(self.memory["rack"]),
                    float(drive),
                    float(self.memory["shaft_torque"]),
                    float(self.memory["pitch_ratio"]),
                    outputs,
                    fuel,
                    float(self.state["position"]),
                    float(self.state["ventilation"]),
                    float(self.state["shaft_speed"]),
                )
            )
        self.elapsed += 1
        return found
