"""Ships under a governor, whose commands depend on the measurement of the encoder.

The loop is closed once per sample: the measured shaft speed with its noise and rounding is the input
of a proportional-integral controller, and its command is held until the next sample. Between samples
the equations of motion are integrated by the classical Runge-Kutta method.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .bench import _motor, bench_parameters, bench_table, step_held, thruster_record
from .instruments import ENCODER_DIGIT, encoder_noise, steady
from .motion import STATES, Waves, _balance, calm, compiled
from .parameters import Floats, Parameters, as_record
from .voyage import FINE, STALLED, StalledError, _clock_table, _first_states, columns_of


class Governor(NamedTuple):
    """Proportional-integral controller from shaft speed [rad/s] to the command's unit."""

    gain: float  # proportional [unit s/rad]
    reset: float  # integral gain [unit/rad]
    low: float  # lowest command
    high: float  # highest command
    ramp: float  # fastest change of the set-point [rad/s2]


RACK = Governor(4.0, 2.0, 0.0, 34.0, 0.25)
"""Governor of the frigate, command in mm of fuel rack."""

VOLTAGE = Governor(0.35, 0.8, -40.0, 40.0, 60.0)
"""Governor of the thruster, command in V."""

VOLTS = np.linspace(-48.0, 48.0, 193)


def limit_rate(orders: Floats, governor: Governor, period: float) -> Floats:
    """Return set-points [rad/s] with the governor's rate limit."""
    most, found = governor.ramp * period, np.array(orders, dtype=np.float64)
    for k in range(1, len(found)):
        found[k] = found[k - 1] + min(max(found[k] - found[k - 1], -most), most)
    return found


def _encoder(numbers: Parameters, rows: int, seed: int) -> tuple[Floats, float]:
    """Return noise and resolution of the encoder; the resolution is 0 without rounding."""
    digit = ENCODER_DIGIT if numbers["rounding"] > 0.0 else 0.0
    return encoder_noise(numbers, rows, seed), digit


@compiled
def _rule(error: float, memory: float, rule: Any, period: float) -> tuple[float, float]:
    """Return the command, and the integral with anti-windup."""
    gain, reset, low, high = rule
    grown = memory + reset * period * error
    demand = gain * error + grown
    if low < demand < high:
        return demand, grown
    return min(max(demand, low), high), min(max(memory, low), high)


@compiled
def _runge_kutta(
    t: float, h: float, y: Any, ship: Any, waves: Any, table: Any, step: float, k: Any, out: Any
) -> None:
    """Advance the states by one step, in place."""
    _balance(t, y, ship, waves, table, step, k[0], out)
    _balance(t + 0.5 * h, y + 0.5 * h * k[0], ship, waves, table, step, k[1], out)
    _balance(t + 0.5 * h, y + 0.5 * h * k[1], ship, waves, table, step, k[2], out)
    _balance(t + h, y + h * k[2], ship, waves, table, step, k[3], out)
    y += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])


@compiled
def _voyage(
    ship: Any,
    waves: Any,
    table: Any,
    step: float,
    fine: int,
    orders: Any,
    noise: Any,
    digit: float,
    rule: Any,
    closed: bool,
    first: float,
    start: Any,
    demands: Any,
    states: Any,
) -> None:
    """Write the states at the samples, the rack in the table, and in closed loop the commands."""
    ship = ship[0]
    y, k, out = start.copy(), np.zeros((4, len(start))), np.zeros(3)
    memory, here = first, first
    wanted = np.full(len(table), first)
    for sample in range(len(orders)):
        states[sample] = y
        demand = demands[sample]
        if closed:
            reading = y[0] + noise[sample]
            if digit > 0.0:
                reading = np.round(reading / digit) * digit
            demand, memory = _rule(orders[sample] - reading, memory, rule, step * fine)
            demands[sample] = demand
        if sample == len(orders) - 1:
            break
        for part in range(fine):
            i = sample * fine + part
            wanted[i] = min(max(demand, 0.0), ship.rack_high)
            moved = wanted[i]
            if ship.dead_time > 0.0:
                t = i * step
                turn = 2.0 * math.pi * t
                wander = math.sin(turn / 47.0) + math.sin(turn / 17.3 + 1.0)
                late = ship.dead_time * (1.0 + 0.5 * ship.dead_time_jitter * wander)
                place = max(i - late / step, 0.0)
                below = min(int(place), i)
                above = min(below + 1, i)
                moved = wanted[below] + (place - below) * (wanted[above] - wanted[below])
            if ship.rack_slowness > 0.0:
                up = step / ship.rack_slowness
                here += min(max(moved - here, -up / ship.rack_slowness_down), up)
                moved = here
            table[i, 0] = moved
            table[i + 1, 0] = moved  # until its turn comes: the last stage looks at it
            _runge_kutta(i * step, step, y, ship, waves, table, step, k, out)
    table[len(table) - 1, 0] = table[len(table) - 2, 0]


def _first_rack(numbers: Parameters, order: float, table: Floats) -> tuple[float, Floats]:
    """Return the rack [mm] at which the true ship has a shaft speed, and its states there."""
    ship = as_record(numbers)

    def settled(rack: float) -> Floats:
        held = table[:2].copy()
        held[:, 0] = rack
        return _first_states(ship, numbers, held)

    rack, slope = steady(round(order, 3), round(float(table[0, 1]), 3))[0], 0.35
    states = settled(rack)
    for _ in range(6):
        short = order - float(states[0])
        if abs(short) < 1e-3:
            break
        there = min(max(rack + short / slope, 0.5), numbers["rack_high"])
        moved = settled(there)
        if there != rack and moved[0] != states[0]:
            slope = min(max((moved[0] - states[0]) / (there - rack), 0.1), 2.0)
        rack, states = there, moved
    return rack, states


def simulate_governed(
    numbers: Parameters,
    orders: Floats,
    pitch: Floats,
    period: float,
    seed: int,
    *,
    waves: Waves | None = None,
    wind_seed: int = 0,
) -> pd.DataFrame:
    """Integrate the true ship under a governor; the rack command of the result is the governor's.

    Args:
        numbers: parameters of the true ship.
        orders: set-point of the shaft speed [rad/s] at each sample.
        pitch: commanded pitch ratio at each sample.
        period: sampling interval [s].
        seed: seed of the encoder's noise, as for the measurements.
        waves: waves from :func:`~.motion.head_sea`; calm by default.
        wind_seed: seed of the slow variation of the resistance.

    Raises:
        StalledError: the engine stops.
    """
    table = _clock_table(numbers, np.zeros(len(orders)), pitch, period, wind_seed)
    first, start = _first_rack(numbers, float(orders[0]), table)
    encoder = _encoder(numbers, len(orders), seed)
    wanted, racks = limit_rate(orders, RACK, period), np.zeros(len(orders))
    return _simulate(
        numbers, racks, pitch, period, waves, table, wanted, encoder, True, first, start
    )


def simulate_held(
    numbers: Parameters,
    rack: Floats,
    pitch: Floats,
    period: float,
    *,
    waves: Waves | None = None,
    wind_seed: int = 0,
) -> pd.DataFrame:
    """Integrate the true ship with rack commands [mm] that change at every sample.

    The other arguments and the error are those of :func:`simulate_governed`.
    """
    table = _clock_table(numbers, rack, pitch, period, wind_seed)
    start = _first_states(as_record(numbers), numbers, table)
    first = float(np.clip(rack[0], 0.0, numbers["rack_high"]))
    encoder = np.zeros(len(rack)), 0.0
    return _simulate(
        numbers, rack.copy(), pitch, period, waves, table, rack, encoder, False, first, start
    )


def _simulate(
    numbers: Parameters,
    racks: Floats,
    pitch: Floats,
    period: float,
    waves: Waves | None,
    table: Floats,
    orders: Floats,
    encoder: tuple[Floats, float],
    closed: bool,
    first: float,
    start: Floats,
) -> pd.DataFrame:
    waves = calm() if waves is None else waves
    ship, states = as_record(numbers), np.zeros((len(racks), STATES))
    _voyage(
        ship,
        waves,
        table,
        period / FINE,
        FINE,
        orders,
        *encoder,
        RACK[:4],
        closed,
        first,
        start,
        racks,
        states,
    )
    if not np.isfinite(states).all() or (states[:, 0] < STALLED).any():
        raise StalledError("the engine stops")
    return columns_of(racks, pitch, period, states, ship, waves, table)


def bench_orders(volts: Floats) -> Floats:
    """Return the steady shaft speeds [rad/s] of the ship file's thruster at voltages."""
    n = bench_parameters()
    speeds = np.linspace(-150.0, 150.0, 6001)
    turns = speeds / (2.0 * math.pi)
    load = n["density"] * n["diameter"] ** 5 * n["kq"] * turns * np.abs(turns)
    load += n["rub"] * np.tanh(speeds / 0.1)
    pull = n["constant"] * n["gear"]
    return np.asarray(np.interp(volts, n["ohm"] * load / pull + pull * speeds, speeds))


@compiled
def _bench(
    ship: Any,
    period: float,
    orders: Any,
    noise: Any,
    digit: float,
    rule: Any,
    first: float,
    demands: Any,
    states: Any,
    currents: Any,
) -> None:
    """Write commands, states and currents at the samples."""
    ship = ship[0]
    y, k, memory = np.zeros(4), np.zeros((4, 4)), first
    y[0] = orders[0]
    y[1] = orders[0]
    for sample in range(len(orders)):
        states[sample] = y
        reading = y[0] + noise[sample]
        if digit > 0.0:
            reading = np.round(reading / digit) * digit
        volt, memory = _rule(orders[sample] - reading, memory, rule, period)
        demands[sample] = volt
        currents[sample] = _motor(volt, y, ship, k[0])
        step_held(volt, y, ship, period, k)


def run_bench_governed(
    numbers: Parameters, orders: Floats, period: float, seed: int
) -> pd.DataFrame:
    """Integrate the thruster under a governor; return true signals with the voltage command.

    Args:
        numbers: from :func:`~.bench.bench_parameters`, with effects.
        orders: set-point of the shaft speed [rad/s] at each sample.
        period: sampling interval [s].
        seed: seed of the encoder's noise, as for the measurements.
    """
    encoder, wanted = _encoder(numbers, len(orders), seed), limit_rate(orders, VOLTAGE, period)
    volts, currents = np.zeros((2, len(orders)))
    states = np.zeros((len(orders), 4))
    first = float(np.interp(orders[0], bench_orders(VOLTS), VOLTS))
    _bench(
        thruster_record(numbers),
        period,
        wanted,
        *encoder,
        VOLTAGE[:4],
        first,
        volts,
        states,
        currents,
    )
    return bench_table(numbers, period, volts, states, currents)
