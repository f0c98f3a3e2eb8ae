"""Fuel rack and pitch mechanism of the true ship: from demands to what acts, on a fine grid of time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .numbers import Numbers

Floats = NDArray[np.float64]


def rack_travel(demand: Floats, numbers: Numbers, step: float) -> Floats:
    """Rack position [mm] on the fine grid.

    Args:
        demand: on the fine grid [mm].
        numbers: ``dead_time`` wanders by ``dead_time_jitter`` (a share of it); the rack needs
            ``rack_slowness`` [s/mm] upwards, and ``rack_slowness_down`` of that downwards.
        step: of the grid [s].
    """
    moved = np.clip(demand, 0.0, numbers["rack_high"])
    if numbers["dead_time"] > 0.0:
        time = np.arange(len(demand)) * step
        wander = np.sin(2.0 * math.pi * time / 47.0) + np.sin(2.0 * math.pi * time / 17.3 + 1.0)
        late = numbers["dead_time"] * (1.0 + 0.5 * numbers["dead_time_jitter"] * wander)
        moved = np.interp(time - late, time, moved)
    if numbers["rack_slowness"] > 0.0:
        up = step / numbers["rack_slowness"]
        down = up / numbers["rack_slowness_down"]
        here, track = float(moved[0]), np.empty(len(moved))
        for k, wanted in enumerate(moved.tolist()):
            here += min(max(wanted - here, -down), up)
            track[k] = here
        moved = track
    return moved


def pitch_travel(command: Floats, numbers: Numbers, step: float) -> Floats:
    """Blade pitch ratio on the fine grid: mechanism, then play between mechanism and blade.

    Args:
        command: on the fine grid.
        numbers: the ``pitch_...`` ones. Beyond ``pitch_dead_band`` a valve opens, and it shuts at
            ``pitch_dead_band_stop`` of it; the rate saturates smoothly at 1 / ``pitch_slowness``;
            the play's edges are rounded.
        step: of the grid [s].
    """
    wanted = np.clip(command, numbers["pitch_low"], numbers["pitch_high"])
    wanted = wanted + numbers["pitch_shift"] * (1.0 + numbers["pitch_shift_slope"] * (wanted - 1.1))
    time, band, slow = numbers["pitch_time"], numbers["pitch_dead_band"], numbers["pitch_slowness"]
    stop = band * numbers["pitch_dead_band_stop"]
    play, edge = 0.5 * numbers["pitch_play"], numbers["pitch_play_round"]
    here = blade = float(wanted[0])
    moving = False
    share = -math.expm1(-step / time)
    track = np.empty(len(wanted))
    for k, goal in enumerate(wanted.tolist()):
        track[k] = blade
        error = goal - here
        if band > 0.0:
            moving = abs(error) > (stop if moving else band)
            error = error - math.copysign(0.95 * stop, error) if moving else 0.0
        travel = error * share
        if slow > 0.0:
            most = step / slow
            travel = most * math.tanh(travel / most)
        here += travel
        if play > 0.0:  # the flank gives way a little before it carries the blade
            gap = here - blade
            soft = play * (1.0 - edge)
            if abs(gap) > play:
                blade = here - math.copysign(play, gap)
            elif abs(gap) > soft:
                blade += math.copysign((abs(gap) - soft) * 0.25 * min(step * 20.0, 1.0), gap)
        else:
            blade = here
    return track
