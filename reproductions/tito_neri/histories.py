"""Both published sets in time (Vrijdag & Martelli 2021, Figures 9 to 14), and what the text says."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, TRUTH, new_figure
from shaftline.mismatch.identification.frequency import SPEED
from shaftline.mismatch.identification.steady import CURRENT
from shaftline.plant import Ship, load_ship

from ..side_by_side import published
from .experiments import HOLD_S, Experiment, mix, recorded, staircase
from .identification import SETS

RPM = 30.0 / math.pi
AT_C, AFTER_C = 2, 3
"""Places of points C and D on the staircase."""


def _told(ship: Ship, test: Experiment) -> pd.DataFrame:
    """Time [s], voltage [V], motor speed [rpm] and current [A] of a simulated test."""
    table = recorded(ship, test)
    return pd.DataFrame(
        {
            "time_s": table["time_s"],
            "voltage_V": table["motor_voltage_V"],
            "speed_rpm": RPM * ship.transmission.gear_ratio * table[SPEED],
            "current_A": table[CURRENT],
        }
    )


def on_the_staircase(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """What each set says at the levels of Table 4, and of the peak after the step from C to D.

    Args:
        tables: staircase by set, from :func:`runs`.

    Returns:
        By set: errors of the steady speed at A to E [rpm], the largest of them [%] and the peak [A].
    """
    points = published("tito_neri_operating_points")
    measured = RPM * points["motor_speed_rad_s"].to_numpy(dtype=np.float64)
    rows = []
    for name, table in tables.items():
        level = len(table) // len(points)
        last = table["speed_rpm"].to_numpy()[level - 1 :: level]
        off = last - measured
        after = table["current_A"].iloc[AFTER_C * level : (AFTER_C + 1) * level]
        rows.append(
            {"set": name}
            | {f"{p} [rpm]": value for p, value in zip(points.index, off, strict=True)}
            | {"largest [%]": 100.0 * np.abs(off / measured).max(), "peak C to D [A]": after.max()}
        )
    return pd.DataFrame(rows)


def runs(test: Experiment) -> dict[str, pd.DataFrame]:
    """A test on the drive train of either set.

    Args:
        test: voltage over time.
    """
    return {name: _told(load_ship(file), test) for name, file in SETS.items()}


def picture(steps: dict[str, pd.DataFrame], mixed: dict[str, pd.DataFrame]) -> Figure:
    """Voltage, motor speed and current of staircase (Figures 9 to 11) and mix (12 to 14).

    Args:
        steps: staircase by set.
        mixed: mix by set.
    """
    points = published("tito_neri_operating_points")
    figure, axes = new_figure(3, 2, (11.0, 7.5))
    for column, tables in enumerate((steps, mixed)):
        for i, (name, table) in enumerate(tables.items()):
            if i == 0:
                axes[0, column].plot(table["time_s"], table["voltage_V"], color=TRUTH)
            for row, quantity in enumerate(("speed_rpm", "current_A"), start=1):
                axes[row, column].plot(
                    table["time_s"], table[quantity], color=PALETTE[i], linewidth=1.0,
                    label=f"set {name}",
                )  # fmt: skip
        axes[2, column].set_xlabel("time [s]")
    middle = HOLD_S * (np.arange(len(points)) + 0.5)
    marks = {"marker": "D", "linestyle": "none", "color": "black", "label": "measured (Table 4)"}
    axes[1, 0].plot(middle, RPM * points["motor_speed_rad_s"], **marks)
    axes[2, 0].plot(middle, points["motor_current_A"], **marks)
    axes[0, 0].set_title("staircase")
    axes[0, 1].set_title("mix (its parts are assumed)")
    for row, label in enumerate(("voltage [V]", "motor speed [rpm]", "current [A]")):
        axes[row, 0].set_ylabel(label)
    axes[1, 0].legend(fontsize=8, frameon=False)
    return figure


def gathered() -> tuple[pd.DataFrame, Figure]:
    """The table and the figure."""
    steps = runs(staircase())
    return on_the_staircase(steps), picture(steps, runs(mix()))
