"""Tables and figure of the performance in service."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..core.files import write_json
from ..display import figures, tables
from .monitoring import DAY_S, YEAR_S, PerformanceReport, step_between

if TYPE_CHECKING:
    from .physical_cause import PhysicalCause


def periods_table(report: PerformanceReport) -> pd.DataFrame:
    """Return mean, trend and step at the start of each period; the step of the first is nan."""
    steps = [(math.nan, math.nan)]
    steps += [step_between(a, b) for a, b in itertools.pairwise(report.periods)]
    return pd.DataFrame(
        {
            "from": [_when(report, period.start_s) for period in report.periods],
            "to": [_when(report, period.end_s) for period in report.periods],
            "days": [period.days for period in report.periods],
            "speed_loss_percent": [period.mean for period in report.periods],
            "ci95_half": [period.mean_half for period in report.periods],
            "trend_percent_per_year": [period.slope for period in report.periods],
            "trend_ci95_half": [period.slope_half for period in report.periods],
            "step_percent": [step for step, _ in steps],
            "step_ci95_half": [half for _, half in steps],
        }
    )


def _when(report: PerformanceReport, time: float) -> str:
    """Return a time as a date, or as a day if the log has no dates."""
    if report.first is None:
        return f"day {time / DAY_S:.0f}"
    return str((report.first + pd.Timedelta(seconds=time)).date())


def report_as_dict(report: PerformanceReport) -> dict[str, Any]:
    """Return a performance report as JSON allows."""
    records = periods_table(report).to_dict("records")
    return {
        "ship": report.ship.name,
        "rows": len(report.rows),
        "rejected": report.rejected,
        "periods": [
            {
                str(k): None if isinstance(v, float) and not math.isfinite(v) else v
                for k, v in row.items()
            }
            for row in records
        ],
        "remarks": list(report.remarks),
    }


def _is_missing(value: Any) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def speed_loss_figure(report: PerformanceReport) -> Figure:
    """Return the daily speed loss over time with the trend of each period."""
    figure, axes = figures.new_figure(1, 1, (9.0, 4.5))
    axis = axes[0, 0]

    def place(time: Any) -> Any:
        if report.first is None:
            return np.asarray(time) / DAY_S
        return report.first + pd.to_timedelta(np.asarray(time), unit="s")

    daily = report.daily
    axis.plot(
        place(daily["time"]),
        daily["speed_loss_percent"],
        ".",
        markersize=3,
        color=figures.THESIS,
        label="daily median",
    )
    for k, period in enumerate(report.periods):
        times = np.linspace(period.start_s, period.end_s, 30)
        line = period.mean + period.slope * (times - times.mean()) / YEAR_S
        axis.plot(
            place(times), line, color=figures.ESTIMATE, linewidth=2, label="" if k else "trend"
        )
        if k:
            axis.axvline(place([period.start_s])[0], color=figures.TRUTH, linestyle=":")
    axis.set(ylabel="speed loss [%]", title=report.ship.name)
    if report.first is None:
        axis.set_xlabel("day")
    axis.legend(frameon=False)
    return figure


def save_performance(
    report: PerformanceReport, folder: Path, causes: Sequence[PhysicalCause] = ()
) -> dict[str, Any]:
    """Write ``periods.csv``, ``daily.csv``, ``report.json`` and ``speed-loss.png``; return the report.

    Args:
        report: analysed performance.
        folder: folder for the files.
        causes: physical causes; the report of each diagnosis is written to ``period-N``, N from 2.
    """
    found = report_as_dict(report)
    for cause in causes:
        row = found["periods"][cause.period]
        row["cause"] = cause.headline
        if cause.diagnosis is not None:
            place = folder / f"period-{cause.period + 1}"
            cause.diagnosis.save(place)
            row["diagnosis"] = f"{place.name}/report.json"
    tables.write_csv(folder, "periods", periods_table(report))
    tables.write_csv(folder, "daily", report.daily)
    figures.save(speed_loss_figure(report), folder / "speed-loss.png")
    write_json(folder / "report.json", found)
    return found
