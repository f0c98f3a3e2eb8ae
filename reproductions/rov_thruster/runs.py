"""Diagnose a real ROV thruster and evaluate the corrected ship on held-out runs.

Nine closed-loop runs of 10 s on a bench (three controllers, three references) are published in the
repository ROV-Thruster-Model; the recordings are not kept here. The runs of two controllers are fitted;
those of the third are held out and simulated open loop from their first row.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.mismatch import Diagnosis, Options, diagnose, fit_percent
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import TIME, input_columns
from shaftline.plant.recording import read_recording
from shaftline.plant.replay import simulate_recording

CONTROLLERS = ("lookup", "1state", "2statekf1")
REFERENCES = ("step", "sine", "ramp")
SPEED, THRUST = "shaft_speed_rad_s", "thrust_N"

CONSTANTS = "owners' constants"
WHOLE = "owners' constants and dead zone"
AS_RECORDED = "owners' constants, reversals kept"
WITH_THRUST = "owners' constants, thrust measured too"

OWNERS_DEAD_ZONE_V = 0.845
"""Mean of the dead zone in the owners' file, 0.83 V astern and 0.86 V ahead."""

TOLERANCE_FACTOR = 8.0
"""Factor on the usual tolerances: the owners' constants are initial values."""

BEFORE_S, AFTER_S = 0.08, 0.2
"""Time around a reversal that is left out of the fit [s]: the tachometer measures a magnitude."""
_SHORTEST_S = 2.0

Key = tuple[str, str]
Runs = dict[Key, pd.DataFrame]


@dataclass(frozen=True)
class HeldOutRun:
    """Errors on one held-out run.

    Args:
        run: controller and reference.
        before: rms error of the shaft speed of the ship file [rad/s].
        after: the same of the corrected ship.
        fit_before: FitPercent of the shaft speed of the ship file.
        fit_after: the same of the corrected ship.
    """

    run: Key
    before: float
    after: float
    fit_before: float
    fit_after: float

    @property
    def ratio(self) -> float:
        """Rms error of the corrected ship over that of the ship file."""
        return self.after / self.before


@dataclass(frozen=True)
class Split:
    """A diagnosis on the runs of two controllers, evaluated on those of the third.

    Args:
        title: name of the nominal ship and rows.
        unseen: controller whose runs are held out.
        diagnosis: the diagnosis.
        judged: errors on each held-out run.
    """

    title: str
    unseen: str
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
        for c in CONTROLLERS
        for r in REFERENCES
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
    edges = np.flatnonzero(np.diff(np.concatenate([[1], unknown, [1]])))
    return [
        table.iloc[a:b].reset_index(drop=True)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if time[b - 1] - time[a] >= _SHORTEST_S - 1e-9
    ]


def with_owners_dead_zone(ship: Ship) -> Ship:
    """Return the owners' whole model: their constants and their dead zone."""
    return ship.with_values({"prime_mover.command_dead_zone_V": OWNERS_DEAD_ZONE_V})


def speed_of(ship: Ship, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the simulated shaft speed [rad/s], open loop from the first row, shape (rows,)."""
    return np.asarray(simulate_recording(ship, table)[SPEED], dtype=np.float64)


def evaluate_run(nominal: Ship, corrected: Ship, run: Key, table: pd.DataFrame) -> HeldOutRun:
    """Return the errors of both ships on all rows of a run."""
    measured = table[SPEED].to_numpy()
    before, after = speed_of(nominal, table), speed_of(corrected, table)

    def rms(simulated: Any) -> float:
        return float(np.sqrt(np.mean((simulated - measured) ** 2)))

    return HeldOutRun(
        run, rms(before), rms(after), fit_percent(measured, before), fit_percent(measured, after)
    )


def fitted_and_kept(
    nominal: Ship,
    runs: Runs,
    unseen: str,
    reversals: bool = False,
    channels: tuple[str, ...] = (SPEED,),
) -> tuple[list[pd.DataFrame], list[pd.DataFrame]]:
    """Return the runs of two controllers for a fit: five to fit, the sixth as validation data.

    Args:
        nominal: ship; its command column is kept.
        runs: all nine.
        unseen: controller whose runs are held out.
        reversals: whether to keep the rows in which the sign of the speed was guessed.
        channels: measured columns.
    """
    shown: list[list[pd.DataFrame]] = []
    for (controller, _), table in runs.items():
        if controller != unseen:
            kept = table[[*input_columns(nominal), *channels]]
            shown.append([kept] if reversals else without_reversals(kept))
    return [piece for run in shown[:-1] for piece in run], shown[-1]


def split(
    nominal: Ship,
    runs: Runs,
    unseen: str,
    title: str,
    reversals: bool = False,
    channels: tuple[str, ...] = (SPEED,),
) -> Split:
    """Diagnose on the runs of two controllers, and evaluate on those of the third.

    Args:
        nominal: ship to start from.
        runs: all nine.
        unseen: controller whose runs are held out.
        title: name for the page.
        reversals: whether to keep the rows in which the sign of the speed was guessed.
        channels: measured columns.
    """
    fitted, held = fitted_and_kept(nominal, runs, unseen, reversals, channels)
    options = Options(tolerance=TOLERANCE_FACTOR, quick=True)
    found = diagnose(nominal, *fitted, hold_out=held, options=options)
    results = tuple(
        evaluate_run(nominal, found.corrected, run, table)
        for run, table in runs.items()
        if run[0] == unseen
    )
    return Split(title, unseen, found, results)


def splits(runs: Runs) -> dict[str, list[Split]]:
    """Return the diagnoses with each controller held out in turn, by start."""
    ship = load_ship("rov-thruster")
    whole = with_owners_dead_zone(ship)
    last = CONTROLLERS[::-1]
    return {
        CONSTANTS: [split(ship, runs, c, CONSTANTS) for c in last],
        WHOLE: [split(whole, runs, c, WHOLE) for c in last],
        AS_RECORDED: [split(ship, runs, c, AS_RECORDED, reversals=True) for c in last],
        WITH_THRUST: [split(ship, runs, c, WITH_THRUST, channels=(SPEED, THRUST)) for c in last],
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
    if diagnosis.shape is not None:
        return (
            f"a shape over {diagnosis.shape.signal.replace('_', ' ')} ({diagnosis.shape.balance})"
        )
    return "nothing"


def table_of(found: dict[str, list[Split]]) -> pd.DataFrame:
    """Return a row for each held-out run of each split."""
    rows = []
    for title, group in found.items():
        for one in group:
            diagnosis = one.diagnosis
            for result in one.judged:
                rows.append(
                    {
                        "start": title,
                        "unseen": " ".join(result.run),
                        "verdict": diagnosis.verdict,
                        "named": describe_finding(diagnosis),
                        "rms_before_rad_s": result.before,
                        "rms_after_rad_s": result.after,
                        "after/before": result.ratio,
                        "fit_before_percent": result.fit_before,
                        "fit_after_percent": result.fit_after,
                    }
                )
    return pd.DataFrame(rows)
