"""The pages of the two steering controllers: numbers beside the print, voyages, figures."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pandas as pd

from shaftline.display.loops import loop_figure
from shaftline.display.tables import markdown

from ..cells import Cell, Kind, number
from ..side_by_side import Page, cell_table
from . import results, voyages
from .drawn import autopilot_figure, track_figure

AUTOPILOT_TITLE = "Autopilot by loop shaping (Taylor 2000, section 5.2)"
TRACK_TITLE = "Cross-track controller by loop shaping (Taylor 2000, section 5.3)"


def autopilot(tick: Callable[[], None]) -> Page:
    """The autopilot's page.

    Args:
        tick: called :data:`.results.AUTOPILOT_TICKS` times.
    """
    loop = results.autopilot_loop()
    nine = results.robustness()
    tick()
    acts = results.as_it_acts(track=False)
    tick()
    sailed, at_sea = results.autopilot_voyages(tick)
    rates = results.turn_rates()
    tick()
    cells = autopilot_cells(loop | at_sea, nine)
    shown = nine.rename(columns={
        "gain_margin_dB": "gain margin [dB]", "phase_margin_deg": "phase margin [deg]",
        "overshoot_percent": "overshoot [%]", "settling_lengths": "settled after [L]",
    })  # fmt: skip
    body = (
        f"{_INTRO}\n\n{markdown(cell_table(cells))}\n\n![The loop](figures/autopilot-loop.png)\n\n"
        f"## Robust performance\n\n{_robust()}\n\n"
        f"## Wrong K and T\n\nThe same controller on nine ships:\n\n{markdown(shown, 1)}\n\n"
        f"## As it acts\n\n{_acting(acts)}\n\n"
        f"## On the nonlinear plant\n\n{_AUTOPILOT_SEA}\n\n"
        "![Current and turns](figures/autopilot-voyages.png)\n\n"
        f"{_RATES}\n\n{markdown(_named(rates), 1)}"
    )
    drawn = {
        "autopilot-loop": loop_figure(
            results.thesis_loop(track=False), "Autopilot's loop, time in ship lengths", "L", (0.01, 40.0)
        ),
        "autopilot-voyages": autopilot_figure(sailed),
    }  # fmt: skip
    margins = {
        f"{row.gain}, {row.time}": {
            "gain_margin_dB": row.gain_margin_dB,
            "phase_margin_deg": row.phase_margin_deg,
        }
        for row in nine.itertuples()
    }
    numbers = loop | {"robustness": margins, "as_it_acts": acts._asdict(), "voyages": at_sea}
    return Page(cells, body, drawn, numbers)


_INTRO = """\
C = L / P with L = 60 / (s (s² + 4 √60 s + 60)) on P = 2.04 / (s (1.9287 s + 1)) · 6 / (s + 6), time in
ship lengths at 22 knots: `shaftline.baselines.Autopilot`. Two things of the print are read otherwise:
eq. 5.32 lacks the s of its middle term, without which the loop has no margins; and chapter 5 says rad/s
where its numbers are radians per ship length, by which margins, overshoot and settling come out as
printed. Its crossover of 0.91 is therefore 0.073 rad/s, a tenth of the 0.7 rad/s of the 400 ft wave
that section 5.1.4 wants inside the bandwidth."""

_AUTOPILOT_SEA = """\
The surrogate `ddg-51-surrogate` with engine, shaft, propellers and steering gear, under the same
controller at 0.5 s, heading noise 0.1° rms (assumed; the thesis prints none). Left: a sway speed of 5
knots at the beginning, as the thesis has a current; and the current itself, in which the autopilot
keeps the heading and lets the ship be carried, as it must. Right: 90° to port and back against dead
reckoning."""

_RATES = f"""\
The thesis does not print the rate of the dead-reckoned turn. {voyages.TURN_DEG:g} degrees a ship length
are chosen, so that the rudder is at work for the printed three minutes. No rate that was tried gives the
printed error (3 L), sweep (20 degrees) and time (3 minutes) together:"""

_WEIGHTS = {
    "first order": "W1 = 1 / (s + 0.01)",
    "second order": "W1 = 100 / (1 + s / 0.01)²",
    "held": "W1 = 100 up to 0.01, 0 above",
}


def _named(table: pd.DataFrame) -> pd.DataFrame:
    return table.rename(columns=lambda name: str(name).replace("_", " "))


def _robust() -> str:
    found = results.bounds(results.thesis_loop(track=False))
    rows = [(_WEIGHTS[name], *bound) for name, bound in found.items()]
    columns = ["weight", "largest sum of both", "largest W1 S", "largest W2 T"]
    return (
        "The thesis says that eq. 5.23, |W1 S| + |W2 T| < 1, holds, and prints no weights. W2 = 0.4 "
        "(1 + s / 10) / (1 + s / 100) is assumed. The result depends on the assumed W1: about rest S "
        "is s / (s + 1), so W1 = 1 / (s + 0.01) makes |W1 S| about 1 by construction. A weight that "
        "falls with the square from 0.01 on meets the bound. A weight of 100 up to 0.01, an error of "
        "at most 1 % there, does not, whatever W2 is, because the loop's gain at 0.01 is 40 dB and not "
        "more. The sentence can therefore not be tested; its cell counts as calibrated, with the "
        "second weight. Moduli over all frequencies:\n\n"
        f"{markdown(pd.DataFrame(rows, columns=columns), 3)}"
    )


_LOOP, _CURRENT, _TURNS = "section 5.2.2", "section 5.2.3.1", "section 5.2.3.2"


def autopilot_cells(found: dict[str, float], nine: pd.DataFrame) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.2 with ours.

    Args:
        found: from :func:`.results.autopilot_loop` and :func:`.results.autopilot_voyages`.
        nine: from :func:`.results.robustness`.
    """
    digits, words = "half a unit of the last printed digit", "the limit that the words name"
    free, calibrated = Kind.FREE, Kind.CALIBRATED

    def near(
        where: str,
        what: str,
        key: str,
        printed: float,
        within: float,
        basis: str,
        kind: Kind = free,
    ) -> Cell:
        return number(where, what, "", found[key], printed, within, basis, kind)

    def told(
        where: str, what: str, ours: float, text: str, low: float, high: float, basis: str = words,
        kind: Kind = free,
    ) -> Cell:  # fmt: skip
        return Cell(where, what, "", ours, low, high, basis, kind, words=text)

    phase, gain = nine["phase_margin_deg"], nine["gain_margin_dB"]
    inf, first = math.inf, found["first_turn_error_lengths"]
    return [
        near(_LOOP, "gain margin [dB]", "gain_margin_dB", 30.0, 0.5, digits),
        near(_LOOP, "phase margin [deg]", "phase_margin_deg", 64.0, 0.5, digits),
        told(_LOOP, "gain at 0.01 [dB]", found["gain_at_0.01_dB"], "at least 40", 39.95, inf,
             "the limit that the words name, to a tenth of a decibel"),
        told(_LOOP, "overshoot of a step [%]", found["overshoot_percent"], "at most 5", 0.0, 5.0),
        told(_LOOP, "settled after [L]", found["settling_lengths"], "below 5", 0.0, 5.0),
        told(_LOOP, "largest |W1 S| + |W2 T|", found["robust_performance_second order"], "below 1", 0.0,
             1.0, kind=calibrated),
        near("Figure 5-10", "controller's gain at the noise [dB]", "controller_gain_at_noise_dB", 8.0,
             0.5, digits, calibrated),
        near("Figure 5-10", "plant's gain at the noise [dB]", "plant_gain_at_noise_dB", -33.0, 0.5,
             digits),
        told("section 6.2", "least phase margin, K and T 40 % off [deg]", float(phase.min()),
             "acceptable", 30.0, inf, "the thesis's rule of thumb: 3 dB and 30 degrees"),
        told("section 6.2", "least gain margin, K and T 40 % off [dB]", float(gain.min()),
             "acceptable", 3.0, inf, "the thesis's rule of thumb: 3 dB and 30 degrees"),
        told(_CURRENT, "heading after the sway of 5 kn [deg]", found["blown_heading_end_deg"],
             "returns to 0", -0.1, 0.1, "the assumed noise of the heading, 0.1 degrees rms"),
        near(_CURRENT, "drift from the sway of 5 kn [L]", "blown_drift_lengths", 1.0 / 3.0, 0.05,
             "nearer to 1/3 than to 1/4 or 1/2, read off the figure"),
        told(_CURRENT, "amplitude of the rudder after it [deg]", found["blown_rudder_amplitude_deg"],
             "below 0.1", 0.0, 0.1),
        near(_TURNS, "off the dead-reckoned track after the turn [L]", "first_turn_error_lengths", 3.0,
             0.5, digits),
        told(_TURNS, "off the track after the turn back [L]", found["second_turn_error_lengths"],
             "less than after the first turn", 0.0, first, "our own first turn"),
        near(_TURNS, "sweep of the rudder [deg]", "turn_rudder_sweep_deg", 20.0, 2.5,
             "'approximately', a number rounded to 5"),
        near(_TURNS, "time of the sweep [min]", "turn_minutes", 3.0, 0.5, digits, calibrated),
        told(_TURNS, "heading error at the end [deg]", found["turn_heading_error_end_deg"],
             "below 1 %", 0.0, 0.9, "1 % of the turn of 90 degrees"),
    ]  # fmt: skip


def track(tick: Callable[[], None]) -> Page:
    """The cross-track controller's page.

    Args:
        tick: called :data:`.results.TRACK_TICKS` times.
    """
    loop = results.thesis_loop(track=True)
    numbers: dict[str, Any] = results.loop_numbers(loop)._asdict()
    acts = results.as_it_acts(track=True)
    tick()
    sailed, at_sea = results.track_voyages(tick)
    tried = results.waves_tried()
    tick()
    cells = track_cells(numbers, at_sea)
    columns = {
        name: {key.replace("_", " "): value for key, value in found.items()}
        for name, found in at_sea.items()
    }
    shown = pd.DataFrame(columns).rename_axis("measure").reset_index()
    body = (
        f"{_TRACK_INTRO}\n\n{markdown(cell_table(cells))}\n\n![The loop](figures/track-loop.png)\n\n"
        f"## As it acts\n\n{_acting(acts)} White noise of its reading it answers 200 times: at 0.5 m "
        "rms the rudder goes from stop to stop and the track changes are missed by a third of a length. "
        "0.05 m, a filtered position, is assumed here.\n\n"
        f"## On the nonlinear plant\n\n{_TRACK_SEA}\n\n{markdown(shown, 3)}\n\n"
        "![Track changes](figures/track-voyages.png)\n\n"
        f"## Forces of waves that were tried\n\n{_WAVES}\n\n{markdown(tried, 3)}"
    )
    drawn = {
        "track-loop": loop_figure(loop, "Cross-track controller's loop, time in ship lengths", "L"),
        "track-voyages": track_figure(sailed),
    }
    return Page(cells, body, drawn, numbers | {"as_it_acts": acts._asdict(), "voyages": at_sea})


_TRACK_INTRO = """\
C = 20 (s + 0.5)² (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)²) on P / s, time in ship lengths:
`shaftline.baselines.TrackKeeper`. The thesis shows margins and step as figures (5-15 to 5-17) without
numbers; those here are of its printed controller and plant."""

_TRACK_SEA = f"""\
The surrogate at 22 knots; a beam current of 5 knots from {voyages.GUST_AT:g} L on; a line two lengths to
port at {voyages.LEFT_AT:g} L, led to over {voyages.CHANGE_LENGTHS:g} L (eight minutes), and back at
{voyages.BACK_AT:g} L. "Carried": the current adds to the cross track's speed and does nothing else,
as in the thesis. "Met": the hull meets it and is turned by it, as a ship is. "Waves on the beam": sea
state 4 with the force of the waves that a barrier of the ship's draught reflects. "Waves on a wall": the
hull reflects all of them, as none does. The steady amplitude is that between the two turns, from
{results.STEADY[0]:g} to {results.STEADY[1]:g} L."""

_WAVES = """\
The thesis says that its sea of state 4 makes the ship oscillate about the track by less than 20 yards,
"about 15 % of the ship length"; 20 yards are 0.129 L. It prints neither the force nor the filter nor the
direction of the sea. *Reflected*: second-order force on the beam, rho g a² / 2 for each reflected
amplitude (Maruo 1960), with the reflection of a vertical barrier of the ship's draught (Ursell 1947).
*Wall*: the same with whole reflection. *Orbital*: first-order force of the orbital acceleration on
displaced water and added mass along the length, at the encounter frequency. Each is low-passed with 20
s, which is assumed, and acts on the nonlinear plant with the carried current.

The second-order force on the hull does not come near the print; on a wall it would, but the ship
would also lie 0.2 L beside the track. The first-order force does where the sea comes from the quarter:
the ship then runs with the waves, meets them slowly, and the slow force is large. Which of these, if
any, is the thesis's force is not known."""

_STEPS, _SEA = "section 5.3.3.1", "section 5.3.3.2"


def track_cells(loop: dict[str, float], at_sea: dict[str, dict[str, float]]) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.3 with ours.

    Args:
        loop: margins and step, from :func:`.results.loop_numbers`.
        at_sea: from :func:`.results.track_voyages`.
    """
    calm, sea = at_sea[results.CALM], at_sea[results.BEAM_SEA]
    crab = -math.degrees(math.asin(voyages.CURRENT_M_S / voyages.SPEED_M_S))
    inf = math.inf
    margin = "the thesis's rule of thumb: 3 dB and 30 degrees"
    excess = "the limit of section 5.2.2 for an autopilot, 5 % and 5 L"

    def told(
        where: str, what: str, ours: float, text: str, low: float, high: float, basis: str
    ) -> Cell:
        return Cell(where, what, "", ours, low, high, basis, Kind.FREE, words=text)

    return [
        told("Figure 5-16", "gain margin [dB]", loop["gain_margin_dB"], "accepted practice", 3.0, inf,
             margin),
        told("Figure 5-16", "phase margin [deg]", loop["phase_margin_deg"], "accepted practice", 30.0,
             inf, margin),
        told("Figure 5-17", "overshoot of a step [%]", loop["overshoot_percent"], "may seem excessive",
             5.0, inf, excess),
        told("Figure 5-17", "settled after [L]", loop["settling_lengths"], "may seem excessive", 5.0,
             inf, excess),
        told(_STEPS, "beyond the track after the gust [L]", calm["gust_overshoot_lengths"], "slightly",
             0.001, 0.05, "our reading of the word: between 0.001 and 0.05 L"),
        told(_STEPS, "largest error in the track changes [L]", calm["change_error_lengths"],
             "very small", 0.0, 0.05, "our reading of the words: below 0.05 L"),
        told(_STEPS, "heading held against the current [deg]", calm["crab_deg"], "constant offset",
             crab - 0.1, crab + 0.1,
             "asin(5/22), 13.14 degrees, and the assumed noise of the heading, 0.1 degrees rms"),
        told(_STEPS, "heading nearest to 0 on the return [deg]", calm["heading_on_return_deg"],
             "does not pass through 0", crab, 0.0, "between the offset and 0"),
        number(_SEA, "amplitude about the track in sea state 4 [L]", "", sea["steady_amplitude_lengths"],
               0.129, 0.032, "20 yards to the ten: 15 to 25 yards, of a length of 466 ft"),
    ]  # fmt: skip


def _acting(acts: results.Numbers) -> str:
    return (
        f"On the surrogate's own linear steering, a command every {voyages.INTERVAL_S:g} s: gain margin "
        f"{acts.gain_margin_dB:.1f} dB, phase margin {acts.phase_margin_deg:.1f}°, overshoot "
        f"{acts.overshoot_percent:.1f} %, settled after {acts.settling_lengths:.2f} L."
    )
