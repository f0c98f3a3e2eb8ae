"""The page and the figures of the rig: :mod:`.results` beside the paper."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pandas as pd

from shaftline.baselines.thrust_control import ThrustControlTuning
from shaftline.display.tables import markdown
from shaftline.plant import load_ship

from ..cells import Cell, Kind, half_digit, number
from ..side_by_side import Page, cell_table, published_text
from .experiment import Air, Programme, TankRun
from .figures import power_panels, with_panels, without_panels
from .results import NEAR, PRINTED, RIG, Numbers, Pair, Results

TITLE = "Anti-spin on the towing-tank rig (Pivano et al. 2008, section 5)"
INTRO = """\
The paper's own rig: `towing-tank`, under `shaftline.baselines.ThrustControl` at every time step of
2 ms. Thrust is ordered ahead, then astern; the carriage follows it; in the harsh tests the
propeller moves up and down near the surface. Ventilation is that of [the plant](../plant.md), by
the suction of the blades against the static head above them.

**What is calibrated, and to what.** The order of thrust ({thrust:g} N), the carriage's speed
({carriage:g} m/s) and the Coulomb friction ({friction:g} N m): three numbers, so that the test
*with* anti-spin has the printed mean thrust, mean power and eta_E. These three rows are therefore
no result. The test without anti-spin, and so every change, is predicted.

**What is assumed** because the paper does not print it: the programme, the inception of air, all of
the gains, and the propeller (Wageningen B4-70 curves scaled to a B4-58 of P/D 1.0). The losses of a
ventilated blade are those of the theory. None of this was chosen by what the tests without
anti-spin give.

{assumed}

## Beside the print

A number is met within its printed digits, since the paper prints neither a repeat nor an error of its
instruments. The effect of anti-spin is the change of Table 1, here in percent:

{changes}

{table}

What was calculated about the differences:

{calculated}

![Calm water](figures/towing-tank-calm.png)

Calm water, as the paper's Figure 3. The thrust is tracked to {tracking:.1f} N rms, the reversals
included.

![With anti-spin](figures/towing-tank-anti-spin.png)

Near the surface with anti-spin, as Figure 4. {found:.0f} % of the time in air is called air,
{right:.0f} % of what is called air is.

![Without](figures/towing-tank-without.png)

The same without anti-spin, as Figure 5. The motor then takes {peaks:.1f} times the power in air, the
"large peaks" of the paper.

![Power](figures/towing-tank-power.png)

Motor power of the three tests, as Figure 6.

## Thrust over the shaft speed

Steady thrust [N] at bollard pull, each shaft speed reached from the one below. It rises, drops
where air comes, and rises again more slowly. So a slower shaft can give more thrust, which is the
paper's motive.

{steady}

The drop begins at {onset_half:.0f} rad/s for h/R = 0.5 and at {onset_one:.0f} rad/s for h/R = 1.
The printed limits of 45 and 54 rad/s are above the first: where h/R < {near:g} the shaft still
ventilates there.

## What a detector and another limit could reach

A detector that knows when the propeller ventilates gives {oracle.thrust:.1f} N, {oracle.power:.0f} W
and eta_E {oracle.efficiency:.3f} against {on.thrust:.1f} N, {on.power:.0f} W and {on.efficiency:.3f}.
The columns of the next tables from "thrust" on are ratios, with over without anti-spin; "carriage by
thrust" is the carriage's speed weighted by thrust.

{limits}

## Other air

Each calibrated anew to the same three numbers.

{airs}

## Another programme, a wrong model, other instruments

As calibrated above, one thing changed at a time.

{others}
"""


def _assumed() -> pd.DataFrame:
    """Everything that the paper does not print, with its value."""
    rows: list[dict[str, Any]] = []
    tuning = ThrustControlTuning()
    for title, thing in (
        ("programme", Programme()), ("air", Air()), ("law", tuning),
        ("observer", tuning.observer), ("detection", tuning.detector),
    ):  # fmt: skip
        values = {f.name: getattr(thing, f.name) for f in fields(thing)}
        told = ", ".join(f"{k} {v:g}" for k, v in values.items() if isinstance(v, float))
        rows.append({"of": title, "assumed": told})
    return pd.DataFrame(rows)


WORDS = ("mean thrust [N]", "mean power [W]", "eta_E")
TEXT = "section 5"
"""Where the paper's words stand."""


def _change(ratio: float) -> float:
    return 100.0 * (ratio - 1.0)


def cells(found: Results) -> list[Cell]:
    """Return the printed numbers and words of section 5 beside ours.

    Args:
        found: of the study.
    """
    digits = published_text("anti_spin_towing_tank")
    compared = []
    for row, values, kind in (
        ("anti-spin", found.pair.on, Kind.CALIBRATED), ("no-anti-spin", found.pair.off, Kind.FREE),
    ):  # fmt: skip
        for words, ours, text in zip(WORDS, values[:3], digits.loc[row], strict=True):
            compared.append(
                number("Table 1", row, words, ours, float(text), half_digit(text),
                       "half a unit of the last printed digit", kind)
            )  # fmt: skip
    highest = found.pair.off.highest_speed
    return [
        *compared,
        number(TEXT, "highest shaft speed without anti-spin [rad/s]", "", highest, 75.0, 0.5,
               "half a unit of the last printed digit", Kind.INPUT),
        Cell(TEXT, f"thrust with over without where h/R < {NEAR:g}", "", found.pair.near, 0.95, 1.05,
             "'practically equal': within 5 %", words="practically equal"),
        Cell(TEXT, "shaft speed in air, without over with", "", _speeds_in_air(found), 1.8, 2.0,
             "'almost double': at most 10 % below 2", words="almost double"),
    ]  # fmt: skip


def _changes(found: Results) -> pd.DataFrame:
    """Return the change of each number of Table 1 by anti-spin [%], ours and printed."""
    with_it, without = (np.array(PRINTED[name]) for name in PRINTED)
    return pd.DataFrame(
        {
            "change by anti-spin [%]": WORDS,
            "ours": [f"{_change(ratio):+.1f}" for ratio in found.pair.ratios],
            "printed": [f"{_change(ratio):+.1f}" for ratio in with_it / without],
        }
    )


def _efficiency(found: Results) -> str:
    """Split the change of eta_E = (T / P) u, with u the carriage's speed weighted by thrust."""
    thrust, power, efficiency = found.pair.ratios
    (t, p, e), (t0, p0, e0) = PRINTED["anti-spin"], PRINTED["no anti-spin"]
    print_u, print_tp = (e * p / t) / (e0 * p0 / t0), (t / p) / (t0 / p0)
    tried = pd.concat([found.airs, found.others])["carriage by thrust"]
    return (
        f"a gain of {_change(efficiency):.0f} % against {_change(e / e0):.0f} %. eta_E is thrust per "
        "power times the carriage's speed weighted by thrust. Ours rise by "
        f"{_change(thrust / power):.1f} % and {_change(found.pair.carriage):.1f} %, the print's by "
        f"{_change(print_tp):.1f} % and {_change(print_u):.1f} %. In the {len(tried)} tests below the "
        f"second lies between {_change(tried.min()):.1f} and {_change(tried.max()):.1f} %: how the "
        "print comes to its value is not known"
    )


def _near(found: Results) -> str:
    steady = found.steady.set_index("shaft speed [rad/s]")
    shares = [steady.loc[45.0, f"h/R {h:g}"] / steady.loc[75.0, f"h/R {h:g}"] for h in (0.25, 0.5)]
    return (
        "a ventilated propeller of the plant gives more thrust at 75 rad/s than at 45: by the steady "
        f"thrust below, 45 rad/s gives {shares[0]:.2f} of it at h/R 0.25 and {shares[1]:.2f} at 0.5. "
        "The theory leaves a quarter of the wetted lift, which grows with the square of the shaft "
        "speed; the print asks for a thrust that does not grow at all. See the table of other air for "
        "a blade that keeps less"
    )


def _speed(found: Results) -> str:
    ahead, astern = (_speeds_in_air(found, sign) for sign in (1.0, -1.0))
    return (
        "the printed limits allow 75 / 45 = 1.67 ahead and 75 / 54 = 1.39 astern, and "
        f"(75 + 75) / (45 + 54) = 1.52 over both; ours are {ahead:.2f} ahead and {astern:.2f} astern. "
        "No run within the printed limits can come to 2"
    )


def _in_air(test: TankRun, values: Any) -> float:
    """Mean of the values while the propeller is in air and the controller knows it."""
    return float(np.mean(values[(test.samples["ventilation"] > 0.8) & test.detected]))


def _speeds_in_air(found: Results, direction: float = 0.0) -> float:
    """Shaft speed in air, without over with anti-spin, of one direction of thrust or of both."""

    def speed(test: TankRun) -> float:
        air = (test.samples["ventilation"] > 0.8) & test.detected
        if direction:
            air &= test.thrust_order * direction > 0.0
        return float(np.mean(np.abs(test.samples["shaft_speed"][air])))

    return speed(found.off) / speed(found.on)


def _power_in_air(found: Results) -> float:
    return _in_air(found.off, found.off.motor_power) / _in_air(found.on, found.on.motor_power)


def page(found: Results) -> Page:
    """Return the page's parts."""
    compared = cells(found)
    calculated = {
        "change of eta_E": _efficiency(found), "thrust near the surface": _near(found),
        "shaft speed in air": _speed(found),
    }  # fmt: skip
    body = INTRO.format(
        thrust=found.programme.thrust_N, carriage=found.programme.carriage_m_s,
        assumed=markdown(_assumed()), table=markdown(cell_table(compared)),
        changes=markdown(_changes(found)), peaks=_power_in_air(found),
        calculated="\n".join(f"- {name}: {text}" for name, text in calculated.items()),
        tracking=found.calm_numbers.tracking, found=100.0 * found.detection[0],
        right=100.0 * found.detection[1], oracle=found.oracle, on=found.pair.on, near=NEAR,
        steady=markdown(found.steady, 1), onset_half=_onset(found, 0.5), onset_one=_onset(found, 1.0),
        limits=markdown(found.limits, 3), airs=markdown(found.airs, 3),
        others=markdown(found.others, 3), friction=float(load_ship(RIG).record()["coulomb_engine_side"]),
    )  # fmt: skip
    figures = {
        "towing-tank-calm": without_panels(found.calm),
        "towing-tank-anti-spin": with_panels(found.on, found.programme),
        "towing-tank-without": without_panels(found.off),
        "towing-tank-power": power_panels(found),
    }
    return Page(compared, body, figures, _numbers(found.pair, found.calm_numbers))


def _onset(found: Results, relative: float) -> float:
    """Shaft speed [rad/s] of the table from which the thrust drops."""
    thrust = found.steady[f"h/R {relative:g}"].to_numpy()
    return float(found.steady["shaft speed [rad/s]"][int(np.argmax(np.diff(thrust) < 0.0))])


def _numbers(found: Pair, calm: Numbers) -> dict[str, Any]:
    thrust, power, efficiency = found.ratios
    return {
        "anti-spin": found.on._asdict(), "no anti-spin": found.off._asdict(), "calm": calm._asdict(),
        "ratios": {"thrust": thrust, "power": power, "eta_E": efficiency},
    }  # fmt: skip
