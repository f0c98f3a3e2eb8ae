"""Simulate a voyage of the true ship from commands and waves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from . import motion
from .motion import STATES, Waves, calm
from .parameters import Floats, Parameters, as_record

FINE = 5  # steps of the clock's table within a sample
SETTLING = 1500.0  # s of the first demands before the record begins
JUMP = 0.3  # mm of rack; the integration stops and starts anew there
STALLED = 0.5  # rad/s; an engine this slow has stopped


class StalledError(ValueError):
    """Error for an effect so large that the engine stops."""


def varies_every_sample(rack: Floats) -> bool:
    """Return whether a rack command [mm] changes in steps too small for :func:`simulate_voyage`.

    Its error control does not detect them: during a slow ramp its steps of a second would skip samples,
    and the shaft would respond up to half a sample early.
    """
    steps = np.abs(np.diff(rack))
    return bool(np.any((steps > 0.0) & (steps <= JUMP)))


def _slow(_: float, states: Floats, *__: Any) -> float:
    return float(states[0] - STALLED)


_slow.terminal = True  # type: ignore[attr-defined]


def episode_factor(numbers: Parameters, time: Floats, seconds: float) -> Floats:
    """Return the added share of the resistance with its ramps."""
    rise, fall = (
        np.clip((time - numbers[end] * seconds) / numbers["episode_edge"] + 0.5, 0.0, 1.0)
        for end in ("episode_start", "episode_end")
    )
    return np.asarray(numbers["episode_gain"] * (rise - fall))


def current_over(numbers: Parameters, time: Floats) -> Floats:
    """Return the current along the track [m/s]."""
    angle = 2.0 * math.pi * time / numbers["current_period"] + numbers["current_phase"]
    return np.asarray(numbers["current"] * (1.0 + numbers["current_swing"] * np.sin(angle)))


def _clock_table(
    numbers: Parameters, rack: Floats, pitch: Floats, period: float, wind_seed: int
) -> Floats:
    step = period / FINE
    time: Floats = np.arange((len(rack) - 1) * FINE + 1, dtype=np.float64) * step
    seconds = float(time[-1])
    held = np.minimum(np.arange(len(time)) // FINE, len(rack) - 1)
    table = np.zeros((len(time), len(motion.CLOCK)))
    table[:, 0] = motion.rack_travel(rack[held], numbers, step)
    table[:, 1] = motion.pitch_travel(pitch[held], numbers, step)
    gust = np.random.default_rng(wind_seed).uniform(0.0, 2.0 * math.pi, 4)
    turn = 2.0 * math.pi * time
    wind = sum(np.sin(turn / p + g) for p, g in zip((900, 410, 233, 137), gust, strict=True))
    rudder = np.sin(turn / numbers["rudder_period"]) ** 2 * (np.sin(turn / 613.0 + 1.0) > -0.3)
    table[:, 2] = 1.0 + episode_factor(numbers, time, seconds)
    table[:, 2] += numbers["wind"] * wind / math.sqrt(2.0)
    table[:, 2] += numbers["rudder"] * rudder
    table[:, 3] = current_over(numbers, time)
    start, end = numbers["generator_start"] * seconds, numbers["generator_end"] * seconds
    table[:, 4] = numbers["generator_torque"] * ((time > start) & (time < end))
    table[:, 5] = numbers["bubbles"] * (
        (time / numbers["bubbles_period"]) % 1.0 < numbers["bubbles_share"]
    )
    return table


def _first_states(ship: NDArray[Any], numbers: Parameters, table: Floats) -> Floats:
    """Return the steady states at the first commands in calm water."""
    held = np.vstack([table[0], table[0]])
    held[:, 2] = 1.0
    held[:, 4:] = 0.0
    brake = 2e4 if numbers["lag_time"] > 0.0 else 0.0
    start = np.array([9.0, 7.0 + held[0, 3], 0.0, brake, 0.0, 6.0, 0.0, 0.0, 0.0])
    whole = scipy.integrate.solve_ivp(
        motion.rates,
        (0.0, SETTLING),
        start,
        method="LSODA",
        rtol=1e-7,
        atol=motion.ABSOLUTE_TOLERANCES,
        args=(ship, calm(), held, SETTLING),
        events=_slow,
    )
    if whole.status != 0:
        raise StalledError("the engine stops at the first demands")
    settled = np.asarray(whole.y[:, -1])
    settled[[2, 6, 7]] = 0.0  # at the origin, no air, the bearing cold
    return settled


def simulate_voyage(
    numbers: Parameters,
    rack: Floats,
    pitch: Floats,
    period: float,
    *,
    waves: Waves | None = None,
    wind_seed: int = 0,
) -> pd.DataFrame:
    """Integrate the true ship; return its true signals in the canonical columns of a recording.

    Args:
        numbers: parameters of the true ship.
        rack: command [mm] at each sample, held until the next.
        pitch: commanded pitch ratio at each sample.
        period: sampling interval [s].
        waves: waves from :func:`~.motion.head_sea`; calm by default.
        wind_seed: seed of the slow variation of the resistance.

    Raises:
        StalledError: the engine stops.
    """
    waves = calm() if waves is None else waves
    ship = as_record(numbers)
    table = _clock_table(numbers, rack, pitch, period, wind_seed)
    step = period / FINE
    times: Floats = np.arange(len(rack), dtype=np.float64) * period
    state = _first_states(ship, numbers, table)
    states = np.empty((len(times), STATES))
    longest = 0.5 if len(waves) else 2.0  # s
    jumps = np.flatnonzero(np.abs(np.diff(table[::FINE, 0])) > JUMP) + 1
    for first, last in zip([0, *jumps], [*jumps, len(times) - 1], strict=True):
        if first == last:
            continue
        span = float(times[first]), float(times[last]) - 1e-6
        solution = scipy.integrate.solve_ivp(
            motion.rates,
            span,
            state,
            method="RK45",
            rtol=1e-5,
            atol=motion.ABSOLUTE_TOLERANCES,
            max_step=longest,
            t_eval=np.append(times[first:last], span[1]),
            args=(ship, waves, table, step),
            events=_slow,
        )
        if solution.status != 0:
            raise StalledError(f"the engine stops at {solution.t[-1]:.1f} s")
        states[first:last] = solution.y.T[:-1]
        state = states[last] = solution.y[:, -1]
    return columns_of(rack, pitch, period, states, ship, waves, table)


def columns_of(
    rack: Floats,
    pitch: Floats,
    period: float,
    states: Floats,
    ship: NDArray[Any],
    waves: Waves,
    table: Floats,
) -> pd.DataFrame:
    """Return the true signals in the canonical columns of a recording, from the states at the samples.

    ``ship`` is an array of one record, ``table`` that of the clock; the other arguments are those of
    :func:`simulate_voyage`.
    """
    times: Floats = np.arange(len(rack), dtype=np.float64) * period
    outs = motion.signals(times, states, ship, waves, table, period / FINE)
    return pd.DataFrame(
        {
            "time_s": times,
            "fuel_rack_mm": rack,
            "pitch_ratio_command": pitch,
            "pitch_ratio": table[::FINE, 1],
            "shaft_speed_rad_s": states[:, 0],
            "shaft_torque_N_m": outs[:, 0],
            "ship_speed_m_s": states[:, 1],
            "thrust_N": outs[:, 1],
            "propeller_submergence_m": outs[:, 2],
        }
    )
