"""Pages of the autopilot and the cross-track controller: comparison with the thesis, and figures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH
from shaftline.display.loops import loop_figure
from shaftline.display.manoeuvres import outline

from ..cells import Cell, Kind
from ..pages import fill_template
from ..side_by_side import Page, Tick, cell_table
from ..writing import WORDS, Line, Panel, claim, draw, near
from . import results, voyages

AUTOPILOT_TITLE = "Autopilot by loop shaping (Taylor 2000, section 5.2)"
TRACK_TITLE = "Cross-track controller by loop shaping (Taylor 2000, section 5.3)"
_MARGINS = {
    "gain_margin_dB": "gain margin [dB]",
    "phase_margin_deg": "phase margin [deg]",
    "overshoot_percent": "overshoot [%]",
    "settling_lengths": "settling distance [L]",
}
_WEIGHTS = {
    "first order": "W1 = 1 / (s + 0.01)",
    "second order": "W1 = 100 / (1 + s / 0.01)²",
    "held": "W1 = 100 up to 0.01, 0 above",
}


def autopilot(tick: Tick) -> Page:
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
        Path(__file__).with_name("autopilot.md"),
        cells=cell_table(cells),
        bounds=bounds,
        nine=nine.rename(columns=_MARGINS),
        sampled=sampled,
        interval=voyages.INTERVAL_S,
        turn_deg=voyages.TURN_DEG,
        rates=rates.rename(columns=_spaced),
    )
    title = "Autopilot's loop, time in ship lengths"
    figures = {
        "autopilot-loop": loop_figure(thesis, title, "L", (0.01, 40.0)),
        "autopilot-voyages": _autopilot_figure(tracks),
    }
    margins = nine.set_index(nine["gain"] + ", " + nine["time"])[[*_MARGINS][:2]].to_dict("index")
    numbers = loop | {"robustness": margins, "as_it_acts": sampled._asdict(), "voyages": at_sea}
    return Page(cells, body, figures, numbers)


def track(tick: Tick) -> Page:
    """Return the page of the cross-track controller."""
    loop = results.thesis_loop(track=True)
    numbers: dict[str, Any] = results.loop_numbers(loop)._asdict()
    sampled = results.sampled_loop(track=True)
    tick()
    tracks, at_sea = results.track_voyages(tick)
    forces = results.wave_forces()
    tick()
    cells = track_cells(numbers, at_sea)
    measures = pd.DataFrame(at_sea).rename(index=_spaced).rename_axis("measure").reset_index()
    body = fill_template(
        Path(__file__).with_name("track.md"),
        cells=cell_table(cells),
        sampled=sampled,
        interval=voyages.INTERVAL_S,
        voyages=voyages,
        steady=results.STEADY,
        forces=forces,
        measures=measures,
    )
    title = "Cross-track controller's loop, time in ship lengths"
    figures = {"track-loop": loop_figure(loop, title, "L"), "track-voyages": _track_figure(tracks)}
    numbers |= {"as_it_acts": sampled._asdict(), "voyages": at_sea}
    return Page(cells, body, figures, numbers)


def _spaced(name: Any) -> str:
    return str(name).replace("_", " ")


RULE = "the thesis's rule of thumb: 3 dB and 30 degrees"


def autopilot_cells(found: dict[str, float], nine: pd.DataFrame) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.2 with ours."""
    loop, current, turns = (f"section 5.2.{number}" for number in ("2", "3.1", "3.2"))
    noise = "Figure 5-10"
    fitted, inf, first = Kind.CALIBRATED, math.inf, found["first_turn_error_lengths"]
    phase, gain = float(nine["phase_margin_deg"].min()), float(nine["gain_margin_dB"].min())
    return [
        near(loop, "gain margin [dB]", found["gain_margin_dB"], 30.0, 0.5),
        near(loop, "phase margin [deg]", found["phase_margin_deg"], 64.0, 0.5),
        claim(loop, "gain at 0.01 [dB]", found["gain_at_0.01_dB"], "at least 40", 39.95, inf,
              f"{WORDS}, to a tenth of a decibel"),
        claim(loop, "overshoot of a step [%]", found["overshoot_percent"], "at most 5", 0.0, 5.0),
        claim(loop, "settled after [L]", found["settling_lengths"], "below 5", 0.0, 5.0),
        claim(loop, "largest |W1 S| + |W2 T|", found["robust_performance_second order"], "below 1", 0.0,
              1.0, kind=fitted),
        near(noise, "controller's gain at the noise [dB]", found["controller_gain_at_noise_dB"], 8.0,
             0.5, kind=fitted),
        near(noise, "plant's gain at the noise [dB]", found["plant_gain_at_noise_dB"], -33.0, 0.5),
        claim("section 6.2", "least phase margin, K and T 40 % off [deg]", phase, "acceptable", 30.0,
              inf, RULE),
        claim("section 6.2", "least gain margin, K and T 40 % off [dB]", gain, "acceptable", 3.0, inf,
              RULE),
        claim(current, "heading after the sway of 5 kn [deg]", found["blown_heading_end_deg"],
              "returns to 0", -0.1, 0.1, "the assumed noise of the heading, 0.1 degrees rms"),
        near(current, "drift from the sway of 5 kn [L]", found["blown_drift_lengths"], 1.0 / 3.0, 0.05,
             "nearer to 1/3 than to 1/4 or 1/2, read off the figure"),
        claim(current, "amplitude of the rudder after it [deg]", found["blown_rudder_amplitude_deg"],
              "below 0.1", 0.0, 0.1),
        near(turns, "off the dead-reckoned track after the turn [L]", first, 3.0, 0.5),
        claim(turns, "off the track after the turn back [L]", found["second_turn_error_lengths"],
              "less than after the first turn", 0.0, first, "our own first turn"),
        near(turns, "sweep of the rudder [deg]", found["turn_rudder_sweep_deg"], 20.0, 2.5,
             "'approximately', a number rounded to 5"),
        near(turns, "time of the sweep [min]", found["turn_minutes"], 3.0, 0.5, kind=fitted),
        claim(turns, "heading error at the end [deg]", found["turn_heading_error_end_deg"], "below 1 %",
              0.0, 0.9, "1 % of the turn of 90 degrees"),
    ]  # fmt: skip


def track_cells(loop: dict[str, float], at_sea: dict[str, dict[str, float]]) -> list[Cell]:
    """Return the printed numbers and sentences of section 5.3 with ours."""
    calm, sea = at_sea[results.CALM], at_sea[results.BEAM_SEA]
    crab = -math.degrees(math.asin(voyages.CURRENT_M_S / voyages.SPEED_M_S))
    margins, step, steps, inf = "Figure 5-16", "Figure 5-17", "section 5.3.3.1", math.inf
    excess = "the limit of section 5.2.2 for an autopilot, 5 % and 5 L"
    return [
        claim(margins, "gain margin [dB]", loop["gain_margin_dB"], "accepted practice", 3.0, inf, RULE),
        claim(margins, "phase margin [deg]", loop["phase_margin_deg"], "accepted practice", 30.0, inf,
              RULE),
        claim(step, "overshoot of a step [%]", loop["overshoot_percent"], "may seem excessive", 5.0,
              inf, excess),
        claim(step, "settled after [L]", loop["settling_lengths"], "may seem excessive", 5.0, inf,
              excess),
        claim(steps, "beyond the track after the gust [L]", calm["gust_overshoot_lengths"], "slightly",
              0.001, 0.05, "our interpretation of the word: between 0.001 and 0.05 L"),
        claim(steps, "largest error in the track changes [L]", calm["change_error_lengths"],
              "very small", 0.0, 0.05, "our interpretation of the words: below 0.05 L"),
        claim(steps, "heading held against the current [deg]", calm["crab_deg"], "constant offset",
              crab - 0.1, crab + 0.1,
              "asin(5/22), 13.14 degrees, and the assumed noise of the heading, 0.1 degrees rms"),
        claim(steps, "heading nearest to 0 on the return [deg]", calm["heading_on_return_deg"],
              "does not pass through 0", crab, 0.0, "between the offset and 0"),
        near("section 5.3.3.2", "amplitude about the track in sea state 4 [L]",
             sea["steady_amplitude_lengths"], 0.129, 0.032,
             "20 yards to the ten: 15 to 25 yards, of a length of 466 ft"),
    ]  # fmt: skip


def _autopilot_figure(tracks: dict[str, pd.DataFrame]) -> Figure:
    """Draw heading and rudder in the current, and the two turns (Figures 5-7 to 5-13)."""
    length, heading, rudder = voyages.ship().manoeuvring.length_m, [], []
    for name, label, colour in (
        ("blown", "initial sway of 5 kn, as printed", PALETTE[1]),
        ("met", "current of 5 kn from 10 L on", PALETTE[0]),
    ):
        part = tracks[name]
        heading.append(Line(part["way"], np.degrees(part["heading_rad"]), label, colour))
        rudder.append(Line(part["way"], np.degrees(part["rudder_rad"]), "", colour, width=0.9))
    turns = tracks["turns"]
    reckoned = voyages.dead_reckoning(turns)
    map_ = [
        Line(reckoned[:, 1], reckoned[:, 0], "dead reckoning", THESIS, "--"),
        Line(turns["cross_track_m"] / length, turns["position_m"] / length, "simulated"),
    ]
    turned = [
        Line(turns["way"], np.degrees(turns["aim"]), "", THESIS, "--"),
        Line(turns["way"], np.degrees(turns["heading_rad"])),
    ]
    panels = [
        Panel(heading, {"ylabel": "heading [deg]"}, 1),
        Panel(
            map_,
            {
                "aspect": "equal",
                "adjustable": "datalim",
                "xlabel": "to starboard [L]",
                "ylabel": "advance [L]",
            },
            1,
        ),
        Panel(rudder, {"ylabel": "rudder [deg]"}),
        Panel(turned, {"ylabel": "heading [deg]"}),
    ]
    title = "Autopilot on the nonlinear plant at 22 knots"
    figure = draw(panels, (12.0, 7.2), 2, "distance at 22 knots [L]", title)
    every = round(5.0 * voyages.length_s() / voyages.INTERVAL_S)
    for at in turns.iloc[::every].itertuples():
        corners = outline(at.position_m / length, at.cross_track_m / length, at.heading_rad)
        figure.axes[1].fill(*corners.T, color=PALETTE[1], alpha=0.7, linewidth=0.0)
    beside = figure.axes[3].twinx()
    beside.plot(turns["way"], np.degrees(turns["rudder_rad"]), color=PALETTE[0], linewidth=0.8)
    beside.set_ylabel("rudder [deg]", color=PALETTE[0])
    beside.set_ylim(-10.0, 40.0)
    return figure


def _track_figure(tracks: dict[str, pd.DataFrame]) -> Figure:
    """Draw the track changes (Figures 5-18 to 5-23)."""
    length, drawn = voyages.ship().manoeuvring.length_m, {}
    names = (results.CALM, "current met", "current carried, waves on a wall")
    for ylabel, column, factor in (
        ("cross track [L]", "cross_track_m", 1.0 / length),
        ("heading [deg]", "heading_rad", np.degrees(1.0)),
        ("rudder [deg]", "rudder_rad", np.degrees(1.0)),
    ):
        drawn[ylabel] = [
            Line(tracks[name]["way"], factor * tracks[name][column], name, colour)
            for name, colour in zip(names, (PALETTE[1], PALETTE[0], PALETTE[2]), strict=True)
        ]
    calm = tracks[results.CALM]
    drawn["cross track [L]"].append(
        Line(calm["way"], calm["aim"] / length, "set-point", TRUTH, "--")
    )
    panels = [
        Panel(lines, {"ylabel": ylabel}, int(not k))
        for k, (ylabel, lines) in enumerate(drawn.items())
    ]
    title = "Track changes in a beam current of 5 knots, cross-track controller at 22 knots"
    return draw(panels, (11.0, 8.0), xlabel="distance at 22 knots [L]", title=title)
