"""Diagnose the zig-zags with user-defined terms: a wake that depends on drift, yaw rate and speed.

The hull is fixed and the measured speed is the inflow, so the propeller balance is compared at the
measured flow. Each form of the term is a file (``forms/*.toml``) as a user would write it; its signals
are columns of the recording.
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
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.display import figures
from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.search.catalogue import catalogue, read_entries
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME
from shaftline.plant.replay import Replay, simulate_recording

from .runs import (
    EFFICIENCY,
    PRINTED_WAKE,
    RUDDER,
    SPEED,
    THRUST,
    TORQUE,
    UNSEEN,
    YAW,
    Errors,
    Runs,
    drift_at_propeller,
)

FITTED = ("z_10_05", "z_15_05", "z_20_05", "z_25_05", "z_30_05")
"""Zig-zags with increasing rudder angle, on which the form is chosen and fitted."""

SIGNALS = {"drift_angle": "rad", "yaw_rate": "rad/s", "rudder_angle": "rad"}
"""Signals of the terms: drift at the propeller, yaw rate, rudder angle."""

FORMS = (
    "two-sided", "quadratic", "quadratic-yaw", "table", "table-yaw", "table-yaw-rudder",
    "table-memory", "table-memory-yaw",
)  # fmt: skip
"""Names of the form files, the simplest first."""


WEIGHTS = (1.0, 0.03)
"""Scales of the errors in the least-squares fit [N, N m]: about the residuals of a good form."""

EVERY = 4
"""Number of rows that are averaged to one where the term is fitted: 5 Hz."""

NEAR = 1.02
"""Factor within which errors count as equally good."""


class Tried(NamedTuple):
    """Cross-validation of a form: each of the fitted runs left out in turn.

    Args:
        name: name of the form's file.
        numbers: number of its parameters.
        left_out: errors on each run that was left out, by name.
    """

    name: str
    numbers: int
    left_out: dict[str, Errors]

    @property
    def thrust(self) -> float:
        """Rms thrust error over the runs left out, equally weighted [N]."""
        return float(np.sqrt(np.mean([e.thrust**2 for e in self.left_out.values()])))

    @property
    def torque(self) -> float:
        """Rms torque error over the runs left out [N m]."""
        return float(np.sqrt(np.mean([e.torque**2 for e in self.left_out.values()])))


def file_of(form: str) -> Path:
    """Return the file of a form."""
    return Path(str(importlib.resources.files(__package__).joinpath("forms", f"{form}.toml")))


def fixed_hull(ship: Ship) -> Ship:
    """Return the ship with a fixed hull and the signals of the terms."""
    return ship.with_values({"hull.fixed": True}).with_signals(SIGNALS)


def propeller_table(run: pd.DataFrame, every: int = 1) -> pd.DataFrame:
    """Return the channels of a run with the measured speed as inflow, and the signals.

    Args:
        run: recording.
        every: number of rows that are averaged to one.
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
    """Return the ship with a form's term at its first values, and the keys that are fitted."""
    (effect,) = read_entries(file_of(form))
    first = {parameter.key: parameter.probes[0] for parameter in effect.parameters}
    return effect.on(ship).with_values(first), (EFFICIENCY, *first)


def errors_in_flow(ship: Ship, run: pd.DataFrame) -> Errors:
    """Return the rms errors of a ship with a fixed hull on a whole run."""
    table = propeller_table(run)
    simulated = Replay(ship, table).simulate(ship.record())
    thrust = simulated["thrust"] - table[THRUST]
    torque = simulated["shaft_torque"] - table[TORQUE]
    return Errors(float(np.sqrt(np.mean(thrust**2))), float(np.sqrt(np.mean(torque**2))))


def fit_least_squares(
    ship: Ship, keys: Sequence[str], runs: Sequence[pd.DataFrame], weights: tuple[float, float]
) -> Ship:
    """Return the ship with the parameters of least squared error on whole runs.

    Args:
        ship: ship with a fixed hull; the search starts at its parameters.
        keys: keys of the free parameters.
        runs: runs to fit.
        weights: scales of thrust [N] and torque [N m]; infinite where a channel is not fitted.
    """
    tables = [propeller_table(run, EVERY) for run in runs]
    replays = [Replay(ship, table) for table in tables]
    numbers = [ship.parameter(key) for key in keys]
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
        bounds=([n.search_range[0] for n in numbers], [n.search_range[1] for n in numbers]),
    )  # fmt: skip
    return ship.with_values(dict(zip(keys, map(float, found.x), strict=True)))


def write_start(form: str, ship: Ship, folder: Path) -> Path:
    """Write a copy of a form's file that starts at the parameters of a ship; return its path."""
    tree = tomllib.loads(file_of(form).read_text(encoding="utf-8"))
    (entry,) = tree["term"]
    (term,) = ship.term
    for name, number in entry["parameters"].items():
        number["probes"] = [term.parameters[name].value]
        number.pop("signed", None)
    path = folder / f"{form}.toml"
    path.write_text(tomli_w.dumps(tree), encoding="utf-8")
    return path


def diagnose_flow(
    ship: Ship, runs: Runs, effects: tuple[Path, ...], every: int = EVERY, alone: bool = False
) -> Diagnosis:
    """Diagnose the fitted runs with user-defined terms; the last run is held out.

    Args:
        ship: ship with a fixed hull.
        runs: all runs.
        effects: files of the terms.
        every: number of rows that are averaged to one.
        alone: whether to exclude the catalogue.
    """
    exclude = tuple({effect.id for effect in catalogue()}) if alone else ()
    options = Options(effects=effects, exclude=exclude, free=(EFFICIENCY,))
    tables = [propeller_table(runs[name], every) for name in FITTED]
    return diagnose(ship, *tables, hold_out=[propeller_table(runs[UNSEEN], every)], options=options)


def cross_validate(ship: Ship, runs: Runs, form: str) -> Tried:
    """Fit a form to four of the fitted runs and evaluate it on the fifth, each in turn."""
    start, keys = with_form(ship, form)
    left_out = {}
    for name in FITTED:
        rest = [runs[other] for other in FITTED if other != name]
        left_out[name] = errors_in_flow(fit_least_squares(start, keys, rest, WEIGHTS), runs[name])
    return Tried(form, len(keys) - 1, left_out)


def choose_form(results: Sequence[Tried]) -> Tried:
    """Return the simplest of the forms within :data:`NEAR` of the least thrust error."""
    least = min(result.thrust for result in results)
    near = [result for result in results if result.thrust <= NEAR * least]
    return min(near, key=lambda result: (result.numbers, result.thrust))


def least_errors(ship: Ship, form: str, run: pd.DataFrame) -> Errors:
    """Return the errors of a form that is fitted to the run itself, thrust and torque separately.

    This is a lower bound, not a result.
    """
    start, keys = with_form(ship, form)
    start = fit_least_squares(start, keys, [run], WEIGHTS)
    thrust = fit_least_squares(start, keys, [run], (WEIGHTS[0], np.inf))
    torque = fit_least_squares(start, keys, [run], (np.inf, WEIGHTS[1]))
    return Errors(errors_in_flow(thrust, run).thrust, errors_in_flow(torque, run).torque)


class Own(NamedTuple):
    """Results with user-defined terms.

    Args:
        ship: ship with a fixed hull and the printed values.
        tried: cross-validation of each form.
        squares: ship with the chosen form, fitted to :data:`FITTED` by least squares.
        named: diagnosis with the chosen form alone, starting at this fit.
        both: diagnosis with the form and the catalogue.
        catalogue: diagnosis with the catalogue alone.
        bound: least errors of the chosen form on the held-out run.
    """

    ship: Ship
    tried: tuple[Tried, ...]
    squares: Ship
    named: Diagnosis
    both: Diagnosis
    catalogue: Diagnosis
    bound: Errors

    @property
    def form(self) -> Tried:
        """Form that the fitted runs choose."""
        return choose_form(self.tried)


def own_terms(ship: Ship, runs: Runs) -> Own:
    """Choose a form on the fitted runs and diagnose with it."""
    here = fixed_hull(ship)
    results = tuple(cross_validate(here, runs, form) for form in FORMS)
    best = choose_form(results).name
    start, keys = with_form(here, best)
    squares = fit_least_squares(start, keys, [runs[name] for name in FITTED], WEIGHTS)
    with tempfile.TemporaryDirectory() as folder:
        effects = (write_start(best, squares, Path(folder)),)
        return Own(
            here, results, squares, diagnose_flow(here, runs, effects, alone=True),
            diagnose_flow(here, runs, effects), diagnose_flow(here, runs, ()),
            least_errors(here, best, runs[UNSEEN]),
        )  # fmt: skip


def forms_table(own: Own) -> pd.DataFrame:
    """Return the cross-validation of each form."""
    rows = []
    for result in own.tried:
        link = f"[{result.name}](../../reproductions/kvlcc2/forms/{file_of(result.name).name})"
        last = result.left_out[FITTED[-1]]
        rows.append(
            (link, result.numbers, f"{result.thrust:.2f}", f"{1e3 * result.torque:.0f}",
             f"{last.thrust:.2f}, {1e3 * last.torque:.0f}")
        )  # fmt: skip
    columns = ["form", "parameters", "thrust, N", "torque, mN m", f"{FITTED[-1]} left out"]
    return pd.DataFrame(rows, columns=columns)


def diagnoses_table(own: Own, runs: Runs) -> pd.DataFrame:
    """Return verdict, effects and errors of each diagnosis."""
    rows = []
    cases: list[tuple[str, Ship, Diagnosis | None]] = [("as printed", own.ship, None)]
    cases += [
        (title, found.corrected, found)
        for title, found in (
            ("catalogue alone", own.catalogue),
            (f"{own.form.name} alone", own.named),
            (f"catalogue and {own.form.name}", own.both),
        )
    ]
    for title, ship, found in cases:
        errors = [errors_in_flow(ship, runs[name]) for name in FITTED]
        fitted = Errors(*(float(x) for x in np.sqrt(np.mean(np.square(errors), axis=0))))
        unseen = errors_in_flow(ship, runs[UNSEEN])
        rows.append(
            {
                "candidates": title,
                "verdict": found.verdict if found else "",
                "identified": " + ".join(f.effect.label for f in found.findings) if found else "",
                "thrust, five fitted": f"{fitted.thrust:.2f}",
                f"thrust, {UNSEEN}": f"{unseen.thrust:.2f}",
                "torque, five fitted": f"{1e3 * fitted.torque:.0f}",
                f"torque, {UNSEEN}": f"{1e3 * unseen.torque:.0f}",
            }
        )
    return pd.DataFrame(rows)


def ranges(runs: Runs, *names: str) -> tuple[float, float]:
    """Return the largest drift at the propeller [deg] and the least speed [m/s] of some runs."""
    drift = max(float(np.abs(drift_at_propeller(runs[name])).max()) for name in names)
    return float(np.degrees(drift)), min(float(runs[name][SPEED].min()) for name in names)


def figure_of(own: Own, runs: Runs) -> Figure:
    """Draw thrust and torque of the held-out run: measured, as printed, and with the term."""
    run = runs[UNSEEN]
    table = propeller_table(run)
    figure, axes = figures.new_figure(2, 1, (10.0, 6.0))
    for axis, column, unit in zip(axes[:, 0], (THRUST, TORQUE), ("N", "N m"), strict=True):
        axis.plot(run[TIME], run[column], color=figures.TRUTH, linewidth=0.8, label="measured")
        for ship, label, colour, style in (
            (own.ship, f"w = {PRINTED_WAKE:.2f}, printed", figures.THESIS, "--"),
            (own.named.corrected, "corrected, five runs fitted", figures.ESTIMATE, "-"),
        ):
            simulated = simulate_recording(ship, table)[column]
            axis.plot(run[TIME], simulated, style, color=colour, linewidth=1.3, label=label)
        axis.set_ylabel(f"{'thrust' if column == THRUST else 'torque'} [{unit}]", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].set_title(f"{UNSEEN}, held out (fitted at {20 // EVERY} Hz)", fontsize=9, loc="left")
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
