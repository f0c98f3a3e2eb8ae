"""Cases of the study: ships with concealed physics, and their recordings."""

from __future__ import annotations

import functools
import importlib.resources
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.plant.replay import simulate_recording
from shaftline.plant.ship import Ship
from shaftline.plant.ship_files import load_ship
from shaftline.plant.terms import Term

NULLS = {"frigate": 30, "motor": 20}
"""Cases without any missing physics."""

WRONG = 0.01
"""Standard deviation of a ship's numbers in every fourth case, as a share; known to 0.15 to 0.5 %."""

NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.014,
    "shaft_torque_N_m": 1400.0,
    "ship_speed_m_s": 0.05,
}
"""Of the frigate's instruments, rms."""

MOTOR_NOISE = 0.3
"""Of the motor's shaft speed, rms [rad/s]."""

OUTSIDE = {
    "frigate": {
        "drift_angle": ("rad", 0.0, 0.15), "yaw_rate": ("rad/s", 0.0, 0.015),
        "rudder_angle": ("rad", 0.0, 0.4), "relative_wind": ("m/s", 4.0, 10.0),
        "draught": ("m", 4.5, 0.5), "air_temperature": ("K", 15.0, 10.0),
    },
    "motor": {"side_force": ("N", 40.0, 30.0), "temperature": ("K", 30.0, 25.0)},
}  # fmt: skip
"""Signals that every recording of a rig holds, needed or not: unit, mean, most beside it."""

NUMBERS = {
    "frigate": (
        "hull.resistance_coefficient_N_s2_m2", "hull.mass_kg",
        "prime_mover.torque_per_rack_N_m_mm", "propeller.relative_rotative_efficiency",
        "transmission.inertia_engine_side_kg_m2",
    ),
    "motor": (
        "prime_mover.motor_constant_V_s_rad", "prime_mover.armature_resistance_ohm",
        "propeller.torque_coefficient", "transmission.inertia_engine_side_kg_m2",
    ),
}  # fmt: skip
"""Numbers of a ship's file that are wrong in every fourth case."""


@dataclass(frozen=True)
class Case:
    """One recording.

    Args:
        rig: ``frigate`` or ``motor``.
        truth: what is missing; None of a null.
        seed: of demands, noise, signals and wrong numbers.
        wrong: whether the ship's numbers are off by :data:`WRONG`.
    """

    rig: str
    truth: Term | None
    seed: int
    wrong: bool

    @property
    def name(self) -> str:
        """Its own among all cases."""
        return f"{self.rig}-{self.truth.id if self.truth else 'null'}-{self.seed}"


def cases(seed: int) -> list[Case]:
    """Every truth once, and the nulls; every fourth of either with wrong numbers.

    Args:
        seed: of the first; each has one of its own.
    """
    text = importlib.resources.files(__package__).joinpath("truths.toml").read_text("utf-8")
    found: list[Case] = []
    for entry in tomllib.loads(text)["truth"]:
        term = Term.model_validate(entry["term"])
        found.append(Case(entry["rig"], term, seed + len(found), len(found) % 4 == 3))
    for rig, count in NULLS.items():
        for number in range(count):
            found.append(Case(rig, None, seed + len(found), number % 4 == 3))
    return found


@functools.cache
def nominal(rig: str) -> Ship:
    """The ship as its file has it, in time steps as long as its recording allows."""
    units = {name: unit for name, (unit, _, _) in OUTSIDE[rig].items()}
    if rig == "frigate":
        return (
            load_ship("frigate").with_values({"integration.time_step_s": 0.2}).with_signals(units)
        )
    bench = {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.005}
    return load_ship("tito-neri-sine").with_values(bench).with_signals(units)


def recorded(case: Case) -> pd.DataFrame:
    """A case's recording: steps of the demands at random times, and signals that wander."""
    rng = np.random.default_rng(case.seed)
    ship = nominal(case.rig)
    if case.wrong:
        ship = ship.with_values(
            {
                k: ship.number(k).value * (1.0 + WRONG * rng.standard_normal())
                for k in NUMBERS[case.rig]
            }
        )
    if case.truth is not None:
        ship = ship.with_term(case.truth)
    frigate = case.rig == "frigate"
    rows, interval = (3001, 0.2) if frigate else (1500, 0.02)
    table = pd.DataFrame({"time_s": np.arange(rows) * interval})
    if frigate:
        table["fuel_rack_mm"] = _steps(rng, rows, 12.0, 26.0, (100, 450))
        table["pitch_ratio_command"] = _steps(rng, rows, 0.9, 1.35, (100, 450))
    else:
        table["motor_voltage_V"] = _steps(rng, rows, -9.0, 9.0, (25, 90))
        table["shaft_speed_rad_s"] = 0.0
    for name, (_, middle, most) in OUTSIDE[case.rig].items():
        table[name] = middle + most * _wandering(rng, rows)
    heard = table[list(OUTSIDE[case.rig])]
    sailed = simulate_recording(ship, table)
    noise = NOISE if frigate else {"shaft_speed_rad_s": MOTOR_NOISE}
    kept = list(NOISE) if frigate else ["shaft_speed_rad_s"]
    demands = [c for c in ("fuel_rack_mm", "pitch_ratio_command", "motor_voltage_V") if c in table]
    found = sailed[["time_s", *demands, *kept]].copy()
    for column, rms in noise.items():
        found[column] += rms * rng.standard_normal(rows)
    return pd.concat([found, heard], axis=1)


def _steps(
    rng: np.random.Generator, rows: int, low: float, high: float, hold: Sequence[int]
) -> NDArray[np.float64]:
    values = np.empty(rows)
    at = 0
    while at < rows:
        length = int(rng.uniform(*hold))
        values[at : at + length] = rng.uniform(low, high)
        at += length
    return values


def _wandering(rng: np.random.Generator, rows: int) -> NDArray[np.float64]:
    """Eight sines of random slow periods, at most 1 in size."""
    at: Any = np.arange(rows) / rows
    periods, phases = rng.uniform(1.5, 15.0, 8), rng.uniform(0.0, 2.0 * np.pi, 8)
    waves = rng.standard_normal(8) @ np.sin(2.0 * np.pi * np.outer(periods, at) + phases[:, None])
    return np.asarray(waves / np.abs(waves).max())
