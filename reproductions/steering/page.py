"""Pages of the autopilot and the cross-track controller: comparison with the thesis, and figures."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.display.loops import loop_figure
from shaftline.display.manoeuvres import outline

from ..cells import Cell, Kind, number
from ..pages import fill_template
from ..side_by_side import Page, cell_table
from . import results, voyages

AUTOPILOT_TITLE = "Autopilot by loop shaping (Taylor 2000, section 5.2)"
TRACK_TITLE = "Cross-track controller by loop shaping (Taylor 2000, section 5.3)"
_MARGINS = {
    "gain_margin_dB": "gain margin [dB]", "phase_margin_deg": "phase margin [deg]",
    "overshoot_percent": "overshoot [%]", "settling_lengths": "settling distance [L]",
}  # fmt: skip
_WEIGHTS = {
    "first order": "W1 = 1 / (s + 0.01)",
    "second order": "W1 = 100 / (1 + s / 0.01)²",
    "held": "W1 = 100 up to 0.01, 0 above",
}


def autopilot(tick: Callable[[], None]) -> Page:
    """Return the page of the autopilot."""
    loop, thesis = results.autopilot_loop(), results.thesis_loop(track=False)
    nine = results.robustness()
    tick()
    sampled = results.sampled_loop(track=False)
    tick()
    tracks, at_sea = results.autopilot_voyages(tick)
    rates = results.turn_rates()
    tick()
    cells = autopilot_cells(loop | at_sea, nine)
    bounds = pd.DataFrame(
        [(_WEIGHTS[name], *bound) for name, bound in results.bounds(thesis).items()],
        columns=["weight", "largest sum of both", "largest W1 S", "largest W2 T"],
    )
    body = fill_template(
        Path(__file__).with_name("autopilot.md"), cells=cell_table(cells), bounds=bounds,
        nine=nine.rename(columns=_MARGINS), sampled=sampled, interval=voyages.INTERVAL_S,
        turn_deg=voyages.TURN_DEG, rates=rates.rename(columns=_spaced),
    )  # fmt: skip
    figures = {
        "autopilot-loop": loop_figure(
            thesis, "Autopilot's loop, time in ship lengths", "L", (0.01, 40.0)
        ),
        "autopilot-voyages": autopilot_figure(tracks),
    }
    margins = {
        f"{row.gain}, {row.time}": {
            "gain_margin_dB": row.gain_margin_dB,
            "phase_margin_deg": row.phase_margin_deg,
        }
        for row in nine.itertuples()
    }
    numbers = loop | {"robustness": margins, "as_it_acts": sampled._asdict(), "voyages": at_sea}
    return Page(cells, body, figures, numbers)


def track(tick: Callable[[], None]) -> Page:
    """Return the page of the cross-track controller."""
    loop = results.thesis_loop(track=True)
    numbers: dict[str, Any] = results.loop_numbers(loop)._asdict()
    sampled = results.sampled_loop(track=True)
    tick()
    tracks, at_sea = results.track_voyages(tick)
    forces = results.wave_forces()
    tick()
    cells = track_cells(numbers, at_sea)
    measures = pd.DataFrame(
        {
            name: {_spaced(key): value for key, value in found.items()}
            for name, found in at_sea.items()
        }
    )
    body = fill_template(
        Path(__file__).with_name("track.md"), cells=cell_table(cells), sampled=sampled,
        interval=voyages.INTERVAL_S, voyages=voyages, steady=results.STEADY, forces=forces,
        measures=measures.rename_axis("measure").reset_index(),
    )  # fmt: skip
    figures = {
        "track-loop": loop_figure(loop, "Cross-track controller's loop, time in ship lengths", "L"),
        "track-voyages": track_figure(tracks),
    }
    return Page(
        cells, body, figures, numbers | {"as_it_acts": sampled._asdict(), "voyages": at_sea}
    )


def _spaced(name: Any) -> str:
    return str(name).replace("_", " ")


_LOOP, _CURRENT, _TURNS = "section 5.2.2", "section 5.2.3.1", "section 5.2.3.2"


def autopilot_cells(found: dict[str, float], nine: pd.DataFrame) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.2 with ours."""
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

    def claim(
        where: str, what: str, ours: float, text: str, low: float, high: float, basis: str = words,
        kind: Kind = free,
    ) -> Cell:  # fmt: skip
        return Cell(where, what, "", ours, low, high, basis, kind, words=text)

    phase, gain = nine["phase_margin_deg"], nine["gain_margin_dB"]
    inf, first = math.inf, found["first_turn_error_lengths"]
    return [
        near(_LOOP, "gain margin [dB]", "gain_margin_dB", 30.0, 0.5, digits),
        near(_LOOP, "phase margin [deg]", "phase_margin_deg", 64.0, 0.5, digits),
        claim(_LOOP, "gain at 0.01 [dB]", found["gain_at_0.01_dB"], "at least 40", 39.95, inf,
             "the limit that the words name, to a tenth of a decibel"),
        claim(_LOOP, "overshoot of a step [%]", found["overshoot_percent"], "at most 5", 0.0, 5.0),
        claim(_LOOP, "settled after [L]", found["settling_lengths"], "below 5", 0.0, 5.0),
        claim(_LOOP, "largest |W1 S| + |W2 T|", found["robust_performance_second order"], "below 1", 0.0,
             1.0, kind=calibrated),
        near("Figure 5-10", "controller's gain at the noise [dB]", "controller_gain_at_noise_dB", 8.0,
             0.5, digits, calibrated),
        near("Figure 5-10", "plant's gain at the noise [dB]", "plant_gain_at_noise_dB", -33.0, 0.5,
             digits),
        claim("section 6.2", "least phase margin, K and T 40 % off [deg]", float(phase.min()),
             "acceptable", 30.0, inf, "the thesis's rule of thumb: 3 dB and 30 degrees"),
        claim("section 6.2", "least gain margin, K and T 40 % off [dB]", float(gain.min()),
             "acceptable", 3.0, inf, "the thesis's rule of thumb: 3 dB and 30 degrees"),
        claim(_CURRENT, "heading after the sway of 5 kn [deg]", found["blown_heading_end_deg"],
             "returns to 0", -0.1, 0.1, "the assumed noise of the heading, 0.1 degrees rms"),
        near(_CURRENT, "drift from the sway of 5 kn [L]", "blown_drift_lengths", 1.0 / 3.0, 0.05,
             "nearer to 1/3 than to 1/4 or 1/2, read off the figure"),
        claim(_CURRENT, "amplitude of the rudder after it [deg]", found["blown_rudder_amplitude_deg"],
             "below 0.1", 0.0, 0.1),
        near(_TURNS, "off the dead-reckoned track after the turn [L]", "first_turn_error_lengths", 3.0,
             0.5, digits),
        claim(_TURNS, "off the track after the turn back [L]", found["second_turn_error_lengths"],
             "less than after the first turn", 0.0, first, "our own first turn"),
        near(_TURNS, "sweep of the rudder [deg]", "turn_rudder_sweep_deg", 20.0, 2.5,
             "'approximately', a number rounded to 5"),
        near(_TURNS, "time of the sweep [min]", "turn_minutes", 3.0, 0.5, digits, calibrated),
        claim(_TURNS, "heading error at the end [deg]", found["turn_heading_error_end_deg"],
             "below 1 %", 0.0, 0.9, "1 % of the turn of 90 degrees"),
    ]  # fmt: skip


_STEPS, _SEA = "section 5.3.3.1", "section 5.3.3.2"


def track_cells(loop: dict[str, float], at_sea: dict[str, dict[str, float]]) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.3 with ours."""
    calm, sea = at_sea[results.CALM], at_sea[results.BEAM_SEA]
    crab = -math.degrees(math.asin(voyages.CURRENT_M_S / voyages.SPEED_M_S))
    inf = math.inf
    margin = "the thesis's rule of thumb: 3 dB and 30 degrees"
    excess = "the limit of section 5.2.2 for an autopilot, 5 % and 5 L"

    def claim(
        where: str, what: str, ours: float, text: str, low: float, high: float, basis: str
    ) -> Cell:
        return Cell(where, what, "", ours, low, high, basis, Kind.FREE, words=text)

    return [
        claim("Figure 5-16", "gain margin [dB]", loop["gain_margin_dB"], "accepted practice", 3.0, inf,
             margin),
        claim("Figure 5-16", "phase margin [deg]", loop["phase_margin_deg"], "accepted practice", 30.0,
             inf, margin),
        claim("Figure 5-17", "overshoot of a step [%]", loop["overshoot_percent"], "may seem excessive",
             5.0, inf, excess),
        claim("Figure 5-17", "settled after [L]", loop["settling_lengths"], "may seem excessive", 5.0,
             inf, excess),
        claim(_STEPS, "beyond the track after the gust [L]", calm["gust_overshoot_lengths"], "slightly",
             0.001, 0.05, "our interpretation of the word: between 0.001 and 0.05 L"),
        claim(_STEPS, "largest error in the track changes [L]", calm["change_error_lengths"],
             "very small", 0.0, 0.05, "our interpretation of the words: below 0.05 L"),
        claim(_STEPS, "heading held against the current [deg]", calm["crab_deg"], "constant offset",
             crab - 0.1, crab + 0.1,
             "asin(5/22), 13.14 degrees, and the assumed noise of the heading, 0.1 degrees rms"),
        claim(_STEPS, "heading nearest to 0 on the return [deg]", calm["heading_on_return_deg"],
             "does not pass through 0", crab, 0.0, "between the offset and 0"),
        number(_SEA, "amplitude about the track in sea state 4 [L]", "", sea["steady_amplitude_lengths"],
               0.129, 0.032, "20 yards to the ten: 15 to 25 yards, of a length of 466 ft"),
    ]  # fmt: skip


def autopilot_figure(tracks: dict[str, pd.DataFrame]) -> Figure:
    """Draw heading and rudder in the current, and the two turns (Figures 5-7 to 5-13).

    Args:
        tracks: from :func:`.results.autopilot_voyages`.
    """
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(2, 2, (12.0, 7.2))
    figure.suptitle("Autopilot on the nonlinear plant at 22 knots", fontsize=12)
    for name, label, colour in (
        ("blown", "initial sway of 5 kn, as printed", PALETTE[1]),
        ("met", "current of 5 kn from 10 L on", PALETTE[0]),
    ):
        part = tracks[name]
        heading, rudder = (np.degrees(part[c]) for c in ("heading_rad", "rudder_rad"))
        axes[0, 0].plot(part["way"], heading, color=colour, label=label)
        axes[1, 0].plot(part["way"], rudder, color=colour, linewidth=0.9)
    axes[0, 0].set_ylabel("heading [deg]")
    axes[0, 0].legend(fontsize=8, frameon=False)
    axes[1, 0].set_ylabel("rudder [deg]")
    axes[1, 0].set_xlabel("distance at 22 knots [L]")
    turns = tracks["turns"]
    reckoned = voyages.dead_reckoning(turns)
    map_ = axes[0, 1]
    map_.plot(reckoned[:, 1], reckoned[:, 0], color=THESIS, linestyle="--", label="dead reckoning")
    map_.plot(
        turns["cross_track_m"] / length,
        turns["position_m"] / length,
        color=TRUTH,
        label="simulated",
    )
    for row in range(0, len(turns), round(5.0 * voyages.length_s() / voyages.INTERVAL_S)):
        at = turns.iloc[row]
        corners = outline(
            at["position_m"] / length, at["cross_track_m"] / length, at["heading_rad"]
        )
        map_.fill(*corners.T, color=PALETTE[1], alpha=0.7, linewidth=0.0)
    map_.set_aspect("equal", adjustable="datalim")
    map_.set_xlabel("to starboard [L]")
    map_.set_ylabel("advance [L]")
    map_.legend(fontsize=8, frameon=False)
    lower = axes[1, 1]
    lower.plot(turns["way"], np.degrees(turns["aim"]), color=THESIS, linestyle="--")
    lower.plot(turns["way"], np.degrees(turns["heading_rad"]), color=TRUTH)
    lower.set_ylabel("heading [deg]")
    lower.set_xlabel("distance at 22 knots [L]")
    beside = lower.twinx()
    beside.plot(turns["way"], np.degrees(turns["rudder_rad"]), color=PALETTE[0], linewidth=0.8)
    beside.set_ylabel("rudder [deg]", color=PALETTE[0])
    beside.set_ylim(-10.0, 40.0)
    return figure


def track_figure(tracks: dict[str, pd.DataFrame]) -> Figure:
    """Draw the track changes (Figures 5-18 to 5-23).

    Args:
        tracks: from :func:`.results.track_voyages`.
    """
    length = voyages.ship().manoeuvring.length_m
    figure, axes = new_figure(3, 1, (11.0, 8.0))
    figure.suptitle(
        "Track changes in a beam current of 5 knots, cross-track controller at 22 knots",
        fontsize=12,
    )
    names = [results.CALM, "current met", "current carried, waves on a wall"]
    for name, colour in zip(names, (PALETTE[1], PALETTE[0], PALETTE[2]), strict=True):
        part = tracks[name]
        axes[0, 0].plot(
            part["way"], part["cross_track_m"] / length, color=colour, label=name, lw=1.2
        )
        axes[1, 0].plot(part["way"], np.degrees(part["heading_rad"]), color=colour, lw=1.0)
        axes[2, 0].plot(part["way"], np.degrees(part["rudder_rad"]), color=colour, lw=0.8)
    axes[0, 0].plot(
        tracks[names[0]]["way"], tracks[names[0]]["aim"] / length, color=TRUTH, linestyle="--", lw=1.0,
        label="set-point",
    )  # fmt: skip
    axes[0, 0].legend(fontsize=8, frameon=False)
    for axis, label in zip(
        axes[:, 0], ("cross track [L]", "heading [deg]", "rudder [deg]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[2, 0].set_xlabel("distance at 22 knots [L]")
    return figure
