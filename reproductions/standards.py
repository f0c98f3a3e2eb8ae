"""Compare resistance and trial corrections with published examples; write ``standards.md``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from shaftline.display.tables import write_table
from shaftline.performance.corrections import SEA_WATER, regular_wave_resistance, wave_resistance
from shaftline.plant.holtrop import HullForm, interaction, resistance
from shaftline.plant.particulars import Particulars, design_point, hull_form
from shaftline.plant.surroundings import GRAVITY, KNOT

from .pages import fill_template, make_parser

TITLE = "Resistance and trial corrections compared with published examples"

SHIP_1982 = HullForm(
    length_m=205,
    beam_m=32,
    draught_m=10,
    displacement_m3=37500,
    midship_coefficient=0.98,
    waterplane_coefficient=0.75,
    lcb_percent=-0.75,
    transom_area_m2=16,
    bulb_area_m2=20,
    bulb_centre_m=4,
    appendage_area_m2=50,
    appendage_factor=1.5,
    stern_shape=10,
)
SHIP_1984 = HullForm(
    length_m=50,
    beam_m=12,
    draught_m=3.2,
    draught_forward_m=3.1,
    draught_aft_m=3.3,
    displacement_m3=900,
    midship_coefficient=0.78,
    waterplane_coefficient=0.8,
    lcb_percent=-4.5,
    transom_area_m2=10,
    appendage_area_m2=50,
    appendage_factor=3,
    entrance_angle_deg=25,
    wetted_surface_m2=584.9,
)
PRINTED_1984 = {25: 662.0, 27: 715.0, 29: 756.0, 31: 807.0, 33: 864.0, 35: 925.0}
"""Total resistance [kN] by speed [kn]."""

TANKER = HullForm(
    length_m=320,
    beam_m=58,
    draught_m=20.8,
    displacement_m3=312622,
    midship_coefficient=0.998,
    waterplane_coefficient=0.9,
    lcb_percent=3.5,
)
"""KVLCC2 at full scale."""

STAWAVE = {
    0.2: 0.59833,
    0.5: 0.80324,
    0.8: 1.43766,
    1.0: 1.69708,
    1.2: 1.2448,
    1.5: 0.46587,
    2.0: 0.10527,
}
"""Coefficient of added resistance by wave length over ship length, by the program sta.js at 15.5 kn."""


class Row(NamedTuple):
    """Value here beside the published one."""

    source: str
    quantity: str
    unit: str
    published: float
    here: float


def compare() -> list[Row]:
    """Return all comparisons; each is predicted, nothing is fitted."""
    first, second = "Holtrop & Mennen 1982", "Holtrop 1984"
    parts = resistance(SHIP_1982, 25.0 * KNOT)
    rows = [
        Row(first, "prismatic coefficient", "-", 0.5833, SHIP_1982.prismatic_coefficient),
        Row(first, "length of run", "m", 81.385, SHIP_1982.length_of_run),
        Row(first, "wetted surface", "m2", 7381.45, SHIP_1982.wetted_surface),
        Row(first, "half angle of entrance", "deg", 12.08, SHIP_1982.entrance_angle),
        Row(first, "bulb factor c2", "-", 0.7595, SHIP_1982.bulb_factor),
        Row(first, "correlation allowance", "-", 0.000352, SHIP_1982.correlation_allowance),
        Row(first, "resistance of appendages", "kN", 8.83, parts.appendages / 1e3),
        Row(first, "resistance of the bulb", "kN", 0.049, parts.bulb / 1e3),
        Row(first, "model-ship correlation", "kN", 221.98, parts.correlation / 1e3),
        Row(
            first,
            "relative rotative efficiency",
            "-",
            0.9931,
            interaction(SHIP_1982, 8.0, 25.0 * KNOT, 1, 0.7393).relative_rotative_efficiency,
        ),
    ]
    for knots, printed in PRINTED_1984.items():
        total = resistance(SHIP_1984, knots * KNOT).total / 1e3
        rows.append(Row(second, f"total resistance at {knots} kn", "kN", printed, total))
    unit = 4.0 * SEA_WATER * GRAVITY * TANKER.beam_m**2 / TANKER.length_m
    for ratio, other in STAWAVE.items():
        frequency = math.sqrt(2.0 * math.pi * GRAVITY / (ratio * TANKER.length_m))
        force = regular_wave_resistance(TANKER, 15.5 * KNOT, frequency) / unit
        rows.append(Row("sta.js", f"STAWAVE-2, wave length {ratio:g} L", "-", other, force))
    sea = wave_resistance(TANKER, 15.1 * KNOT, 1.5, 6.0, density=1025.0) / 1e3
    rows.append(Row("sta.js", "STAWAVE-2, sea of 1.5 m and 6 s", "kN", 73.61, sea))
    given = Particulars(
        name="kvlcc2",
        length_m=325.5,
        beam_m=58,
        draught_m=20.8,
        displacement_t=320438,
        design_speed_kn=15.5,
        mcr_kW=28000,
        engine_speed_rpm=76,
        shaft_speed_rpm=76,
        propeller_diameter_m=9.86,
        midship_coefficient=0.998,
        lcb_percent=3.5,
        stern_shape=10,
    )
    point = design_point(given, hull_form(given))
    rows += [
        Row("KVLCC2 (SIMMAN 2008)", "pitch ratio from particulars", "-", 0.721, point.pitch_ratio),
        Row(
            "KVLCC2 (SIMMAN 2008)",
            "expanded area ratio from particulars",
            "-",
            0.431,
            point.expanded_area_ratio,
        ),
    ]
    return rows


def main(arguments: list[str] | None = None) -> None:
    """Write the page."""
    options = make_parser("standards", __doc__, "out/standards").parse_args(arguments)
    table = pd.DataFrame(compare())
    table["difference [%]"] = 100.0 * (table["here"] / table["published"] - 1.0)
    body = fill_template(Path(__file__).with_suffix(".md"), table=table)
    write_table(options.out, "standards", TITLE, "python -m reproductions standards", table, body)
    print(options.out / "standards.md")
