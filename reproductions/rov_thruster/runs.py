"""Diagnose a real ROV thruster and evaluate the corrected ship on held-out runs.

Nine closed-loop runs of 10 s on a bench (three controllers, three references) are published in the
repository ROV-Thruster-Model; the recordings are not kept here. The runs of two controllers are fitted;
those of the third are held out and simulated open loop from their first row.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.core.rows import true_runs
from shaftline.mismatch import Diagnosis, Options, diagnose, fit_percent
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import TIME, input_columns
from shaftline.plant.recording import read_recording
from shaftline.plant.replay import simulate_recording

from ..writing import rms

CONTROLLERS = ("lookup", "1state", "2statekf1")
REFERENCES = ("step", "sine", "ramp")
SPEED, THRUST = "shaft_speed_rad_s", "thrust_N"

CONSTANTS = "owners' constants"
WHOLE = "owners' constants and dead zone"
AS_RECORDED = "owners' constants, reversals kept"
WITH_THRUST = "owners' constants, thrust measured too"

OWNERS_DEAD_ZONE_V = 0.845
"""Mean of the dead zone in the owners' file, 0.83 V astern and 0.86 V ahead."""

TOLERANCE_FACTOR = 8.0  # factor on the usual tolerances: the owners' constants are initial values
BEFORE_S, AFTER_S = 0.08, 0.2
"""Time around a reversal that is left out of the fit [s]: the tachometer measures a magnitude."""
_SHORTEST_S = 2.0

Key = tuple[str, str]
Runs = dict[Key, pd.DataFrame]


class HeldOutRun(NamedTuple):
    """Errors of the shaft speed on one held-out run."""

    run: Key  # controller and reference
    before: float  # rms error of the ship file [rad/s]
    after: float  # the same of the corrected ship
    fit_before: float  # FitPercent of the ship file
    fit_after: float  # the same of the corrected ship

    @property
    def ratio(self) -> float:
        """Rms error of the corrected ship over that of the ship file."""
        return self.after / self.before


class Split(NamedTuple):
    """A diagnosis on the runs of two controllers, evaluated on those of the third."""

    title: str  # name of the nominal ship and rows
    unseen: str  # controller whose runs are held out
    diagnosis: Diagnosis
    judged: tuple[HeldOutRun, ...]


def load_runs(folder: Path) -> Runs:
    """Return the nine runs of a folder by controller and reference.

    Raises:
        RecordingError: a file is missing or cannot be used.
    """
    required = [*input_columns(load_ship("rov-thruster")), SPEED]
    return {
        (c, r): read_recording(folder / f"closed_loop_{c}_{r}.csv", required)
        for c, r in itertools.product(CONTROLLERS, REFERENCES)
    }


def without_reversals(table: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the parts of a run in which the sign of the measured speed is known.

    The tachometer measures a magnitude. In the two or three rows of a reversal the sign was guessed from
    the voltage; in two of the steps it changes one row early, while the thrust is still astern.
    """
    time = table[TIME].to_numpy()
    unknown = np.zeros(len(time), dtype=bool)
    for column in (SPEED, "motor_voltage_V"):
        values = table[column].to_numpy()
        for row in np.flatnonzero(values[1:] * values[:-1] < 0.0) + 1:
            unknown |= (time >= time[row] - BEFORE_S - 1e-9) & (time < time[row] + AFTER_S - 1e-9)
    parts = [table.iloc[a:b] for a, b in true_runs(~unknown)]
    long = (p for p in parts if np.ptp(p[TIME]) >= _SHORTEST_S - 1e-9)
    return [part.reset_index(drop=True) for part in long]


def with_owners_dead_zone(ship: Ship) -> Ship:
    """Return the owners' whole model: their constants and their dead zone."""
    return ship.with_values({"prime_mover.command_dead_zone_V": OWNERS_DEAD_ZONE_V})


def speed_of(ship: Ship, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the simulated shaft speed [rad/s], open loop from the first row, shape (rows,)."""
    return np.asarray(simulate_recording(ship, table)[SPEED], dtype=np.float64)


def evaluate(nominal: Ship, corrected: Ship, runs: Runs, unseen: str) -> tuple[HeldOutRun, ...]:
    """Return the errors of both ships on all rows of the runs of a controller."""
    found = []
    for run, table in runs.items():
        if run[0] == unseen:
            measured = table[SPEED].to_numpy()
            both = [speed_of(ship, table) for ship in (nominal, corrected)]
            fits = (fit_percent(measured, speed) for speed in both)
            found.append(HeldOutRun(run, *(rms(speed - measured) for speed in both), *fits))
    return tuple(found)


def fitted_and_kept(
    nominal: Ship,
    runs: Runs,
    unseen: str,
    reversals: bool = False,
    channels: tuple[str, ...] = (SPEED,),
) -> tuple[list[pd.DataFrame], list[pd.DataFrame]]:
    """Return the runs of two controllers for a fit: five to fit, the sixth as validation data.

    ``reversals`` keeps the rows in which the sign of the speed was guessed.
    """
    shown: list[list[pd.DataFrame]] = []
    for (controller, _), table in runs.items():
        if controller != unseen:
            kept = table[[*input_columns(nominal), *channels]]
            shown.append([kept] if reversals else without_reversals(kept))
    return [piece for run in shown[:-1] for piece in run], shown[-1]


def split(nominal: Ship, runs: Runs, unseen: str, title: str, **kept: Any) -> Split:
    """Diagnose on the runs of two controllers, and evaluate on those of the third."""
    fitted, held = fitted_and_kept(nominal, runs, unseen, **kept)
    options = Options(tolerance=TOLERANCE_FACTOR, quick=True)
    found = diagnose(nominal, *fitted, hold_out=held, options=options)
    return Split(title, unseen, found, evaluate(nominal, found.corrected, runs, unseen))


def splits(runs: Runs) -> dict[str, list[Split]]:
    """Return the diagnoses with each controller held out in turn, by start."""
    ship = load_ship("rov-thruster")
    starts: dict[str, tuple[Ship, dict[str, Any]]] = {
        CONSTANTS: (ship, {}),
        WHOLE: (with_owners_dead_zone(ship), {}),
        AS_RECORDED: (ship, {"reversals": True}),
        WITH_THRUST: (ship, {"channels": (SPEED, THRUST)}),
    }
    return {
        title: [split(start, runs, c, title, **kept) for c in CONTROLLERS[::-1]]
        for title, (start, kept) in starts.items()
    }


def excess_speed(runs: Runs) -> tuple[float, float]:
    """Return the mean excess speed over the owners' whole model [rad/s], astern and ahead.

    The means are over the rows of all runs with 2.5 V or more.
    """
    whole = with_owners_dead_zone(load_ship("rov-thruster"))
    voltage = np.concatenate([t["motor_voltage_V"].to_numpy() for t in runs.values()])
    more = np.concatenate([t[SPEED].to_numpy() - speed_of(whole, t) for t in runs.values()])
    return float(-np.mean(more[voltage < -2.5])), float(np.mean(more[voltage > 2.5]))


def describe_finding(diagnosis: Diagnosis) -> str:
    """Return the identified effects in a few words."""
    if diagnosis.findings:
        return " + ".join(f.effect.id for f in diagnosis.findings)
    if (shape := diagnosis.shape) is not None:
        return f"a shape over {shape.signal.replace('_', ' ')} ({shape.balance})"
    return "nothing"


def table_of(found: dict[str, list[Split]]) -> pd.DataFrame:
    """Return a row for each held-out run of each split."""
    return pd.DataFrame(
        {
            "start": title,
            "unseen": " ".join(result.run),
            "verdict": one.diagnosis.verdict,
            "named": describe_finding(one.diagnosis),
            "rms_before_rad_s": result.before,
            "rms_after_rad_s": result.after,
            "after/before": result.ratio,
            "fit_before_percent": result.fit_before,
            "fit_after_percent": result.fit_after,
        }
        for title, group in found.items()
        for one in group
        for result in one.judged
    )
