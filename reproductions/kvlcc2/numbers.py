"""What the straight parts tell by ``identify``, and how far it carries in the zig-zags."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.mismatch import identify
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED

from .runs import (
    OTHERS,
    SMALL,
    SPEED,
    THRUST,
    TORQUE,
    UNSEEN,
    Runs,
    Straight,
    loads_at,
    straight_parts,
)

WAKE, DEDUCTION = "hull.wake_fraction", "hull.thrust_deduction"
RESISTANCE, MASS = "hull.resistance_coefficient_N_s2_m2", "hull.mass_kg"
EFFICIENCY = "propeller.relative_rotative_efficiency"

FREE = (WAKE, EFFICIENCY, RESISTANCE)
"""Found: thrust tells the wake, torque beside it eta_R, and the balance of the hull one number."""

REFUSED: tuple[tuple[str, ...], ...] = (
    (WAKE, EFFICIENCY, RESISTANCE, DEDUCTION),
    (WAKE, EFFICIENCY, RESISTANCE, DEDUCTION, MASS),
)
"""Numbers that the straight parts do not tell together."""

FRESH_COLD = 998.0
"""Density of fresh water at 21 degrees [kg/m3], to see what the one that is not printed is worth."""


def found_in(ship: Ship, runs: Runs, by: Straight) -> Identification:
    """The numbers :data:`FREE` by the straight parts, as one way tells them."""
    return identify(ship, *straight_parts(runs, by), free=FREE)


def found_by(ship: Ship, runs: Runs, by: Straight) -> dict[str, Identification]:
    """What other questions to the same parts give, by what was asked."""
    parts = straight_parts(runs, by)
    lighter = ship.with_values({"water.density_kg_m3": FRESH_COLD})
    return {
        "auto": identify(ship, *parts),
        "deduction": identify(ship, *parts, free=(WAKE, EFFICIENCY, DEDUCTION)),
        "density": identify(lighter, *parts, free=FREE),
    }


def refusals(ship: Ship, runs: Runs) -> dict[tuple[str, ...], str]:
    """What the tool says of numbers that the straight parts do not tell together.

    Raises:
        ValueError: it finds them after all.
    """
    parts = straight_parts(runs, SMALL)
    said: dict[tuple[str, ...], str] = {}
    for keys in REFUSED:
        try:
            identify(ship, *parts, free=keys)
        except ValueError as error:
            said[keys] = str(error)
        else:
            raise ValueError(f"{', '.join(keys)} are told after all")
    return said


def sensitivity(ship: Ship, runs: Runs) -> pd.DataFrame:
    """The numbers by other answers to what is straight, a row each."""
    rows = []
    for by in OTHERS:
        parts = straight_parts(runs, by)
        row: dict[str, float | str] = {
            "title": by.title,
            "drift_deg": by.drift_deg,
            "yaw_deg_s": by.yaw_deg_s,
            "rudder_deg": by.rudder_deg,
            "from_s": by.from_s,
            "parts": len(parts),
            "rows": sum(map(len, parts)),
        }
        for e in identify(ship, *parts, free=FREE).estimates:
            row |= {e.name: e.value, f"{e.name}_se": e.standard_error}
        rows.append(row)
    return pd.DataFrame(rows)


class Errors(NamedTuple):
    """Rms errors on one run."""

    thrust: float  # N
    torque: float  # N m


def errors(ship: Ship, run: pd.DataFrame) -> Errors:
    """Of thrust and torque on a whole run, at its measured speeds."""
    thrust, torque = loads_at(ship, run[SPEED].to_numpy(), run[SHAFT_SPEED].to_numpy())

    def rms(difference: pd.Series[float]) -> float:
        return float(np.sqrt(np.mean(difference**2)))

    return Errors(rms(thrust - run[THRUST]), rms(torque - run[TORQUE]))


def best_wake(ship: Ship, *runs: pd.DataFrame) -> tuple[float, float]:
    """The constant wake fraction of least thrust error over whole runs, and that rms error [N].

    Of the run that is judged itself it is no result, but the bound on one.
    """
    run = pd.concat(runs, ignore_index=True)
    found = scipy.optimize.minimize_scalar(
        lambda w: errors(ship.with_values({WAKE: float(w)}), run).thrust,
        bounds=(0.2, 0.59), method="bounded", options={"xatol": 1e-5},
    )  # fmt: skip
    return float(found.x), float(found.fun)


def judged(ship: Ship, found: dict[str, Ship], runs: Runs) -> pd.DataFrame:
    """Every zig-zag before and after, a row each, with the least that a constant wake can reach.

    Args:
        ship: with the printed numbers.
        found: ships with numbers that were found, by a word for the columns.
        runs: all of them.
    """
    rows = []
    for name, run in runs.items():
        wake, least = best_wake(ship, run)
        before = errors(ship, run)
        row: dict[str, float | str] = {
            "run": name,
            "unseen": "yes" if name == UNSEEN else "no",
            "thrust_before_N": before.thrust,
        }
        after = {word: errors(other, run) for word, other in found.items()}
        row |= {f"thrust_{word}_N": e.thrust for word, e in after.items()}
        row |= {"best_wake": wake, "thrust_least_N": least, "torque_before_N_m": before.torque}
        row |= {f"torque_{word}_N_m": e.torque for word, e in after.items()}
        rows.append(row)
    return pd.DataFrame(rows)
