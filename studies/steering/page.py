"""The pages of the two steering controllers: numbers beside the print, voyages, figures."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...display.figures import PALETTE, THESIS, TRUTH, new_figure
from ...display.loops import loop_figure
from ...display.manoeuvres import outline
from ...display.tables import markdown
from ..side_by_side import Page, Row, reasons, table
from . import results, voyages

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
    rows = _autopilot_rows(loop | at_sea, nine)
    shown = nine.rename(columns={
        "gain_margin_dB": "gain margin [dB]", "phase_margin_deg": "phase margin [deg]",
        "overshoot_percent": "overshoot [%]", "settling_lengths": "settled after [L]",
    })  # fmt: skip
    body = (
        f"{_INTRO}\n\n{markdown(table(rows))}\n\nWhere they differ, and what they rest on:\n\n"
        f"{reasons(rows)}\n\n![The loop](figures/autopilot-loop.png)\n\n"
        f"## Wrong K and T\n\nThe same controller on nine ships:\n\n{markdown(shown, 1)}\n\n"
        f"## As it acts\n\n{_acting(acts)}\n\n"
        f"## On the nonlinear plant\n\n{_AUTOPILOT_SEA}\n\n"
        "![Current and turns](figures/autopilot-voyages.png)\n"
    )
    drawn = {
        "autopilot-loop": loop_figure(
            results.thesis_loop(track=False), "Autopilot's loop, time in ship lengths", "L", (0.01, 40.0)
        ),
        "autopilot-voyages": _autopilot_figure(sailed),
    }  # fmt: skip
    margins = {
        f"{row.gain}, {row.time}": {
            "gain_margin_dB": row.gain_margin_dB,
            "phase_margin_deg": row.phase_margin_deg,
        }
        for row in nine.itertuples()
    }
    numbers = loop | {"robustness": margins, "as_it_acts": acts._asdict(), "voyages": at_sea}
    return Page(rows, body, drawn, numbers)


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


def _autopilot_rows(found: dict[str, float], nine: pd.DataFrame) -> list[Row]:
    phase, gain = nine["phase_margin_deg"], nine["gain_margin_dB"]
    inf = math.inf

    def row(key: str, what: str, printed: str, low: float, high: float, why: str = "") -> Row:
        return Row(key, what, found[key], printed, low, high, why)

    return [
        row("gain_margin_dB", "gain margin [dB]", "about 30", 29.5, 30.5),
        row("phase_margin_deg", "phase margin [deg]", "about 64", 63.5, 64.5),
        row("gain_at_0.01_dB", "gain at 0.01 [dB]", "at least 40", 39.95, inf,
            "40.00 to a ten-thousandth"),
        row("overshoot_percent", "overshoot of a step [%]", "at most 5", 0.0, 5.0),
        row("settling_lengths", "settled after [L]", "below 5", 0.0, 5.0),
        row("controller_gain_at_noise_dB", "controller's gain at the noise [dB]", "about 8", 7.5, 8.5,
            "the frequency is not printed: at 5.85 both gains are met at once"),
        row("plant_gain_at_noise_dB", "plant's gain there [dB]", "about -33", -33.5, -32.5),
        Row("phase_least", "least phase margin, K and T 40 % off [deg]", float(phase.min()),
            "errors of 40 % still control", 30.0, inf, "30 deg and 3 dB are the thesis's rule of thumb"),
        Row("gain_least", "least gain margin, the same [dB]", float(gain.min()),
            "the same", 3.0, inf),
        row("robust_performance", "largest |W1 S| + |W2 T|", "below 1", 0.0, 1.0,
            "the weights are not printed, and those that are assumed here are harder than the thesis's "
            "must be: near the crossover both ask for something at once"),
        row("blown_heading_end_deg", "heading after the sway of 5 kn [deg]", "returns to 0", -0.1, 0.1),
        row("blown_drift_lengths", "drift from it [L]", "about 1/3", 0.2, 0.5,
            "the thesis's hull is another: how far it is blown hangs on the moment of its sway "
            "alone"),
        row("blown_rudder_rms_deg", "rudder after it, rms [deg]", "amplitude below 0.1", 0.0, 0.1,
            "it is the noise of the heading, which is assumed: half of it would do"),
        row("first_turn_error_lengths", "off the dead-reckoned track after the turn [L]",
            "about 3", 2.0, 4.0, "the rate of the turn is not printed: 8 deg a length, for the rudder "
            "to be at work for three minutes"),
        row("second_turn_error_lengths", "after the turn back [L]", "less", 0.0,
            found["first_turn_error_lengths"]),
        row("turn_rudder_sweep_deg", "sweep of the rudder [deg]", "about 20", 15.0, 25.0,
            "the surrogate needs less rudder for the turn; 20 would ask for 14 deg a length or more, "
            "which is over after two minutes"),
        row("turn_minutes", "time of that [min]", "about 3", 2.5, 3.5),
        row("turn_heading_error_end_deg", "heading error at the end [deg]", "below 1 %", 0.0, 0.9),
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
    rows = _track_rows(numbers, at_sea)
    columns = {
        name: {key.replace("_", " "): value for key, value in found.items()}
        for name, found in at_sea.items()
    }
    shown = pd.DataFrame(columns).rename_axis("measure").reset_index()
    body = (
        f"{_TRACK_INTRO}\n\n{markdown(table(rows))}\n\nWhere they differ, and what they rest on:\n\n"
        f"{reasons(rows)}\n\n![The loop](figures/track-loop.png)\n\n"
        f"## As it acts\n\n{_acting(acts)} White noise of its reading it answers 200 times: at 0.5 m "
        "rms the rudder goes from stop to stop and the track changes are missed by a third of a length. "
        "0.05 m, a filtered position, is assumed here.\n\n"
        f"## On the nonlinear plant\n\n{_TRACK_SEA}\n\n{markdown(shown, 3)}\n\n"
        "![Track changes](figures/track-voyages.png)\n"
    )
    drawn = {
        "track-loop": loop_figure(loop, "Cross-track controller's loop, time in ship lengths", "L"),
        "track-voyages": _track_figure(sailed),
    }
    return Page(rows, body, drawn, numbers | {"as_it_acts": acts._asdict(), "voyages": at_sea})


_TRACK_INTRO = """\
C = 20 (s + 0.5)² (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)²) on P / s, time in ship lengths:
`shaftline.baselines.TrackKeeper`. The thesis shows margins and step as figures (5-15 to 5-17) without
numbers; those here are of its printed controller and plant."""

_TRACK_SEA = f"""\
The surrogate at 22 knots; a beam current of 5 knots from {voyages.GUST_AT:g} L on; a line two lengths to
port at {voyages.LEFT_AT:g} L, led to over {voyages.CHANGE_LENGTHS:g} L (eight minutes), and back at
{voyages.BACK_AT:g} L. "Carried": the current adds to the cross track's speed and does nothing else,
as in the thesis. "Met": the hull meets it and is turned by it, as a ship is. "On a wall": sea state 4
pushes as if the hull threw all of the waves back, which none does; {100.0 * voyages.REFLECTED:g} % of
their energy is assumed otherwise."""


def _track_rows(loop: dict[str, float], at_sea: dict[str, dict[str, float]]) -> list[Row]:
    calm = at_sea["current carried"]
    sea, wall = (at_sea[name] for name in [*results.TRACK_VOYAGES][1:3])
    crab = -math.degrees(math.asin(voyages.CURRENT_M_S / voyages.SPEED_M_S))
    inf = math.inf
    return [
        Row("gain_margin_dB", "gain margin [dB]", loop["gain_margin_dB"], "figure; above 3", 3.0, inf),
        Row("phase_margin_deg", "phase margin [deg]", loop["phase_margin_deg"], "figure; above 30",
            30.0, inf),
        Row("overshoot_percent", "overshoot of a step [%]", loop["overshoot_percent"],
            '"may seem excessive"', 5.0, inf),
        Row("settling_lengths", "settled after [L]", loop["settling_lengths"], '"may seem excessive"',
            5.0, inf),
        Row("gust_overshoot_lengths", "beyond the track after the gust [L]",
            calm["gust_overshoot_lengths"], '"slightly"', 0.001, 0.1),
        Row("change_error_lengths", "largest error in the track changes [L]",
            calm["change_error_lengths"], '"very small"', 0.0, 0.05),
        Row("crab_deg", "heading held against the current [deg]", calm["crab_deg"],
            f"constant; asin(5/22) is {-crab:.2f}", crab - 0.1, crab + 0.1),
        Row("heading_on_return_deg", "heading nearest to 0 on the return [deg]",
            calm["heading_on_return_deg"], "does not pass through 0", -inf, 0.0),
        Row("sea_error_lengths", "off the track in sea state 4 [L]", sea["end_error_lengths"],
            "less than 20 yards, 0.129", 0.0, 0.129,
            "the thesis oscillates up to its limit; its force is not printed. To come near it the waves "
            f"would have to come back as from a wall ({wall['end_error_lengths']:.2f} L, much of it "
            "standing, for the law has no integral)"),
    ]  # fmt: skip


def _acting(acts: results.Numbers) -> str:
    return (
        f"On the surrogate's own linear steering, a command every {voyages.INTERVAL_S:g} s: gain margin "
        f"{acts.gain_margin_dB:.1f} dB, phase margin {acts.phase_margin_deg:.1f}°, overshoot "
        f"{acts.overshoot_percent:.1f} %, settled after {acts.settling_lengths:.2f} L."
    )


def _autopilot_figure(sailed: dict[str, pd.DataFrame]) -> Figure:
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(2, 2, (12.0, 7.2))
    figure.suptitle("Autopilot on the nonlinear plant at 22 knots", fontsize=12)
    for name, label, colour in (
        ("blown", "a sway of 5 kn at first, as printed", PALETTE[1]),
        ("met", "a current of 5 kn, met at 10 L", PALETTE[0]),
    ):
        part = sailed[name]
        heading, rudder = (np.degrees(part[c]) for c in ("heading_rad", "rudder_rad"))
        axes[0, 0].plot(part["way"], heading, color=colour, label=label)
        axes[1, 0].plot(part["way"], rudder, color=colour, linewidth=0.9)
    axes[0, 0].set_ylabel("heading [deg]")
    axes[0, 0].legend(fontsize=8, frameon=False)
    axes[1, 0].set_ylabel("rudder [deg]")
    axes[1, 0].set_xlabel("way at 22 knots [L]")
    turns = sailed["turns"]
    reckoned = voyages.dead_reckoned(turns)
    map_ = axes[0, 1]
    map_.plot(reckoned[:, 1], reckoned[:, 0], color=THESIS, linestyle="--", label="dead reckoned")
    map_.plot(
        turns["cross_track_m"] / length, turns["position_m"] / length, color=TRUTH, label="sailed"
    )
    for row in range(0, len(turns), round(5.0 * voyages.length_s() / voyages.INTERVAL_S)):
        at = turns.iloc[row]
        corners = outline(
            at["position_m"] / length, at["cross_track_m"] / length, at["heading_rad"]
        )
        map_.fill(*corners.T, color=PALETTE[1], alpha=0.7, linewidth=0.0)
    map_.set_aspect("equal", adjustable="datalim")
    map_.set_xlabel("to starboard [L]")
    map_.set_ylabel("along the first course [L]")
    map_.legend(fontsize=8, frameon=False)
    lower = axes[1, 1]
    lower.plot(turns["way"], np.degrees(turns["aim"]), color=THESIS, linestyle="--")
    lower.plot(turns["way"], np.degrees(turns["heading_rad"]), color=TRUTH)
    lower.set_ylabel("heading [deg]")
    lower.set_xlabel("way at 22 knots [L]")
    beside = lower.twinx()
    beside.plot(turns["way"], np.degrees(turns["rudder_rad"]), color=PALETTE[0], linewidth=0.8)
    beside.set_ylabel("rudder [deg]", color=PALETTE[0])
    beside.set_ylim(-10.0, 40.0)
    return figure


def _track_figure(sailed: dict[str, pd.DataFrame]) -> Figure:
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(3, 1, (11.0, 8.0))
    figure.suptitle(
        "Track changes in a beam current of 5 knots, cross-track controller at 22 knots",
        fontsize=12,
    )
    names = ["current carried", "current met", "current carried, sea state 4 on a wall"]
    for name, colour in zip(names, (PALETTE[1], PALETTE[0], PALETTE[2]), strict=True):
        part = sailed[name]
        axes[0, 0].plot(
            part["way"], part["cross_track_m"] / length, color=colour, label=name, lw=1.2
        )
        axes[1, 0].plot(part["way"], np.degrees(part["heading_rad"]), color=colour, lw=1.0)
        axes[2, 0].plot(part["way"], np.degrees(part["rudder_rad"]), color=colour, lw=0.8)
    axes[0, 0].plot(
        sailed[names[0]]["way"], sailed[names[0]]["aim"] / length, color=TRUTH, linestyle="--", lw=1.0,
        label="line led to",
    )  # fmt: skip
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis, label in zip(
        axes[:, 0], ("cross track [L]", "heading [deg]", "rudder [deg]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[2, 0].set_xlabel("way at 22 knots [L]")
    return figure
