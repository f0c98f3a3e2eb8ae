"""Compute Table 2-1: the working points A to D, and the steady state of the load cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shaftline.plant import Ship, equilibrium, load_ship

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, Reason, half_digit, printed_number
from ..side_by_side import published, published_text
from . import figures, rounded_table
from .poles import models, printed_line

TABLE = "advance_velocity_thesis_working_points"
COLUMNS = ["shaft_speed_rad_s", "ship_speed_m_s", "advance_velocity_m_s", "engine_torque_N_m"]
INPUTS = ["pitch_ratio", "fuel_rack_mm"]


def _steady(ship: Ship, rack: float, pitch: float) -> list[float]:
    found = equilibrium(ship, rack, pitch)
    state, outputs = found.state, found.outputs
    return [state.shaft_speed, state.ship_speed, outputs.advance_velocity, outputs.brake_torque]


def working_points() -> pd.DataFrame:
    """Return our steady states at the thesis's inputs; rows A, B, C, D and base."""
    frigate = load_ship("frigate")
    rows = {
        point: [pitch, rack, *_steady(frigate, float(rack), float(pitch))]
        for point, pitch, rack in published(TABLE)[INPUTS].itertuples()
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*INPUTS, *COLUMNS])


def _change_by_rack_rounding() -> pd.DataFrame:
    """Return by how much half a digit of the printed rack changes our steady states."""
    frigate, rows = load_ship("frigate"), {}
    for point, pitch, rack in published_text(TABLE)[INPUTS].itertuples():
        # the base is chosen, not rounded: 22 mm of section 4-1
        half = 0.0 if point == "base" else half_digit(rack)
        ends = [_steady(frigate, float(rack) + by, float(pitch)) for by in (-half, half)]
        rows[point] = 0.5 * np.abs(np.array(ends[1]) - np.array(ends[0]))
    return pd.DataFrame.from_dict(rows, orient="index", columns=COLUMNS)


def rounded_points() -> pd.DataFrame:
    """Return the steady states of :func:`working_points` on the rounded table of the thesis."""
    frigate = load_ship("frigate")
    table, rows = rounded_table.rounded_table(frigate), {}
    for point, pitch, rack in published(TABLE)[INPUTS].itertuples():
        at = rounded_table.steady_state(frigate, table, float(rack), float(pitch))
        velocity = at.ship_speed * (1.0 - float(frigate.record()["wake_fraction"]))
        rows[point] = [pitch, rack, at.shaft_speed, at.ship_speed, velocity, at.brake_torque]
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*INPUTS, *COLUMNS])


_BY_TABLE = (
    "the open-water diagram of the thesis is a rounded table "
    "([poles](poles.md#the-open-water-table-of-the-thesis)), on which the steady states have this number"
)


def table_reasons(smooth: pd.DataFrame) -> dict[tuple[str, str], Reason]:
    """Return the effect of the rounded table on our steady states, as reasons of Table 2-1."""
    shifts = rounded_points()[COLUMNS] - smooth[COLUMNS]
    return {
        (str(row), column): Reason(_BY_TABLE, float(shift))
        for row, line in shifts.iterrows()
        for column, shift in line.items()
        if shift
    }


def cells(ours: pd.DataFrame, reasons: dict[tuple[str, str], Reason] | None = None) -> list[Cell]:
    """Return the cells of Table 2-1 for our steady states, from :func:`working_points`.

    The steady states are calibrated: the thesis does not print the number of blades, and five was
    chosen by this table.
    """
    spread = _change_by_rack_rounding()
    propagated = f"{HALF_DIGIT}, and the change by half a digit of the printed rack"

    def judge(row: str, column: str, text: str) -> beside.Judged:
        if column in INPUTS:
            return Kind.INPUT, half_digit(text), HALF_DIGIT
        return Kind.CALIBRATED, half_digit(text) + float(spread.loc[row, column]), propagated

    return beside.compare("2-1", ours, published_text(TABLE), judge, reasons)


def text_cells(table: pd.DataFrame) -> list[Cell]:
    """Return the cells of the changes of shaft speed that sections 4-1-1 and 4-1-2 print."""
    return [
        printed_number(
            f"section 4-1-{i}",
            line.what,
            "",
            line.ours,
            line.printed,
            reason=Reason(_BY_TABLE, float(line.rounded) - line.ours),
        )
        for i, line in enumerate(table.head(2).itertuples(), 1)
    ]


def _gain_of_table_2_12(point: str, frequency: float) -> float:
    """Return the gain [dB] from the inflow to the shaft speed by Table 2-12."""
    line = printed_line("2-12", point)
    above, below = (
        np.prod([1.0 - 1j * frequency / root for root in roots])
        for roots in (line.zeros, line.poles)
    )
    return 20.0 * float(np.log10(abs(line.gain * above / below)))


def numbers_of_text(ship: Ship) -> pd.DataFrame:
    """Return numbers of the thesis's text with ours, and with those on its rounded table."""
    rows, table = [], rounded_table.rounded_table(ship)
    for what, before, after, printed in (
        ("rack 20 to 27.5 mm at P/D 1.4: shaft speed [%]", (20.0, 1.4), (27.5, 1.4), "24.62"),
        ("P/D 1.25 to 1.0 at 22 mm: shaft speed [%]", (22.0, 1.25), (22.0, 1.0), "23.23"),
    ):
        speeds = [equilibrium(ship, *point).state.shaft_speed for point in (before, after)]
        rounded = [
            rounded_table.steady_state(ship, table, *point).shaft_speed for point in (before, after)
        ]
        changes = (100.0 * (pair[1] / pair[0] - 1.0) for pair in (speeds, rounded))
        rows.append((what, *changes, printed))
    linear = models(ship)
    for frequency in (0.1, 4.0):
        for point in "AD":
            response = abs(complex(linear[point]["shaft_speed", "inflow"](1j * frequency)))
            what = f"inflow to shaft speed at {frequency:g} rad/s, {point} [dB]"
            printed = f"{_gain_of_table_2_12(point, frequency):.1f}"
            tabled = abs(
                complex(
                    rounded_table.model_at(ship, table, point)["shaft_speed", "inflow"](
                        1j * frequency
                    )
                )
            )
            decibels = (20.0 * float(np.log10(one)) for one in (response, tabled))
            rows.append((what, *decibels, printed))
    return pd.DataFrame(rows, columns=["what", "ours", "rounded", "printed"])


def page(tick: beside.Tick) -> beside.Page:
    """Return the page of Table 2-1, Figures 2-4 and 4-1, and the numbers of sections 2-7-3 and 4-1."""
    ours, frigate = working_points(), load_ship("frigate")
    text = numbers_of_text(frigate)
    drawn = {
        "fuel-rack-map": figures.fuel_rack_map(frigate),
        "load-cases": figures.load_case_overview(frigate),
    }
    tick()
    template = Path(__file__).with_suffix(".md")
    printed = published(TABLE)
    off = pd.DataFrame(
        {
            column: [
                f"{rounded:.5g} ({100.0 * (rounded / float(printed.loc[point, column]) - 1.0):+.2f} %)"
                if pd.notna(printed.loc[point, column])
                else f"{rounded:.5g}"
                for point, rounded in values.items()
            ]
            for column, values in rounded_points()[COLUMNS].items()
        },
        index=ours.index,
    )
    shown = {"text": text, "rounded": off.reset_index(names="")}
    compared = cells(ours, table_reasons(ours))
    made = beside.page_of_table(ours, compared, drawn, 75, template, 3, **shown)
    return made._replace(cells=[*made.cells, *text_cells(text)])


STUDY = beside.Study("Working points of the frigate (thesis, Table 2-1)", page, 1)
