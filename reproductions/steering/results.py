"""Margins, steps and simulated voyages of the two controllers, for comparison with the thesis."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.baselines import loop_shaping
from shaftline.baselines.loop_shaping import TAYLOR, TAYLOR_GEAR, shape_controller
from shaftline.core.lazy import control
from shaftline.plant.loops import Loop

from ..side_by_side import Tick
from . import voyages

CONTROLLER_GAIN_DB = 8.0
"""Printed gain of the controller at the noise frequency; the frequency itself is not printed."""

SHARES = (0.6, 1.0, 1.4)
CALM, BEAM_SEA = "current carried", "current carried, waves on the beam"
TRACK_VOYAGES: dict[str, tuple[bool, str | None]] = {
    CALM: (True, None),
    BEAM_SEA: (True, voyages.REFLECTED),
    "current carried, waves on a wall": (True, voyages.WALL),
    "current met": (False, None),
}
"""Whether the current is carried, and wave force of sea state 4 on the beam."""

HEADINGS_DEG = (15.0, 30.0, 45.0, 60.0, 90.0, 120.0, 150.0)
"""Directions of sea state 4; 0 is following."""

TURN_RATES_DEG = (8.0, 10.0, 12.0, 14.0, 16.0)
"""Rates of the dead-reckoned turns [deg per ship length]."""

STEADY = (105.0, 140.0)  # steady part of the track change, between its two turns [ship lengths]
AUTOPILOT_TICKS, TRACK_TICKS = 6, 2 + len(TRACK_VOYAGES)


class Numbers(NamedTuple):
    """Margins and step response of a loop, with the names of the JSON file."""

    gain_margin_dB: float
    phase_margin_deg: float
    overshoot_percent: float
    settling_lengths: float


def loop_numbers(loop: Loop) -> Numbers:
    """Return margins and step response of a loop in ship lengths."""
    margins, step = loop.margins(), loop.step_measures()
    return Numbers(
        margins.gain_margin_dB, margins.phase_margin_deg, step.overshoot_percent, step.settling
    )


def _shaped(track: bool, *ship: Any) -> tuple[Any, Any]:
    """Return the plant of a controller and the controller that is shaped for it."""
    if track:
        plant = loop_shaping.track_plant(*ship)
        return plant, shape_controller(loop_shaping.TRACK_LOOP, plant)
    plant = loop_shaping.heading_plant(*ship)
    return plant, shape_controller(loop_shaping.COURSE_LOOP, plant)


def thesis_loop(track: bool) -> Loop:
    """Return the loop of the thesis, on its K, T and steering gear."""
    plant, controller = _shaped(track, TAYLOR, TAYLOR_GEAR)
    return Loop.from_plant(plant.system, controller)


def sampled_loop(track: bool) -> Numbers:
    """Return margins and step of the sampled controller on the surrogate's linear steering."""
    own = loop_shaping.steering_dynamics(voyages.ship(), voyages.straight())
    law = loop_shaping.ShapedController(_shaped(track, *own)[1])
    way = voyages.INTERVAL_S / voyages.length_s()
    return loop_numbers(Loop.from_plant(voyages.linear_plant(track), law.sampled(way)))


def robustness() -> pd.DataFrame:
    """Return the autopilot's margins on nine plants with other K and T than it was shaped for."""
    _, controller = _shaped(False, TAYLOR, TAYLOR_GEAR)
    rows = []
    for gain, time in itertools.product(SHARES, SHARES):
        wrong = TAYLOR._replace(gain=gain * TAYLOR.gain, time=time * TAYLOR.time)
        plant = loop_shaping.heading_plant(wrong, TAYLOR_GEAR).system
        found = loop_numbers(Loop.from_plant(plant, controller))
        rows.append({"gain": f"K times {gain}", "time": f"T times {time}", **found._asdict()})
    return pd.DataFrame(rows)


def autopilot_loop() -> dict[str, float]:
    """Return the numbers of section 5.2.2 on the autopilot's loop, by name."""
    loop = thesis_loop(track=False)
    plant, controller = _shaped(False, TAYLOR, TAYLOR_GEAR)

    def missing(frequency: float) -> float:
        return _decibels(controller, frequency) - CONTROLLER_GAIN_DB

    noise = float(scipy.optimize.brentq(missing, 1.0, 20.0, xtol=1e-9))
    return loop_numbers(loop)._asdict() | {
        "crossover_rad_per_length": loop.margins().crossover,
        "gain_at_0.01_dB": 20.0 * math.log10(abs(loop.response(np.array([0.01]))[0])),
        "noise_frequency_rad_per_length": noise,
        "controller_gain_at_noise_dB": _decibels(controller, noise),
        "plant_gain_at_noise_dB": _decibels(plant.system, noise),
        **{f"robust_performance_{name}": bound.whole for name, bound in bounds(loop).items()},
    }


def _decibels(system: control.StateSpace, frequency: float) -> float:
    """Return the gain [dB] of a system at a frequency [rad per ship length]."""
    return 20.0 * math.log10(abs(complex(system(1j * frequency))))


class Bound(NamedTuple):
    """Largest values over all frequencies of the terms of eq. 5.23."""

    whole: float  # |W1 S| + |W2 T|
    missed: float  # |W1 S|
    wrong: float  # |W2 T|


PERFORMANCE_WEIGHTS: dict[str, Callable[[Any], Any]] = {
    "first order": lambda s: 1.0 / (s + 0.01),
    "second order": lambda s: 100.0 / (1.0 + s / 0.01) ** 2,
    "held": lambda s: np.where(np.abs(s) <= 0.01 * (1.0 + 1e-9), 100.0, 0.0),
}
"""Weights W1 for steady errors of at most 1 %. The last, 100 up to 0.01 rad per ship length, is the
requirement as worded in section 5.1.4.
"""


def bounds(loop: Loop) -> dict[str, Bound]:
    """Return eq. 5.23 with each of :data:`PERFORMANCE_WEIGHTS`; the design asks for less than 1.

    The thesis prints no weights. W2 = 0.4 (1 + s / 10) / (1 + s / 100) is assumed: a plant that is 40 %
    wrong, and more beyond 10.
    """
    grid = np.append(np.geomspace(1e-4, 1e3, 6000), 0.01)
    response, s = loop.response(grid), 1j * grid
    wrong = np.abs(0.4 * (1.0 + s / 10.0) / (1.0 + s / 100.0) * response / (1.0 + response))
    found = {}
    for name, weight in PERFORMANCE_WEIGHTS.items():
        missed = np.abs(weight(s) / (1.0 + response))
        found[name] = Bound(float((missed + wrong).max()), float(missed.max()), float(wrong.max()))
    return found


def _between(table: pd.DataFrame, first: float, last: float) -> pd.DataFrame:
    """Return the rows between two distances, with angles in degrees and tracks in ship lengths."""
    rows = table[(table["way"] >= first) & (table["way"] < last)]
    length = voyages.ship().manoeuvring.length_m
    heading, rudder = np.degrees(rows["heading_rad"]), np.degrees(rows["rudder_rad"])
    off = (rows["cross_track_m"] - rows["aim"]) / length
    return rows.assign(
        heading=heading, rudder=rudder, off=off, track=rows["cross_track_m"] / length
    )


def autopilot_voyages(tick: Tick) -> tuple[dict[str, pd.DataFrame], dict[str, float]]:
    """Simulate the autopilot's voyages; return them by name, and their measures."""
    blown = voyages.keep_heading(30.0, sway_m_s=voyages.CURRENT_M_S)
    tick()
    met = voyages.keep_heading(40.0, current_at=10.0)
    tick()
    turns = voyages.two_turns()
    tick()
    whole, late = (_between(blown, first, math.inf) for first in (0.0, 20.0))
    current, end = _between(met, 0.0, math.inf), _between(turns, 80.0, 90.0)
    speed = turns["ship_speed_m_s"]
    found = {
        "blown_heading_peak_deg": whole["heading"].abs().max(),
        "blown_heading_end_deg": late["heading"].mean(),
        "blown_drift_lengths": abs(whole["track"].iloc[-1]),
        "blown_rudder_amplitude_deg": math.sqrt(2.0) * late["rudder"].std(),
        "blown_command_rms_deg": math.degrees(late["rudder_command_rad"].std()),
        "met_heading_peak_deg": current["heading"].abs().max(),
        "met_drift_lengths": abs(current["track"].iloc[-1]),
        **turn_measures(turns),
        "turn_heading_error_end_deg": abs(math.degrees((end["heading_rad"] - end["aim"]).mean())),
        "turn_speed_loss_percent": 100.0 * (1.0 - speed.min() / speed.iloc[0]),
    }
    return {"blown": blown, "met": met, "turns": turns}, found


def turn_measures(turns: pd.DataFrame) -> dict[str, float]:
    """Return errors of the dead-reckoned track [ship lengths], rudder sweep [deg] and its time [min]."""
    place = turns[["position_m", "cross_track_m"]].to_numpy() / voyages.ship().manoeuvring.length_m
    off = np.hypot(*(place - voyages.dead_reckoning(turns)).T)
    busy = _between(turns, 0.0, 50.0)
    size = busy["rudder"].abs()
    return {
        "first_turn_error_lengths": float(np.interp(48.0, turns["way"], off)),
        "second_turn_error_lengths": float(off[-1]),
        "turn_rudder_sweep_deg": float(np.ptp(busy["rudder"])),
        "turn_minutes": float(np.ptp(busy["time_s"][size > 0.1 * size.max()])) / 60.0,
    }


def turn_rates() -> pd.DataFrame:
    """Return :func:`turn_measures` for each of :data:`TURN_RATES_DEG`."""
    found = {rate: turn_measures(voyages.two_turns(rate)) for rate in TURN_RATES_DEG}
    return pd.DataFrame(found).T.rename_axis("rate_deg_per_length").reset_index()


def oscillation(track: pd.DataFrame) -> tuple[float, float]:
    """Return mean and amplitude of the cross-track error over :data:`STEADY` [ship lengths]."""
    off = _between(track, *STEADY)["off"]
    return float(off.mean()), float((off - off.mean()).abs().max())


def wave_forces() -> pd.DataFrame:
    """Return mean and amplitude of the track error in sea state 4, by wave force and direction."""
    tried = [(voyages.REFLECTED, 90.0, seed) for seed in (1, 2, 3)]
    tried += [(voyages.WALL, 90.0, 1)]
    tried += [(voyages.ORBITAL, heading, 1) for heading in HEADINGS_DEG]
    rows = []
    for kind, heading, seed in tried:
        sea = voyages.wave_case(kind, seed, heading)
        mean, amplitude = oscillation(voyages.track_change(sea=sea, seed=seed))
        rows.append(
            {
                "force": kind,
                "waves from astern by [deg]": heading,
                "seed": seed,
                "force, mean [kN]": 1e-3 * sea[1].side_N.mean(),
                "force, standard deviation [kN]": 1e-3 * sea[1].side_N.std(),
                "mean off the track [L]": mean,
                "amplitude [L]": amplitude,
            }
        )
    return pd.DataFrame(rows)


def track_voyages(tick: Tick) -> tuple[dict[str, pd.DataFrame], dict[str, dict[str, float]]]:
    """Simulate the track changes of :data:`TRACK_VOYAGES`; return them by name, and their measures."""
    tracks, found = {}, {}
    for name, (carried, force) in TRACK_VOYAGES.items():
        sea = None if force is None else voyages.wave_case(force, 1)
        track = tracks[name] = voyages.track_change(carried, sea)
        gust = _between(track, voyages.GUST_AT, voyages.LEFT_AT)
        changes = _between(track, voyages.LEFT_AT, voyages.END_AT)
        back = _between(track, voyages.BACK_AT, voyages.BACK_AT + voyages.CHANGE_LENGTHS)
        away = gust["way"][gust["off"].abs() > 0.02]
        found[name] = {
            "gust_excursion_lengths": gust["off"].max(),
            "gust_overshoot_lengths": max(0.0, -gust["off"].min()),
            "gust_over_after_lengths": float(away.max()) - voyages.GUST_AT,
            "gust_rudder_deg": gust["rudder"].abs().max(),
            "crab_deg": gust["heading"][gust["way"] >= 50.0].mean(),
            "change_error_lengths": changes["off"].abs().max(),
            "change_rudder_deg": changes["rudder"].abs().max(),
            "heading_on_return_deg": back["heading"].max(),
            "end_error_lengths": changes["off"][changes["way"] >= 200.0].abs().max(),
            "steady_amplitude_lengths": oscillation(track)[1],
        }
        tick()
    return tracks, found
