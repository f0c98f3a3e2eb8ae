"""Diagnose and identify the manoeuvring ship of captive tests, in comparison with Nomoto's model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.mismatch import Diagnosis, Options, diagnose, identify
from shaftline.mismatch.estimate import Tick, ignore_progress
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import HEADING, SWAY_SPEED, YAW_RATE
from shaftline.plant.dynamics import loads
from shaftline.plant.expressions import external_at
from shaftline.plant.manoeuvring import planar_acceleration
from shaftline.plant.replay import Replay, simulate_recording
from shaftline.plant.state import STATE, get_state, inputs_without_sea

from .. import nomoto
from ..writing import Panel, draw, rms
from .runs import HELD_OUT, HERE, SPEED, Recordings

SURGE = "speed at measured sway and turn"
"""Name of the speed error with measured sway speed, rate of turn and heading."""

FREE = (
    "hull.resistance_coefficient_N_s2_m2",
    "manoeuvring.Y_v",
    "manoeuvring.N_r",
    "rudder.normal_force_slope",
)
"""Free parameters: resistance, damping of sway and yaw, rudder. The diagnosis identifies Y_r, and
the runs cannot distinguish N_v from N_r."""

Floats = NDArray[np.float64]


class Turning(NamedTuple):
    """Results of the manoeuvring ship."""

    ships: dict[str, Ship]  # by their names on the page
    said: Diagnosis
    found: Identification
    response: nomoto.Response
    errors: dict[str, pd.DataFrame]  # rms by ship: a row for each run, columns CHANNELS and SURGE


def turning_ship() -> Ship:
    """Return the ship file with the owners' parameters."""
    return load_ship(HERE / "turning.toml")


@compiled
def _surge(
    plant: Record, states: Any, drive: Floats, rudder: Floats, signals: Floats, dt: float
) -> None:
    """Integrate the speed ahead [m/s] of STATE records with all other states given."""
    for k in range(len(states) - 1):
        slope = 0.0
        for part in range(2):  # Heun's rule, from row to row
            at = k + part
            state = get_state(states[at])
            acts = inputs_without_sea(
                drive[at],
                plant.pitch_ratio_max,
                0.0,
                0.0,
                1.0,
                0.0,
                0.0,
                rudder[at],
                external_at(signals, at),
            )
            acting = loads(plant, state, acts, plant.pitch_ratio_max)
            push = acting.push - acting.resistance + acting.surge_force
            rate, _, _ = planar_acceleration(
                plant,
                acting.ahead,
                acting.across,
                state.yaw_rate,
                state.heading,
                push,
                acting.side_force,
                acting.yaw_moment,
            )
            if part == 0:
                slope = rate
                states[k + 1].ship_speed = states[k].ship_speed + dt * rate
            else:
                states[k + 1].ship_speed = states[k].ship_speed + 0.5 * dt * (slope + rate)


def surge_at_measured(ship: Ship, table: pd.DataFrame) -> Floats:
    """Return the speed ahead by the ship's surge equation at measured sway and turn [m/s].

    As for the surge model, revolutions, rudder, sway speed, rate of turn and wind are given.
    """
    run = Replay(ship, table)
    plant = ship.record()
    plant["rudder_lag"] = 0.0
    states = np.zeros(run.rows, STATE)
    states["pitch_ratio"] = plant["pitch_ratio_max"]
    for column, state in ((SWAY_SPEED, "sway_speed"), (YAW_RATE, "yaw_rate"), (HEADING, "heading")):
        states[state] = table[column]
    states["ship_speed"][0] = table[SPEED].iloc[0]
    constant = len(run.signals) == 1
    signals = run.signals.repeat(run.rows, 0) if constant else run.signals[:: 2 * run.per_row]
    signals = np.ascontiguousarray(signals)
    _surge(plant, states, run.drive_rows, run.rudder_rows, signals, run.interval_s)
    return np.asarray(states["ship_speed"])


def errors_of(ship: Ship, tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the rms errors of a ship on each run, free-running from its first row."""
    errors = nomoto.run_errors(lambda table: simulate_recording(ship, table), tables)
    surge = {n: rms(surge_at_measured(ship, t) - t[SPEED]) for n, t in tables.items()}
    return errors.assign(**{SURGE: pd.Series(surge)})


def simulate_all(runs: Recordings, tick: Tick = ignore_progress) -> Turning:
    """Diagnose and identify the manoeuvring ship on the fitted runs, and simulate all runs."""
    ship = turning_ship()
    paths = [runs.paths[name] for name in runs.fitted]
    held = [runs.paths[name] for name in HELD_OUT]
    columns = runs.columns
    said = diagnose(ship, *paths, hold_out=held, options=Options(columns=columns), tick=tick)
    own = said.corrected
    found = identify(own, *paths, free=FREE, hold_out=held, columns=columns, tick=tick)
    ships = {
        "captive tests": ship,
        "diagnosed": own,
        "diagnosed, then identified": found.identified,
    }
    tables = runs.tables(said.corrected)
    errors = {what: errors_of(one, tables) for what, one in ships.items()}
    length = ship.manoeuvring.length_m
    response = nomoto.fit_response([tables[name] for name in runs.fitted], length)
    errors["Nomoto"] = nomoto.response_errors(response, tables, length)
    return Turning(ships, said, found, response, errors)


TITLES = nomoto.TITLES | {SURGE: f"{SURGE}, m/s"}


def csv_table(turning: Turning) -> pd.DataFrame:
    """Return the rms errors in SI units, a row for each ship and run."""
    table = pd.concat(turning.errors, names=["ship", "run"]).reset_index()
    table["held out"] = np.where(table["run"].isin(HELD_OUT), "yes", "")
    return table[["ship", "run", "held out", *TITLES]]


def errors_table(turning: Turning) -> pd.DataFrame:
    """Return the errors on the fitted and the held-out runs."""
    runs = turning.errors["Nomoto"].index
    fitted = tuple(name for name in runs if name not in HELD_OUT)
    groups = {"seven fitted": fitted, "two held out": HELD_OUT}
    return nomoto.errors_table(turning.errors, groups, TITLES, 0)


def errors_by_run(turning: Turning, channel: str) -> pd.DataFrame:
    """Return the errors of a channel by run and ship."""
    known = {what: own for what, own in turning.errors.items() if channel in own}
    whole = pd.DataFrame({what: own[channel] for what, own in known.items()})
    shown = whole.map(lambda value: nomoto.format_error(channel, value, 0))
    shown.insert(0, "held out", np.where(shown.index.isin(HELD_OUT), "yes", ""))
    return shown.rename_axis("run").reset_index()


def effects_table(turning: Turning) -> pd.DataFrame:
    """Return the identified effects with their parameters."""
    return pd.DataFrame(
        {
            "effect": finding.effect.label,
            "parameter": own.name,
            "file": f"{own.neutral:.3g}",
            "value": f"{own.value:.3g}",
            "95 %": f"{own.ci95[0]:.3g} to {own.ci95[1]:.3g}",
            "unit": own.unit,
            "2 Δ log L": f"{finding.score:.0f}",
        }
        for finding in turning.said.findings
        for own in finding.estimates
    )


def estimates_table(turning: Turning) -> pd.DataFrame:
    """Return the identified parameters."""
    return pd.DataFrame(
        {
            "key": e.key,
            "before": f"{e.neutral:.4g}",
            "identified": f"{e.value:.4g}",
            "95 %": f"{e.ci95[0]:.4g} to {e.ci95[1]:.4g}",
        }
        for e in turning.found.estimates
    )


def summary(turning: Turning) -> dict[str, Any]:
    """Return the numbers of the page's conclusions by name."""

    def at(what: str, channel: str, names: tuple[str, ...] = HELD_OUT) -> float:
        return float(nomoto.mean_errors(turning.errors[what], names)[channel])

    first, named, last = turning.ships
    fitted = tuple(name for name in turning.errors[first].index if name not in HELD_OUT)
    turns = tuple(name for name in fitted if name.startswith("turn"))
    k = next(e.value for f in turning.said.findings for e in f.estimates if "wind-side" in e.key)
    rates = {
        what: [f"{np.degrees(at(what, YAW_RATE, names)):.2f}" for names in (HELD_OUT, fitted)]
        for what in ("Nomoto", first, named, last)
    }
    return {
        "rates": rates,
        "sway": [at(what, SWAY_SPEED) for what in (first, named)],
        "k": k,
        "side_force": k / (0.5 * 1.166 * 0.52038),
        "surge": at(named, SURGE),
        "speed": at(named, SPEED),
        "turns": [at(first, channel, turns) for channel in (SPEED, SURGE)],
        "worst": turning.errors[named][SURGE].idxmax(),
        "noise": turning.said.verdict == "nothing-missing",
    }


def figure_of(runs: Recordings, turning: Turning) -> Figure:
    """Draw rate of turn and sway of the held-out runs, measured and simulated."""
    length = turning.ships["captive tests"].manoeuvring.length_m
    tables = runs.tables(turning.ships["diagnosed"])
    panels: list[Panel] = []
    for name in HELD_OUT:
        table = tables[name]
        lines = {what: simulate_recording(ship, table) for what, ship in turning.ships.items()}
        lines["Nomoto"] = nomoto.simulate_response(turning.response, table, length)
        for column in (YAW_RATE, SWAY_SPEED):
            legend, title = 0 if panels else 2, f"{name}, held out"
            panels.append(nomoto.channel_panel(table, lines, column, title, legend))
    return draw(panels, (10.0, 5.6), 2, "time [s]")
