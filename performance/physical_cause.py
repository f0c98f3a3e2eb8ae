"""Physical cause of a speed loss: a diagnosis of each period against the first.

The speed loss of ISO 19030 does not say where it arises. If the log also has the commands of the plant
and the shaft speed, the plant is calibrated on the first period and each later period is diagnosed: the
difference is assigned to hull, propeller, engine or instruments.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..mismatch import Diagnosis, Options, Recording, diagnose
from ..mismatch.estimate import Tick, ignore_progress
from ..mismatch.pipeline import begin
from ..plant.columns import TIME
from ..plant.ship import Ship
from .monitoring import DAY_S, PerformanceReport, Period
from .tables import TableError


class PhysicalCause(NamedTuple):
    """Diagnosis of a period, or the reason why there is none."""

    period: int
    """Index of the period in the report."""
    diagnosis: Diagnosis | None
    reason: str
    """Empty with a diagnosis."""

    @property
    def headline(self) -> str:
        """Cause in at most 15 words, or the reason why there is none."""
        return self.reason if self.diagnosis is None else self.diagnosis.headline


def explain_periods(
    report: PerformanceReport, recording: Recording, ship: Ship, tick: Tick = ignore_progress
) -> Iterator[PhysicalCause]:
    """Yield the physical cause of each period after the first.

    Only rows within the reference conditions of the report are used. The parameters of the plant are
    estimated on the rows of the first period.

    Args:
        report: speed loss of the log.
        recording: the same log, read by :func:`shaftline.mismatch.load_recording`.
        ship: propulsion plant of the ship.
        tick: progress callback ``tick(stage, done, total)``.

    Raises:
        TableError: the report has one period only.
        ValueError: the plant cannot be calibrated on the first period.
    """
    if len(report.periods) < 2:
        raise TableError(
            "the log has one period without an event, so there is no earlier condition to compare with; "
            "diagnose a later log against this one: shaftline diagnose LATER --calibrate LOG --ship SHIP"
        )
    reference = rows_of(report.periods[0], report, recording)
    start = begin(ship, Options(calibrate=(reference,)), tick)
    for k, period in enumerate(report.periods[1:], start=1):
        try:
            diagnosis = diagnose(start, rows_of(period, report, recording), tick=tick)
        except ValueError as error:
            yield PhysicalCause(k, None, f"not diagnosed: {error}")
        else:
            yield PhysicalCause(k, diagnosis, "")


def rows_of(period: Period, report: PerformanceReport, recording: Recording) -> pd.DataFrame:
    """Return the rows of a recording in a period and within the reference conditions, at even times."""
    half = 0.5 * DAY_S
    time = report.rows["time"]
    accepted = time[time.between(period.start_s - half, period.end_s + half)]
    kept = np.rint(accepted / recording.interval_s)
    table = recording.table[np.isin(np.arange(len(recording)), kept)].reset_index(drop=True)
    return table.assign(**{TIME: recording.interval_s * np.arange(len(table))})
