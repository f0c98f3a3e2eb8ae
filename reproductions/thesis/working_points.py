"""Compute Table 2-1: the working points A to D, and the steady state of the load cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shaftline.plant import Ship, equilibrium, load_ship

from ..cells import Cell, Kind, half_digit, number
from ..pages import fill_template
from ..side_by_side import (
    Judged,
    Page,
    Study,
    Tick,
    compare,
    numbers_by_row,
    published,
    published_text,
    side_by_side,
)
from . import figures
from .poles import models, sorted_numbers

TABLE = "advance_velocity_thesis_working_points"
COLUMNS = ["shaft_speed_rad_s", "ship_speed_m_s", "advance_velocity_m_s", "engine_torque_N_m"]


INPUTS = ["pitch_ratio", "fuel_rack_mm"]


def _steady(ship: Ship, rack: float, pitch: float) -> list[float]:
    found = equilibrium(ship, rack, pitch)
    state, outputs = found.state, found.outputs
    return [state.shaft_speed, state.ship_speed, outputs.advance_velocity, outputs.brake_torque]


def working_points() -> pd.DataFrame:
    """Return our steady states at the thesis's inputs; rows A, B, C, D and base."""
    frigate, table = load_ship("frigate"), published(TABLE)
    rows = {}
    for point in table.index:
        rack, pitch = (float(table.loc[point, name]) for name in ("fuel_rack_mm", "pitch_ratio"))
        rows[point] = [pitch, rack, *_steady(frigate, rack, pitch)]
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*INPUTS, *COLUMNS])


def _change_by_rack_rounding() -> pd.DataFrame:
    """Return by how much half a digit of the printed rack changes our steady states."""
    frigate, texts = load_ship("frigate"), published_text(TABLE)
    rows = {}
    for point in texts.index:
        rack, pitch = (texts.loc[point, name] for name in ("fuel_rack_mm", "pitch_ratio"))
        # the base is chosen, not rounded: 22 mm of section 4-1
        half = 0.0 if point == "base" else half_digit(rack)
        ends = [_steady(frigate, float(rack) + by, float(pitch)) for by in (-half, half)]
        rows[point] = 0.5 * np.abs(np.array(ends[1]) - np.array(ends[0]))
    return pd.DataFrame.from_dict(rows, orient="index", columns=COLUMNS)


def cells(ours: pd.DataFrame) -> list[Cell]:
    """Return the cells of Table 2-1 for our steady states, from :func:`working_points`.

    The steady states are calibrated: the thesis does not print the number of blades, and five was
    chosen by this table.
    """
    spread = _change_by_rack_rounding()

    def judge(row: str, column: str, text: str) -> Judged:
        if column in INPUTS:
            return Kind.INPUT, half_digit(text), "half a unit of the last printed digit"
        return (
            Kind.CALIBRATED,
            half_digit(text) + float(spread.loc[row, column]),
            "half a unit of the last printed digit, and the change by half a digit of the printed rack",
        )

    return compare("2-1", ours, published_text(TABLE), judge)


def text_cells(table: pd.DataFrame) -> list[Cell]:
    """Return the cells of the changes of shaft speed that sections 4-1-1 and 4-1-2 print."""
    return [
        number(f"section 4-1-{i}", line.what, "", line.ours, float(line.printed),
               half_digit(line.printed), "half a unit of the last printed digit")
        for i, line in enumerate(table.head(2).itertuples(), 1)
    ]  # fmt: skip


def _gain_of_table_2_12(point: str, frequency: float) -> float:
    """Return the gain [dB] from the inflow to the shaft speed by Table 2-12."""
    table = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    own = table[(table["table"] == "2-12") & (table["working_point_or_source"] == point)].iloc[0]
    s = 1j * frequency
    above = [1.0 - s / zero for zero in sorted_numbers(own["zeros_rad_s"])]
    below = [1.0 - s / pole for pole in sorted_numbers(own["poles_rad_s"])]
    return 20.0 * float(np.log10(abs(float(own["dc_gain"]) * np.prod(above) / np.prod(below))))


def numbers_of_text(ship: Ship) -> pd.DataFrame:
    """Return numbers of the thesis's text with ours."""
    rows = []
    for what, before, after, printed in (
        ("rack 20 to 27.5 mm at P/D 1.4: shaft speed [%]", (20.0, 1.4), (27.5, 1.4), "24.62"),
        ("P/D 1.25 to 1.0 at 22 mm: shaft speed [%]", (22.0, 1.25), (22.0, 1.0), "23.23"),
    ):
        speeds = [equilibrium(ship, *point).state.shaft_speed for point in (before, after)]
        rows.append((what, 100.0 * (speeds[1] / speeds[0] - 1.0), printed))
    linear = models(ship)
    for frequency in (0.1, 4.0):
        for point in "AD":
            answer = abs(complex(linear[point]["shaft_speed", "inflow"](1j * frequency)))
            what = f"inflow to shaft speed at {frequency:g} rad/s, {point} [dB]"
            printed = f"{_gain_of_table_2_12(point, frequency):.1f}"
            rows.append((what, 20.0 * float(np.log10(answer)), printed))
    return pd.DataFrame(rows, columns=["what", "ours", "printed"])


def page(tick: Tick) -> Page:
    """Return the page of Table 2-1, Figures 2-4 and 4-1, and the numbers of sections 2-7-3 and 4-1."""
    ours, frigate = working_points(), load_ship("frigate")
    text = numbers_of_text(frigate)
    compared = cells(ours)
    shown = side_by_side(ours, compared, 3)
    drawn = {
        "fuel-rack-map": figures.fuel_rack_map(frigate),
        "load-cases": figures.load_case_overview(frigate),
    }
    tick()
    body = fill_template(Path(__file__).with_suffix(".md"), shown=shown, text=text)
    numbers = numbers_by_row(ours)
    return Page([*compared, *text_cells(text)], body, drawn, numbers, ours.reset_index(), shown, 75)


STUDY = Study("Working points of the frigate (thesis, Table 2-1)", page, 1)
