"""One lever of the CPP optimiser paper's experiment in closed loop, through a step of the resistance."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from shaftline.baselines.combinator import Combinator
from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.baselines.controller import readings
from shaftline.baselines.cpp_optimiser import CppOptimiser
from shaftline.envs import CLASSIC
from shaftline.envs.frigate import FrigateEnv
from shaftline.envs.tasks import get_task
from shaftline.plant import Ship
from shaftline.plant.fuel import specific_consumption

from .lever_points import COMBINATOR, CORRECTED, HELD, curves, lever_speeds, rises, slowed

LEVER, SECONDS, STEP_AT = 3, 600.0, 300.0
MEANS_OVER = 100.0  # last seconds


def voyage(
    ship: Ship,
    controller: Any,
    speed: float,
    corrected: float,
    *,
    sea: str = "calm",
    rise: float | None = None,
    observer: str = "oracle",
    noise: float | Mapping[str, float] = 0.0,
) -> pd.DataFrame:
    """A ship in closed loop; resistance steps up on the way.

    Args:
        ship: a ship with a diesel.
        controller: with ``predict``.
        speed: ordered ship speed [m/s].
        corrected: order [m/s] from the step on.
        sea: that it sails in, head seas; calm water by default.
        rise: resistance factor from the step on [-]; that of the middle lever by default.
        observer: of the advance velocity; the truth by default.
        noise: of the instruments, as ``sensor_noise`` of the environment; none by default.

    Returns:
        One row per 0.5 s: time [s], ship speed [m/s], engine speed [rpm], P/D, SFOC [g/kWh], fuel
        flow [kg/s], thrust [N].
    """
    still = {"resistance_rise": (0.0, 0.0), "resistance_swing": 0.0, "seas": (sea,)}
    task = get_task("transit").model_dump() | still
    factor = rises()[LEVER - 1] if rise is None else rise
    # only the sea knows of the step
    heavier = ship.with_values(
        {"hull.episode_resistance_fraction": factor - 1.0, "hull.episode_start_s": STEP_AT}
    )
    env = FrigateEnv(
        ship=heavier,
        task=task,
        observer=observer,
        sensor_noise=noise,
        max_episode_steps=None,
        **CLASSIC,
    )
    plant = ship.record()
    orders = {"speed_order_m_s": (speed, corrected), "order_interval_s": STEP_AT}
    observation, _ = env.reset(seed=0, options=orders)
    remembered, rows = None, []
    for k in range(round(SECONDS / env.batch.interval_s)):
        time = 0.5 * k
        action, remembered = controller.predict(observation, remembered, np.array([k == 0]))
        observation, _, _, _, info = env.step(action)
        engine = float(plant["gear_ratio"]) * info["shaft_speed"]
        sfoc = specific_consumption(plant, engine, info["brake_torque"])
        pitch = float(readings(observation).pitch_ratio[0])
        rpm = engine * 30.0 / math.pi
        rows.append(
            (time + 0.5, info["ship_speed"], rpm, pitch, sfoc, info["fuel_flow"], info["thrust"])
        )
    names = [
        "time_s",
        "ship_speed_m_s",
        "engine_speed_rpm",
        "pitch_ratio",
        "sfoc_g_kwh",
        "fuel_kg_s",
        "thrust_N",
    ]
    return pd.DataFrame(rows, columns=names)


def voyages(ship: Ship, tick: Callable[[], None] = lambda: None) -> dict[str, pd.DataFrame]:
    """The three controls of the paper at the middle lever, starting alike from the design curve."""
    curve = curves(ship, combinator_surface(ship))["design"]
    speed = lever_speeds(ship)[LEVER - 1]
    found = {COMBINATOR: voyage(ship, Combinator(ship, curve=curve), speed, speed)}
    tick()
    reached = float(found[COMBINATOR]["ship_speed_m_s"].iloc[-1])
    held = slowed(ship, speed, rises()[LEVER - 1])
    for control, order in ((HELD, speed), (CORRECTED, reached * speed / held)):
        found[control] = voyage(ship, CppOptimiser(ship), speed, order)
        tick()
    return found


def settled(found: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Means over the last :data:`MEANS_OVER` seconds of each voyage, with fuel per nautical mile."""
    means = {name: log[log["time_s"] > SECONDS - MEANS_OVER].mean() for name, log in found.items()}
    frame = pd.DataFrame(means).T.drop(columns=["time_s", "thrust_N"])
    frame["fuel_kg_nmi"] = 1852.0 * frame.pop("fuel_kg_s") / frame["ship_speed_m_s"]
    return frame.rename_axis("control").reset_index()
