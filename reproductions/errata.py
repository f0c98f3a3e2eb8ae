"""What the five sources contradict themselves in, each with the calculation that shows it.

``docs/results/errata.md``. A row is worked out here and not copied: what is printed goes in, what
follows from it comes out.
"""

from __future__ import annotations

import argparse
import cmath
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.baselines.loop_shaping import COURSE_LOOP, TAYLOR, TAYLOR_GEAR, heading_plant, shaped
from shaftline.display.tables import markdown, write_table
from shaftline.plant.loops import Loop

from .side_by_side import published
from .thesis import misprints

FOOT, LONG_TON, KNOT, WATER = 0.3048, 1016.047, 0.514444, 1025.0
TITLE = "Errata of the sources"

SOURCES = {
    "observers": "van der Kroft 2020, advance velocity observers (TU Delft)",
    "drive train": "Vrijdag & Martelli 2021, identification of the Tito Neri drive train",
    "steering": "Taylor 2000, state-augmented EKF, autopilot and track controller (MIT)",
    "optimiser": "the CPP optimiser on a ferry",
    "anti-spin": "Pivano et al. 2008, four-quadrant thrust control and anti-spin",
}


class Erratum(NamedTuple):
    """One contradiction, or a remark on words that are looser than the numbers beside them."""

    source: str  # a key of :data:`SOURCES`
    where: str
    printed: str
    shown: str  # by which calculation
    used: str  # here, in its place
    remark: bool = False


def _observers() -> list[Erratum]:
    return [Erratum("observers", *one) for one in misprints.misprints()]


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
    one = published("tito_neri_identified_parameters")[column]
    point = published("tito_neri_operating_points").loc["C"]
    current, speed = float(point["motor_current_A"]), float(point["motor_speed_rad_s"])
    torque, drop = float(one["K_e"]) * current, float(one["R_a"]) * current
    efficiency = 1.0 - float(one["M_f"]) / torque
    return _PointC(
        efficiency,
        float(one["I_p"]) * speed / torque,
        1.0 + float(one["K_e"]) * speed / (2.0 * efficiency * drop),
        float(one["L_a"]) / float(one["R_a"]),
        float(point["motor_voltage_V"]) / drop,
    )


def _drive_train() -> list[Erratum]:
    first, fourth = (_at_point_c(c) for c in ("staircase_method_1", "sine_correlation_method_4"))
    printed = -first.stiffness * first.efficiency / first.slow_pole
    response = published("tito_neri_frequency_response")
    measured, kept = response["current_gain"], float(response["current_phase_deg"].loc[500.0])
    resistance = published("tito_neri_identified_parameters").loc["R_a"]
    resistance = float(resistance["sine_correlation_method_4"])

    def too_late(inductance: float) -> float:
        return fourth._replace(electric_time=inductance / resistance).phase(500.0) - kept

    by_phase = scipy.optimize.brentq(too_late, 1e-5, 1e-3)
    return [
        Erratum(
            "drive train",
            "eq. 31",
            "tau_w = -C eta / s2",
            "A34 has s2 = -C / tau_we, and tau_we = tau_w / (2 eta). Set I at point C: eta = 1 - M_f / "
            f"(K_e i) = {first.efficiency:.3f}, C = 1 + K_e w / (2 eta R_a i) = {first.stiffness:.3f}, "
            f"tau_w = I_p w / (K_e i) = {first.shaft_time:.3f} s (eq. 29), thus s2 = "
            f"{first.slow_pole:.2f} rad/s. Eq. 31 gives {printed:.3f} s back, half; with a 2 it gives "
            f"{2.0 * printed:.3f} s",
            "with the 2",
        ),
        Erratum(
            "drive train",
            "section 5.2",
            "set I falls early in the Bode plot for its low inertia",
            "a lower inertia falls later, since s2 = -2 C eta / tau_w and tau_w is proportional to I_p. "
            f"By the formulas of the row on eq. 31 s2 is {first.slow_pole:.2f} rad/s for set I and "
            f"{fourth.slow_pole:.2f} for set IV (eta {fourth.efficiency:.3f}, C "
            f"{fourth.stiffness:.3f}, tau_w {fourth.shaft_time:.3f} s), although set I has 0.54 of the "
            "inertia",
            "the pole s2 as what sets the drop, not the inertia alone",
        ),
        Erratum(
            "drive train",
            "Table 5, set IV, L_a",
            "6.03e-4 H, a pole at -2500 rad/s",
            "eq. 12 with set IV at point C (tau_em = L_a / R_a = "
            f"{1e3 * fourth.electric_time:.3f} ms) gives the current a gain of "
            f"{abs(fourth.current(1000.0)):.2f} at 1000 rad/s and {abs(fourth.current(5000.0)):.2f} at "
            f"5000; Table 2 has {measured.loc[1000.0]:.2f} and {measured.loc[5000.0]:.2f}. The authors "
            "discard these two points for their noise; but at 500 rad/s, which they keep, set IV has a "
            f"phase of {fourth.phase(500.0):.1f} deg and Table 2 {kept:.1f}, which L_a = "
            f"{by_phase:.1e} H gives with the rest of set IV",
            "as printed, with the remark",
        ),
    ]


def _block(draught_ft: float) -> float:
    """Return the block coefficient of the Esso Osaka at a draught."""
    length, beam = 1066.3 * FOOT, 173.9 * FOOT
    return 314_410.0 * LONG_TON / (WATER * length * beam * draught_ft * FOOT)


def _slope(factor: float) -> float:
    """Return the lift slope of a rudder of aspect ratio 1.538 [1/rad] (eq. 3.30)."""
    ratio = 1.538
    return 1.0 / (
        1.0 / (factor * math.pi) + 1.0 / (math.pi * ratio) + 1.0 / (2.0 * math.pi * ratio**2)
    )


def _steering() -> list[Erratum]:
    middle = 4.0 * math.sqrt(60.0)  # 2 zeta w_n with w_n = sqrt(60) and zeta = 2
    roots = np.roots([1.0, 0.0, 60.0 + middle, 60.0])
    rightmost = roots[np.argmax(roots.real)]
    length, speed = 466.0 * FOOT, 22.0 * KNOT
    seconds = length / speed
    own = heading_plant(TAYLOR, TAYLOR_GEAR)
    law = shaped(COURSE_LOOP, own)
    crossover = Loop.of(own.system, law).margins().crossover
    swing = TAYLOR.gain * math.radians(10.0)  # rate of turn, rad/s or rad per ship length
    wave = math.sqrt(2.0 * math.pi * 9.81 / (400.0 * FOOT))
    return [
        Erratum(
            "steering",
            "Table 2.2, draught of the Esso Osaka",
            "92.8 ft",
            "the block coefficient, 314,410 long tons (1016.047 kg) over 1025 kg/m3 times 1066.3 ft "
            f"times 173.9 ft times the draught, would be {_block(92.8):.3f}; 92.8 ft (28.3 m) is her "
            f"moulded depth. With 71.3 ft (21.73 m) it is {_block(71.3):.3f}; Crane (SNAME Transactions "
            "1979), who reports her trials, has this draught and a block coefficient of 0.83",
            "71.3 ft",
        ),
        Erratum(
            "steering",
            "Table 2.2, centre of gravity",
            "25 ft aft of midship",
            "the data set FRT-DS-ESSO has x_G = +0.094 m of her 3 m model, which is 0.094 / 3 of her "
            f"length: {0.094 / 3.0 * 1066.3:.0f} ft forward",
            "as printed; of Table 2.3 m x_g - N_r alone contains it",
        ),
        Erratum(
            "steering",
            "eq. 3.30",
            "0.18 pi",
            "1 / (1 / (0.18 pi) + 1 / (pi AR) + 1 / (2 pi AR^2)) with AR = 1.538 (Table 2.2, Esso "
            f"Osaka) is {_slope(0.18):.3f} per rad, and less than 0.18 pi = {0.18 * math.pi:.2f} for "
            f"every aspect ratio; with 1.8 pi it is {_slope(1.8):.3f}",
            "1.8 pi",
        ),
        Erratum(
            "steering",
            "eqs. 4.1 and 4.2",
            "f2 = -Y_v v - (m - Y_r) r with -Y_v = 0.0244 (Table 2.3)",
            "without yaw the inertia times dv/dt would be +0.0244 v: a drifting ship drifts ever faster",
            "f2 = -(-Y_v) v - (m - Y_r) r, f3 = -(-N_v) v - (m x_g - N_r) r",
        ),
        Erratum(
            "steering",
            "eq. 5.32",
            "w^2 / (s (s^2 + 2 zeta w + w^2))",
            f"with w = sqrt(60) and zeta = 2 the closed loop is s^3 + {60.0 + middle:.2f} s + 60 "
            "= 0. It "
            "has no term in s^2, so its roots add up to 0 and cannot all lie on the left: the "
            "rightmost is "
            f"{rightmost.real:.3f} +- {abs(rightmost.imag):.2f}i, unstable",
            "2 zeta w s",
        ),
        Erratum(
            "steering",
            "chapter 5",
            "frequencies in rad/s",
            f"K = {TAYLOR.gain:g} in rad/s would turn her with 10 deg of rudder at "
            f"{10.0 * TAYLOR.gain:.1f} deg/s, at 22 kn on a radius of {speed / swing:.0f} m for a ship "
            f"of {length:.0f} m. In radians per ship length the radius is 1 / (K delta) = "
            f"{1.0 / swing:.1f} lengths; section 5.2 says as well that the equations are without "
            "dimension. Margins do not tell: they are the same in either unit",
            "radians per ship length",
        ),
        Erratum(
            "steering",
            "section 5.1.4",
            "a crossover of 0.5 to 1.5 rad/s, at the 0.7 rad/s of the 400 ft wave",
            f"at a fixed point the wave comes with sqrt(2 pi 9.81 / 121.92 m) = {wave:.2f} rad/s; by "
            f"the row above the loop of eq. 5.32 with the 2 zeta w s crosses over at {crossover:.2f} "
            f"per ship length, which is {crossover:.2f} / {seconds:.2f} s = {crossover / seconds:.3f} "
            "rad/s (466 ft at 22 kn)",
            "the design as printed, which does not answer to the wave",
        ),
    ]


def _optimiser() -> list[Erratum]:
    tables = published("cpp_ferry_tables")
    held = tables.loc["optimal"].set_index("condition")
    plain = tables.loc["combinator"].set_index("condition")
    off = held["sfoc_g_kwh_before"] - plain["sfoc_g_kwh_before"]
    differ = ", ".join(f"{value:+.1f}" for value in off)
    most = 100.0 * float((off / plain["sfoc_g_kwh_before"]).abs().max())
    return [
        Erratum(
            "optimiser",
            "Tables 1 and 2, before the disturbance",
            "the optimal control's output matches that of the combinator",
            "at the same engine and ship speeds the consumption of Table 2 differs from that of Table 1 "
            f"by {differ} g/kWh (at most {most:.2f} %) in the initial conditions 1 to 5, and the pitch "
            f"of the fifth is {held.loc[5, 'pitch_deg_before']:g} in place of "
            f"{plain.loc[5, 'pitch_deg_before']:g} deg",
            "the numbers of each table",
            remark=True,
        ),
    ]


def _others() -> list[Erratum]:
    ratio = 0.151 / 0.123
    with_it, without = 0.151 * 290.0 / 79.2, 0.123 * 378.0 / 89.1
    return [
        Erratum(
            "anti-spin",
            "text beside Table 1",
            "about 20 % more efficient",
            f"0.151 / 0.123 is {100.0 * (ratio - 1.0):.1f} % more",
            "the numbers of the table",
            remark=True,
        ),
        Erratum(
            "anti-spin",
            "the rule of the anti-spin action",
            "the action holds where omega_d is at least a limit",
            "that is right for omega > 0 alone. Astern the order of -75 rad/s is below the limit of -54 "
            "rad/s, so nothing would ever act: the inequality has to be mirrored",
            "the rule, mirrored for omega < 0",
        ),
        Erratum(
            "anti-spin",
            "Table 1, eta_E",
            "one eta_E beside the other",
            f"eta_E P / T, the carriage's speed weighted by thrust, is {with_it:.3f} m/s with and "
            f"{without:.3f} m/s without anti-spin: a factor of {with_it / without:.2f} of the 1.23 is "
            "no gain in power for thrust. It comes from another carriage or from when the thrust was "
            "lost; the paper does not tell which",
            "one carriage for both tests",
            remark=True,
        ),
        Erratum(
            "anti-spin",
            "section 5, shaft speed without anti-spin",
            "almost double",
            f"the limit of 75 rad/s allows 75 / 45 = {75.0 / 45.0:.2f} ahead and 75 / 54 = "
            f"{75.0 / 54.0:.2f} astern",
            "the limits as printed",
            remark=True,
        ),
    ]


def errata() -> list[Erratum]:
    """All of them, by source."""
    return [*_observers(), *_drive_train(), *_steering(), *_optimiser(), *_others()]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/errata"))
    folder = parser.parse_args().out
    table = pd.DataFrame(errata())
    shown = table[~table["remark"]].drop(columns="remark")
    parts = [
        f"## {name}\n\n{markdown(shown[shown['source'] == key].drop(columns='source'))}"
        for key, name in SOURCES.items()
        if (shown["source"] == key).any()
    ]
    remarks = table[table["remark"]].drop(columns="remark")
    parts.append(f"## Remarks\n\n{LOOSE}\n\n{markdown(remarks)}")
    body = f"{ABOUT}\n\n" + "\n\n".join(parts)
    write_table(folder, "errata", TITLE, "python -m reproductions errata", table, body)
    print(table.to_string(index=False))


ABOUT = """\
Where a source contradicts itself or another, the calculation that shows it, and what is used here in
its place. The numbers under "shown" are calculated from the printed ones each time this page is made.
The sources were read as text that was extracted from them, in which a sign or a letter may be lost;
the calculations do not depend on that."""

LOOSE = (
    "No contradictions: words that are looser than the numbers beside them, or numbers that differ "
    "little."
)


if __name__ == "__main__":
    main()
