"""What the five sources contradict themselves in, each with the calculation that shows it.

``docs/results/errata.md``. A row is worked out here and not copied: what is printed goes in, what
follows from it comes out.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..baselines.loop_shaping import COURSE_LOOP, TAYLOR, TAYLOR_GEAR, heading_plant, shaped
from ..core.lazy import control
from ..display.tables import markdown, write_table
from ..plant.loops import Loop
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
    """One contradiction."""

    source: str  # a key of :data:`SOURCES`
    where: str
    printed: str
    shown: str  # by which calculation
    used: str  # here, in its place


def _observers() -> list[Erratum]:
    return [Erratum("observers", *one) for one in misprints.misprints()]


def _drive_train() -> list[Erratum]:
    first, second = -7.63, -8.91  # s2 of sets I and IV
    measured = float(published("tito_neri_frequency_response").loc[5000.0, "current_gain"])
    return [
        Erratum(
            "drive train",
            "eq. 31",
            "tau_w = -C eta / s2",
            "A26 and A34 have -2 C eta / s2; set I meets its own s2 with the 2 alone: "
            f"{2.0 * 2.626 * 0.3040 / 7.63 / (2.0 * 0.3441 * 0.3040):.2f} of its tau_w with it, "
            "half without",
            "with the 2",
        ),
        Erratum(
            "drive train",
            "section 5.2",
            "set I falls early in the Bode plot for its low inertia",
            f"a lower inertia falls later; it falls earlier because |s2| is {-first:.2f} and not "
            f"{-second:.2f} rad/s",
            "the pole",
        ),
        Erratum(
            "drive train",
            "Table 5, set IV, L_a",
            "6.03e-4 H, a pole at -2500 rad/s",
            f"with set IV the current's gain is {_current_gain(2500.0):.2f} at 2500 rad/s and "
            f"{_current_gain(5000.0):.2f} at 5000, where Table 2 has {measured:.2f}",
            "as printed, with the remark; about 3e-4 H from the table",
        ),
    ]


def _current_gain(frequency: float) -> float:
    """Gain of the current to the voltage with set IV's numbers at C, normalised (eqs. 8 to 13)."""
    electric, mechanical, stiffness = 3.993e-4, 0.5174, 4.609  # tau_em, tau_we [s] and C [-]
    s = 1j * frequency
    below = electric * mechanical * s**2 + (electric + mechanical) * s + stiffness
    return abs((mechanical * s + 1.0) * 5.89 / (1.51 * 1.29) / below)


def _block(draught_ft: float) -> float:
    """Block coefficient of the Esso Osaka at a draught."""
    length, beam = 1066.3 * FOOT, 173.9 * FOOT
    return 314_410.0 * LONG_TON / (WATER * length * beam * draught_ft * FOOT)


def _slope(factor: float) -> float:
    """Lift slope of a rudder of aspect ratio 1.538 [1/rad] (eq. 3.30)."""
    ratio = 1.538
    return 1.0 / (
        1.0 / (factor * math.pi) + 1.0 / (math.pi * ratio) + 1.0 / (2.0 * math.pi * ratio**2)
    )


def _steering() -> list[Erratum]:
    as_printed = Loop(control.tf([60.0], [1.0, 0.0, 60.0 + 4.0 * math.sqrt(60.0), 0.0]))
    length, speed = 466.0 * FOOT, 22.0 * KNOT
    seconds = length / speed
    own = heading_plant(TAYLOR, TAYLOR_GEAR)
    law = shaped(COURSE_LOOP, own)
    crossover = Loop.of(own.system, law).margins().crossover
    slow = TAYLOR._replace(gain=TAYLOR.gain / seconds, time=TAYLOR.time * seconds)
    wrong = Loop.of(heading_plant(slow, TAYLOR_GEAR).system, law).margins()
    wave = math.sqrt(2.0 * math.pi * 9.81 / (400.0 * FOOT))
    return [
        Erratum(
            "steering",
            "Table 2.2, draught of the Esso Osaka",
            "92.8 ft",
            f"the block coefficient would be {_block(92.8):.3f}; it is her moulded depth. With 71.3 "
            f"ft it is {_block(71.3):.3f}, as published of her",
            "71.3 ft",
        ),
        Erratum(
            "steering",
            "Table 2.2, centre of gravity",
            "25 ft aft of midship",
            "a tanker of this form, and her 3 m model (x_G +0.094 m), has it forward",
            "as printed, with the four coefficients that rest on it",
        ),
        Erratum(
            "steering",
            "eq. 3.30",
            "0.18 pi",
            f"the lift slope would be {_slope(0.18):.3f} per rad, whatever the aspect ratio at most "
            f"{0.18 * math.pi:.2f}; with 1.8 pi it is {_slope(1.8):.3f}",
            "1.8 pi",
        ),
        Erratum(
            "steering",
            "eqs. 4.1 and 4.2",
            "-Y_v v with -Y_v a positive number",
            "the force would push a drifting ship on: sway and yaw then have a pole to the right",
            "Y = -(-Y_v) v - (m - Y_r) r",
        ),
        Erratum(
            "steering",
            "eq. 5.32",
            "w^2 / (s (s^2 + 2 zeta w + w^2))",
            "without an s in the middle term the closed loop is "
            + ("stable" if as_printed.stable else "unstable")
            + ", and there are no margins",
            "2 zeta w s",
        ),
        Erratum(
            "steering",
            "chapter 5",
            "frequencies in rad/s",
            f"in ship lengths the margins are the printed 30 dB and 64 deg; with K and T in seconds the "
            f"phase margin would be {wrong.phase_margin_deg:.0f} deg",
            "radians per ship length",
        ),
        Erratum(
            "steering",
            "section 5.1.4",
            "a bandwidth that holds the 400 ft wave",
            f"the wave comes with {wave:.2f} rad/s; the crossover of {crossover:.2f} per ship length is "
            f"{crossover / seconds:.3f} rad/s",
            "the design as printed, which does not hold it",
        ),
    ]


def _optimiser() -> list[Erratum]:
    tables = published("cpp_ferry_tables")
    held = tables.loc["optimal"].set_index("condition")
    plain = tables.loc["combinator"].set_index("condition")
    speeds = held["ship_speed_m_s_before"] / held["ship_speed_m_s_after"]
    powers = np.log(1.15) / np.log(speeds)
    off = (plain["sfoc_g_kwh_before"] - held["sfoc_g_kwh_before"]).abs()
    implied = 100.0 * (speeds**2 - 1.0)
    return [
        Erratum(
            "optimiser",
            "Table 2, speeds after the disturbance",
            "resistance up by 15 % at a thrust that is held",
            f"with a resistance that goes with the speed's square the speeds say {implied.min():.1f} to "
            f"{implied.max():.1f} %; 15 % asks for powers of {powers.min():.2f} to {powers.max():.2f} "
            "from the last lever to the first",
            "the square; `hull.resistance_exponent` for a steeper hull",
        ),
        Erratum(
            "optimiser",
            "Tables 1 and 2, lever 5 before the disturbance",
            "both controls start alike",
            f"pitch {plain.loc[5, 'pitch_deg_before']:g} and {held.loc[5, 'pitch_deg_before']:g} deg, "
            f"{plain.loc[5, 'sfoc_g_kwh_before']:g} and {held.loc[5, 'sfoc_g_kwh_before']:g} g/kWh at "
            f"the same engine and ship speed; all five differ by up to {off.max():.1f} g/kWh",
            "each table's own",
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
            "the table",
        ),
        Erratum(
            "anti-spin",
            "the rule of the anti-spin action",
            "an inequality in omega_d",
            "it holds for omega > 0 alone; astern it has to be mirrored",
            "both directions",
        ),
        Erratum(
            "anti-spin",
            "Table 1, eta_E",
            "the same carriage in both tests",
            f"eta_E P / T, the carriage's speed weighted by thrust, is {with_it:.3f} m/s with and "
            f"{without:.3f} m/s without anti-spin, a factor of {with_it / without:.2f} of the 1.23",
            "one programme for both",
        ),
        Erratum(
            "anti-spin",
            "section 5, shaft speed without anti-spin",
            "almost double",
            f"75 against 45 and 54 rad/s allow {75.0 / 45.0:.2f} ahead and {75.0 / 54.0:.2f} astern",
            "the limits",
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
    parts = [
        f"## {name}\n\n{markdown(table[table['source'] == key].drop(columns='source'))}"
        for key, name in SOURCES.items()
        if (table["source"] == key).any()
    ]
    body = f"{ABOUT}\n\n" + "\n\n".join(parts)
    write_table(folder, "errata", TITLE, "python -m shaftline.studies.errata", table, body)
    print(table.to_string(index=False))


ABOUT = """\
Where a source contradicts itself or another, the calculation that shows it, and what stands here in its
place. Numbers in the third column are worked out from what is printed when the page is made."""


if __name__ == "__main__":
    main()
