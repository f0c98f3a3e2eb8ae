"""The two controllers in numbers: their loops beside what is printed, and their voyages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from ...baselines.loop_shaping import (
    COURSE_LOOP,
    TAYLOR,
    TAYLOR_GEAR,
    TRACK_LOOP,
    Factors,
    ShapedLaw,
    heading_plant,
    shaped,
    steered_at,
    track_plant,
)
from ...plant.loops import Loop
from . import voyages

NOISE_FREQUENCY = 5.85
"""At which controller and plant have the gains that are printed, 8 and -33 dB [rad per ship length]."""

SHARES = (0.6, 1.0, 1.4)
WALL = 1.0  # share of the waves that a wall throws back
TRACK_VOYAGES = {
    "current carried": (voyages.CARRIED, 0.0),
    "current carried, sea state 4": (voyages.CARRIED, voyages.REFLECTED),
    "current carried, sea state 4 on a wall": (voyages.CARRIED, WALL),
    "current met": (voyages.MET, 0.0),
}
"""Kind of current, and share of the waves that is thrown back."""

AUTOPILOT_TICKS, TRACK_TICKS = 5, 1 + len(TRACK_VOYAGES)


class Numbers(NamedTuple):
    """What is printed of a loop, as ours; the names are those of the JSON."""

    gain_margin_dB: float
    phase_margin_deg: float
    overshoot_percent: float
    settling_lengths: float


def loop_numbers(loop: Loop) -> Numbers:
    """Margins and step of a loop in ship lengths."""
    margins, step = loop.margins(), loop.step_measures()
    return Numbers(
        margins.gain_margin_dB, margins.phase_margin_deg, step.overshoot_percent, step.settling
    )


def designed(loop: Factors, plant: Factors) -> Loop:
    """The loop of a plant and of the controller that is shaped for it."""
    return Loop.of(plant.system, shaped(loop, plant))


def thesis_loop(track: bool) -> Loop:
    """The loop as the thesis has it, on its K, T and steering gear."""
    if track:
        return designed(TRACK_LOOP, track_plant(TAYLOR, TAYLOR_GEAR))
    return designed(COURSE_LOOP, heading_plant(TAYLOR, TAYLOR_GEAR))


def as_it_acts(track: bool) -> Numbers:
    """The same controller on the surrogate's own linear steering, at intervals."""
    ship, point = voyages.ship(), voyages.straight()
    own = steered_at(ship, point)
    kind, plant = (TRACK_LOOP, track_plant(*own)) if track else (COURSE_LOOP, heading_plant(*own))
    law = ShapedLaw(shaped(kind, plant))
    way = voyages.INTERVAL_S / voyages.length_s()
    return loop_numbers(Loop.of(voyages.linear_plant(track), law.sampled(way)))


def robustness() -> pd.DataFrame:
    """The autopilot's margins where K and T are not what it was shaped for: nine plants."""
    controller = shaped(COURSE_LOOP, heading_plant(TAYLOR, TAYLOR_GEAR))
    rows = []
    for gain in SHARES:
        for time in SHARES:
            wrong = TAYLOR._replace(gain=gain * TAYLOR.gain, time=time * TAYLOR.time)
            found = loop_numbers(Loop.of(heading_plant(wrong, TAYLOR_GEAR).system, controller))
            rows.append(("K times " + str(gain), "T times " + str(time), *found))
    return pd.DataFrame(rows, columns=["gain", "time", *Numbers._fields])


def autopilot_loop() -> dict[str, float]:
    """What section 5.2.2 prints of the autopilot's loop, by name."""
    loop = thesis_loop(track=False)
    plant = heading_plant(TAYLOR, TAYLOR_GEAR)
    controller = shaped(COURSE_LOOP, plant)
    gain = {
        name: 20.0 * math.log10(abs(complex(system(1j * NOISE_FREQUENCY))))
        for name, system in (("controller", controller), ("plant", plant.system))
    }
    at_low = 20.0 * math.log10(abs(loop.response(np.array([0.01]))[0]))
    return loop_numbers(loop)._asdict() | {
        "crossover_rad_per_length": loop.margins().crossover,
        "gain_at_0.01_dB": at_low,
        "controller_gain_at_noise_dB": gain["controller"],
        "plant_gain_at_noise_dB": gain["plant"],
        "robust_performance": robust_performance(loop),
    }


def robust_performance(loop: Loop) -> float:
    """Largest |W1 S| + |W2 T| over all frequencies (eq. 5.23; the design asks for less than 1).

    The weights are not printed. Assumed: W1 = 1 / (s + 0.01), errors of at most 1 % where frequencies
    are low; W2 = 0.4 (1 + s / 10) / (1 + s / 100), a plant that is 40 % wrong, and more beyond 10.
    """
    grid = np.geomspace(1e-3, 1e3, 4000)
    response, s = loop.response(grid), 1j * grid
    missed = np.abs(1.0 / (s + 0.01) / (1.0 + response))
    wrong = np.abs(0.4 * (1.0 + s / 10.0) / (1.0 + s / 100.0) * response / (1.0 + response))
    return float((missed + wrong).max())


def _between(table: pd.DataFrame, first: float, last: float) -> pd.DataFrame:
    return table[(table["way"] >= first) & (table["way"] < last)]


def autopilot_voyages(
    tick: Callable[[], None],
) -> tuple[dict[str, pd.DataFrame], dict[str, float]]:
    """The autopilot's voyages, by name, and what they measure.

    Args:
        tick: called three times.
    """
    length = voyages.ship().manoeuvring.length_m
    blown = voyages.blown()
    tick()
    met = voyages.into_current()
    tick()
    turns = voyages.two_turns()
    tick()
    rest = _between(blown, 20.0, 30.0)
    found = {
        "blown_heading_peak_deg": math.degrees(blown["heading_rad"].abs().max()),
        "blown_heading_end_deg": math.degrees(rest["heading_rad"].mean()),
        "blown_drift_lengths": abs(blown["cross_track_m"].iloc[-1]) / length,
        "blown_rudder_rms_deg": math.degrees(rest["rudder_rad"].std()),
        "blown_command_rms_deg": math.degrees(rest["rudder_command_rad"].std()),
        "met_heading_peak_deg": math.degrees(met["heading_rad"].abs().max()),
        "met_drift_lengths": abs(met["cross_track_m"].iloc[-1]) / length,
    }
    reckoned = voyages.dead_reckoned(turns)
    place = turns[["position_m", "cross_track_m"]].to_numpy() / length
    off = np.hypot(*(place - reckoned).T)
    found["first_turn_error_lengths"] = float(np.interp(48.0, turns["way"], off))
    found["second_turn_error_lengths"] = float(off[-1])
    busy = _between(turns, 0.0, 50.0)
    rudder = np.degrees(busy["rudder_rad"].to_numpy())
    at_work = busy["time_s"].to_numpy()[np.abs(rudder) > 0.1 * np.abs(rudder).max()]
    found["turn_rudder_sweep_deg"] = float(np.ptp(rudder))
    found["turn_minutes"] = float(np.ptp(at_work)) / 60.0
    rest = _between(turns, 80.0, 90.0)
    found["turn_heading_error_end_deg"] = math.degrees(
        abs((rest["heading_rad"] - rest["aim"]).mean())
    )
    found["turn_speed_loss_percent"] = 100.0 * (
        1.0 - turns["ship_speed_m_s"].min() / turns["ship_speed_m_s"].iloc[0]
    )
    return {"blown": blown, "met": met, "turns": turns}, found


def track_voyages(
    tick: Callable[[], None],
) -> tuple[dict[str, pd.DataFrame], dict[str, dict[str, float]]]:
    """The track changes of :data:`TRACK_VOYAGES`, and what each measures.

    Args:
        tick: called after each.
    """
    length = voyages.ship().manoeuvring.length_m
    sailed, found = {}, {}
    for name, (current, share) in TRACK_VOYAGES.items():
        track = sailed[name] = voyages.track_change(current, share)
        off = (track["cross_track_m"] - track["aim"]) / length
        track = track.assign(off=off, size=off.abs(), rudder=np.degrees(track["rudder_rad"]).abs())
        gust = _between(track, voyages.GUST_AT, voyages.LEFT_AT)
        changes = _between(track, voyages.LEFT_AT, voyages.END_AT)
        back = _between(track, voyages.BACK_AT, voyages.BACK_AT + voyages.CHANGE_LENGTHS)
        away = gust["way"][gust["size"] > 0.02]
        found[name] = {
            "gust_excursion_lengths": gust["off"].max(),
            "gust_overshoot_lengths": max(0.0, -gust["off"].min()),
            "gust_over_after_lengths": float(away.max()) - voyages.GUST_AT,
            "gust_rudder_deg": gust["rudder"].max(),
            "crab_deg": math.degrees(_between(gust, 50.0, 60.0)["heading_rad"].mean()),
            "change_error_lengths": changes["size"].max(),
            "change_rudder_deg": changes["rudder"].max(),
            "heading_on_return_deg": math.degrees(back["heading_rad"].max()),
            "end_error_lengths": _between(track, 200.0, voyages.END_AT)["size"].max(),
        }
        tick()
    return sailed, found
