"""Identify wake, eta_R and resistance of KVLCC2 from the straight parts of zig-zag tests.

The recordings are free zig-zag tests of a 7 m model (scale 45.7) in HSVA's towing tank at constant
revolutions. They belong to their owners (public repository martinlarsalbert/
System-identification-of-Vessel-Manoeuvring-Models, commit 4b7ce53, data/01_raw/kvlcc2_hsva); columns are
renamed and in SI units. Names of runs are rudder angle, heading at the execute, and p or s where one
side was run alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.core.rows import true_runs
from shaftline.mismatch import identify
from shaftline.mismatch.identify import Identification
from shaftline.plant import RecordingError, Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME
from shaftline.plant.dynamics import loads
from shaftline.plant.expressions import NO_SIGNALS
from shaftline.plant.recording import convert_numbers, read_recording, read_table
from shaftline.plant.ship import validate_tables
from shaftline.plant.state import inputs_without_sea, motion_state

from ..writing import refusal, rms

NAMES = (
    "z_05_01",
    "z_10_01",
    "z_10_05",
    "z_10_10_p",
    "z_10_10_s",
    "z_15_01",
    "z_15_05",
    "z_20_05",
    "z_20_10_p",
    "z_20_10_s",
    "z_25_05",
    "z_30_05",
    "z_35_05",
)
UNSEEN = "z_35_05"  # held-out run: the largest rudder angle and the largest loss of speed
TORQUE, THRUST, SPEED = "shaft_torque_N_m", "thrust_N", "ship_speed_m_s"
SWAY, YAW, RUDDER = "sway_speed_m_s", "yaw_rate_rad_s", "rudder_rad"
CHANNELS = (TIME, SHAFT_SPEED, TORQUE, THRUST, SPEED)
"""Columns that are fitted; sway, yaw and rudder only select the rows."""

PROPELLER_AT_M = -3.386  # position of the propeller, forward of midship [m]
DENSITY = 1000.0  # density of the tank's fresh water [kg/m3]; not printed
PRINTED_WAKE, PRINTED_DEDUCTION = 0.40, 0.25
APPROACH_SPEED = 15.5 * 1852.0 / 3600.0 / 45.7**0.5
"""Model speed at which the printed values are assumed to be in balance [m/s]: 15.5 kn full scale."""

REVOLUTIONS = 10.23  # revolutions, constant in all runs [1/s]
Runs = dict[str, pd.DataFrame]
Floats = NDArray[np.float64]


class Straight(NamedTuple):
    """Limits within which the rows of a run count as straight."""

    title: str  # for the page
    drift_deg: float  # largest drift angle at the propeller; infinite where the rudder alone counts
    yaw_deg_s: float
    rudder_deg: float
    from_s: float  # time before which all rows are left out
    first_only: bool  # whether to end at the first row beyond a limit
    least_rows: int  # of a part


SMALL = Straight("small drift", 1.5, 0.2, 6.0, 3.0, False, 40)
"""Parts of 2 s or more after the start: thrust rises in the first three seconds."""

BEFORE = Straight("before the first rudder execute", np.inf, np.inf, 1.0, 0.0, True, 10)
"""Rows before the rudder leaves midship."""

LIMITS = (
    SMALL._replace(drift_deg=1.0, yaw_deg_s=0.1),
    SMALL._replace(drift_deg=1.0),
    SMALL,
    *(SMALL._replace(drift_deg=d, yaw_deg_s=y) for d, y in ((2.0, 0.3), (3.0, 0.5))),
    SMALL._replace(drift_deg=2.0, yaw_deg_s=0.3, rudder_deg=11.0),
    SMALL._replace(from_s=0.0),
    BEFORE,
)
"""Other limits, for the sensitivity of the result."""


def load_runs(folder: Path) -> Runs:
    """Return the thirteen runs of a folder by name.

    Raises:
        RecordingError: a file is missing or cannot be used.
    """
    required = [*CHANNELS, SWAY, YAW, RUDDER]
    return {name: read_recording(folder / f"{name}.csv", required) for name in NAMES}


def ship_of(folder: Path) -> Ship:
    """Return the model with its printed values and its own open-water table.

    Neither resistance nor added mass in surge is printed. The resistance balances the printed values at
    the approach speed; the mass is that of the model.

    Raises:
        RecordingError: the open-water table is missing or unusable.
    """
    path = folder / "open_water.csv"
    table = convert_numbers(path, read_table(path), ["J", "Kt", "10Kq"])[["J", "Kt", "10Kq"]]
    if not np.isfinite(table.to_numpy(dtype=np.float64)).all():
        raise RecordingError(f"{path}: an entry is not a finite number")
    entries = table.astype(float)
    tree = {
        "name": "kvlcc2",
        "description": "7 m model of the tanker KVLCC2 at constant revolutions",
        "water": {"density_kg_m3": DENSITY},
        "hull": {
            "mass_kg": 3272.0,
            "resistance_coefficient_N_s2_m2": 1.0,
            "wake_fraction": PRINTED_WAKE,
            "thrust_deduction": PRINTED_DEDUCTION,
        },
        "propeller": {  # eta_R is not printed; the assumed depth acts where air is drawn only
            "model": "table",
            "diameter_m": 0.204,
            "blades": 4,
            "relative_rotative_efficiency": 1.0,
            "depth_m": 0.3,
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
    ship = validate_tables(Ship, tree, "kvlcc2")
    omega = np.array([2.0 * np.pi * REVOLUTIONS])
    thrust = loads_at(ship, np.array([APPROACH_SPEED]), omega)[0][0]
    resistance = (1.0 - PRINTED_DEDUCTION) * float(thrust) / APPROACH_SPEED**2
    return ship.with_values({RESISTANCE: round(resistance, 2)})


def drift_at_propeller(run: pd.DataFrame) -> Floats:
    """Return the drift angle at the propeller [rad], shape (rows,)."""
    across = run[SWAY] + PROPELLER_AT_M * run[YAW]
    return np.asarray(np.arctan2(across.to_numpy(), run[SPEED].to_numpy()))


def straight_rows(run: pd.DataFrame, by: Straight) -> list[tuple[int, int]]:
    """Return the first row of each straight part of a run, and one past its last."""
    angles = np.degrees(np.abs([drift_at_propeller(run), run[YAW], run[RUDDER]]))
    straight = np.less(angles.T, by[1:4]).all(axis=1) & (run[TIME].to_numpy() >= by.from_s)
    if by.first_only:
        straight = np.logical_and.accumulate(straight)
    return [(a, b) for a, b in true_runs(straight) if b - a >= by.least_rows]


def straight_parts(runs: Runs, by: Straight) -> list[pd.DataFrame]:
    """Return the straight parts of all fitted runs, each from time 0."""
    parts = []
    for name, run in runs.items():
        if name != UNSEEN:
            for a, b in straight_rows(run, by):
                part = run.iloc[a:b][[*CHANNELS]].reset_index(drop=True)
                parts.append(part.assign(**{TIME: part[TIME] - part[TIME].iloc[0]}))
    return parts


@compiled
def _fill_loads(
    plant: Record, ship_speed: Floats, shaft_speed: Floats, thrust: Floats, torque: Floats
) -> None:
    """Fill thrust [N] and torque [N m] behind the ship at each row."""
    for k in range(len(ship_speed)):
        state = motion_state(plant.pitch_ratio_max, shaft_speed[k], ship_speed[k])
        acts = inputs_without_sea(
            shaft_speed[k], plant.pitch_ratio_max, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, NO_SIGNALS
        )
        acting = loads(plant, state, acts, plant.pitch_ratio_max)
        thrust[k] = acting.thrust
        torque[k] = acting.load_torque


def loads_at(ship: Ship, ship_speed: Floats, shaft_speed: Floats) -> tuple[Floats, Floats]:
    """Return thrust [N] and torque [N m] at measured speeds [m/s, rad/s], each of shape (rows,).

    The measured speed is used because a surge model lacks the speed loss by drift and rudder.
    """
    thrust, torque = np.empty(len(ship_speed)), np.empty(len(ship_speed))
    _fill_loads(ship.record(), ship_speed, shaft_speed, thrust, torque)
    return thrust, torque


WAKE, DEDUCTION = "hull.wake_fraction", "hull.thrust_deduction"
RESISTANCE, MASS = "hull.resistance_coefficient_N_s2_m2", "hull.mass_kg"
EFFICIENCY = "propeller.relative_rotative_efficiency"

FREE = (WAKE, EFFICIENCY, RESISTANCE)
"""Free parameters: thrust identifies the wake, torque eta_R, the balance of the hull one more."""

REFUSED: tuple[tuple[str, ...], ...] = ((*FREE, DEDUCTION), (*FREE, DEDUCTION, MASS))
"""Parameters that the straight parts cannot identify together."""

FRESH_COLD = 998.0
"""Density of fresh water at 21 degrees [kg/m3], for the sensitivity to the unprinted density."""


def identify_straight(ship: Ship, runs: Runs, by: Straight) -> Identification:
    """Identify :data:`FREE` from the straight parts."""
    return identify(ship, *straight_parts(runs, by), free=FREE)


def identify_variants(ship: Ship, runs: Runs, by: Straight) -> dict[str, Identification]:
    """Return other identifications from the same parts: automatic, thrust deduction, other density."""
    parts = straight_parts(runs, by)
    lighter = ship.with_values({"water.density_kg_m3": FRESH_COLD})
    return {
        "auto": identify(ship, *parts),
        "deduction": identify(ship, *parts, free=(WAKE, EFFICIENCY, DEDUCTION)),
        "density": identify(lighter, *parts, free=FREE),
    }


def refusals(ship: Ship, runs: Runs) -> dict[tuple[str, ...], str]:
    """Return the messages with which ``identify`` refuses :data:`REFUSED`.

    Raises:
        ValueError: a set is not refused.
    """
    parts = straight_parts(runs, SMALL)
    return {keys: refusal(ship, parts, keys) for keys in REFUSED}


def sensitivity(ship: Ship, runs: Runs) -> pd.DataFrame:
    """Return the estimates with each of :data:`LIMITS`, a row each."""
    rows = []
    for by in LIMITS:
        parts = straight_parts(runs, by)
        row = dict(zip(by._fields[:5], by, strict=False))
        row |= {"parts": len(parts), "rows": sum(map(len, parts))}
        for e in identify(ship, *parts, free=FREE).estimates:
            row |= {e.name: e.value, f"{e.name}_se": e.standard_error}
        rows.append(row)
    return pd.DataFrame(rows)


class Errors(NamedTuple):
    """Rms errors on one run."""

    thrust: float  # N
    torque: float  # N m


def errors(ship: Ship, run: pd.DataFrame) -> Errors:
    """Return the errors of thrust and torque on a whole run at its measured speeds."""
    thrust, torque = loads_at(ship, run[SPEED].to_numpy(), run[SHAFT_SPEED].to_numpy())
    return Errors(rms(thrust - run[THRUST]), rms(torque - run[TORQUE]))


def best_wake(ship: Ship, *runs: pd.DataFrame) -> tuple[float, float]:
    """Return the constant wake fraction with the least thrust error on whole runs, and this error [N].

    On a held-out run it is the lower bound for a constant wake, not a result.
    """
    run = pd.concat(runs, ignore_index=True)
    found = scipy.optimize.minimize_scalar(
        lambda w: errors(ship.with_values({WAKE: float(w)}), run).thrust,
        bounds=(0.2, 0.59),
        method="bounded",
        options={"xatol": 1e-5},
    )
    return float(found.x), float(found.fun)


def zigzag_errors(ship: Ship, found: dict[str, Ship], runs: Runs) -> pd.DataFrame:
    """Return the errors on each zig-zag before and after, and the least error of a constant wake."""
    rows = []
    for name, run in runs.items():
        wake, least = best_wake(ship, run)
        all_ = {word: errors(one, run) for word, one in {"before": ship, **found}.items()}
        row: dict[str, float | str] = {"run": name, "unseen": "yes" if name == UNSEEN else "no"}
        row |= {f"thrust_{word}_N": e.thrust for word, e in all_.items()}
        row |= {"best_wake": wake, "thrust_least_N": least}
        rows.append(row | {f"torque_{word}_N_m": e.torque for word, e in all_.items()})
    return pd.DataFrame(rows)
