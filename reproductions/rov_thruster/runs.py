"""A real ROV thruster: what its owners' model leaves out, judged on runs that were never seen.

Nine closed-loop runs of 10 s on a bench, three controllers by three references, published by the
owners of ROV-Thruster-Model; the recordings stay with whoever has them. Two of the controllers' runs are
fitted, the third's are judged, open loop from their first row on.
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
WITH_THRUST = "owners' constants, thrust read too"

OWNERS_DEAD_ZONE_V = 0.845
"""Mean of the dead zone in the owners' own file, 0.83 V astern and 0.86 V ahead."""

TOLERANCE_FACTOR = 8.0
"""Factor on the usual tolerances: the owners' constants are a start, not the truth."""

BEFORE_S, AFTER_S = 0.08, 0.2
"""Rows around a reversal that are left out of the fit [s]: the tachometer reads a magnitude."""
_SHORTEST_S = 2.0

Key = tuple[str, str]
Runs = dict[Key, pd.DataFrame]


@dataclass(frozen=True)
class Judged:
    """One unseen run.

    Args:
        run: controller and reference.
        before: rms error of the shaft speed [rad/s], nominal; then corrected.
        after: likewise, corrected.
        fit_before: FitPercent of the shaft speed, nominal.
        fit_after: likewise, corrected.
    """

    run: Key
    before: float
    after: float
    fit_before: float
    fit_after: float

    @property
    def ratio(self) -> float:
        """Rms error after / before."""
        return self.after / self.before


@dataclass(frozen=True)
class Split:
    """A diagnosis on two controllers' runs, judged on the third's.

    Args:
        title: of the split's nominal ship and rows.
        unseen: the controller that is judged.
        diagnosis: what the tool said.
        judged: every unseen run.
    """

    title: str
    unseen: str
    diagnosis: Diagnosis
    judged: tuple[Judged, ...]


def load_runs(folder: Path) -> Runs:
    """The nine runs of a folder, by controller and reference.

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
    """The stretches of a run in which the sign of the measured speed is known.

    The tachometer gives a magnitude. While the shaft reverses, in two to three rows, the sign was
    guessed from the voltage; in two of the steps it turns a row early, the thrust still astern.
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
    """The owners' whole model: their constants and their dead zone."""
    return ship.with_values({"prime_mover.command_dead_zone_V": OWNERS_DEAD_ZONE_V})


def speed_of(ship: Ship, table: pd.DataFrame) -> NDArray[np.float64]:
    """Shaft speed [rad/s] under a run's voltages, open loop from its first row, shape (rows,)."""
    return np.asarray(simulate_recording(ship, table)[SPEED], dtype=np.float64)


def judged(nominal: Ship, corrected: Ship, run: Key, table: pd.DataFrame) -> Judged:
    """Both ships beside one run, every row of it as recorded."""
    measured = table[SPEED].to_numpy()
    before, after = speed_of(nominal, table), speed_of(corrected, table)

    def rms(simulated: Any) -> float:
        return float(np.sqrt(np.mean((simulated - measured) ** 2)))

    return Judged(
        run, rms(before), rms(after), fit_percent(measured, before), fit_percent(measured, after)
    )


def shown_of(
    nominal: Ship,
    runs: Runs,
    unseen: str,
    reversals: bool = False,
    channels: tuple[str, ...] = (SPEED,),
) -> tuple[list[pd.DataFrame], list[pd.DataFrame]]:
    """What a tool is shown of the runs of two controllers: five to fit, the sixth to judge itself by.

    Args:
        nominal: the ship; its demand goes with the channels.
        runs: all nine.
        unseen: the controller whose runs are set aside.
        reversals: keep the rows in which the sign of the speed was guessed.
        channels: measured columns that are compared.
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
    """Diagnose on the runs of two controllers, judge on those of the third, which the tool never sees.

    Args:
        nominal: the ship to start from.
        runs: all nine.
        unseen: the controller whose runs are set aside.
        title: for the page.
        reversals: keep the rows in which the sign of the speed was guessed.
        channels: measured columns that are compared.
    """
    fitted, held = shown_of(nominal, runs, unseen, reversals, channels)
    options = Options(tolerance=TOLERANCE_FACTOR, quick=True)
    found = diagnose(nominal, *fitted, hold_out=held, options=options)
    results = tuple(
        judged(nominal, found.corrected, run, table)
        for run, table in runs.items()
        if run[0] == unseen
    )
    return Split(title, unseen, found, results)


def splits(runs: Runs) -> dict[str, list[Split]]:
    """Every controller set aside in turn, from each start, by title."""
    ship = load_ship("rov-thruster")
    whole = with_owners_dead_zone(ship)
    last = CONTROLLERS[::-1]
    return {
        CONSTANTS: [split(ship, runs, c, CONSTANTS) for c in last],
        WHOLE: [split(whole, runs, c, WHOLE) for c in last],
        AS_RECORDED: [split(ship, runs, c, AS_RECORDED, reversals=True) for c in last],
        WITH_THRUST: [split(ship, runs, c, WITH_THRUST, channels=(SPEED, THRUST)) for c in last],
    }


def beyond_the_owners(runs: Runs) -> tuple[float, float]:
    """By how much the shaft turns faster than the owners' whole model [rad/s], astern and ahead.

    Mean over the rows of all runs with 2.5 V or more.
    """
    whole = with_owners_dead_zone(load_ship("rov-thruster"))
    voltage = np.concatenate([t["motor_voltage_V"].to_numpy() for t in runs.values()])
    more = np.concatenate([t[SPEED].to_numpy() - speed_of(whole, t) for t in runs.values()])
    return float(-np.mean(more[voltage < -2.5])), float(np.mean(more[voltage > 2.5]))


def names_of(diagnosis: Diagnosis) -> str:
    """What was named, in a few words."""
    if diagnosis.findings:
        return " + ".join(f.effect.id for f in diagnosis.findings)
    if diagnosis.shape is not None:
        return (
            f"a shape over {diagnosis.shape.signal.replace('_', ' ')} ({diagnosis.shape.balance})"
        )
    return "nothing"


def table_of(found: dict[str, list[Split]]) -> pd.DataFrame:
    """Every unseen run of every split, one row each."""
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
                        "named": names_of(diagnosis),
                        "rms_before_rad_s": result.before,
                        "rms_after_rad_s": result.after,
                        "after/before": result.ratio,
                        "fit_before_percent": result.fit_before,
                        "fit_after_percent": result.fit_after,
                    }
                )
    return pd.DataFrame(rows)
