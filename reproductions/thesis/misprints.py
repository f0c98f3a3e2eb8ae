"""What the thesis contradicts itself in: rows of the errata page, each with formula and numbers."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import pandas as pd

from shaftline.plant import Ship, load_ship
from shaftline.plant.open_water import open_water

from ..side_by_side import published
from . import dead_beat, printed_plant, sensitivity
from .printed_lines import printed


class Misprint(NamedTuple):
    """One contradiction."""

    where: str
    printed: str
    shown: str
    """The calculation: formula and numbers."""
    used: str
    """What is used here in its place."""


def _turns_that_fit(changes: pd.Series, deviation: float) -> list[str]:
    """Return pairs of changes whose signs, both turned, give the printed standard deviation as well."""
    moved = changes.index[changes != 0.0]
    return [
        " and ".join(pair)
        for pair in itertools.combinations(moved, 2)
        if abs(changes.where(~changes.index.isin(pair), -changes).std() - deviation) < 0.005
    ]


def _signs() -> list[Misprint]:
    table, found = published("advance_velocity_thesis_sensitivity"), []
    for row, column in sensitivity.sign_slips(table):
        cells = table.loc[row]
        changes = cells.iloc[1:7].astype(float)
        turned = changes.where(changes.index != column, -changes)
        listed = ", ".join(f"{value:+.2f}" for value in changes)
        pairs = _turns_that_fit(changes, float(cells["sd"]))
        others = f"; so would {', or '.join(pairs)} together" if pairs else ""
        found.append(
            Misprint(
                f"Table 5-1, {row}, {column}",
                f"{changes[column]:+.2f}",
                "SD = sqrt(sum((x - mean)^2) / 5) of the row's six changes "
                f"({listed}) is {changes.std():.2f} as printed and {turned.std():.2f} with the other "
                "sign "
                f"of {changes[column]:+.2f}; the row prints {cells['sd']:.2f}. No other single sign "
                f"gives it{others}",
                f"{-changes[column]:+.2f}",
            )
        )
    return found


def _random_walk(ship: Ship) -> list[Misprint]:
    table = dead_beat.compared(ship)
    free = table[table["table"] != "3-14"]  # whose gains give k2
    slip = table[(table["table"] == "3-11") & (table["point"] == "C")].iloc[0]
    worst = 100.0 * (free["gain follows"] / free["gain printed"] - 1.0).abs().max()
    return [
        Misprint(
            "Table 3-11, C",
            f"a zero of {slip['zero printed']:.3f}",
            "the zero is 1 - 1 / (1 + a11), where a11 is the zero of Table 3-13: with -0.6648 it is "
            f"{slip['zero follows']:.3f}; the same formula gives A (-0.0659: -0.0706), B (-0.1239: "
            "-0.1414) "
            "and D (-1.8686: 2.151) to their digits",
            "the other sign",
        ),
        Misprint(
            "Tables 3-11 to 3-14",
            "poles near 0 and zeros, discussed as frequencies of a Bode plot; steady gains to 1e16",
            "the filter of the section has A = [[a11, a12], [0, 1]] taken as the matrix of one step and "
            "so little measurement noise that it is a dead-beat predictor, x+ = (A - K C) x + B u + K y "
            "with K = (1 + a11, 1 / a12): both poles lie at z = 0 and the printed ones are what "
            "rounding leaves of them. Its gains at z = 0 are -a11 / (p1 p2), -1 / (I_R p1 p2), -k2 a11 "
            "/ (p1 p2) and -k2 / (I_R p1 p2). With the printed poles p1 and p2, a11 (the zero of Table "
            "3-13), I_R (Table B-1), and k2 taken from the gains of Table 3-14, the other twelve "
            f"printed gains follow within {worst:.1f} % (at A: 0.0659 / (-4.610e-10 x 3.795e-7) = "
            "-3.77e14)",
            "poles at z = 0; the gains have no meaning",
        ),
    ]


def _equations(ship: Ship) -> list[Misprint]:
    record = ship.record()
    drag, mass = float(record["resistance_coefficient"]), float(record["mass"])
    speed, zero = 11.8, printed("2-12", "D").zeros[0]
    gear, loss = float(record["gear_ratio"]), float(record["transmission_efficiency"])
    omega, torque = 14.2, 37430.0 * gear * loss
    scale = float(record["density"] * record["diameter"] ** 5)
    slip = torque / (scale * omega**2 / (2.0 * math.pi))
    right = torque / (scale * (omega / (2.0 * math.pi)) ** 2)
    advance = 11.2 * 2.0 * math.pi / (omega * float(record["diameter"]))
    curve = open_water(record["kq"], advance, 1.4)
    other = {
        blades: open_water(
            ship.with_values({"propeller.blades": blades}).record()["kq"], advance, 1.4
        )
        for blades in (4, 6)
    }
    return [
        Misprint(
            "eq. 2-35, a33",
            "d_c1 c1 v_s^2 / m_s for the slope of the resistance",
            "the resistance is d_c1 c1 v_s^2, so its slope is 2 d_c1 c1 v_s / m_s, as eqs. 2-29 and "
            "2-30 have it. Its negative is the zero of omega/u_x (Table 2-12), where the terms of the "
            "propeller cancel, since u_x and v_s enter them alike: at D, v_s = "
            f"{speed:g} m/s, 2 x {drag:g} x {speed:g} / {mass:g} = "
            f"{2.0 * drag * speed / mass:.4f} 1/s, as printed ({zero:.4f}); c1 v_s^2 / m_s is "
            f"{drag * speed**2 / mass:.4f}",
            "2 d_c1 c1 v_s / m_s",
        ),
        Misprint(
            "eq. 3-7",
            "omega^2 / (2 pi)",
            f"at D, M_p = M_b i_gb eta_trm = 37430 x {gear:g} x {loss:g} = {torque:.0f} N m and "
            "omega = "
            f"{omega:g} rad/s give KQ = M_p / (rho D^5 (omega / 2 pi)^2) = {right:.4f}; the B-series "
            f"polynomials (Oosterveld and van Oossanen 1975) have {curve:.4f} at J = {advance:.3f}, P/D "
            "1.4, area ratio 0.9 (section 5-1-3) and 5 blades. The number of blades is not printed; it "
            f"is chosen here by these points, and 4 and 6 blades give {other[4]:.4f} and "
            f"{other[6]:.4f}. As printed KQ would be {slip:.4f}",
            "(omega / (2 pi))^2, as in eq. 2-3",
        ),
    ]


def _repeated_row(ship: Ship) -> Misprint:
    (pitch, speed, ahead), (_, rack, _, _) = printed_plant.implied(ship, "A").gauge
    own = printed_plant.implied(ship, "D").gauge
    to_speed, to_ship = (printed(table, "D").gain for table in ("2-6", "2-7"))
    by_own = own[0][1] * to_speed + own[0][2] * to_ship + own[1][1]
    row, worst = printed_plant.common_row()
    by_row = row["omega"] * to_speed + row["v_s"] * to_ship + row["X"]
    return Misprint(
        "Tables 2-5, 2-8, 2-11 and 2-14 at B, C and D",
        "gains and zeros to M_m at B, C and D",
        "they are those of point A's row of M_m (eq. 2-31). One row for all four points, fitted to the "
        "sixteen printed gains to M_m by least squares with the printed gains to omega and v_s, has "
        f"M_m = {row['omega']:.0f} omega {row['v_s']:+.0f} v_s {row['X']:+.0f} X {row['P/D']:+.0f} P/D "
        f"{row['u_x']:+.0f} u_x and gives every one of them within {100.0 * worst:.2f} %. At D, M_m/X = "
        f"{row['omega']:.0f} x {to_speed:g} {row['v_s']:+.0f} x {to_ship:g} {row['X']:+.0f} = "
        f"{by_row:.0f} (printed {printed('2-8', 'D').gain:g}); D's own row gives {by_own:.0f}. It is "
        "A's: with a22 = the zero of Table 2-10, a33 = p1 + p2 - a22, a23 = -(gain of Table 2-9) p1 p2 "
        "m_s / (c1 v_s^2) and e = a i_gb^2 eta_trm / I the row at A is I_L (e - a22) + I_R e = "
        f"{speed:.0f} to omega, -I_L a23 = {ahead:.0f} to v_s and I_R b i_gb eta_trm / I = {rack:.0f} "
        f"to X; a21, from the gains of Tables 2-3 and 2-4, gives {pitch:.0f} to P/D. The zeros -0.6666, "
        "-0.8914 and -1.8938 follow as well",
        "the row of each point",
    )


def _two_slopes(ship: Ship) -> Misprint:
    record = ship.record()
    behind = float(record["inertia_propeller_side"])
    inertia = behind + float(record["inertia_engine_side"])
    engine = float(
        record["torque_per_speed"] * record["gear_ratio"] ** 2 * record["transmission_efficiency"]
    )
    engine /= inertia
    ratios, numbers = {}, {}
    for point in printed_plant.POINTS:
        lines = published("advance_velocity_thesis_poles_zeros_gains").loc[["3-13"]]
        text = lines.set_index("working_point_or_source").loc[point, "zeros_rad_s"]
        observer, plant = dead_beat.number(text), printed("2-10", point).zeros[0]
        ratios[point], numbers[point] = (engine - observer) / (engine - plant), (observer, plant)
    listed = ", ".join(f"{point} {ratio:.3f}" for point, ratio in ratios.items())
    observer, plant = numbers["A"]
    return Misprint(
        "Tables 3-9 and 3-13 against Table 2-10",
        "two slopes of the propeller torque to omega at each point",
        f"with e = a i_gb^2 eta_trm / I = {engine:.5f} 1/s the zero of Table 2-10 is e - "
        f"(dM_p/domega) / I, and so is that of Table 3-13; at A ({engine:.5f} - ({observer:g})) / "
        f"({engine:.5f} - ({plant:g})) = {ratios['A']:.3f}. The observers' slope over the plant's is "
        f"{listed}. Table 3-9, which has A and D only, agrees with 3-13: its zero is -(dM_p/domega) / "
        f"I_R, and 0.1481 x I_R / I = {0.1481 * behind / inertia:.4f} beside {engine:.5f} + "
        f"{-observer:.4f} = {engine - observer:.4f} at A",
        "the slope of B5-90 in both",
    )


def misprints() -> list[Misprint]:
    """Return every contradiction of the thesis."""
    ship = load_ship("frigate")
    return [
        *_signs(), *_random_walk(ship), *_equations(ship), _repeated_row(ship), _two_slopes(ship)
    ]  # fmt: skip
