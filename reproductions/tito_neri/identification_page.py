"""Write the page of the identification of Vrijdag & Martelli 2021, with Figures 9 to 16."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.cli import tour_command
from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.mismatch.identification.frequency import SPEED, modelled_response
from shaftline.mismatch.identification.steady import CURRENT
from shaftline.plant import Ship, load_ship

from ..cells import Cell
from ..pages import fill_template
from ..side_by_side import Page, Study, Tick, published
from . import identification as study
from .experiments import HOLD_S, Experiment, mix, simulate_test, staircase
from .identification import SETS

RPM = 30.0 / math.pi
AFTER_C = 3  # index of point D on the staircase


def simulate_sets(test: Experiment) -> dict[str, pd.DataFrame]:
    """Return time [s], voltage [V], motor speed [rpm] and current [A] of a test on either set."""
    found = {}
    for name, file in SETS.items():
        ship = load_ship(file)
        table = simulate_test(ship, test)
        speed = RPM * ship.transmission.gear_ratio * table[SPEED]
        found[name] = table[["time_s"]].assign(
            voltage_V=table["motor_voltage_V"], speed_rpm=speed, current_A=table[CURRENT]
        )
    return found


def on_the_staircase(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the errors of each set at the levels of Table 4, and its peak after the step from C to D.

    Returns:
        By set: errors of the steady speed at A to E [rpm], the largest of them [%] and the peak [A].
    """
    points = published("tito_neri_operating_points")
    measured = RPM * points["motor_speed_rad_s"].to_numpy(dtype=np.float64)
    rows = []
    for name, table in tables.items():
        level = len(table) // len(points)
        off = table["speed_rpm"].to_numpy()[level - 1 :: level] - measured
        after = table["current_A"].iloc[AFTER_C * level : (AFTER_C + 1) * level]
        rows.append(
            {
                "set": name,
                **{f"{p} [rpm]": value for p, value in zip(points.index, off, strict=True)},
                "largest [%]": 100.0 * np.abs(off / measured).max(),
                "peak C to D [A]": after.max(),
            }
        )
    return pd.DataFrame(rows)


def draw_histories(steps: dict[str, pd.DataFrame], mixed: dict[str, pd.DataFrame]) -> Figure:
    """Draw voltage, motor speed and current of staircase (Figures 9 to 11) and mix (12 to 14)."""
    points = published("tito_neri_operating_points")
    figure, axes = new_figure(3, 2, (11.0, 7.5))
    titles = ("staircase", "mix (its parts are assumed)")
    for (voltage, speed, current), tables, title in zip(
        axes.T, (steps, mixed), titles, strict=True
    ):
        for color, (name, table) in zip(PALETTE, tables.items(), strict=False):
            shown = {"color": color, "linewidth": 1.0, "label": f"set {name}"}
            speed.plot(table["time_s"], table["speed_rpm"], **shown)
            current.plot(table["time_s"], table["current_A"], **shown)
        voltage.plot(tables["I"]["time_s"], tables["I"]["voltage_V"], color=TRUTH)
        voltage.set_title(title)
        current.set_xlabel("time [s]")
    middle = HOLD_S * (np.arange(len(points)) + 0.5)
    marks = {"marker": "D", "linestyle": "none", "color": "black", "label": "measured (Table 4)"}
    axes[1, 0].plot(middle, RPM * points["motor_speed_rad_s"], **marks)
    axes[2, 0].plot(middle, points["motor_current_A"], **marks)
    for axis, label in zip(
        axes[:, 0], ("voltage [V]", "motor speed [rpm]", "current [A]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[1, 0].legend(fontsize=8, frameon=False)
    return figure


def simulate_in_time() -> tuple[pd.DataFrame, Figure]:
    """Return the table and the figure of the time histories."""
    steps = simulate_sets(staircase())
    return on_the_staircase(steps), draw_histories(steps, simulate_sets(mix()))


class Findings(NamedTuple):
    """Results that the page shows."""

    table_five: pd.DataFrame
    rounding: pd.DataFrame
    density: pd.DataFrame
    fits: pd.DataFrame
    best: Ship
    five: dict[str, float]
    dead_time: pd.DataFrame
    delays: dict[str, tuple[float, float]]
    known: pd.DataFrame
    stairs: pd.DataFrame
    in_time: Figure


def compute_findings(tick: Tick = lambda: None) -> Findings:
    """Return all results of the page."""
    fits, best = study.fits_of_table_two()
    tick()
    return Findings(
        study.table_five(),
        study.rounding_of_column_one(),
        densities(),
        fits,
        best,
        study.five_numbers(),
        study.dead_time(),
        study.fitted_dead_time(),
        study.on_known_truth(tick),
        *simulate_in_time(),
    )


def densities() -> pd.DataFrame:
    """Return the effect of two likely densities of the water on either set."""
    rows = []
    for density in (1000.0, 1025.0):
        first = study.column_one(density_kg_m3=density)
        row = {"density_kg_m3": density, "I_KQ_over_K_e": first["KQ0_over_eta_R"] / first["K_e"]}
        for name, file in study.SETS.items():
            ship = load_ship(file).with_values({"water.density_kg_m3": density})
            errors = tour_command.speed_errors_percent(ship)
            row[f"{name}_worst_speed_percent"] = float(np.abs(errors).max())
        ship = load_ship(study.SETS["IV"]).with_values({"water.density_kg_m3": density})
        row["IV_KQ_closed_form"] = study.column_four(ship)["KQ0_over_eta_R"]
        rows.append(row)
    return pd.DataFrame(rows)


def draw_bode(best: Ship) -> Figure:
    """Draw the measured points beside both printed sets and ours (the paper's Figures 15 and 16)."""
    figure, axes = new_figure(2, 2, (10.5, 7.0))
    measured = study.table_two(kept=False)
    fine = replace(measured, frequency=np.geomspace(0.2, 7000.0, 300))
    ships = {f"set {name}": load_ship(file) for name, file in SETS.items()} | {
        "ours, speed late": best
    }
    shown = {
        SPEED: ("speed", (3e-3, 2.0), (-400.0, 60.0)),
        CURRENT: ("current", (0.4, 5.0), (-100.0, 60.0)),
    }
    for (gain, phase), (name, (label, gains, phases)) in zip(axes.T, shown.items(), strict=True):
        points = measured.response[name]
        seen = np.abs(points) > 0.0  # the table rounds the last gain of the speed to 0
        gain.loglog(measured.frequency[seen], np.abs(points[seen]), "k*", label="measured")
        phase.semilogx(measured.frequency[seen], _phase_deg(points[seen]), "k*")
        for color, (words, ship) in zip(PALETTE, ships.items(), strict=False):
            answer = modelled_response(ship, fine)[name]
            gain.loglog(fine.frequency, np.abs(answer), color=color, label=words)
            phase.semilogx(fine.frequency, _phase_deg(answer), color=color)
        gain.set(ylim=gains, ylabel=f"{label} gain [-]")
        phase.set(ylim=phases, ylabel="phase [deg]", xlabel="frequency [rad/s]")
        for axis in (gain, phase):
            axis.axvspan(700.0, 7000.0, color=THESIS, alpha=0.15, linewidth=0)
    axes[0, 0].legend(fontsize=8, frameon=False)
    title = "Response to the voltage about point C, relative; grey: discarded by the authors"
    figure.suptitle(title)
    return figure


def _phase_deg(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.degrees(np.unwrap(np.angle(values))))


def cells_of(found: Findings) -> list[Cell]:
    """Return every printed number that the page compares."""
    tables = study.table_five_cells(found.rounding)
    return [*study.given_cells(), *tables, *study.text_cells(found.stairs)]


def page(found: Findings) -> Page:
    """Return the page of the results."""
    five = found.table_five
    ours, printed = (five[c].map(f"{{:.{n}g}}".format) for c, n in (("ours", 4), ("printed", 3)))
    shown = five.assign(ours=ours, printed=printed)
    small = ["L_a", "K_e", "R_a", "I_p", "M_f", "KQ0_over_eta_R", "L_a_error"]
    first = five[five["set"] == "I"].set_index("parameter")
    pairs, off = study.least_squares_variants(), first["difference_percent"]
    body = fill_template(
        Path(__file__).with_name("identification.md"),
        found=found,
        shown=shown,
        known=found.known.rename(columns=lambda c: c.split(".")[-1]),
        rounding=found.rounding.reset_index(names="of 300 draws"),
        count=len(pairs),
        ratios=[first.loc["M_f", c] / first.loc["K_e", c] for c in ("ours", "printed")],
        kq=abs(off["KQ0_over_eta_R"] - off["K_e"]),
        nearest=pairs.head(4).assign(K_e=pairs["K_e"].map("{:.5f}".format)),
        fits=found.fits.assign(**{c: found.fits[c].map("{:.3g}".format) for c in small}),
        ways=found.fits.set_index("errors weigh").to_dict("index"),
    )
    numbers = {
        str(name): dict(zip(part["parameter"], map(float, part["ours"]), strict=True))
        for name, part in five.groupby("set", sort=False)
    }
    drawn = {"tito-neri-bode": draw_bode(found.best), "tito-neri-histories": found.in_time}
    file = "tito-neri-identification"
    return Page(cells_of(found), body, drawn, {"table-5": numbers}, five, shown, file=file)


TITLE = "Identification of the Tito Neri drive train (Table 5)"
STUDY = Study(TITLE, lambda tick: page(compute_findings(tick)), study.TICKS + 1)
