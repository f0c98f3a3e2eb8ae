"""Terms of one's own: a wake that follows drift, yaw and speed, tried by ``diagnose`` on the zig-zags.

The hull is held and the measured speed is given as the inflow, so the propeller is judged in the flow
that it met, whatever drift and rudder do to the hull. Every form stands in a file of its own
(``forms/*.toml``), as a user would write it, and hears signals that no channel of the plant is.
"""

from __future__ import annotations

import importlib.resources
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
import tomli_w
from numpy.typing import NDArray

from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.search.catalogue import catalogue, read_entries
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME
from shaftline.plant.replay import Replay

from .numbers import EFFICIENCY, Errors
from .runs import (
    PRINTED_WAKE,
    RUDDER,
    SPEED,
    THRUST,
    TORQUE,
    UNSEEN,
    YAW,
    Runs,
    drift_at_propeller,
)

FITTED = ("z_10_05", "z_15_05", "z_20_05", "z_25_05", "z_30_05")
"""Zig-zags of one kind with rising rudder: the form is chosen and fitted on these alone."""

SIGNALS = {"drift_angle": "rad", "yaw_rate": "rad/s", "rudder_angle": "rad"}
"""What the terms hear: at the propeller, of the ship, of the rudder."""

FORMS = (
    "two-sided", "quadratic", "quadratic-yaw", "table", "table-yaw", "table-yaw-rudder",
    "table-memory", "table-memory-yaw",
)  # fmt: skip
"""Names of the files, the simplest first."""


WEIGHTS = (1.0, 0.03)
"""What one unit of squared error is worth [N, N m]: about what a good form leaves of each."""

EVERY = 4
"""Rows of which one is made where the term is fitted: 5 Hz."""

NEAR = 1.02
"""Forms whose errors differ by less than this factor count as equally good."""


class Tried(NamedTuple):
    """One form, each of the fitted runs left out in turn.

    Args:
        name: of its file.
        numbers: how many it has.
        left_out: errors on each run that was left out, by name.
    """

    name: str
    numbers: int
    left_out: dict[str, Errors]

    @property
    def thrust(self) -> float:
        """Rms thrust error over the runs left out, all counted alike [N]."""
        return float(np.sqrt(np.mean([e.thrust**2 for e in self.left_out.values()])))

    @property
    def torque(self) -> float:
        """Likewise of the torque [N m]."""
        return float(np.sqrt(np.mean([e.torque**2 for e in self.left_out.values()])))


def file_of(form: str) -> Path:
    """The file of a form's term."""
    return Path(str(importlib.resources.files(__package__).joinpath("forms", f"{form}.toml")))


def held(ship: Ship) -> Ship:
    """The ship at a place in the measured flow, with the signals that the terms hear."""
    return ship.with_values({"hull.fixed": True}).with_signals(SIGNALS)


def beside(run: pd.DataFrame, every: int = 1) -> pd.DataFrame:
    """A run's channels with the measured speed as inflow, and the signals.

    Args:
        run: as recorded.
        every: rows of which one is made, by their mean.
    """
    table = run[[TIME, SHAFT_SPEED, TORQUE, THRUST]].copy()
    table["inflow_velocity_m_s"] = (1.0 - PRINTED_WAKE) * run[SPEED]
    table["drift_angle"] = drift_at_propeller(run)
    table["yaw_rate"] = run[YAW]
    table["rudder_angle"] = run[RUDDER]
    if every == 1:
        return table
    whole = len(table) // every * every
    return table.iloc[:whole].groupby(np.arange(whole) // every).mean()


def with_form(ship: Ship, form: str) -> tuple[Ship, tuple[str, ...]]:
    """A held ship with a form's term on it, at the values first tried, and the keys that are fitted.

    Args:
        ship: held.
        form: name of its file.
    """
    (effect,) = read_entries(file_of(form))
    first = {parameter.key: parameter.probes[0] for parameter in effect.parameters}
    return effect.on(ship).with_values(first), (EFFICIENCY, *first)


def errors_in_flow(ship: Ship, run: pd.DataFrame) -> Errors:
    """Rms errors of a held ship on a whole run, from its first row on."""
    table = beside(run)
    simulated = Replay(ship, table).simulate(ship.record())
    thrust = simulated["thrust"] - table[THRUST]
    torque = simulated["shaft_torque"] - table[TORQUE]
    return Errors(float(np.sqrt(np.mean(thrust**2))), float(np.sqrt(np.mean(torque**2))))


def by_squares(
    ship: Ship, keys: Sequence[str], runs: Sequence[pd.DataFrame], weights: tuple[float, float]
) -> Ship:
    """A held ship with the numbers of least squared error on whole runs.

    Args:
        ship: held; the search begins at its numbers.
        keys: of the numbers.
        runs: to fit.
        weights: of thrust [N] and torque [N m]; infinite where a channel does not count.
    """
    tables = [beside(run, EVERY) for run in runs]
    replays = [Replay(ship, table) for table in tables]
    numbers = [ship.number(key) for key in keys]
    start = np.array([number.value for number in numbers])
    record = ship.record()

    def residuals(values: NDArray[np.float64]) -> NDArray[np.float64]:
        for number, value in zip(numbers, values, strict=True):
            number.write(record, float(value))
        parts = []
        for replay, table in zip(replays, tables, strict=True):
            simulated = replay.simulate_into(record)
            parts.append((simulated["thrust"] - table[THRUST].to_numpy()) / weights[0])
            parts.append((simulated["shaft_torque"] - table[TORQUE].to_numpy()) / weights[1])
        return np.concatenate(parts)

    found = scipy.optimize.least_squares(
        residuals, start, x_scale=np.maximum(np.abs(start), 0.1), max_nfev=60,
        bounds=([n.searched[0] for n in numbers], [n.searched[1] for n in numbers]),
    )  # fmt: skip
    return ship.with_values(dict(zip(keys, map(float, found.x), strict=True)))


def begun_at(form: str, ship: Ship, folder: Path) -> Path:
    """A copy of a form's file whose probes are the numbers of a ship that carries it.

    Args:
        form: name of its file.
        ship: held, with the form's term.
        folder: of the copy.
    """
    tree = tomllib.loads(file_of(form).read_text(encoding="utf-8"))
    (entry,) = tree["term"]
    (term,) = ship.term
    for name, number in entry["parameters"].items():
        number["probes"] = [term.parameters[name].value]
        number.pop("signed", None)
    path = folder / f"{form}.toml"
    path.write_text(tomli_w.dumps(tree), encoding="utf-8")
    return path


def diagnosed(
    ship: Ship, runs: Runs, effects: tuple[Path, ...], every: int = EVERY, alone: bool = False
) -> Diagnosis:
    """Terms of one's own tried on the fitted runs, judged on the unseen one.

    Args:
        ship: held.
        runs: all of them.
        effects: files of the terms.
        every: rows of which one is made.
        alone: without the catalogue.
    """
    exclude = tuple({effect.id for effect in catalogue()}) if alone else ()
    options = Options(effects=effects, exclude=exclude, free=(EFFICIENCY,))
    tables = [beside(runs[name], every) for name in FITTED]
    return diagnose(ship, *tables, hold_out=[beside(runs[UNSEEN], every)], options=options)


def tried(ship: Ship, runs: Runs, form: str) -> Tried:
    """One form on four of the fitted runs by least squares, judged on the fifth, each in turn.

    Args:
        ship: held.
        runs: all of them.
        form: name of its file.
    """
    start, keys = with_form(ship, form)
    left_out = {}
    for name in FITTED:
        others = [runs[other] for other in FITTED if other != name]
        left_out[name] = errors_in_flow(by_squares(start, keys, others, WEIGHTS), runs[name])
    return Tried(form, len(keys) - 1, left_out)


def chosen(results: Sequence[Tried]) -> Tried:
    """The form of least thrust error on runs left out; of those that come :data:`NEAR`, the simplest."""
    least = min(result.thrust for result in results)
    near = [result for result in results if result.thrust <= NEAR * least]
    return min(near, key=lambda result: (result.numbers, result.thrust))


def oracle(ship: Ship, form: str, run: pd.DataFrame) -> Errors:
    """The least errors that a form reaches on a run when it is fitted to that run itself.

    No result, but the bound on one: thrust and torque each by least squares for itself.

    Args:
        ship: held.
        form: name of its file.
        run: the run.
    """
    start, keys = with_form(ship, form)
    start = by_squares(start, keys, [run], WEIGHTS)
    thrust = by_squares(start, keys, [run], (WEIGHTS[0], np.inf))
    torque = by_squares(start, keys, [run], (np.inf, WEIGHTS[1]))
    return Errors(errors_in_flow(thrust, run).thrust, errors_in_flow(torque, run).torque)


class Own(NamedTuple):
    """What a term of one's own makes of the zig-zags.

    Args:
        ship: held, with the printed numbers.
        tried: every form, by runs left out.
        squares: the ship with the chosen form, by least squares on :data:`FITTED`.
        named: the diagnosis on them with the chosen form, begun there.
        beside: the same beside the catalogue.
        catalogue: the same with the catalogue alone.
        bound: of the chosen form on the unseen run.
    """

    ship: Ship
    tried: tuple[Tried, ...]
    squares: Ship
    named: Diagnosis
    beside: Diagnosis
    catalogue: Diagnosis
    bound: Errors

    @property
    def form(self) -> Tried:
        """The one that the fitted runs choose."""
        return chosen(self.tried)


def own_terms(ship: Ship, runs: Runs) -> Own:
    """Choose a form by the fitted runs, and hold it against the run that was never seen.

    Args:
        ship: with the printed numbers.
        runs: all of them.
    """
    here = held(ship)
    results = tuple(tried(here, runs, form) for form in FORMS)
    best = chosen(results).name
    start, keys = with_form(here, best)
    squares = by_squares(start, keys, [runs[name] for name in FITTED], WEIGHTS)
    with tempfile.TemporaryDirectory() as folder:
        effects = (begun_at(best, squares, Path(folder)),)
        return Own(
            here, results, squares, diagnosed(here, runs, effects, alone=True),
            diagnosed(here, runs, effects), diagnosed(here, runs, ()),
            oracle(here, best, runs[UNSEEN]),
        )  # fmt: skip
