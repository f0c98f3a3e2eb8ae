"""The zig-zags sailed: the plant's turning KVLCC2 steered by the recorded rudder, free-running."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.mismatch import identify
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import HEADING, SHAFT_SPEED, TIME
from shaftline.plant.replay import simulate_recording

from .. import nomoto
from .oblique import FITTED
from .runs import RUDDER, SPEED, SWAY, UNSEEN, YAW, Runs, ship_of

CHANNELS = (YAW, HEADING, SWAY, SPEED)
"""That are judged; the table's order."""

EVERY = 4
"""Rows of 20 Hz of which one is fitted: a zig-zag says nothing at frequencies above."""

THREE = (
    "hull.resistance_coefficient_N_s2_m2", "manoeuvring.N_r", "rudder.normal_force_slope",
)  # fmt: skip
SIX = (*THREE, "manoeuvring.Y_v", "manoeuvring.Y_r", "manoeuvring.N_v")
EIGHT = (*SIX, "rudder.straightening_port", "rudder.straightening_starboard")
SETS = {"three numbers": THREE, "six numbers": SIX, "eight numbers": EIGHT}
"""What is found: drag, damping and rudder; every linear derivative; and the flow at the rudder too."""


class Turning(NamedTuple):
    """What the page tells of the turning ship."""

    ships: dict[str, Ship]  # by what the page calls them
    found: dict[str, Identification]  # those with numbers that were found
    response: nomoto.Response
    errors: pd.DataFrame  # rms, a row a run, columns (ship, channel)


def steered_runs(runs: Runs) -> Runs:
    """The runs with the rudder's angle positive where it turns to starboard; in the files, to port."""
    kept = [TIME, SHAFT_SPEED, RUDDER, *CHANNELS]
    return {name: run[kept].assign(**{RUDDER: -run[RUDDER]}) for name, run in runs.items()}


def with_own_propeller(folder: Path) -> Ship:
    """The published turning ship behind the propeller that this model had, with its printed wake.

    Args:
        folder: of the recordings and the open-water table.

    Raises:
        RecordingError: no open-water table, or one that cannot be used.
    """
    tree, own = load_ship("kvlcc2").model_dump(exclude_unset=True), ship_of(folder)
    mine = own.model_dump(exclude_unset=True)
    tree["propeller"] = mine["propeller"]
    tree["hull"] |= {key: mine["hull"][key] for key in ("wake_fraction", "thrust_deduction")}
    return Ship.model_validate(tree).with_values({"integration.time_step_s": 0.1})


def errors_of(ship: Ship, runs: Runs) -> pd.DataFrame:
    """Rms errors of a ship on each run, free-running from its first row; a row a run.

    Args:
        ship: that turns.
        runs: of :func:`steered_runs`.
    """
    rows = {}
    for name, run in runs.items():
        sailed = simulate_recording(ship, run)
        rows[name] = {c: _rms(sailed[c] - run[c]) for c in CHANNELS}
    return pd.DataFrame(rows).T


def _rms(difference: pd.Series) -> float:
    return float(np.sqrt(np.mean(np.square(difference.to_numpy()))))


def over(errors: pd.DataFrame, names: tuple[str, ...]) -> pd.Series:
    """Root of the mean square of runs' errors, all runs counted alike."""
    return np.sqrt((errors.loc[list(names)] ** 2).mean())


def groups(errors: pd.DataFrame) -> dict[str, tuple[str, ...]]:
    """The runs by what they are for."""
    others = tuple(name for name in errors.index if name not in (*FITTED, UNSEEN))
    return {"five fitted": FITTED, "seven others": others, UNSEEN: (UNSEEN,)}


def sailed_by(folder: Path, runs: Runs) -> Turning:
    """Sail all runs, as published and with numbers found on five of them.

    Args:
        folder: of the recordings and the open-water table.
        runs: as they were loaded.
    """
    steered = steered_runs(runs)
    own = with_own_propeller(folder)
    tables = [steered[name].iloc[::EVERY].reset_index(drop=True) for name in FITTED]
    aside = [steered[UNSEEN].iloc[::EVERY].reset_index(drop=True)]
    found = {what: identify(own, *tables, hold_out=aside, free=keys) for what, keys in SETS.items()}
    ships = {"as published": load_ship("kvlcc2"), "her own propeller": own}
    ships |= {what: one.identified for what, one in found.items()}
    length = own.manoeuvring.length_m
    response = nomoto.fitted([steered[name] for name in FITTED], length)
    errors = {what: errors_of(ship, steered) for what, ship in ships.items()}
    rows = {}
    for name, run in steered.items():
        sailed = nomoto.sailed(response, run, length)
        rows[name] = {c: _rms(sailed[c] - run[c]) for c in CHANNELS if c in sailed}
    errors["Nomoto"] = pd.DataFrame(rows).T
    return Turning(ships, found, response, pd.concat(errors, axis=1))
