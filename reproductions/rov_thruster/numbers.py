"""The owners' constants found anew by ``identify``, judged on the same unseen runs as the diagnosis.

Leave one controller out: the numbers are fitted on two controllers' runs and judged on the third's.
Beside each error stands the least that the same numbers reach when they are fitted to that run itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.mismatch import identify
from shaftline.mismatch.identification.free_parameters import AUTO, Free
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import MEASURED
from shaftline.plant.replay import Replay

from .runs import (
    CONSTANTS,
    CONTROLLERS,
    SPEED,
    TOLERANCE_FACTOR,
    WHOLE,
    Judged,
    Runs,
    judged,
    shown_of,
    with_owners_dead_zone,
)

CONSTANT, RESISTANCE = "prime_mover.motor_constant_V_s_rad", "prime_mover.armature_resistance_ohm"
INERTIA = "transmission.inertia_engine_side_kg_m2"
LOAD = "propeller.torque_coefficient"
DEAD_ZONE = "prime_mover.command_dead_zone_V"
OFFSET = "prime_mover.torque_offset_N_m"
REVERSE = "prime_mover.reverse_torque_fraction"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"

REFUSED = ((CONSTANT, RESISTANCE, INERTIA, LOAD), (CONSTANT, RESISTANCE, DEAD_ZONE, LOAD))
"""Numbers that these runs do not tell together."""

_STEP, _STEP_FROM_ZERO = 0.05, 0.01
"""First steps of the search for the least error: a share of a number, or where it is 0, of its unit."""


class Freed(NamedTuple):
    """Numbers that are found from one start."""

    title: str
    start: str
    keys: tuple[str, ...] | str


SETS = (
    Freed("those that are told", CONSTANTS, AUTO),
    Freed("and friction", CONSTANTS, (CONSTANT, RESISTANCE, FRICTION)),
    Freed("and dead zone", CONSTANTS, (CONSTANT, RESISTANCE, DEAD_ZONE)),
    Freed("those that are told", WHOLE, AUTO),
    Freed("and torque astern", WHOLE, (CONSTANT, RESISTANCE, DEAD_ZONE, REVERSE)),
    Freed("and torque offset", WHOLE, (CONSTANT, RESISTANCE, DEAD_ZONE, OFFSET)),
)


@dataclass(frozen=True)
class Refit:
    """Numbers found on two controllers' runs, judged on the third's.

    Args:
        freed: which, from which start.
        unseen: the controller that is judged.
        identification: what the tool found.
        judged: every unseen run.
        least: rms error of the shaft speed on each of them [rad/s] with the same numbers fitted to it.
    """

    freed: Freed
    unseen: str
    identification: Identification
    judged: tuple[Judged, ...]
    least: tuple[float, ...]


def start_of(title: str) -> Ship:
    """The ship of a start."""
    ship = load_ship("rov-thruster")
    return with_owners_dead_zone(ship) if title == WHOLE else ship


def refit(freed: Freed, runs: Runs, unseen: str) -> Refit:
    """Find numbers on the runs of two controllers, judge on those of the third."""
    ship = start_of(freed.start)
    fitted, held = shown_of(ship, runs, unseen)
    found = identify(ship, *fitted, free=freed.keys, hold_out=held, tolerance=TOLERANCE_FACTOR)
    unseen_runs = {run: table for run, table in runs.items() if run[0] == unseen}
    results = tuple(judged(ship, found.identified, run, t) for run, t in unseen_runs.items())
    least = tuple(least_error(found, table) for table in unseen_runs.values())
    return Refit(freed, unseen, found, results, least)


def refits(runs: Runs) -> list[Refit]:
    """Every controller set aside in turn, for each of :data:`SETS`."""
    return [refit(freed, runs, unseen) for freed in SETS for unseen in CONTROLLERS[::-1]]


def least_error(found: Identification, table: pd.DataFrame) -> float:
    """Rms error of the shaft speed [rad/s] on a run with the found numbers fitted to it instead.

    By the run's own rms error (Nelder & Mead 1965), from what was found on; it is no result but the
    bound on one.
    """
    free = Free(found.ship, tuple(found.parameters))
    replay = Replay(found.ship, table)
    measured = table[SPEED].to_numpy()
    here = np.array(list(found.parameters.values()))
    sizes = np.where(here == 0.0, _STEP_FROM_ZERO, _STEP * np.abs(here))

    def error(shares: Any) -> float:
        values = free.towards(list(here), list(here + shares * sizes))
        simulated = replay.simulate(free.record(values))[MEASURED[SPEED]]
        return float(np.sqrt(np.mean((simulated - measured) ** 2)))

    corner = np.zeros(len(here))
    simplex = np.vstack([corner, corner + np.eye(len(here))])
    found_there = scipy.optimize.minimize(
        error, corner, method="Nelder-Mead",
        options={"maxfev": 150 * len(here), "xatol": 1e-2, "fatol": 1e-4, "initial_simplex": simplex},
    )  # fmt: skip
    return float(found_there.fun)


def refusals(runs: Runs, sets: Sequence[tuple[str, ...]] = REFUSED) -> list[str]:
    """What the tool says of numbers that two controllers' runs do not tell together.

    Raises:
        ValueError: it finds them after all.
    """
    ship = start_of(WHOLE)
    fitted, held = shown_of(ship, runs, CONTROLLERS[-1])
    said = []
    for keys in sets:
        try:
            identify(ship, *fitted, free=keys, hold_out=held, tolerance=TOLERANCE_FACTOR)
        except ValueError as error:
            said.append(str(error))
        else:
            raise ValueError(f"{', '.join(keys)} are told after all")
    return said


def table_of(found: Sequence[Refit]) -> pd.DataFrame:
    """Every unseen run of every refit, one row each: errors, and the numbers with their errors."""
    rows = []
    for one in found:
        numbers: dict[str, float] = {}
        for e in one.identification.estimates:
            numbers |= {e.name: e.value, f"{e.name}_se": e.standard_error}
        for result, least in zip(one.judged, one.least, strict=True):
            rows.append(
                {
                    "start": one.freed.start,
                    "freed": one.freed.title,
                    "unseen": " ".join(result.run),
                    "rms_before_rad_s": result.before,
                    "rms_after_rad_s": result.after,
                    "after/before": result.ratio,
                    "rms_least_rad_s": least,
                    **numbers,
                }
            )
    return pd.DataFrame(rows)
