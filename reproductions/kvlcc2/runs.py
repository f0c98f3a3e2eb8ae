"""KVLCC2, a 7 m model (scale 45.7): free zig-zag tests in HSVA's towing tank at constant revolutions.

The recordings stay with whoever has them (public repository martinlarsalbert/
System-identification-of-Vessel-Manoeuvring-Models, commit 4b7ce53, data/01_raw/kvlcc2_hsva), their
columns renamed and in SI units. Names are rudder angle, heading at which the rudder is put over,
and p or s where one side was run alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.plant import RecordingError, Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME
from shaftline.plant.dynamics import loads
from shaftline.plant.recording import as_numbers, read_recording, read_table
from shaftline.plant.ship import validated
from shaftline.plant.state import motion_state, steady_inputs

NAMES = (
    "z_05_01", "z_10_01", "z_10_05", "z_10_10_p", "z_10_10_s", "z_15_01", "z_15_05", "z_20_05",
    "z_20_10_p", "z_20_10_s", "z_25_05", "z_30_05", "z_35_05",
)  # fmt: skip
UNSEEN = "z_35_05"
"""Never fitted: the largest rudder, and the largest loss of speed."""

TORQUE, THRUST, SPEED = "shaft_torque_N_m", "thrust_N", "ship_speed_m_s"
SWAY, YAW, RUDDER = "sway_speed_m_s", "yaw_rate_rad_s", "rudder_rad"
CHANNELS = (TIME, SHAFT_SPEED, TORQUE, THRUST, SPEED)
"""What ``identify`` is shown; sway, yaw and rudder only choose the rows."""

PROPELLER_AT_M = -3.386
"""Place of the propeller, forward of midship."""

DENSITY = 1000.0
"""Of the tank's fresh water [kg/m3]; not printed."""

PRINTED_WAKE, PRINTED_DEDUCTION = 0.40, 0.25
APPROACH_SPEED = 15.5 * 1852.0 / 3600.0 / 45.7**0.5
"""Of the model [m/s], at which the printed numbers are taken to be in balance: 15.5 kn full scale."""

REVOLUTIONS = 10.23
"""Constant in all runs [1/s]."""

Runs = dict[str, pd.DataFrame]


class Straight(NamedTuple):
    """Which rows of a run are straight.

    Args:
        title: for the page.
        drift_deg: most drift angle at the propeller; infinite where the rudder alone counts.
        yaw_deg_s: most yaw rate.
        rudder_deg: most rudder angle.
        from_s: the rows before are left out.
        first_only: only until one of them is exceeded for the first time.
        least_rows: of a part.
    """

    title: str
    drift_deg: float
    yaw_deg_s: float
    rudder_deg: float
    from_s: float
    first_only: bool
    least_rows: int


SMALL = Straight("small drift", 1.5, 0.2, 6.0, 3.0, False, 40)
"""Parts of 2 s or more, when the start is over: thrust rises through the first three seconds."""

BEFORE = Straight("before the first rudder order", np.inf, np.inf, 1.0, 0.0, True, 10)
"""From a run's first row until the rudder has left midship."""

OTHERS = (
    SMALL._replace(drift_deg=1.0, yaw_deg_s=0.1),
    SMALL._replace(drift_deg=1.0),
    SMALL,
    SMALL._replace(drift_deg=2.0, yaw_deg_s=0.3),
    SMALL._replace(drift_deg=3.0, yaw_deg_s=0.5),
    SMALL._replace(drift_deg=2.0, yaw_deg_s=0.3, rudder_deg=11.0),
    SMALL._replace(from_s=0.0),
    BEFORE,
)
"""Other answers to what is straight, to see how much hangs on it."""


def load_runs(folder: Path) -> Runs:
    """The thirteen runs of a folder, by name.

    Raises:
        RecordingError: a file is missing or cannot be used.
    """
    required = [*CHANNELS, SWAY, YAW, RUDDER]
    return {name: read_recording(folder / f"{name}.csv", required) for name in NAMES}


def ship_of(folder: Path) -> Ship:
    """The model with its printed numbers and its own open-water table.

    The resistance is not printed: it starts where the printed numbers are in balance at the approach
    speed. Nor is an added mass in surge; the mass is the model's own.

    Raises:
        RecordingError: no open-water table, or one that cannot be used.
    """
    path = folder / "open_water.csv"
    table = as_numbers(path, read_table(path), ["J", "Kt", "10Kq"])[["J", "Kt", "10Kq"]]
    if not np.isfinite(table.to_numpy(dtype=np.float64)).all():
        raise RecordingError(f"{path}: an entry is not a finite number")
    entries = table.astype(float)
    tree: dict[str, Any] = {
        "name": "kvlcc2",
        "description": "7 m model of the tanker KVLCC2 at constant revolutions",
        "water": {"density_kg_m3": DENSITY},
        "hull": {
            "mass_kg": 3272.0,
            "resistance_coefficient_N_s2_m2": 1.0,
            "wake_fraction": PRINTED_WAKE,
            "thrust_deduction": PRINTED_DEDUCTION,
        },
        "propeller": {
            "model": "table",
            "diameter_m": 0.204,
            "blades": 4,
            "relative_rotative_efficiency": 1.0,  # not printed
            "depth_m": 0.3,  # assumed; without effect while nothing ventilates
            "open_water": {
                "advance_ratio": entries["J"].tolist(),
                "thrust_coefficient": entries["Kt"].tolist(),
                "torque_coefficient": (0.1 * entries["10Kq"]).round(8).tolist(),
            },
        },
        "prime_mover": {"type": "speed-command", "speed_max_rad_s": 100.0},
        "transmission": {"inertia_propeller_side_kg_m2": 0.0},
        "integration": {"time_step_s": 0.05},
    }
    ship = validated(Ship, tree, "kvlcc2")
    omega = np.array([2.0 * np.pi * REVOLUTIONS])
    thrust = loads_at(ship, np.array([APPROACH_SPEED]), omega)[0][0]
    resistance = (1.0 - PRINTED_DEDUCTION) * float(thrust) / APPROACH_SPEED**2
    return ship.with_values({"hull.resistance_coefficient_N_s2_m2": round(resistance, 2)})


def drift_at_propeller(run: pd.DataFrame) -> NDArray[np.float64]:
    """Drift angle where the propeller is [rad], shape (rows,)."""
    across = run[SWAY] + PROPELLER_AT_M * run[YAW]
    return np.asarray(np.arctan2(across.to_numpy(), run[SPEED].to_numpy()))


def straight_rows(run: pd.DataFrame, by: Straight) -> list[tuple[int, int]]:
    """First row of each straight part of a run, and one past its last."""
    straight = (
        (np.degrees(np.abs(drift_at_propeller(run))) < by.drift_deg)
        & (np.degrees(np.abs(run[YAW].to_numpy())) < by.yaw_deg_s)
        & (np.degrees(np.abs(run[RUDDER].to_numpy())) < by.rudder_deg)
        & (run[TIME].to_numpy() >= by.from_s)
    )
    if by.first_only:
        straight = np.logical_and.accumulate(straight)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], straight.astype(int), [0]])))
    return [
        (int(a), int(b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= by.least_rows
    ]


def straight_parts(runs: Runs, by: Straight) -> list[pd.DataFrame]:
    """The straight parts of all runs but the unseen one, each from time 0."""
    parts = []
    for name, run in runs.items():
        if name != UNSEEN:
            for a, b in straight_rows(run, by):
                part = run.iloc[a:b][[*CHANNELS]].reset_index(drop=True)
                parts.append(part.assign(**{TIME: part[TIME] - part[TIME].iloc[0]}))
    return parts


@compiled
def _fill_loads(
    plant: Record,
    ship_speed: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    thrust: NDArray[np.float64],
    torque: NDArray[np.float64],
) -> None:
    """Thrust [N] and torque [N m] behind the ship at each row; the last two filled."""
    for k in range(len(ship_speed)):
        state = motion_state(plant.pitch_ratio_max, shaft_speed[k], ship_speed[k])
        acts = steady_inputs(shaft_speed[k], plant.pitch_ratio_max, 0.0, 0.0)
        acting = loads(plant, state, acts, plant.pitch_ratio_max)
        thrust[k] = acting.thrust
        torque[k] = acting.load_torque


def loads_at(
    ship: Ship, ship_speed: NDArray[np.float64], shaft_speed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Thrust [N] and torque [N m] at measured speeds [m/s, rad/s], each of shape (rows,).

    By the measured speed, since a ship that only surges does not lose what drift and rudder take.
    """
    thrust, torque = np.empty(len(ship_speed)), np.empty(len(ship_speed))
    _fill_loads(ship.record(), ship_speed, shaft_speed, thrust, torque)
    return thrust, torque
