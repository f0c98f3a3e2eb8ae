"""Compare the printed poles, zeros and gains with ours, Tables 2-2 to 2-23 and 3-1 to 3-14.

The poles of a point stand in twelve tables and count once. Steady gains of Tables 3-11 to 3-14 are
printed at z = 0, divided by the product of two poles that are rounding errors, and are no cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.core.lazy import control
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.plant import Ship, equilibrium, linearise, load_ship

from .. import side_by_side as beside
from ..cells import (
    HALF_DIGIT,
    Cell,
    Kind,
    Reason,
    explain,
    half_digit,
    number,
    printed_number,
    shift_to,
)
from ..pages import fill_template
from . import figures, observer_transfers, poles, printed_plant, rounded_table
from .poles import poles_zeros_gain, printed_line

PROPAGATED = (
    f"{HALF_DIGIT}, and the change by half a digit of the printed rack (Table 2-1); Table B-1 as "
    "exact"
)
ROUNDED_ZERO = "the print shows the rounding of a number that is 0"
GAUGE_SHARE = 0.04
"""Relative tolerance of the gains to M_m at B, C and D by A's row on the printed plant."""

_ROUNDING = 1e-6

Found = dict[tuple[str, str], float]  # our number by table and name, such as ``zero 1``


def _of_model(model: control.StateSpace, tables: dict[str, tuple[str, str]]) -> Found:
    found: Found = {}
    for table, (output, source) in tables.items():
        lag, zeros, gain = poles_zeros_gain(model[output, source])
        names = {f"zero {i}": zero for i, zero in enumerate(zeros, 1)} | {"gain": gain}
        if (output, source) == ("shaft_speed", "drive") or output == "pitch_ratio":
            names |= {f"pole {i}": pole for i, pole in enumerate(lag, 1)}  # of the point, once
        found |= {(table, name): value for name, value in names.items()}
    return found


_REPEATED = (
    "the thesis used point A's row of M_m (eq. 2-31) at B, C and D as well: on the print's own plant "
    "this row gives the printed number within 4 %, the point's own row does not (errata page)"
)


def gauge_reasons(ship: Ship, point: str) -> dict[tuple[str, str], Reason]:
    """Return the effect of A's row of M_m on zeros and gains of a point as reasons."""
    tables = {table: ("shaft_torque", source) for table, source in printed_plant.GAUGE.items()}
    own, of_a = (
        _of_model(printed_plant.implied_plant(ship, point, row).system, tables)
        for row in (None, "A")
    )
    found = {}
    for table, name in own:
        if shift := of_a[table, name] - own[table, name]:
            value, _ = printed_line(table, point).numbers[name]
            within = min(GAUGE_SHARE * abs(value), 0.5 * abs(shift))
            found[table, name] = Reason(_REPEATED, shift, within)
    return found


_BY_TABLE = (
    "the open-water diagram of the thesis is a table with KT rounded to two decimals and KQ to three, "
    "at steps of 0.05 in J and 0.1 in P/D (section on the table). "
)
_AT_POINTS = (
    f"{_BY_TABLE}With its differences at the printed omega and v_a, and point A's row of M_m, the "
    "number follows"
)
_AT_MID_RANGE = f"{_BY_TABLE}With its differences at P/D 1.2 the number follows"
_BY_OBSERVERS = (
    f"{_BY_TABLE}The observers have KQ and dKQ/dJ of this table at J = "
    f"{rounded_table.OBSERVER_ADVANCE_RATIO:g}, which the zeros of Table 3-13 at A and D give, at all "
    "points"
)

CHOSEN_BY = {
    (table, name, point)
    for point in "AC"
    for table, name in (
        ("2-6", "pole 1"),
        ("2-6", "pole 2"),
        ("2-10", "zero 1"),
        ("2-9", "gain"),
        ("2-3", "gain"),
        ("2-4", "gain"),
    )
}
"""Numbers that chose steps, decimals and offset of the table."""


def plant_cells(ship: Ship) -> list[Cell]:
    """Return the cells of Tables 2-2 to 2-14."""
    points, cells = beside.published_text("advance_velocity_thesis_working_points"), []
    table_of_thesis = rounded_table.rounded_table(ship)
    for point in printed_plant.POINTS:
        rack, pitch = (points.loc[point, name] for name in ("fuel_rack_mm", "pitch_ratio"))
        half = half_digit(rack)
        rows = {} if point == "A" else gauge_reasons(ship, point)
        follows = _of_model(rounded_table.model_at(ship, table_of_thesis, point), poles.TABLES)
        ours, *moved = (
            _of_model(
                linearise(ship, equilibrium(ship, float(rack) + by, float(pitch))), poles.TABLES
            )
            for by in (0.0, half, -half)
        )
        for table, (output, _) in poles.TABLES.items():
            for name, (value, rounding) in printed_line(table, point).numbers.items():
                if (table, name) not in ours:
                    continue  # a pole that stands in another table
                kind = Kind.INPUT if output == "pitch_ratio" else Kind.FREE
                mine = ours[table, name]
                tolerance = rounding + max(abs(other[table, name] - mine) for other in moved)
                if (table, name, point) in CHOSEN_BY:
                    kind, reasons = Kind.CALIBRATED, []
                else:
                    by_table = shift_to(_AT_POINTS, mine, follows[table, name])
                    reasons = [by_table, rows.get((table, name))]
                cell = number(table, name, point, mine, value, tolerance, PROPAGATED, kind)
                cells.append(explain(cell, *reasons))
    return cells


def mid_range_cells(ship: Ship) -> list[Cell]:
    """Return the cells of Tables 2-16 to 2-23: the thesis's model at the point that two gains set."""
    table_of_thesis, cells = rounded_table.rounded_table(ship), []
    at = rounded_table.mid_range_state(ship, table_of_thesis)
    by_table = rounded_table.linear_model(ship, at, *table_of_thesis.coefficients(at))
    ours, follows = (
        _of_model(model, poles.MID_RANGE_TABLES)
        for model in (linearise(ship, poles.mid_range_point(ship)), by_table)
    )
    for table in poles.MID_RANGE_TABLES:
        for name, (value, half) in printed_line(table, poles.SOURCES[0]).numbers.items():
            if (mine := ours.get((table, name))) is not None:
                fitted = table in {"2-18", "2-19"} and name == "gain"
                kind = Kind.CALIBRATED if fitted else Kind.FREE
                cell = number(table, name, "mid-range", mine, value, half, HALF_DIGIT, kind)
                reason = None if fitted else shift_to(_AT_MID_RANGE, mine, follows[table, name])
                cells.append(explain(cell, reason))
    return cells


def _linear_observer_cells(ship: Ship) -> Iterator[Cell]:
    texts = beside.published_text("advance_velocity_thesis_observer_transfers").reset_index()
    found = observer_transfers.linear_transfers(ship)
    for text, line in zip(texts.itertuples(), found.to_dict("records"), strict=True):
        for what, shown in (("zero", text.zero_rad_s), ("gain", text.dc_gain)):
            where = text.table, f"{what} of {text.output}^/{text.input}", text.observer
            mine = line[f"{what} ours"]
            if shown.strip() and abs(float(shown)) < _ROUNDING:
                yield number(*where, mine, 0.0, _ROUNDING, ROUNDED_ZERO)
            elif shown.strip():
                yield printed_number(*where, mine, shown)
    for name, gains in observer_transfers.PRINTED_GAINS.items():
        ours = observer_transfers.gains(name, ship)
        for i, (mine, value) in enumerate(zip(ours, gains, strict=True), 1):
            yield printed_number("section 3-1-3", f"k{i}", name, mine, f"{value:.1e}")
    observer = observer_transfers.KALMAN
    kalman = observer_transfers.linear_observer(observer, ship).poles()[0]
    yield printed_number("3-5", "real part of the poles", observer, kalman.real, "-10.53")
    yield printed_number("3-5", "imaginary part of the poles", observer, abs(kalman.imag), "10.41")


_AS_PRINTED = (
    "Tables 3-9 and 3-10 leave out that M_p in eq. 3-13 depends on the estimate: with dM_p/dv_a^ = 0 "
    "the pole gamma (dM_p/dv_a) / I_R becomes the printed 0"
)
_PRINTED_ZEROS = {"A": "-0.1481", "D": "-8.6677"}


def _invariance_cells(ship: Ship) -> Iterator[Cell]:
    for point, text in _PRINTED_ZEROS.items():
        for tuning in ("low", "high"):
            gamma = ImmersionInvariance.tunings[tuning].gain
            own, as_printed = (
                observer_transfers.immersion_invariance(ship, point, gamma, as_printed=choice)
                for choice in (False, True)
            )
            pole, bare = (float(system.poles().real[0]) for system in (own, as_printed))
            where, reason = f"{point}, gamma {gamma:g}", Reason(_AS_PRINTED, bare - pole)
            basis = "half a unit of the fourth digit"
            for table in ("3-9", "3-10"):
                yield number(table, "pole 1", where, pole, 0.0, 5e-5, basis, reason=reason)
        ours = float(as_printed[0, 0].zeros().real[0])
        _, zero = rounded_table.observer_slopes(ship, rounded_table.rounded_table(ship), point)
        cell = printed_number("3-9", "zero 1", point, ours, text)
        yield explain(cell, shift_to(_BY_OBSERVERS, ours, zero))


_OBSERVERS_CHOSEN_BY = {("3-13", "A"), ("3-13", "D")}


def _random_walk_cells(ship: Ship) -> Iterator[Cell]:
    found = observer_transfers.random_walk_transfers(ship)
    table_of_thesis = rounded_table.rounded_table(ship)
    for line in found[found["zero printed"].notna()].to_dict("records"):
        value = line["zero printed"]
        half = 0.0005 if line["table"] == "3-11" and abs(value) >= 1.0 else 5e-5
        table, point, ours = line["table"], line["point"], line["zero ours"]
        row, kind, reason = f"zero of {line['transfer']}", Kind.FREE, None
        if (table, point) in _OBSERVERS_CHOSEN_BY:
            kind = Kind.CALIBRATED
        elif table in {"3-11", "3-13"}:
            a11, _ = rounded_table.observer_slopes(ship, table_of_thesis, point)
            zero = 1.0 - 1.0 / (1.0 + a11) if table == "3-11" else a11
            reason = shift_to(_BY_OBSERVERS, ours, zero)
        cell = number(table, row, point, ours, value, half, HALF_DIGIT, kind)
        yield explain(cell, reason)


def cells(ship: Ship) -> list[Cell]:
    """Return every cell of the poles, zeros and gains."""
    parts = (
        plant_cells,
        mid_range_cells,
        _linear_observer_cells,
        _invariance_cells,
        _random_walk_cells,
    )
    return [cell for part in parts for cell in part(ship)]


def fitted_coefficients(ship: Ship) -> tuple[pd.DataFrame, float]:
    """Return KQ, KT and slopes by the fit to the print, by the rounded table and by B5-90.

    Also return the largest deviation of the fit from a printed number, in halves of its last digit.
    """
    table_of_thesis, rows, worst = rounded_table.rounded_table(ship), [], 0.0
    for point in (*printed_plant.POINTS, "mid-range"):
        fit = rounded_table.fit_coefficients(ship, point)
        worst = max(worst, fit.worst)
        if point == "mid-range":
            at = rounded_table.mid_range_state(ship, table_of_thesis)
        else:
            at = rounded_table.printed_point(ship, point)
        pair = zip(
            ("KQ", "KT"), (fit.torque, fit.thrust), table_of_thesis.coefficients(at), strict=True
        )
        for name, told, rounded in pair:
            smooth = rounded_table.smooth_coefficient(ship, name.lower(), at)
            line: dict[str, object] = {"point": point, "J": at.advance_ratio, "coefficient": name}
            heads = ("value", "slope over J", "slope over P/D")
            for head, *three in zip(heads, told, rounded, smooth, strict=True):
                shown = (f"{value:.5f}" for value in three)
                line |= {head: " / ".join(shown)}
            rows.append(line)
    return pd.DataFrame(rows), worst


def other_tables(ship: Ship) -> pd.DataFrame:
    """Return how many predicted numbers of Tables 2-3 to 2-14 other rounded tables meet."""
    cells = [cell for cell in plant_cells(ship) if cell.kind is Kind.FREE]
    rows: list[dict[str, object]] = []
    for decimals, steps, change in (
        ((2, 3), (0.05, 0.1), rounded_table.TORQUE_CHANGE),
        ((2, 3), (0.05, 0.1), (1.0, 0.0)),
        ((2, 3), (0.1, 0.1), rounded_table.TORQUE_CHANGE),
        ((2, 3), (0.025, 0.1), rounded_table.TORQUE_CHANGE),
        ((2, 3), (0.05, 0.2), rounded_table.TORQUE_CHANGE),
        ((2, 3), (0.05, 0.05), rounded_table.TORQUE_CHANGE),
        ((2, 4), (0.05, 0.1), rounded_table.TORQUE_CHANGE),
        ((3, 3), (0.05, 0.1), rounded_table.TORQUE_CHANGE),
        ((3, 4), (0.05, 0.1), (1.0, 0.0)),
        ((9, 9), (0.05, 0.1), (1.0, 0.0)),
    ):
        table = rounded_table.rounded_table(ship, decimals, steps, change)
        line: dict[str, object] = {
            "decimals of KT": decimals[0] if decimals[0] < 9 else "exact",
            "decimals of KQ": decimals[1] if decimals[1] < 9 else "exact",
            "step in J": f"{steps[0]:g}",
            "step in P/D": f"{steps[1]:g}",
            "KQ before rounding": f"{change[0]:g} KQ + {change[1]:g}",
        }
        for head, steady in (
            ("printed omega and v_a", False),
            ("steady states of the table", True),
        ):
            models = {
                point: _of_model(
                    rounded_table.model_at(ship, table, point, steady=steady), poles.TABLES
                )
                for point in printed_plant.POINTS
            }
            met = sum(c.low <= models[c.column][c.table, c.row] <= c.high for c in cells)
            line[f"met of {len(cells)} at {head}"] = met
        rows.append(line)
    return pd.DataFrame(rows)


def _fields(ship: Ship) -> dict[str, Any]:
    """Return the tables and numbers of the page."""
    slopes = printed_plant.slopes(ship)
    torque = slopes[slopes["coefficient"] == "KQ"]
    fitted, worst = fitted_coefficients(ship)
    linear = observer_transfers.linear_transfers(ship)
    for column in ("zero printed", "gain printed"):
        linear[column] = linear[column].map("{:.4g}".format).replace("nan", "–")
    walk = observer_transfers.random_walk_transfers(ship)
    for column in ("gain follows", "gain printed"):
        walk[column] = walk[column].map("{:.3g}".format)
    gains = [
        (name, *observer_transfers.gains(name, ship), *values)
        for name, values in observer_transfers.PRINTED_GAINS.items()
    ]
    return {
        "steepest": torque.set_index("point")["steepest slope of B5-90 at this pitch"],
        "fitted": fitted,
        "worst": worst,
        "others": other_tables(ship),
        "mid_range_rounded": rounded_table.mid_range_state(ship, rounded_table.rounded_table(ship)),
        "closest": printed_plant.other_propellers(ship).iloc[0],
        "row": printed_plant.repeated_row(ship),
        "linear": linear,
        "gains": gains,
        "walk": walk,
        "invariance": observer_transfers.invariance_transfers(ship),
        "point": poles.mid_range_point(ship),
        "mid_range": poles.mid_range(ship),
    }


def page(tick: beside.Tick) -> beside.Page:
    """Return the page of Tables 2-2 to 2-23 and 3-1 to 3-14; Figures 2-5, 2-6, 3-2, 3-4, 3-8, 3-10."""
    ship = load_ship("frigate")
    plant, compared, fields = poles.plant_transfers(ship), cells(ship), _fields(ship)
    tick()
    body = fill_template(Path(__file__).with_name("poles.md"), plant=plant, **fields)
    middle = {
        "ours": linearise(ship, fields["point"], outputs=("shaft_speed", "ship_speed")),
        **{name: poles.printed_model(name) for name in poles.SOURCES},
    }
    title = "Linear frigate at the mid-range point (Figure 2-6)"
    drawn = {
        "bode": figures.bode(poles.models(ship), "Linear frigate at A to D (Figure 2-5)"),
        "bode-shaft-observers": figures.shaft_observer_bode(ship),
        "bode-immersion-invariance": figures.invariance_bode(ship),
        "bode-random-walk-kalman": figures.random_walk_bode(ship),
        "bode-mid-range": figures.bode(middle, title),
    }
    numbers = {
        f"{r.table} {r.point}": {"gain": float(r.gain), "gain_thesis": float(r.gain_thesis)}
        for r in plant.itertuples()
    }
    return beside.Page(compared, body, drawn, numbers, plant, plant, 80)


STUDY = beside.Study("Poles, zeros and steady gains (thesis, Tables 2-2 to 3-14)", page, 1)
