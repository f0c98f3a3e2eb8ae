"""Estimate the owners' constants with ``identify``, and evaluate them on the same held-out runs.

Parameters are fitted on the runs of two controllers and evaluated on those of the third. For comparison
the same parameters are also fitted to each held-out run itself, which bounds the error from below.
"""

from __future__ import annotations

from collections.abc import Sequence
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

from ..writing import interval, refusal, rms, span
from . import runs as rov
from .runs import CONSTANTS, CONTROLLERS, SPEED, WHOLE, HeldOutRun, Runs

CONSTANT, RESISTANCE = "prime_mover.motor_constant_V_s_rad", "prime_mover.armature_resistance_ohm"
INERTIA = "transmission.inertia_engine_side_kg_m2"
LOAD = "propeller.torque_coefficient"
DEAD_ZONE = "prime_mover.command_dead_zone_V"
OFFSET = "prime_mover.torque_offset_N_m"
REVERSE = "prime_mover.reverse_torque_fraction"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"

REFUSED = ((CONSTANT, RESISTANCE, INERTIA, LOAD), (CONSTANT, RESISTANCE, DEAD_ZONE, LOAD))
"""Parameters that these runs cannot identify together."""

_STEP, _STEP_FROM_ZERO = 0.05, 0.01
"""First steps of the search for the least error: relative, or absolute where a parameter is 0."""


class Freed(NamedTuple):
    """Free parameters of an identification."""

    title: str
    start: str
    keys: tuple[str, ...] | str


SETS = (
    Freed("`--free auto`", CONSTANTS, AUTO),
    Freed("with friction", CONSTANTS, (CONSTANT, RESISTANCE, FRICTION)),
    Freed("with dead zone", CONSTANTS, (CONSTANT, RESISTANCE, DEAD_ZONE)),
    Freed("`--free auto`", WHOLE, AUTO),
    Freed("with torque astern", WHOLE, (CONSTANT, RESISTANCE, DEAD_ZONE, REVERSE)),
    Freed("with torque offset", WHOLE, (CONSTANT, RESISTANCE, DEAD_ZONE, OFFSET)),
)


class Refit(NamedTuple):
    """Parameters estimated on the runs of two controllers, evaluated on those of the third."""

    freed: Freed
    unseen: str  # controller whose runs are held out
    identification: Identification
    judged: tuple[HeldOutRun, ...]
    least: tuple[float, ...]  # least rms error of the shaft speed on each of these runs [rad/s]


def start_of(title: str) -> Ship:
    """Return the ship of a start."""
    ship = load_ship("rov-thruster")
    return rov.with_owners_dead_zone(ship) if title == WHOLE else ship


def refit(freed: Freed, runs: Runs, unseen: str) -> Refit:
    """Estimate parameters on the runs of two controllers, and evaluate them on those of the third."""
    ship = start_of(freed.start)
    fitted, held = rov.fitted_and_kept(ship, runs, unseen)
    found = identify(ship, *fitted, free=freed.keys, hold_out=held, tolerance=rov.TOLERANCE_FACTOR)
    results = rov.evaluate(ship, found.identified, runs, unseen)
    least = tuple(least_error(found, runs[result.run]) for result in results)
    return Refit(freed, unseen, found, results, least)


def refits(runs: Runs) -> list[Refit]:
    """Return the identifications with each controller held out in turn, for each of :data:`SETS`."""
    return [refit(freed, runs, unseen) for freed in SETS for unseen in CONTROLLERS[::-1]]


def least_error(found: Identification, table: pd.DataFrame) -> float:
    """Return the least rms error of the shaft speed on a run with the same parameters free [rad/s].

    The rms error is minimised (Nelder & Mead 1965), starting at the estimated parameters. It is a lower
    bound for other methods.
    """
    free = Free(found.ship, tuple(found.parameters))
    replay = Replay(found.ship, table)
    measured = table[SPEED].to_numpy()
    here = np.array(list(found.parameters.values()))
    sizes = np.where(here == 0.0, _STEP_FROM_ZERO, _STEP * np.abs(here))

    def error(shares: Any) -> float:
        values = free.towards(list(here), list(here + shares * sizes))
        return rms(replay.simulate(free.record(values))[MEASURED[SPEED]] - measured)

    corner = np.zeros(len(here))
    simplex = np.vstack([corner, corner + np.eye(len(here))])
    found_there = scipy.optimize.minimize(
        error,
        corner,
        method="Nelder-Mead",
        options={
            "maxfev": 150 * len(here),
            "xatol": 1e-2,
            "fatol": 1e-4,
            "initial_simplex": simplex,
        },
    )
    return float(found_there.fun)


def refusals(runs: Runs) -> list[str]:
    """Return the messages with which ``identify`` refuses :data:`REFUSED`.

    Raises:
        ValueError: a set is not refused.
    """
    ship = start_of(WHOLE)
    fitted, held = rov.fitted_and_kept(ship, runs, CONTROLLERS[-1])
    options = {"hold_out": held, "tolerance": rov.TOLERANCE_FACTOR}
    return [refusal(ship, fitted, keys, **options) for keys in REFUSED]


def table_of(found: Sequence[Refit]) -> pd.DataFrame:
    """Return a row for each held-out run: errors, and the parameters with their standard errors."""
    rows = []
    for one in found:
        numbers: dict[str, float] = {}
        for e in one.identification.estimates:
            numbers |= {e.name: e.value, f"{e.name}_se": e.standard_error}
        rows += [
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
            for result, least in zip(one.judged, one.least, strict=True)
        ]
    return pd.DataFrame(rows)


SYMBOLS = {
    "motor_constant_V_s_rad": "K_e [V s/rad]",
    "armature_resistance_ohm": "R_a [ohm]",
    "coulomb_friction_engine_side_N_m": "Coulomb friction [N m]",
    "reverse_torque_fraction": "torque astern / ahead",
    "command_dead_zone_V": "dead zone [V]",
    "torque_offset_N_m": "torque offset [N m]",
}


def rows_of(table: pd.DataFrame, freed: Freed) -> pd.DataFrame:
    """Return the rows of one set of free parameters."""
    return table[(table["start"] == freed.start) & (table["freed"] == freed.title)]


def errors_table(start: str, table: pd.DataFrame, diagnosed: pd.DataFrame) -> pd.DataFrame:
    """Return the rms errors from one start: file, diagnosis and each set, the bound in brackets."""
    rows = diagnosed[diagnosed["start"] == start]
    shown = pd.DataFrame({"held-out run": rows["unseen"].to_numpy()})
    shown["ship file"] = rows["rms_before_rad_s"].to_numpy()
    shown["diagnosed"] = rows["rms_after_rad_s"].to_numpy()
    for freed in (freed for freed in SETS if freed.start == start):
        part = rows_of(table, freed).set_index("unseen").loc[shown["held-out run"]]
        pairs = zip(part["rms_after_rad_s"], part["rms_least_rad_s"], strict=True)
        shown[freed.title] = [f"{after:.2f} ({least:.2f})" for after, least in pairs]
    return shown


def estimates_table(found: Sequence[Refit]) -> pd.DataFrame:
    """Return the estimates with their 95 % intervals."""
    rows = []
    for one in found:
        known = [f"{SYMBOLS[e.name]} {interval(e, '.4g')}" for e in one.identification.estimates]
        rows.append((one.freed.start, one.freed.title, one.unseen, "; ".join(known)))
    return pd.DataFrame(rows, columns=["start", "free", "held out", "estimates"])


def summary(found: Sequence[Refit], table: pd.DataFrame, diagnosed: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of the page's conclusions by name; ratios are over sines and ramps."""
    sets = ("auto", "friction", "zone", "whole", "astern", "offset")
    parts = {name: _smooth(rows_of(table, freed)) for name, freed in zip(sets, SETS, strict=True)}
    named = {s: _smooth(diagnosed[diagnosed["start"] == s]) for s in (CONSTANTS, WHOLE)}
    runs = {freed: [one.identification for one in found if one.freed == freed] for freed in SETS}
    first, last = runs[SETS[0]], runs[SETS[-1]]
    nominal = [next(e.neutral for e in one.estimates if e.key == CONSTANT) for one in first]
    constants = [one.parameters[CONSTANT] / n for one, n in zip(first, nominal, strict=True)]
    volts = [p[OFFSET] * p[RESISTANCE] / p[CONSTANT] for p in (one.parameters for one in last)]
    intervals = [e.ci95 for one in last for e in one.estimates if e.key == DEAD_ZONE]
    kept = [span([i.fit_after[SPEED] for i in runs[freed]], 1) for freed in SETS[:2:-1]]
    values: dict[str, Any] = {name: span(part["after/before"]) for name, part in parts.items()}
    better = [_better(parts[name], named[CONSTANTS]) for name in ("friction", "zone")]
    return values | {
        "diagnosed": span(named[CONSTANTS]["after/before"]),
        "constants": span(constants),
        "diagnosed_whole": span(named[WHOLE]["after/before"]),
        "bound": span(parts["auto"]["rms_least_rad_s"] / parts["auto"]["rms_before_rad_s"]),
        "warned": f"{sum(bool(i.warnings) for i in first)} of {len(first)}",
        "better": better,
        "count": len(parts["zone"]),
        "offset_error": span(parts["offset"]["rms_after_rad_s"]),
        "offset_bound": span(parts["offset"]["rms_least_rad_s"]),
        "volts": span(volts, 3),
        "within": sum(low <= rov.OWNERS_DEAD_ZONE_V <= high for low, high in intervals),
        "intervals": len(intervals),
        "kept": kept,
    }


def _smooth(table: pd.DataFrame) -> pd.DataFrame:
    return table[~table["unseen"].str.endswith("step")]


def _better(table: pd.DataFrame, than: pd.DataFrame) -> int:
    """Return on how many held-out runs the error is less."""
    error, other = (t.set_index("unseen")["rms_after_rad_s"] for t in (table, than))
    return int((error < other.loc[error.index]).sum())
