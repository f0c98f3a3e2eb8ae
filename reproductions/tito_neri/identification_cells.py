"""The printed numbers of Vrijdag & Martelli 2021 as cells, with what is left open by their digits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pandas as pd

from ..cells import Cell, Kind, Reason, half_digit, number
from ..side_by_side import published_text
from . import identification as study

COLUMNS = {"I": "staircase_method_1", "IV": "sine_correlation_method_4"}
_DIGIT = "half a unit of the last printed digit"
_GAIN_HALF_DIGIT = 0.005


def given() -> list[Cell]:
    """Return the cells of what the methods were given: Tables 2 and 4 and the values of section 5.2."""
    cells = []
    for name, table in (("2", "frequency_response"), ("4", "operating_points")):
        frame = published_text(f"tito_neri_{table}")
        for row, column in itertools.product(frame.index, frame.columns):
            text = str(frame.loc[row, column])
            value = float(text)
            cells.append(number(f"Table {name}", str(row), column, value, value, half_digit(text),
                                _DIGIT, Kind.INPUT))  # fmt: skip
    for name, value in study.READ_OFF.items():
        cells.append(number("section 5.2", name, "", value, value, 0.0, "as printed", Kind.INPUT))
    return cells


def left_open(rounding: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return how far Table 5 moves with the digits of what it follows from, by set and parameter.

    Args:
        rounding: least and largest values of column I, from
            :func:`.identification.rounding_of_column_one`.
    """
    own = study.column_one()
    found = {
        ("I", name): float(max(abs(rounding.loc[end, name] - value) for end in ("min", "max")))
        for name, value in own.items()
    }
    corners = [
        study.column_four(
            read=study.READ_OFF
            | {
                "speed_gain": study.READ_OFF["speed_gain"] + a * _GAIN_HALF_DIGIT,
                "current_gain": study.READ_OFF["current_gain"] + b * _GAIN_HALF_DIGIT,
            }
        )
        for a, b in itertools.product((-1.0, 1.0), repeat=2)
    ]
    for name, value in study.column_four().items():
        found["IV", name] = max(abs(corner[name] - value) for corner in corners)
    return found


def table_five_cells(rounding: pd.DataFrame) -> list[Cell]:
    """Return Table 5 with ours.

    Args:
        rounding: as of :func:`left_open`.
    """
    printed, slack = published_text("tito_neri_identified_parameters"), left_open(rounding)
    ours = {"I": study.column_one(), "IV": study.column_four()}
    bases = {
        "I": "half a unit of the last printed digit, and the rounding of Table 4 (300 draws)",
        "IV": "half a unit of the last printed digit, and half a digit of the gains 1.24 and 0.71",
    }
    constant = float(printed.loc["K_e", COLUMNS["I"]])
    cells = []
    for name, column in COLUMNS.items():
        for parameter in printed.index:
            text = printed.loc[parameter, column]
            value = ours[name].get(parameter, math.nan)
            reason = None
            if name == "I" and parameter in ("M_f", "KQ0_over_eta_R"):
                moved = value * constant / ours["I"]["K_e"]
                reason = Reason(
                    f"eq. 22 fixes the ratio to K_e alone: ours is {value / ours['I']['K_e']:.4g}; with "
                    f"the printed K_e of {constant:g} it gives {moved:.4g}",
                    moved - value,
                )
            tolerance = half_digit(text) + slack.get((name, parameter), 0.0)
            cells.append(
                number("Table 5", parameter, f"set {name}", value, float(text), tolerance, bases[name],
                       Kind.FREE, reason)
            )  # fmt: skip
    return cells


def told(stairs: pd.DataFrame) -> list[Cell]:
    """Return the sentences of section 5.1 with ours.

    Args:
        stairs: from :func:`.histories.on_the_staircase`.
    """
    by = stairs.set_index("set")
    away = abs(by.loc["IV", "A [rpm]"]) / abs(by.loc["IV", "C [rpm]"])
    return [
        Cell("Figure 10", "set I: largest error of the steady speed [%]", "",
             float(by.loc["I", "largest [%]"]), 0.0, 3.0, "the limit that the words name",
             words="within 3 %"),
        Cell("Figure 10", "set IV: error of the speed at A over that at C [-]", "", float(away), 1.0,
             np.inf, "more than at C", words="increases away from C"),
        Cell("Figure 13", "bias of the speed on the mix [rpm]", "", math.nan, 45.0, 55.0,
             "'around 50', a number rounded to 10", Kind.FREE, 50.0),
    ]  # fmt: skip


def cells_of(rounding: pd.DataFrame, stairs: pd.DataFrame) -> list[Cell]:
    """Return every printed number that the study compares.

    Args:
        rounding: as of :func:`left_open`.
        stairs: as of :func:`told`.
    """
    return [*given(), *table_five_cells(rounding), *told(stairs)]
