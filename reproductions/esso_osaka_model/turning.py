"""The model as a ship that turns: her owners' captive tests, what the seven runs add, and Nomoto."""

from __future__ import annotations

import importlib.resources
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.mismatch import Diagnosis, Options, diagnose, identify
from shaftline.mismatch.estimate import Tick, silent
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import HEADING, SWAY_SPEED, YAW_RATE
from shaftline.plant.dynamics import loads
from shaftline.plant.expressions import outside_at
from shaftline.plant.manoeuvring import planar_acceleration
from shaftline.plant.replay import Replay, simulate_recording
from shaftline.plant.state import STATE, Inputs, get_state

from .. import nomoto
from .runs import HELD_OUT, SPEED, Recordings

CHANNELS = (YAW_RATE, HEADING, SWAY_SPEED, SPEED)
"""That are judged; the tables' order."""

SURGE = "speed at measured sway and turn"
"""Name of the speed's error where sway speed, rate of turn and heading are the measured ones."""

FREE = (
    "hull.resistance_coefficient_N_s2_m2", "manoeuvring.Y_v", "manoeuvring.N_r",
    "rudder.normal_force_slope",
)  # fmt: skip
"""What is found beside the effects: resistance, damping of sway and yaw, and the rudder. Y_r is named by
the diagnosis, and the runs do not tell N_v from N_r."""

Floats = NDArray[np.float64]


class Turning(NamedTuple):
    """What the page tells of the model that turns."""

    ships: dict[str, Ship]  # by what the page calls them
    said: Diagnosis
    found: Identification
    response: nomoto.Response
    errors: dict[str, pd.DataFrame]  # rms by ship: a row a run, columns CHANNELS and SURGE


def turning_ship() -> Ship:
    """The file with the owners' numbers."""
    return load_ship(str(importlib.resources.files(__package__).joinpath("turning.toml")))


@compiled
def _surge(
    plant: Record,
    states: Any,
    drive: Floats,
    rudder: Floats,
    signals: Floats,
    dt: float,
) -> None:
    """Speeds ahead [m/s] of STATE records at all else that they hold; filled from the first on."""
    for k in range(len(states) - 1):
        slope = 0.0
        for part in range(2):  # Heun's rule, from row to row
            at = k + part
            state = get_state(states[at])
            acts = Inputs(
                drive[at], plant.pitch_ratio_max, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
                rudder[at], 0.0, outside_at(signals, at),
            )  # fmt: skip
            acting = loads(plant, state, acts, plant.pitch_ratio_max)
            push = acting.push - acting.resistance + acting.surge_force
            rate, _, _ = planar_acceleration(
                plant, acting.ahead, acting.across, state.yaw_rate, state.heading, push,
                acting.side_force, acting.yaw_moment,
            )  # fmt: skip
            if part == 0:
                slope = rate
                states[k + 1].ship_speed = states[k].ship_speed + dt * rate
            else:
                states[k + 1].ship_speed = states[k].ship_speed + 0.5 * dt * (slope + rate)


def surge_at_measured(ship: Ship, table: pd.DataFrame) -> Floats:
    """Speed ahead [m/s] by the turning ship's own surge equation, sway and turn being the measured.

    What the surge-only ship is asked: revolutions, rudder, sway speed, rate of turn and wind are given.

    Args:
        ship: that turns, at revolutions that are held.
        table: a recording in canonical columns.
    """
    run = Replay(ship, table)
    plant = ship.record()
    plant["rudder_lag"] = 0.0
    states = np.zeros(run.rows, STATE)
    states["pitch_ratio"] = plant["pitch_ratio_max"]
    for column, state in ((SWAY_SPEED, "sway_speed"), (YAW_RATE, "yaw_rate"), (HEADING, "heading")):
        states[state] = table[column]
    states["ship_speed"][0] = table[SPEED].iloc[0]
    rows = np.repeat(run.signals, run.rows, axis=0) if len(run.signals) == 1 else None
    signals = run.signals[:: 2 * run.per_row] if rows is None else rows
    _surge(
        plant,
        states,
        run.drive_rows,
        run.rudder_rows,
        np.ascontiguousarray(signals),
        run.interval_s,
    )
    return np.asarray(states["ship_speed"])


def _rms(difference: Any) -> float:
    return float(np.sqrt(np.mean(np.square(np.asarray(difference)))))


def errors_of(ship: Ship, tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Rms errors of a ship on each run, free-running from its first row; a row a run.

    Args:
        ship: that turns.
        tables: the runs.
    """
    rows = {}
    for name, table in tables.items():
        sailed = simulate_recording(ship, table)
        rows[name] = {c: _rms(sailed[c] - table[c]) for c in CHANNELS}
        rows[name][SURGE] = _rms(surge_at_measured(ship, table) - table[SPEED])
    return pd.DataFrame(rows).T


def errors_by_nomoto(
    response: nomoto.Response, tables: Mapping[str, pd.DataFrame], length_m: float
) -> pd.DataFrame:
    """The same of Nomoto's model, which has no speed of its own."""
    rows = {}
    for name, table in tables.items():
        sailed = nomoto.sailed(response, table, length_m)
        rows[name] = {c: _rms(sailed[c] - table[c]) for c in CHANNELS if c in sailed}
    return pd.DataFrame(rows).T


def over(errors: pd.DataFrame, names: tuple[str, ...]) -> pd.Series:
    """Root of the mean square of runs' errors, all runs counted alike."""
    return np.sqrt((errors.loc[list(names)] ** 2).mean())


def sailed_by(runs: Recordings, tick: Tick = silent) -> Turning:
    """Diagnose and identify the turning model on the fitted runs, and sail all of them.

    Args:
        runs: with the wind across (:class:`.runs.Recordings`).
        tick: progress.
    """
    ship = turning_ship()
    paths = [runs.paths[name] for name in runs.fitted]
    aside = [runs.paths[name] for name in HELD_OUT]
    options = Options(columns=runs.columns)
    said = diagnose(ship, *paths, hold_out=aside, options=options, tick=tick)
    found = identify(
        said.corrected, *paths, free=FREE, hold_out=aside, columns=runs.columns, tick=tick
    )
    ships = {"captive tests": ship, "diagnosed": said.corrected}
    ships["diagnosed, numbers found"] = found.identified
    tables = runs.tables(said.corrected)
    errors = {what: errors_of(one, tables) for what, one in ships.items()}
    length = ship.manoeuvring.length_m
    response = nomoto.fitted([tables[name] for name in runs.fitted], length)
    errors["Nomoto"] = errors_by_nomoto(response, tables, length)
    return Turning(ships, said, found, response, errors)
