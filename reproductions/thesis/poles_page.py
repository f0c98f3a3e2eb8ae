"""Compare the printed poles, zeros and gains with ours, Tables 2-2 to 2-23 and 3-1 to 3-14.

The poles of a point stand in twelve tables and count once. Steady gains of Tables 3-11 to 3-14 are
printed at z = 0, divided by the product of two poles that are rounding errors, and are no cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shaftline.core.lazy import control
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.plant import Ship, equilibrium, linearise, load_ship

from ..cells import Cell, Kind, Reason, half_digit, number
from ..pages import fill_template
from ..side_by_side import Page, Study, Tick, published_text
from . import figures, observer_transfers, poles, printed_plant
from .poles import Printed, poles_zeros_gain, printed_line

DIGITS = "half a unit of the last printed digit"
PROPAGATED = (
    f"{DIGITS}, and the change by half a digit of the printed rack (Table 2-1); Table B-1 as exact"
)
ROUNDED_ZERO = "the print shows the rounding of a number that is 0"
GAUGE_SHARE = 0.04
"""Relative tolerance of the gains to M_m at B, C and D by A's row on the printed plant."""

_ROUNDING = 1e-6

Found = dict[tuple[str, str], float]
"""Our number by table and name, such as ``zero 1``."""


def _numbered(kind: str, values: Any) -> dict[str, float]:
    return {f"{kind} {i + 1}": float(value) for i, value in enumerate(values)}


def _of_model(model: control.StateSpace, tables: dict[str, tuple[str, str]]) -> Found:
    found: Found = {}
    for table, (output, source) in tables.items():
        lag, zeros, gain = poles_zeros_gain(model[output, source])
        names = {**_numbered("zero", zeros), "gain": gain}
        if output == "shaft_speed" and source == "drive":  # the poles of the point, once
            names |= _numbered("pole", lag)
        if output == "pitch_ratio":
            names = {"pole 1": lag[0], "gain": gain}
        found |= {(table, name): value for name, value in names.items()}
    return found


def _at(ship: Ship, rack: float, pitch: float) -> Found:
    return _of_model(linearise(ship, equilibrium(ship, rack, pitch)), poles.TABLES)


def _printed_numbers(line: Printed) -> Iterator[tuple[str, float, float]]:
    for kind, values, rounding in (
        ("pole", line.poles, line.pole_rounding),
        ("zero", line.zeros, line.zero_rounding),
        ("gain", (line.gain,), (line.gain_rounding,)),
    ):
        for i, (value, half) in enumerate(zip(values, rounding, strict=True)):
            yield kind if kind == "gain" else f"{kind} {i + 1}", value, half


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
    values = {
        (table, name): value
        for table in tables
        for name, value, _ in _printed_numbers(printed_line(table, point))
    }
    return {
        key: Reason(_REPEATED, shift, min(GAUGE_SHARE * abs(values[key]), 0.5 * abs(shift)))
        for key in own
        if (shift := of_a[key] - own[key])
    }


def plant_cells(ship: Ship) -> list[Cell]:
    """Return the cells of Tables 2-2 to 2-14."""
    points, cells = published_text("advance_velocity_thesis_working_points"), []
    for point in printed_plant.POINTS:
        rack, pitch = (points.loc[point, name] for name in ("fuel_rack_mm", "pitch_ratio"))
        half = half_digit(rack)
        reasons = {} if point == "A" else gauge_reasons(ship, point)
        ours, *moved = (_at(ship, float(rack) + by, float(pitch)) for by in (0.0, half, -half))
        for table, (output, _) in poles.TABLES.items():
            for name, value, rounding in _printed_numbers(printed_line(table, point)):
                if (table, name) not in ours:
                    continue  # a pole that stands in another table
                mine = ours[table, name]
                spread = max(abs(other[table, name] - mine) for other in moved)
                kind = Kind.INPUT if output == "pitch_ratio" else Kind.FREE
                cells.append(
                    number(table, name, point, mine, value, rounding + spread, PROPAGATED, kind,
                           reasons.get((table, name)))
                )  # fmt: skip
    return cells


def mid_range_cells(ship: Ship) -> list[Cell]:
    """Return the cells of Tables 2-16 to 2-23: the thesis's model at the point that two gains set."""
    model = linearise(ship, poles.mid_range_point(ship))
    ours, cells = _of_model(model, poles.MID_RANGE_TABLES), []
    for table in poles.MID_RANGE_TABLES:
        for name, value, rounding in _printed_numbers(printed_line(table, poles.SOURCES[0])):
            if (table, name) not in ours:
                continue
            fitted = table in {"2-18", "2-19"} and name == "gain"
            kind = Kind.CALIBRATED if fitted else Kind.FREE
            cells.append(
                number(table, name, "mid-range", ours[table, name], value, rounding, DIGITS, kind)
            )
    return cells


def _linear_observer_cells(ship: Ship) -> Iterator[Cell]:
    texts = published_text("advance_velocity_thesis_observer_transfers").reset_index()
    found = observer_transfers.linear_transfers(ship)
    for text, line in zip(texts.itertuples(), found.to_dict("records"), strict=True):
        for what, shown in (("zero", text.zero_rad_s), ("gain", text.dc_gain)):
            if not shown.strip():
                continue
            value, tolerance, basis = float(shown), half_digit(shown), DIGITS
            if abs(value) < _ROUNDING:
                value, tolerance, basis = 0.0, _ROUNDING, ROUNDED_ZERO
            yield number(text.table, f"{what} of {text.output}^/{text.input}", text.observer,
                         line[f"{what} ours"], value, tolerance, basis)  # fmt: skip
    for name, gains in observer_transfers.PRINTED_GAINS.items():
        for i, (ours, value) in enumerate(
            zip(observer_transfers.gains(name, ship), gains, strict=True), 1
        ):
            yield number(
                "section 3-1-3", f"k{i}", name, ours, value, half_digit(f"{value:.1e}"), DIGITS
            )
    kalman = observer_transfers.linear_observer(observer_transfers.KALMAN, ship).poles()
    for what, mine, value in (
        ("real part of the poles", kalman.real[0], -10.53),
        ("imaginary part of the poles", np.abs(kalman.imag[0]), 10.41),
    ):
        yield number("3-5", what, observer_transfers.KALMAN, float(mine), value, 0.005, DIGITS)


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
            where = f"{point}, gamma {gamma:g}"
            for table in ("3-9", "3-10"):
                yield number(table, "pole 1", where, pole, 0.0, 5e-5, "half a unit of the fourth digit",
                             reason=Reason(_AS_PRINTED, bare - pole))  # fmt: skip
        (zero,) = as_printed[0, 0].zeros().real
        yield number("3-9", "zero 1", point, float(zero), float(text), half_digit(text), DIGITS)


def _random_walk_cells(ship: Ship) -> Iterator[Cell]:
    found = observer_transfers.random_walk_transfers(ship)
    for line in found[found["zero printed"].notna()].to_dict("records"):
        digits = 0.0005 if line["table"] == "3-11" else 5e-5
        if abs(line["zero printed"]) < 1.0:
            digits = 5e-5
        yield number(line["table"], f"zero of {line['transfer']}", line["point"], line["zero ours"],
                     line["zero printed"], digits, DIGITS)  # fmt: skip


def cells(ship: Ship) -> list[Cell]:
    """Return every cell of the poles, zeros and gains."""
    return [
        *plant_cells(ship),
        *mid_range_cells(ship),
        *_linear_observer_cells(ship),
        *_invariance_cells(ship),
        *_random_walk_cells(ship),
    ]


def _fields(ship: Ship) -> dict[str, Any]:
    """Return the tables and numbers of the page."""
    slopes = printed_plant.slopes(ship)
    torque = slopes[slopes["coefficient"] == "KQ"]
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
        "slopes": slopes, "torque": 100.0 * (torque["implied"] / torque["B5-90"] - 1.0).abs().max(),
        "closest": printed_plant.other_propellers(ship).iloc[0],
        "row": printed_plant.repeated_row(ship), "linear": linear, "gains": gains, "walk": walk,
        "invariance": observer_transfers.invariance_transfers(ship),
        "point": poles.mid_range_point(ship), "mid_range": poles.mid_range(ship),
    }  # fmt: skip


def page(tick: Tick) -> Page:
    """Return the page of Tables 2-2 to 2-23 and 3-1 to 3-14; Figures 2-5, 2-6, 3-2, 3-4, 3-8, 3-10."""
    ship = load_ship("frigate")
    plant = poles.plant_transfers(ship)
    compared, fields = cells(ship), _fields(ship)
    tick()
    body = fill_template(Path(__file__).with_name("poles.md"), plant=plant, **fields)
    models = {
        "ours": linearise(ship, fields["point"], outputs=("shaft_speed", "ship_speed")),
        **{name: poles.printed_model(name) for name in poles.SOURCES},
    }
    drawn = {
        "bode": figures.bode(poles.models(ship), "Linear frigate at A to D (Figure 2-5)"),
        "bode-shaft-observers": figures.shaft_observer_bode(ship),
        "bode-immersion-invariance": figures.invariance_bode(ship),
        "bode-random-walk-kalman": figures.random_walk_bode(ship),
        "bode-mid-range": figures.bode(
            models, "Linear frigate at the mid-range point (Figure 2-6)"
        ),
    }
    numbers = {
        f"{r.table} {r.point}": {"gain": float(r.gain), "gain_thesis": float(r.gain_thesis)}
        for r in plant.itertuples()
    }
    return Page(compared, body, drawn, numbers, plant, plant, 80)


STUDY = Study("Poles, zeros and steady gains (thesis, Tables 2-2 to 3-14)", page, 1)
