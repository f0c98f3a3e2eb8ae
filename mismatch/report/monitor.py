"""Write the result of a condition monitoring: tables, figure and data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...core.files import write_atomically, write_json
from ...display.figures import PALETTE, new_figure, save
from ..condition import Monitoring
from .data import replace_non_finite

TABLE, DATA, FIGURE = "monitor.csv", "monitor.json", "monitor.png"
"""File names of the changes of each recording, of the whole result, and of the picture."""


def parameters_table(found: Monitoring) -> pd.DataFrame:
    """Return a row for each parameter: normal value, scatter, last change, limits, alarms, trend."""
    rows = []
    for key, normal in found.baselines.items():
        own = found.changes[found.changes["key"] == key]
        row: dict[str, Any] = {
            "key": key,
            "unit": found.units[key],
            "normal": normal.value,
            "scatter": normal.scatter,
        }
        if len(own):
            last = own.iloc[-1]
            row |= {
                "last_change": last["change"],
                "last_half_95": last["half_95"],
                "threshold": last["threshold"],
                "detection_limit": last["detection_limit"],
                "alarms": int(own["alarm"].sum()),
                "recordings": len(own),
            }
        if (trend := found.trends.get(key)) is not None:
            row |= {"trend": trend.slope, "trend_half_95": trend.half_95}
        rows.append(row)
    return pd.DataFrame(rows)


def monitoring_as_dict(found: Monitoring) -> dict[str, Any]:
    """Return the result as JSON allows; sizes are in the units of their keys."""
    content: dict[str, Any] = replace_non_finite(
        {
            "ship": found.ship.name,
            "method": found.method,
            "false_alarm_risk": found.risk,
            "trend_per": found.per,
            "parameters": parameters_table(found).to_dict("records"),
            "changes": found.changes.to_dict("records"),
            "references": found.references.to_dict("records"),
            "failed": dict(found.failed),
            "remarks": list(found.remarks),
        }
    )
    return content


def monitoring_in_words(found: Monitoring) -> list[str]:
    """Return a sentence for each alarm, trend and recording that could not be used."""
    said = []
    for row in found.alarms.to_dict("records"):
        normal, unit = found.baselines[row["key"]].value, _suffix(found.units[row["key"]])
        share = f" ({100.0 * row['change'] / normal:+.1f} %)" if unit and normal else ""
        said.append(
            f"alarm: {row['recording']} ({row['date']}): {row['key']} has changed by "
            f"{row['change']:+.3g} +- {row['half_95']:.2g}{unit}{share}, threshold "
            f"{row['threshold']:.2g}"
        )
    if not said and len(found.changes):
        said.append("no alarm: no parameter has changed beyond its threshold")
    for key, trend in found.trends.items():
        if abs(trend.slope) > trend.half_95:
            said.append(
                f"trend: {key} changes by {trend.slope:+.3g} +- {trend.half_95:.2g}"
                f"{_suffix(found.units[key])} a {found.per}"
            )
    said += [f"not used: {name}: {why}" for name, why in found.failed.items()]
    return said + list(found.remarks)


def _suffix(unit: str) -> str:
    """Return a unit behind a space, nothing for a dimensionless one."""
    return "" if unit == "-" else f" {unit}"


def monitoring_figure(found: Monitoring) -> Figure:
    """Draw the estimates of each parameter in the order of time, with normal value and thresholds."""
    keys = list(found.baselines)
    figure, axes = new_figure(len(keys), 1, (8.0, 1.9 * len(keys) + 0.8))
    for axis, (key, normal) in zip(axes.flat, found.baselines.items(), strict=True):
        before = found.references[found.references["key"] == key]
        after = found.changes[found.changes["key"] == key]
        first = np.arange(len(before)) - len(before)
        last = np.arange(len(after))
        for place, part, color, label in (
            (first, before, PALETTE[1], "reference"),
            (last, after, "black", "later"),
        ):
            axis.errorbar(
                place,
                part["estimate"],
                1.96 * part["standard_error"],
                fmt="o",
                color=color,
                markersize=4.0,
                linewidth=1.0,
                label=label,
            )
        loud = after["alarm"].to_numpy(bool)
        axis.plot(
            last[loud],
            after["estimate"][loud],
            "o",
            color=PALETTE[0],
            markersize=6.0,
            label="alarm",
            zorder=3.0,
        )
        axis.axhline(normal.value, color="grey", linewidth=0.8)
        if len(after):
            for sign in (-1.0, 1.0):
                axis.plot(
                    last,
                    normal.value + sign * after["threshold"],
                    color="grey",
                    linestyle=":",
                    label="threshold" if sign > 0.0 else None,
                )
        axis.axvline(-0.5, color="grey", linewidth=0.8)
        axis.set_title(f"{key} [{found.units[key]}]", fontsize=8, loc="left")
        axis.set_xticks([])
    dates = found.changes.drop_duplicates("recording")["date"].tolist()
    bottom = axes.flat[-1]
    shown = np.unique(np.linspace(0, len(dates) - 1, min(len(dates), 8)).astype(int))
    bottom.set_xticks(shown, [dates[k] for k in shown], fontsize=7)
    bottom.set_xlabel("later recordings, by date; the references are on the left")
    figure.legend(
        *axes.flat[0].get_legend_handles_labels(), loc="outside upper center", fontsize=7, ncols=4
    )
    return figure


def save_monitoring(found: Monitoring, folder: str | Path) -> Path:
    """Write the changes, the data and the figure into a folder, and return it."""
    folder = Path(folder)
    write_atomically(folder / TABLE, lambda file: found.changes.to_csv(file, index=False))
    write_json(folder / DATA, monitoring_as_dict(found))
    save(monitoring_figure(found), folder / FIGURE)
    return folder
