"""Diagnose the zig-zags with user-defined terms: a wake that depends on drift, yaw rate and speed.

The hull is fixed and the measured speed is the inflow, so the propeller balance is compared at the
measured flow. Each form of the term is a file (``forms/*.toml``) as a user would write it; its signals
are columns of the recording.
"""

from __future__ import annotations

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

from shaftline.display.figures import ESTIMATE, THESIS
from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.search.catalogue import catalogue, read_entries
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME
from shaftline.plant.replay import Replay, simulate_recording

from ..writing import Panel, against_measured, draw, rms
from .runs import EFFICIENCY, PRINTED_WAKE, RUDDER, SPEED, THRUST, TORQUE, UNSEEN, YAW, Errors, Runs
from .runs import drift_at_propeller as drift

FITTED = ("z_10_05", "z_15_05", "z_20_05", "z_25_05", "z_30_05")
"""Zig-zags with increasing rudder angle, on which the form is chosen and fitted."""

SIGNALS = {"drift_angle": "rad", "yaw_rate": "rad/s", "rudder_angle": "rad"}
"""Signals of the terms: drift at the propeller, yaw rate, rudder angle."""

FORMS = (
    "two-sided",
    "quadratic",
    "quadratic-yaw",
    "table",
    "table-yaw",
    "table-yaw-rudder",
    "table-memory",
    "table-memory-yaw",
)
"""Names of the form files, the simplest first."""


WEIGHTS = (1.0, 0.03)
"""Scales of the errors in the least-squares fit [N, N m]: about the residuals of a good form."""

EVERY = 4  # number of rows that are averaged to one where the term is fitted: 5 Hz
NEAR = 1.02  # factor within which errors count as equally good


class Tried(NamedTuple):
    """Cross-validation of a form: each of the fitted runs left out in turn."""

    name: str  # of the form's file
    numbers: int  # of its parameters
    left_out: dict[str, Errors]  # on each run that was left out, by name

    @property
    def thrust(self) -> float:
        """Rms thrust error over the runs left out, equally weighted [N]."""
        return rms([e.thrust for e in self.left_out.values()])

    @property
    def torque(self) -> float:
        """Rms torque error over the runs left out [N m]."""
        return rms([e.torque for e in self.left_out.values()])


def file_of(form: str) -> Path:
    """Return the file of a form."""
    return Path(__file__).with_name("forms") / f"{form}.toml"


def fixed_hull(ship: Ship) -> Ship:
    """Return the ship with a fixed hull and the signals of the terms."""
    return ship.with_values({"hull.fixed": True}).with_signals(SIGNALS)


def propeller_table(run: pd.DataFrame, every: int = 1) -> pd.DataFrame:
    """Return the channels of a run with the measured speed as inflow, and the signals.

    ``every`` rows are averaged to one.
    """
    table = run[[TIME, SHAFT_SPEED, TORQUE, THRUST]].assign(
        inflow_velocity_m_s=(1.0 - PRINTED_WAKE) * run[SPEED],
        drift_angle=drift(run),
        yaw_rate=run[YAW],
        rudder_angle=run[RUDDER],
    )
    whole = len(table) // every * every
    return table.iloc[:whole].groupby(np.arange(whole) // every).mean() if every > 1 else table


def with_form(ship: Ship, form: str) -> tuple[Ship, tuple[str, ...]]:
    """Return the ship with a form's term at its first values, and the keys that are fitted."""
    (effect,) = read_entries(file_of(form))
    first = {parameter.key: parameter.probes[0] for parameter in effect.parameters}
    return effect.on(ship).with_values(first), (EFFICIENCY, *first)


def errors_in_flow(ship: Ship, run: pd.DataFrame) -> Errors:
    """Return the rms errors of a ship with a fixed hull on a whole run."""
    table = propeller_table(run)
    found = Replay(ship, table).simulate(ship.record())
    return Errors(rms(found["thrust"] - table[THRUST]), rms(found["shaft_torque"] - table[TORQUE]))


def fit_least_squares(
    ship: Ship, keys: Sequence[str], runs: Sequence[pd.DataFrame], weights: tuple[float, float]
) -> Ship:
    """Return the ship with the parameters of least squared error on whole runs, from its own on.

    ``weights`` are the scales of thrust [N] and torque [N m]; infinite where a channel is not fitted.
    """
    tables = [propeller_table(run, EVERY) for run in runs]
    replays = [Replay(ship, table) for table in tables]
    numbers = [ship.parameter(key) for key in keys]
    start = np.array([number.value for number in numbers])
    record = ship.record()
    channels = tuple(zip(("thrust", "shaft_torque"), (THRUST, TORQUE), weights, strict=True))

    def residuals(values: NDArray[np.float64]) -> NDArray[np.float64]:
        for number, value in zip(numbers, values, strict=True):
            number.write(record, float(value))
        parts = []
        for replay, table in zip(replays, tables, strict=True):
            found = replay.simulate(record)
            parts += [(found[name] - table[c].to_numpy()) / weight for name, c, weight in channels]
        return np.concatenate(parts)

    found = scipy.optimize.least_squares(
        residuals,
        start,
        x_scale=np.maximum(np.abs(start), 0.1),
        max_nfev=60,
        bounds=scipy.optimize.Bounds(*np.transpose([n.search_range for n in numbers])),
    )
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
    ship: Ship, runs: Runs, effects: tuple[Path, ...], alone: bool = False
) -> Diagnosis:
    """Diagnose the fitted runs with files of user-defined terms, with the catalogue or alone."""
    exclude = tuple({effect.id for effect in catalogue()}) if alone else ()
    options = Options(effects=effects, exclude=exclude, free=(EFFICIENCY,))
    *fitted, held = (propeller_table(runs[name], EVERY) for name in (*FITTED, UNSEEN))
    return diagnose(ship, *fitted, hold_out=[held], options=options)


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
    """Results with user-defined terms."""

    ship: Ship  # with a fixed hull and the printed values
    tried: tuple[Tried, ...]  # cross-validation of each form
    squares: Ship  # with the chosen form, fitted to FITTED by least squares
    named: Diagnosis  # with the chosen form alone, starting at this fit
    both: Diagnosis  # with the form and the catalogue
    catalogue: Diagnosis  # with the catalogue alone
    bound: Errors  # least errors of the chosen form on the held-out run

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
            here,
            results,
            squares,
            diagnose_flow(here, runs, effects, alone=True),
            diagnose_flow(here, runs, effects),
            diagnose_flow(here, runs, ()),
            least_errors(here, best, runs[UNSEEN]),
        )


def forms_table(own: Own) -> pd.DataFrame:
    """Return the cross-validation of each form."""
    folder, last = "../../reproductions/kvlcc2/forms", FITTED[-1]
    return pd.DataFrame(
        {
            "form": f"[{one.name}]({folder}/{file_of(one.name).name})",
            "parameters": one.numbers,
            "thrust, N": f"{one.thrust:.2f}",
            "torque, mN m": f"{1e3 * one.torque:.0f}",
            f"{last} left out": f"{rest.thrust:.2f}, {1e3 * rest.torque:.0f}",
        }
        for one in own.tried
        for rest in [one.left_out[last]]
    )


def diagnoses_table(own: Own, runs: Runs) -> pd.DataFrame:
    """Return verdict, effects and errors of each diagnosis."""
    rows = []
    for title, found in (
        ("as printed", None),
        ("catalogue alone", own.catalogue),
        (f"{own.form.name} alone", own.named),
        (f"catalogue and {own.form.name}", own.both),
    ):
        ship = found.corrected if found else own.ship
        thrust, torque = map(
            rms, zip(*(errors_in_flow(ship, runs[n]) for n in FITTED), strict=True)
        )
        unseen = errors_in_flow(ship, runs[UNSEEN])
        rows.append(
            {
                "candidates": title,
                "verdict": found.verdict if found else "",
                "identified": " + ".join(f.effect.label for f in found.findings) if found else "",
                "thrust, five fitted": f"{thrust:.2f}",
                f"thrust, {UNSEEN}": f"{unseen.thrust:.2f}",
                "torque, five fitted": f"{1e3 * torque:.0f}",
                f"torque, {UNSEEN}": f"{1e3 * unseen.torque:.0f}",
            }
        )
    return pd.DataFrame(rows)


def ranges(runs: Runs, *names: str) -> tuple[float, float]:
    """Return the largest drift at the propeller [deg] and the least speed [m/s] of some runs."""
    largest = max(float(np.abs(drift(runs[name])).max()) for name in names)
    return float(np.degrees(largest)), min(float(runs[name][SPEED].min()) for name in names)


def figure_of(own: Own, runs: Runs) -> Figure:
    """Draw thrust and torque of the held-out run: measured, as printed, and with the term."""
    run = runs[UNSEEN]
    table = propeller_table(run)
    before, after = (simulate_recording(s, table) for s in (own.ship, own.named.corrected))
    labels = f"w = {PRINTED_WAKE:.2f}, printed", "corrected, five runs fitted"
    title = f"{UNSEEN}, held out (fitted at {20 // EVERY} Hz)"
    panels = []
    for column, ylabel in ((THRUST, "thrust [N]"), (TORQUE, "torque [N m]")):
        simulated = dict(zip(labels, (before[column], after[column]), strict=True))
        lines = against_measured(run[TIME], run[column], simulated, (THESIS, ESTIMATE))
        settings = {"ylabel": ylabel, "title": title if column == THRUST else ""}
        panels.append(Panel(lines, settings, 3 if column == THRUST else 0))
    return draw(panels, (10.0, 6.0), xlabel="time [s]")
