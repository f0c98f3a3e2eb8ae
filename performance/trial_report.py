"""Tables and figure of a speed trial."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..core.files import write_json, write_text
from ..display import figures, tables
from ..plant.ship_files import format_value
from ..plant.surroundings import KNOT
from .speed_trial import SpeedTrial


def runs_table(trial: SpeedTrial) -> pd.DataFrame:
    """Return measured and corrected values of each run in the units of a trial report."""
    runs = trial.runs
    efficiency = trial.ship.shaft_efficiency
    return pd.DataFrame(
        {
            "run": np.arange(1, len(runs) + 1),
            "setting": runs["pair"] + 1,
            "heading_deg": np.degrees(runs["heading"]),
            "speed_over_ground_kn": runs["speed_over_ground"] / KNOT,
            "shaft_power_kW": runs["shaft_power"] / 1e3,
            "wind_resistance_kN": runs["wind_resistance_N"] / 1e3,
            "wave_resistance_kN": runs["wave_resistance_N"] / 1e3,
            "water_resistance_kN": runs["water_resistance_N"] / 1e3,
            "current_kn": runs["current_m_s"] / KNOT,
            "shallow_water_loss_percent": 100.0 * runs["shallow_water_loss"],
            "corrected_speed_kn": runs["speed_m_s"] / KNOT,
            "corrected_shaft_power_kW": runs["power_W"] / efficiency / 1e3,
        }
    )


def curve_table(trial: SpeedTrial, points: int = 25) -> pd.DataFrame:
    """Return the speed-power curve in calm water with its 95 % interval, over the speeds of the trial.

    Args:
        trial: analysed trial.
        points: number of speeds.
    """
    speeds = trial.runs["speed_m_s"]
    grid = np.linspace(float(speeds.min()), float(speeds.max()), points)
    values = [trial.shaft_power(float(speed)) for speed in grid]
    return pd.DataFrame(
        {
            "speed_kn": grid / KNOT,
            "shaft_power_kW": [power / 1e3 for power, _ in values],
            "half_interval_kW": [half / 1e3 for _, half in values],
        }
    )


def reference_text(trial: SpeedTrial) -> str | None:
    """Return the file of a :class:`~shaftline.performance.monitoring.ReferenceShip` with the curve.

    None if the power of the curve does not rise throughout.
    """
    curve = curve_table(trial, 9)
    if not np.all(np.diff(curve["shaft_power_kW"], prepend=0.0) > 0.0):
        return None
    ship = trial.ship
    keys = {
        "name": ship.name,
        "beam_m": ship.hull.beam_m,
        "draught_m": ship.hull.draught_m,
        "speed_kn": [round(float(one), 3) for one in curve["speed_kn"]],
        "power_kW": [round(float(one), 1) for one in curve["shaft_power_kW"]],
    }
    lines = ["# Speed-power curve of a trial, corrected to calm, deep water; of all shafts."]
    lines += [f"{key} = {format_value(value)}" for key, value in keys.items()]
    if ship.superstructure is not None:
        given = ship.superstructure.model_dump(exclude_unset=True)
        lines += ["", "[superstructure]"]
        lines += [f"{key} = {format_value(value)}" for key, value in given.items()]
    return "\n".join(lines) + "\n"


def speed_power_figure(trial: SpeedTrial) -> Figure:
    """Return the figure of measured runs, corrected runs and the curve in calm water."""
    figure, axes = figures.new_figure(1, 1, (7.5, 5.0))
    axis, table, curve = axes[0, 0], runs_table(trial), curve_table(trial, 60)
    axis.plot(
        table["speed_over_ground_kn"],
        table["shaft_power_kW"],
        "o",
        mfc="none",
        color=figures.THESIS,
        label="measured, over ground",
    )
    axis.plot(
        table["corrected_speed_kn"],
        table["corrected_shaft_power_kW"],
        "o",
        color=figures.ESTIMATE,
        label="corrected, through calm water",
    )
    axis.plot(curve["speed_kn"], curve["shaft_power_kW"], color=figures.TRUTH, label="curve")
    if np.isfinite(curve["half_interval_kW"]).all():
        low, high = (curve["shaft_power_kW"] + sign * curve["half_interval_kW"] for sign in (-1, 1))
        axis.fill_between(
            curve["speed_kn"], low, high, color=figures.TRUTH, alpha=0.15, label="95 %"
        )
    mcr = trial.ship.mcr_kW
    if mcr is not None:
        axis.axhline(0.75 * mcr, color=figures.THESIS, linestyle=":", label="75 % MCR")
    axis.set(xlabel="speed [kn]", ylabel="shaft power [kW]", title=trial.ship.name)
    axis.legend(frameon=False)
    return figure


def trial_as_dict(
    trial: SpeedTrial, powers_kW: list[float], speeds_kn: list[float]
) -> dict[str, Any]:
    """Return the results of a trial as JSON allows.

    Args:
        trial: analysed trial.
        powers_kW: shaft powers at which the speed is wanted.
        speeds_kn: speeds at which the shaft power is wanted.

    Raises:
        TrialError: the curve does not reach a power.
    """
    curve = trial.curve
    at_power = [(power, *trial.speed_at(power * 1e3)) for power in powers_kW]
    at_speed = [(speed, *trial.shaft_power(speed * KNOT)) for speed in speeds_kn]
    return {
        "ship": trial.ship.name,
        "method": trial.method,
        "curve": {
            "equation": "delivered power [W] = constant + factor * speed^exponent, speed in m/s",
            "constant": curve.constant,
            "factor": curve.factor,
            "exponent": curve.exponent,
            "degrees_of_freedom": curve.freedom,
        },
        "speed_at_power": [
            {
                "shaft_power_kW": p,
                "speed_kn": v / KNOT,
                "ci95_half_kn": _known(half / KNOT),
                "extrapolated": _outside(trial, v),
            }
            for p, v, half in at_power
        ],
        "power_at_speed": [
            {
                "speed_kn": v,
                "shaft_power_kW": p / 1e3,
                "ci95_half_kW": _known(half / 1e3),
                "extrapolated": _outside(trial, v * KNOT),
            }
            for v, p, half in at_speed
        ],
        "runs": runs_table(trial).to_dict("records"),
        "remarks": list(trial.remarks),
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _outside(trial: SpeedTrial, speed: float) -> bool:
    """Return whether a speed [m/s] lies outside those of the corrected runs."""
    speeds = trial.runs["speed_m_s"]
    return not float(speeds.min()) <= speed <= float(speeds.max())


def save_trial(
    trial: SpeedTrial, folder: Path, powers_kW: list[float], speeds_kn: list[float]
) -> dict[str, Any]:
    """Write tables, figure, report and ``reference.toml`` (see below); return the report.

    The files are ``runs.csv``, ``curve.csv``, ``report.json``, ``speed-power.png`` and, where the power
    of the curve rises throughout, ``reference.toml``: the ship of ``shaftline performance``.

    Args:
        trial: analysed trial.
        folder: folder for the files.
        powers_kW: shaft powers at which the speed is wanted.
        speeds_kn: speeds at which the shaft power is wanted.

    Raises:
        TrialError: the curve does not reach a power; nothing is written.
    """
    report = trial_as_dict(trial, powers_kW, speeds_kn)
    tables.write_csv(folder, "runs", runs_table(trial))
    tables.write_csv(folder, "curve", curve_table(trial))
    figures.save(speed_power_figure(trial), folder / "speed-power.png")
    write_json(folder / "report.json", report)
    reference = reference_text(trial)
    if reference is None:  # A file of an earlier trial would not belong to this report.
        (folder / "reference.toml").unlink(missing_ok=True)
    else:
        write_text(folder / "reference.toml", reference)
    return report
