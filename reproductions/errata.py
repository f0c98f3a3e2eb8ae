"""List the contradictions of the five sources, each with the calculation that shows it.

The texts stand in ``errata.toml``. Their numbers are calculated here from the printed ones and are not
copied. The page is ``docs/results/errata.md``.
"""

from __future__ import annotations

import cmath
import itertools
import math
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.baselines import loop_shaping
from shaftline.baselines.loop_shaping import TAYLOR
from shaftline.plant import load_ship
from shaftline.plant.loops import Loop
from shaftline.plant.open_water import open_water

from .ferry.experiment import printed_levers
from .pages import fill_text, make_parser, write_page
from .side_by_side import published
from .thesis import observer_transfers, printed_plant, sensitivity
from .thesis.poles import printed_line

FOOT, LONG_TON, KNOT, WATER = 0.3048, 1016.047, 0.514444, 1025.0
TITLE = "Errata of the five sources"

SOURCES = {
    "observers": "van der Kroft 2020, advance velocity observers (TU Delft)",
    "drive train": "Vrijdag & Martelli 2021, identification of the Tito Neri drive train",
    "steering": "Taylor 2000, state-augmented EKF, autopilot and track controller (MIT)",
    "optimiser": "the CPP optimiser on a ferry",
    "anti-spin": "Pivano et al. 2008, four-quadrant thrust control and anti-spin",
}

TEXTS = ("where", "printed", "shown", "used")

Values = dict[str, Any]


class Erratum(NamedTuple):
    """A contradiction, or a remark on words that are less exact than the numbers beside them.

    ``shown`` is the calculation that shows it, ``used`` what the reproductions use instead.
    """

    source: str  # a key of :data:`SOURCES`
    where: str
    printed: str
    shown: str
    used: str
    remark: bool = False


def _signs() -> list[Values]:
    table, rows = published("advance_velocity_thesis_sensitivity"), []
    for row, column in sensitivity.find_sign_misprints(table):
        cells = table.loc[row]
        changes = cells.iloc[1:7].astype(float)
        pairs = [
            " and ".join(pair)
            for pair in itertools.combinations(changes.index[changes != 0.0], 2)
            if abs(changes.where(~changes.index.isin(pair), -changes).std() - cells["sd"]) < 0.005
        ]
        rows.append(
            {
                "row": row,
                "column": column,
                "cells": cells,
                "changes": changes,
                "turned": changes.where(changes.index != column, -changes),
                "listed": ", ".join(f"{value:+.2f}" for value in changes),
                "others": f"; so would {', or '.join(pairs)} together" if pairs else "",
            }
        )
    return rows


def _random_walk() -> Values:
    table = observer_transfers.random_walk_transfers(load_ship("frigate"))
    free = table[table["table"] != "3-14"]  # whose gains give k2
    return {
        "slip": table[(table["table"] == "3-11") & (table["point"] == "C")].iloc[0],
        "worst": 100.0 * (free["gain follows"] / free["gain printed"] - 1.0).abs().max(),
    }


def _equations() -> Values:
    ship = load_ship("frigate")
    record = ship.record()
    gear, loss = float(record["gear_ratio"]), float(record["transmission_efficiency"])
    omega, torque = 14.2, 37430.0 * gear * loss
    scale = float(record["density"] * record["diameter"] ** 5)
    advance = 11.2 * 2.0 * math.pi / (omega * float(record["diameter"]))
    blades = {n: ship.with_values({"propeller.blades": n}).record()["kq"] for n in (4, 6)}
    return {
        "drag": float(record["resistance_coefficient"]),
        "mass": float(record["mass"]),
        "speed": 11.8,
        "zero": printed_line("2-12", "D").zeros[0],
        "gear": gear,
        "loss": loss,
        "omega": omega,
        "torque": torque,
        "slip": torque / (scale * omega**2 / (2.0 * math.pi)),
        "right": torque / (scale * (omega / (2.0 * math.pi)) ** 2),
        "advance": advance,
        "curve": open_water(record["kq"], advance, 1.4),
        "other": {n: open_water(kq, advance, 1.4) for n, kq in blades.items()},
    }


def _repeated_row() -> Values:
    ship = load_ship("frigate")
    (pitch, speed, ahead), (_, rack, _, _) = printed_plant.implied_plant(ship, "A").gauge
    own = printed_plant.implied_plant(ship, "D").gauge
    to_speed, to_ship = (printed_line(table, "D").gain for table in ("2-6", "2-7"))
    row, worst = printed_plant.common_row()
    return {
        "pitch": pitch,
        "speed": speed,
        "ahead": ahead,
        "rack": rack,
        "row": row,
        "worst": worst,
        "to_speed": to_speed,
        "to_ship": to_ship,
        "printed_line": printed_line,
        "by_own": own[0][1] * to_speed + own[0][2] * to_ship + own[1][1],
        "by_row": row["omega"] * to_speed + row["v_s"] * to_ship + row["X"],
    }


def _two_slopes() -> Values:
    record = load_ship("frigate").record()
    behind = float(record["inertia_propeller_side"])
    inertia = behind + float(record["inertia_engine_side"])
    slope = (
        record["torque_per_speed"] * record["gear_ratio"] ** 2 * record["transmission_efficiency"]
    )
    engine = float(slope) / inertia
    numbers = {
        point: tuple(printed_line(table, point).zeros[0] for table in ("3-13", "2-10"))
        for point in printed_plant.POINTS
    }
    ratios = {p: (engine - observer) / (engine - plant) for p, (observer, plant) in numbers.items()}
    return {
        "engine": engine,
        "behind": behind,
        "inertia": inertia,
        "ratios": ratios,
        "observer": numbers["A"][0],
        "plant": numbers["A"][1],
        "listed": ", ".join(f"{point} {ratio:.3f}" for point, ratio in ratios.items()),
    }


class _PointC(NamedTuple):
    """A set of Table 5 at point C of Table 4: quantities of eqs. 8 to 13 and A26 to A35."""

    efficiency: float  # eta = 1 - M_f / (K_e i) [-]
    shaft_time: float  # tau_w = I_p w / (K_e i), eq. 29 [s]
    stiffness: float  # C = 1 + K_e w / (2 eta R_a i) [-]
    electric_time: float  # tau_em = L_a / R_a [s]
    gain: float  # U / (R_a i) [-]

    @property
    def slow_pole(self) -> float:
        """Return s2 = -2 C eta / tau_w [rad/s] (A34 with tau_we = tau_w / (2 eta))."""
        return -2.0 * self.stiffness * self.efficiency / self.shaft_time

    def current(self, frequency: float) -> complex:
        """Return the transfer of the voltage to the current (eq. 12) at a frequency [rad/s]."""
        effective, s = self.shaft_time / (2.0 * self.efficiency), 1j * frequency
        below = self.electric_time * effective * s**2 + (self.electric_time + effective) * s
        return (effective * s + 1.0) * self.gain / (below + self.stiffness)

    def phase(self, frequency: float) -> float:
        """Return the phase of the current at a frequency [rad/s], in degrees."""
        return math.degrees(cmath.phase(self.current(frequency)))


def _at_point_c(column: str) -> _PointC:
    one = (
        published("tito_neri_identified_parameters")[column]
        .drop("unit", errors="ignore")
        .astype(float)
    )
    point = published("tito_neri_operating_points").loc["C"]
    current, speed = float(point["motor_current_A"]), float(point["motor_speed_rad_s"])
    torque, drop = one["K_e"] * current, one["R_a"] * current
    efficiency = 1.0 - one["M_f"] / torque
    return _PointC(
        efficiency,
        one["I_p"] * speed / torque,
        1.0 + one["K_e"] * speed / (2.0 * efficiency * drop),
        one["L_a"] / one["R_a"],
        float(point["motor_voltage_V"]) / drop,
    )


def _drive_train() -> Values:
    first, fourth = (_at_point_c(c) for c in ("staircase_method_1", "sine_correlation_method_4"))
    response = published("tito_neri_frequency_response")
    kept = float(response["current_phase_deg"].loc[500.0])
    resistances = published("tito_neri_identified_parameters").loc["R_a"]
    resistance = float(resistances["sine_correlation_method_4"])

    def phase_error(inductance: float) -> float:
        return fourth._replace(electric_time=inductance / resistance).phase(500.0) - kept

    return {
        "first": first,
        "fourth": fourth,
        "measured": response["current_gain"],
        "kept": kept,
        "printed": -first.stiffness * first.efficiency / first.slow_pole,
        "by_phase": scipy.optimize.brentq(phase_error, 1e-5, 1e-3),
    }


def _block_coefficient(draught_ft: float) -> float:
    """Return the block coefficient of the Esso Osaka at a draught."""
    length, beam = 1066.3 * FOOT, 173.9 * FOOT
    return 314_410.0 * LONG_TON / (WATER * length * beam * draught_ft * FOOT)


def _lift_slope(factor: float, ratio: float = 1.538) -> float:
    """Return the lift slope of a rudder of an aspect ratio [1/rad] (eq. 3.30)."""
    terms = factor * math.pi, math.pi * ratio, 2.0 * math.pi * ratio**2
    return 1.0 / sum(1.0 / term for term in terms)


def _steering() -> Values:
    middle = 4.0 * math.sqrt(60.0)  # 2 zeta w_n with w_n = sqrt(60) and zeta = 2
    roots = np.roots([1.0, 0.0, 60.0 + middle, 60.0])
    length, speed = 466.0 * FOOT, 22.0 * KNOT
    own = loop_shaping.heading_plant(TAYLOR, loop_shaping.TAYLOR_GEAR)
    loop = Loop.from_plant(own.system, loop_shaping.shape_controller(loop_shaping.COURSE_LOOP, own))
    return {
        "middle": middle,
        "rightmost": roots[np.argmax(roots.real)],
        "length": length,
        "speed": speed,
        "seconds": length / speed,
        "crossover": loop.margins().crossover,
        "gain": TAYLOR.gain,
        "swing": TAYLOR.gain * math.radians(10.0),  # rate of turn, rad/s or rad per ship length
        "wave": math.sqrt(2.0 * math.pi * 9.81 / (400.0 * FOOT)),
        "block": _block_coefficient,
        "slope": _lift_slope,
        "pi": math.pi,
    }


def _optimiser() -> Values:
    held, plain = printed_levers("optimal"), printed_levers("combinator")
    off = held["sfoc_g_kwh_before"] - plain["sfoc_g_kwh_before"]
    return {
        "held": held,
        "plain": plain,
        "differ": ", ".join(f"{value:+.1f}" for value in off),
        "most": 100.0 * float((off / plain["sfoc_g_kwh_before"]).abs().max()),
    }


def _anti_spin() -> Values:
    with_it, without = 0.151 * 290.0 / 79.2, 0.123 * 378.0 / 89.1
    return {"ratio": 0.151 / 0.123, "with_it": with_it, "without": without}


def errata() -> list[Erratum]:
    """Return every contradiction, by source."""
    values = {
        "signs": _signs(),
        "random-walk": [_random_walk()],
        "equations": [_equations()],
        "repeated-row": [_repeated_row()],
        "two-slopes": [_two_slopes()],
        "drive-train": [_drive_train()],
        "steering": [_steering()],
        "optimiser": [_optimiser()],
        "anti-spin": [_anti_spin()],
    }
    found = []
    for entry in tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))[
        "erratum"
    ]:
        for one in values[entry["values"]]:
            texts = {name: fill_text(entry[name], **one).replace("\n", " ") for name in TEXTS}
            found.append(Erratum(entry["source"], **texts, remark=entry.get("remark", False)))
    return found


def main() -> None:
    """Write the page."""
    folder = make_parser("errata", __doc__, "out/errata").parse_args().out
    table = pd.DataFrame(errata())
    parts = {
        SOURCES[key]: own.drop(columns=["source", "remark"])
        for key, own in table[~table["remark"]].groupby("source", sort=False)
    }
    remarks = table[table["remark"]].drop(columns="remark")
    template = Path(__file__).with_suffix(".md")
    write_page(folder, "errata", TITLE, "errata", table, template, parts=parts, remarks=remarks)
    print(table.to_string(index=False))
