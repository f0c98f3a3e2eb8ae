"""The linear plant that the thesis's own printed poles, zeros and gains imply (Tables 2-2 to 2-14).

From eq. 2-35 with r = 2 d c1 v / m and q = c1 v^2 / m, for the states omega and v_s:

    p1 p2 = a22 a33 - a23 a32,   p1 + p2 = a22 + a33,   zero of v_s/d_c1 (Table 2-10) = a22,
    gain of omega/d_c1 (Table 2-9) = -a23 q / (p1 p2)

so the printed numbers give the four elements, and with Y = rho D^5 / (4 pi^2 I)

    a22 = e - Y omega (2 KQ - J dKQ/dJ),   a23 = -2 pi Y (1 - w) / D dKQ/dJ,   e = a i^2 eta / I

give KQ and its slope. The column of the pitch follows from the gains of Tables 2-3 and 2-4.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.core.lazy import control
from shaftline.plant import Ship
from shaftline.plant.open_water import MAX_ADVANCE_RATIO, open_water

from ..side_by_side import published
from .poles import INPUTS, poles_zeros_gain, printed_line, show

POINTS = "ABCD"
GAUGE = dict(zip(("2-5", "2-8", "2-11", "2-14"), INPUTS, strict=True))
"""Tables of the transfers to M_m, and their inputs."""


class PrintedPlant(NamedTuple):
    """The linear model that the printed numbers imply at one point."""

    system: control.StateSpace  # from :data:`INPUTS` to pitch ratio, omega, v_s and M_m
    gauge: tuple[tuple[float, ...], tuple[float, ...]]  # row of M_m in C and in D (eq. 2-31)
    advance_ratio: float
    torque: float  # KQ
    torque_slope: float  # dKQ/dJ
    thrust: float  # KT
    thrust_slope: float  # dKT/dJ


def implied_plant(ship: Ship, point: str, gauge_point: str | None = None) -> PrintedPlant:
    """Return the linear model that the printed numbers of one point imply.

    Its row of M_m is that of ``gauge_point``, the point itself by default.
    """
    record = ship.record()
    behind, ahead = (float(record[f"inertia_{side}_side"]) for side in ("propeller", "engine"))
    inertia, mass, gear = behind + ahead, float(record["mass"]), float(record["gear_ratio"])
    engine = gear * float(record["transmission_efficiency"]) / inertia
    by_speed = engine * gear * float(record["torque_per_speed"])
    by_rack = engine * float(record["torque_per_rack"])
    at = published("advance_velocity_thesis_working_points").loc[point]
    omega, speed = float(at["shaft_speed_rad_s"]), float(at["ship_speed_m_s"])
    inflow = 1.0 - float(record["wake_fraction"])
    diameter, density = float(record["diameter"]), float(record["density"])
    resisting = float(record["resistance_coefficient"]) * speed / mass  # c1 v / m [1/s]

    poles = printed_line("2-6", point).poles
    product, total = poles[0] * poles[1], poles[0] + poles[1]
    a22 = printed_line("2-10", point).zeros[0]
    a33 = total - a22
    a23 = -printed_line("2-9", point).gain * product / (resisting * speed)
    a32 = (a22 * a33 - product) / a23
    to_omega, to_speed = (printed_line(table, point).gain for table in ("2-3", "2-4"))
    a21, a31 = (-(row[0] * to_omega + row[1] * to_speed) for row in ((a22, a23), (a32, a33)))
    lag = 1.0 / float(record["pitch_time_constant"])

    a = [[-lag, 0.0, 0.0], [a21, a22, a23], [a31, a32, a33]]
    b = [
        [lag, 0.0, 0.0, 0.0],
        [0.0, by_rack, 0.0, a23 / inflow],
        [0.0, 0.0, -resisting * speed, (a33 + 2.0 * resisting) / inflow],
    ]
    row = (
        (-ahead * a21, ahead * (by_speed - a22) + behind * by_speed, -ahead * a23),
        (0.0, behind * by_rack, 0.0, -ahead * a23 / inflow),
    )
    gauge = row if gauge_point is None else implied_plant(ship, gauge_point).gauge
    c, d = np.vstack([np.eye(3), gauge[0]]), np.vstack([np.zeros((3, 4)), gauge[1]])
    outputs = ["pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"]
    system = control.ss(a, b, c, d, inputs=list(INPUTS), outputs=outputs)

    advance = inflow * speed / (omega / (2.0 * math.pi) * diameter)
    y = density * diameter**5 / (4.0 * math.pi**2) / inertia
    z = float(record["propellers"]) * (1.0 - float(record["thrust_deduction"])) * density
    z *= diameter**4 / (4.0 * math.pi**2) / mass
    by_velocity = omega * inflow * 2.0 * math.pi / (omega * diameter)
    torque_slope = -a23 / (y * omega * by_velocity)
    thrust_slope = (a33 + 2.0 * resisting) / (z * omega * by_velocity)
    torque = 0.5 * ((by_speed - a22) / (y * omega) + advance * torque_slope)
    thrust = 0.5 * (a32 / (z * omega) + advance * thrust_slope)
    return PrintedPlant(system, gauge, advance, torque, torque_slope, thrust, thrust_slope)


def steepest_slope(ship: Ship, coefficient: str, pitch_ratio: float) -> float:
    """Return the steepest (least) dK/dJ of ``kq`` or ``kt`` at any J from 0 to that of K = 0.

    Differences of the curve over any step lie between its least and largest slope, so no table of the
    curve, however coarse, is steeper.
    """
    curve = ship.record()[coefficient]
    j = np.arange(0.0, MAX_ADVANCE_RATIO, 1e-3)
    k = np.array([open_water(curve, one, pitch_ratio) for one in j])
    return float(np.min(np.diff(k)[k[1:] > 0.0]) / 1e-3)


def _value_and_slope(
    ship: Ship, coefficient: str, j: float, pitch_ratio: float
) -> tuple[float, float]:
    curve, step = ship.record()[coefficient], 1e-4
    low, middle, high = (open_water(curve, j + by, pitch_ratio) for by in (-step, 0.0, step))
    return float(middle), float((high - low) / (2.0 * step))


def _pitch(point: str) -> float:
    return float(published("advance_velocity_thesis_working_points").loc[point, "pitch_ratio"])


def _coefficients(found: PrintedPlant) -> Iterator[tuple[str, float, float]]:
    """Yield name, value and slope of KQ and KT."""
    yield "KQ", found.torque, found.torque_slope
    yield "KT", found.thrust, found.thrust_slope


def other_propellers(ship: Ship) -> pd.DataFrame:
    """Return B-series propellers, sorted by the distance of KQ, KT and slopes from the implied ones.

    Returns:
        Columns blades, area ratio, rms of the eight relative differences, and the differences of the
        slopes at A [%]; the closest first.
    """
    wanted = {point: implied_plant(ship, point) for point in "AC"}
    rows = []
    for blades, area in itertools.product(
        range(2, 8), np.arange(0.3, 1.051, 0.05).round(2).tolist()
    ):
        changes = {"propeller.blades": blades, "propeller.expanded_area_ratio": area}
        one, off = ship.with_values(changes), {}
        for point, told in wanted.items():
            for name, value, slope in _coefficients(told):
                mine = _value_and_slope(one, name.lower(), told.advance_ratio, _pitch(point))
                off[f"{name} at {point} [%]"] = 100.0 * (mine[0] / value - 1.0)
                off[f"d{name}/dJ at {point} [%]"] = 100.0 * (mine[1] / slope - 1.0)
        rms = float(np.sqrt(np.mean(np.square(list(off.values())))))
        rows.append({"blades": blades, "area ratio": area, "rms [%]": rms, **off})
    return pd.DataFrame(rows).sort_values("rms [%]", ignore_index=True)


def slopes(ship: Ship) -> pd.DataFrame:
    """Return KQ, KT and their slopes implied by the printed numbers at A to D, beside those of B5-90."""
    rows = []
    for point in POINTS:
        found, pitch = implied_plant(ship, point), _pitch(point)
        for name, value, slope in _coefficients(found):
            own = _value_and_slope(ship, name.lower(), found.advance_ratio, pitch)
            rows.append(
                {
                    "point": point,
                    "coefficient": name,
                    "J": found.advance_ratio,
                    "implied": value,
                    "B5-90": own[0],
                    "implied slope": slope,
                    "slope of B5-90": own[1],
                    "steepest slope of B5-90 at this pitch": steepest_slope(
                        ship, name.lower(), pitch
                    ),
                }
            )
    return pd.DataFrame(rows)


def common_row() -> tuple[dict[str, float], float]:
    """Return the one row of M_m that is nearest to all printed gains of Tables 2-5, 2-8, 2-11 and 2-14.

    Each gain is (row to omega) x (gain to omega) + (row to v_s) x (gain to v_s) + what the input adds
    itself; the resistance adds nothing. Least squares of the relative differences.

    Returns:
        The row by signal [N m per unit], and the largest relative difference from a printed gain.
    """
    signals = ("omega", "v_s", "P/D", "X", "u_x")
    direct = {"2-5": "P/D", "2-8": "X", "2-14": "u_x"}
    lines = []
    for table, point in itertools.product(GAUGE, POINTS):
        last = int(
            table.removeprefix("2-")
        )  # the gains to omega and v_s stand in the two tables before
        line = dict.fromkeys(signals, 0.0)
        line["omega"], line["v_s"] = (printed_line(f"2-{last - by}", point).gain for by in (2, 1))
        if table in direct:
            line[direct[table]] = 1.0
        lines.append([line[name] / printed_line(table, point).gain for name in signals])
    row = np.linalg.lstsq(np.array(lines), np.ones(len(lines)), rcond=None)[0]
    worst = float(np.max(np.abs(np.array(lines) @ row - 1.0)))
    return dict(zip(signals, row.tolist(), strict=True)), worst


def repeated_row(ship: Ship) -> pd.DataFrame:
    """Return gains and zeros to M_m at B, C and D: by the point's own row, by A's row, and printed."""
    rows = []
    for point in POINTS[1:]:
        systems = {
            who: implied_plant(ship, point, at).system for who, at in (("own", None), ("A", "A"))
        }
        for table, source in GAUGE.items():
            line: dict[str, object] = {"table": table, "input": source, "point": point}
            for who, system in systems.items():
                _, zeros, gain = poles_zeros_gain(system["shaft_torque", source])
                line |= {f"gain, row of {who}": gain, f"zeros, row of {who}": show(zeros)}
            told = printed_line(table, point)
            rows.append(line | {"gain printed": told.gain, "zeros printed": show(told.zeros)})
    return pd.DataFrame(rows)
