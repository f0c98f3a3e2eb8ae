"""What the thesis contradicts itself in: rows of the errata page, each with formula and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...plant import Ship, load_ship
from ...plant.open_water import open_water
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


def _signs() -> list[Misprint]:
    table, found = published("advance_velocity_thesis_sensitivity"), []
    for row, column in sensitivity.sign_slips(table):
        cells = table.loc[row]
        changes = cells.iloc[1:7].astype(float)
        turned = changes.where(changes.index != column, -changes)
        listed = ", ".join(f"{value:+.2f}" for value in changes)
        found.append(
            Misprint(
                f"Table 5-1, {row}, {column}",
                f"{changes[column]:+.2f}",
                "SD = sqrt(sum((x - mean)^2) / 5) of the row's six changes "
                f"({listed}) is {changes.std():.2f} as printed and {turned.std():.2f} with the other "
                "sign "
                f"of {changes[column]:+.2f}; the row prints {cells['sd']:.2f}",
                f"{-changes[column]:+.2f}",
            )
        )
    return found


def _random_walk(ship: Ship) -> list[Misprint]:
    table = dead_beat.compared(ship)
    slip = table[(table["table"] == "3-11") & (table["point"] == "C")].iloc[0]
    worst = 100.0 * (table["gain follows"] / table["gain printed"] - 1.0).abs().max()
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
            "poles and zeros in rad/s, steady gains to 1e16",
            "a discrete dead-beat predictor has poles at z = 0 and gains at z = 0 of -a11 / (p1 p2), "
            "-1 / (I_R p1 p2), -k2 a11 / (p1 p2) and -k2 / (I_R p1 p2); with the printed p1, p2 and "
            "a11, "
            "and k2 from Table 3-14, all sixteen printed gains follow within "
            f"{worst:.1f} % (at A: 0.0659 / (-4.610e-10 x 3.795e-7) = -3.77e14)",
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
    return [
        Misprint(
            "eq. 2-35, a33",
            "d_c1 c1 v_s^2 / m_s for the slope of the resistance",
            "the resistance is d_c1 c1 v_s^2, so its slope is 2 d_c1 c1 v_s / m_s. Its negative is "
            "the zero "
            f"of omega/u_x (Table 2-12): at D, v_s = {speed:g} m/s, 2 x {drag:g} x {speed:g} / "
            f"{mass:g} = "
            f"{2.0 * drag * speed / mass:.4f} 1/s, as printed ({zero:.4f}); c1 v_s^2 / m_s is "
            f"{drag * speed**2 / mass:.4f}",
            "2 d_c1 c1 v_s / m_s",
        ),
        Misprint(
            "eq. 3-7",
            "omega^2 / (2 pi)",
            f"at D, M_p = M_b i_gb eta_trm = 37430 x {gear:g} x {loss:g} = {torque:.0f} N m and "
            "omega = "
            f"{omega:g} rad/s give KQ = M_p / (rho D^5 (omega / 2 pi)^2) = {right:.4f}; B5-90 has "
            f"{curve:.4f} at J = {advance:.3f}, P/D 1.4. As printed KQ would be {slip:.4f}",
            "(omega / (2 pi))^2, as in eq. 2-3",
        ),
    ]


def _repeated_row(ship: Ship) -> Misprint:
    (pitch, speed, ahead), (_, rack, _, _) = printed_plant.implied(ship, "A").gauge
    own = printed_plant.implied(ship, "D").gauge
    to_speed, to_ship = (printed(table, "D").gain for table in ("2-6", "2-7"))
    by_a = speed * to_speed + ahead * to_ship + rack
    by_own = own[0][1] * to_speed + own[0][2] * to_ship + own[1][1]
    table = printed_plant.repeated_row(ship)
    worst = (table["gain, row of A"] / table["gain printed"] - 1.0).abs().max()
    return Misprint(
        "Tables 2-5, 2-8, 2-11 and 2-14 at B, C and D",
        "gains and zeros to M_m of three other points",
        "they are those of point A's row of M_m (eq. 2-31). With a22 = the zero of Table 2-10, a33 = "
        "p1 + p2 - a22, a23 = -(gain of Table 2-9) p1 p2 m_s / (c1 v_s^2) and e = a i_gb^2 eta_trm / "
        "I, the "
        f"row at A is I_L (e - a22) + I_R e = {speed:.0f} to omega, -I_L a23 = {ahead:.0f} to v_s and "
        f"I_R b i_gb eta_trm / I = {rack:.0f} to X. At D, M_m/X = {speed:.0f} x {to_speed:g} "
        f"{ahead:+.0f} x {to_ship:g} + {rack:.0f} = {by_a:.0f}; D's own row gives {by_own:.0f}; "
        "printed "
        f"is {printed('2-8', 'D').gain:g}. All twelve gains follow within {100.0 * worst:.1f} % "
        f"(pitch: {pitch:.0f} to P/D), and so do the zeros -0.6666, -0.8914 and -1.8938",
        "the row of each point",
    )


def _two_slopes(ship: Ship) -> Misprint:
    record = ship.record()
    inertia = float(record["inertia_propeller_side"] + record["inertia_engine_side"])
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
        f"with e = a i_gb^2 eta_trm / I = {engine:.4f} 1/s the zero of Table 2-10 is e - "
        "(dM_p/domega) / I, "
        f"and so is that of Table 3-13; at A ({engine:.4f} - ({observer:g})) / ({engine:.4f} - "
        f"({plant:g})) = "
        f"{ratios['A']:.3f}. The observers' slope over the plant's is {listed}. Table 3-9 agrees "
        "with 3-13: "
        f"0.1481 x I_R / I = {0.1481 * float(record['inertia_propeller_side']) / inertia:.4f} and "
        f"{engine:.4f} + {-observer:.4f} = {engine - observer:.4f} at A",
        "neither; the slope of B5-90",
    )


def misprints() -> list[Misprint]:
    """Return every contradiction of the thesis."""
    ship = load_ship("frigate")
    return [
        *_signs(), *_random_walk(ship), *_equations(ship), _repeated_row(ship), _two_slopes(ship)
    ]  # fmt: skip
