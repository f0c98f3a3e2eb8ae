"""Simulate the zig-zags free-running with the manoeuvring ship ``kvlcc2`` and the recorded rudder."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.mismatch import identify
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import HEADING, SHAFT_SPEED, TIME
from shaftline.plant.replay import simulate_recording

from .. import nomoto
from ..writing import Panel, draw, interval
from .oblique import FITTED
from .runs import RUDDER, UNSEEN, YAW, Runs, ship_of

EVERY = 4
"""One row in so many of 20 Hz is fitted: a zig-zag has no information at higher frequencies."""

THREE = ("hull.resistance_coefficient_N_s2_m2", "manoeuvring.N_r", "rudder.normal_force_slope")
SIX = (*THREE, "manoeuvring.Y_v", "manoeuvring.Y_r", "manoeuvring.N_v")
EIGHT = (*SIX, "rudder.straightening_port", "rudder.straightening_starboard")
SETS = {"three parameters": THREE, "six parameters": SIX, "eight parameters": EIGHT}
"""Free parameters: resistance, damping and rudder; all linear derivatives; and flow straightening."""


class Turning(NamedTuple):
    """Results of the manoeuvring ship."""

    ships: dict[str, Ship]  # by their names on the page
    found: dict[str, Identification]  # identifications
    response: nomoto.Response
    errors: dict[str, pd.DataFrame]  # rms by ship, a row for each run


def steered_runs(runs: Runs) -> Runs:
    """Return the runs with the rudder angle positive for a turn to starboard; in the files, to port."""
    kept = [TIME, SHAFT_SPEED, RUDDER, *nomoto.CHANNELS]
    return {name: run[kept].assign(**{RUDDER: -run[RUDDER]}) for name, run in runs.items()}


def with_own_propeller(folder: Path) -> Ship:
    """Return the published ship with this model's own propeller and its printed wake.

    Raises:
        RecordingError: the open-water table is missing or unusable.
    """
    tree, own = load_ship("kvlcc2").model_dump(exclude_unset=True), ship_of(folder)
    mine = own.model_dump(exclude_unset=True)
    tree["propeller"] = mine["propeller"]
    tree["hull"] |= {key: mine["hull"][key] for key in ("wake_fraction", "thrust_deduction")}
    return Ship.model_validate(tree).with_values({"integration.time_step_s": 0.1})


def errors_of(ship: Ship, runs: Runs) -> pd.DataFrame:
    """Return the rms errors of a ship on each run, free-running from its first row."""
    return nomoto.run_errors(lambda run: simulate_recording(ship, run), runs)


def groups(errors: pd.DataFrame) -> dict[str, tuple[str, ...]]:
    """Return the names of the fitted, the other and the held-out runs."""
    others = tuple(name for name in errors.index if name not in (*FITTED, UNSEEN))
    return {"five fitted": FITTED, "seven others": others, UNSEEN: (UNSEEN,)}


def simulate_all(folder: Path, runs: Runs) -> Turning:
    """Simulate all runs with the published parameters and with parameters identified on five runs."""
    steered = steered_runs(runs)
    own = with_own_propeller(folder)
    tables = [steered[name].iloc[::EVERY].reset_index(drop=True) for name in FITTED]
    kept = [steered[UNSEEN].iloc[::EVERY].reset_index(drop=True)]
    found = {what: identify(own, *tables, hold_out=kept, free=keys) for what, keys in SETS.items()}
    ships = {"as published": load_ship("kvlcc2"), "own propeller": own}
    ships |= {what: one.identified for what, one in found.items()}
    length = own.manoeuvring.length_m
    response = nomoto.fit_response([steered[name] for name in FITTED], length)
    errors = {what: errors_of(ship, steered) for what, ship in ships.items()}
    errors["Nomoto"] = nomoto.response_errors(response, steered, length)
    return Turning(ships, found, response, errors)


DRAWN = ("own propeller", "three parameters", "six parameters")


def errors_table(turning: Turning) -> pd.DataFrame:
    """Return the errors of each ship on the three groups of runs."""
    names = groups(turning.errors["Nomoto"])
    return nomoto.errors_table(turning.errors, names, nomoto.TITLES, 1)


def estimates_table(turning: Turning) -> pd.DataFrame:
    """Return the estimates of each identification with their 95 % intervals."""
    rows = []
    for key in EIGHT:
        row = {"key": key, "published": ""}
        for what, one in turning.found.items():
            known = next((e for e in one.estimates if e.key == key), None)
            row[what] = interval(known) if known else ""
            row["published"] = f"{known.neutral:.4g}" if known else row["published"]
        rows.append(row)
    return pd.DataFrame(rows)


def error_of(turning: Turning, what: str, channel: str, group: str = UNSEEN) -> float:
    """Return an error of a ship on a group of runs; angles in degrees."""
    own = turning.errors[what]
    value = float(nomoto.mean_errors(own, groups(own)[group])[channel])
    return float(np.degrees(value)) if channel in (YAW, HEADING) else value


def figure_of(turning: Turning, runs: Runs) -> Figure:
    """Draw the rate of turn of a fitted and of the held-out run, measured and simulated."""
    names, steered = ("z_20_05", UNSEEN), steered_runs(runs)
    panels: list[Panel] = []
    length = turning.ships[DRAWN[0]].manoeuvring.length_m
    for name in names:
        run = steered[name]
        lines = {what: simulate_recording(turning.ships[what], run) for what in DRAWN}
        lines["Nomoto"] = nomoto.simulate_response(turning.response, run, length)
        title = f"{name}{', held out' if name == UNSEEN else ''}"
        panels.append(nomoto.channel_panel(run, lines, YAW, title, 0 if panels else 3))
    return draw(panels, (9.0, 5.6), xlabel="time [s]")
