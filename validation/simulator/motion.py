"""Waves, actuators and equations of motion of the true ship, with the effects that its file leaves out.

The waves are a long-crested JONSWAP head sea of components of equal energy with random phases.

Compiled for speed. The states are shaft speed, ship speed, position, brake torque and its rate (of an
engine with lag), inflow (where it lags), air at the propeller, bearing heat, and the phase of a torque
of the shaft's order.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from .parameters import Floats, Parameters

GRAVITY = 9.81
COMPONENTS = 48

Waves = Floats
"""Shape (n, 5), one component a row: elevation amplitude [m], inflow amplitude at the propeller [m/s],
circular frequency [rad/s], wave number along the track [rad/m], phase [rad]."""


def calm() -> Waves:
    """Return calm water."""
    return np.zeros((0, 5))


def head_sea(
    height: float,
    period: float,
    depth: float,
    seed: int,
    peakedness: float = 3.3,
    angle: float = 0.0,
) -> Waves:
    """Draw a sea that meets the ship; each component has the same share of the energy height^2 / 16.

    Args:
        height: significant wave height [m].
        period: peak period [s].
        depth: depth of the propeller's centre [m].
        seed: seed of the phases and frequencies.
        peakedness: gamma [-].
        angle: angle off the bow [rad].
    """
    rng = np.random.default_rng(seed)
    grid = np.linspace(0.5, 3.5, 4000) * 2.0 * math.pi / period
    ratio = grid * period / (2.0 * math.pi)
    sigma = np.where(ratio < 1.0, 0.07, 0.09)
    density = ratio**-5 * np.exp(-1.25 / ratio**4)
    density *= peakedness ** np.exp(-((ratio - 1.0) ** 2) / (2.0 * sigma**2))
    share = np.cumsum(density)
    wanted = (np.arange(COMPONENTS) + rng.random(COMPONENTS)) / COMPONENTS
    frequency = np.interp(wanted, share / share[-1], grid)
    number = frequency**2 / GRAVITY
    waves = np.zeros((COMPONENTS, 5))
    waves[:, 0] = height / 4.0 * math.sqrt(2.0 / COMPONENTS)
    # in a head sea's crest the water runs against the ship: it adds to the inflow
    waves[:, 1] = waves[:, 0] * frequency * np.exp(-number * depth) * math.cos(angle)
    waves[:, 2] = frequency
    waves[:, 3] = number * math.cos(angle)
    waves[:, 4] = rng.uniform(0.0, 2.0 * math.pi, COMPONENTS)
    return waves


def rack_travel(demand: Floats, numbers: Parameters, step: float) -> Floats:
    """Return the rack position [mm] for commands on a grid with a step [s].

    ``dead_time`` varies by its share ``dead_time_jitter``; the rack needs ``rack_slowness`` [s/mm]
    upwards, and ``rack_slowness_down`` of that downwards.
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


def pitch_travel(command: Floats, numbers: Parameters, step: float) -> Floats:
    """Return the blade pitch ratio for commands on a grid with a step [s]: mechanism, then backlash.

    Beyond ``pitch_dead_band`` a valve opens, and it shuts at ``pitch_dead_band_stop`` of it; the rate
    saturates smoothly at 1 / ``pitch_slowness``; the edges of the play are rounded.
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


STATES = 9
ABSOLUTE_TOLERANCES = np.array([1e-5, 1e-5, 1e-2, 5.0, 20.0, 1e-4, 1e-3, 1e-3, 1e-2])
CLOCK = ("rack", "pitch", "resistance", "current", "generator", "bubbles")
"""Prescribed inputs over time, one column each: rack [mm] (held), blade pitch, resistance factor,
current [m/s], torque of a shaft generator [N m], share of air blown over the propeller."""

SURFACE_PRESSURE = 101325.0 - 1671.0  # Pa, above vapour pressure

compiled = numba.njit(cache=True, error_model="numpy")


@compiled
def _wave_at(waves: Floats, t: float, x: float) -> tuple[float, float]:
    elevation, inflow = 0.0, 0.0
    for k in range(len(waves)):
        c = math.cos(waves[k, 2] * t + waves[k, 3] * x + waves[k, 4])
        elevation += waves[k, 0] * c
        inflow += waves[k, 1] * c
    return elevation, inflow


@compiled
def _curve(table: Floats, j: float, p: float) -> float:
    total, power = 0.0, 1.0
    for s in range(table.shape[0]):
        inner = 0.0
        for k in range(table.shape[1] - 1, -1, -1):
            inner = inner * p + table[s, k]
        total += inner * power
        power *= j
    return total


@compiled
def _stribeck(ship: Any, dry: float, wet: float, omega: float) -> Any:
    """Return Stribeck friction and oil drag that is not quite linear in speed [N m]."""
    speed = abs(omega)
    torque = dry * (1.0 + ship.stribeck_rise * math.exp(-((speed / ship.stribeck_speed) ** 2)))
    if wet != 0.0:
        torque += wet * speed**ship.wet_power * 10.0 ** (1.0 - ship.wet_power)
    return torque * math.tanh(omega / 0.1)


@compiled
def _engine(ship: Any, omega: float, rack: float) -> Any:
    speed = ship.gear * omega
    if ship.limiter_cut > 0.0:  # a governor that grants fuel in proportion to speed
        excess = rack - ship.limiter_line * (1.0 - ship.limiter_cut) * omega
        rack -= 0.8 * max(excess, 0.0)
    torque = ship.map_speed * speed + ship.map_rack * rack + ship.map_zero
    away = speed - ship.bend_speed
    torque += ship.bend * away * away * (1.0 + ship.bend_skew * away / ship.bend_speed)
    torque *= 1.0 - ship.derating * (1.0 + ship.derating_slope * (omega / 10.0 - 1.0))
    limit = ship.limit_low + ship.limit_slope * (speed - ship.idle)
    # the envelope of a slow engine shrinks no further than that of one at four fifths of idle speed
    least = ship.limit_low - min(0.2 * ship.limit_slope * ship.idle, 0.5 * ship.limit_low)
    return min(torque, min(max(limit, least), ship.limit_high))


@compiled
def _turned_slowly(ship: Any, omega: float, torque: float) -> Any:
    """Return the torque of an engine that may turn too slowly to fire, or astern [N m].

    Its friction is the torque of the map without fuel. The torque of the fuel rises with a squared sine.
    """
    speed = ship.gear * omega
    fires = (speed / ship.idle - 0.4) / 0.4
    if fires >= 1.0:
        return torque
    rubbing = max(-(ship.map_speed * abs(speed) + ship.map_zero), 0.0)
    rubbing *= 1.0 - ship.derating
    burnt = (torque + rubbing) * math.sin(0.5 * math.pi * max(fires, 0.0)) ** 2
    return burnt - rubbing * math.tanh(speed / (0.05 * ship.idle))


@compiled
def _screw(
    ship: Any,
    omega: float,
    pitch: float,
    inflow: float,
    submergence: float,
    air: float,
    bubbles: float,
) -> tuple[float, float]:
    """Return thrust [N] and torque [N m] of one propeller."""
    n = omega / (2.0 * math.pi)
    scale = ship.density * n * n * ship.diameter**4
    j = min(max(inflow / (max(n, 1e-3) * ship.diameter), -0.25), 1.6)
    kt, kq = _curve(ship.kt, j, pitch), _curve(ship.kq, j, pitch)
    if ship.section_drag != 0.0:  # drag of the section at 0.75 R, turned by its hydrodynamic angle
        angle = math.atan2(j, 0.75 * math.pi)
        solidity = 0.45 * ship.area_ratio * math.pi
        kt -= ship.section_drag * ship.section_thrust * solidity * math.tan(angle) * math.pi
        kq += ship.section_drag * ship.section_torque * solidity / math.cos(angle)
    if ship.breakdown > 0.0:
        pressure = SURFACE_PRESSURE + ship.density * 9.81 * submergence
        around = inflow * inflow + (0.7 * math.pi * n * ship.diameter) ** 2
        sigma = pressure / (0.5 * ship.density * around)
        lack = ship.breakdown_sigma / sigma - 1.0
        if lack > 0.0:
            loss = ship.breakdown * lack**1.5
            kt *= max(1.0 - loss, 0.0)
            kq *= max(1.0 - ship.breakdown_torque * loss, 0.0)
    kt *= max(1.0 - ship.air_torque * ship.air_thrust_ratio * air, 0.0) * (1.0 - 1.2 * bubbles)
    kq *= (1.0 - ship.air_torque * air) * (1.0 - bubbles)
    return scale * kt, scale * ship.diameter * kq / ship.rotative


@compiled
def _resistance(ship: Any, v: float, factor: float) -> Any:
    drag = ship.resistance * v * v * factor
    if ship.fouling != 0.0:
        reference = ship.fouling_speed ** (2.0 - ship.fouling_power)
        drag += ship.fouling * ship.resistance * abs(v) ** ship.fouling_power * reference
    if ship.shallow_rise > 0.0 and v > ship.shallow_speed:
        drag *= 1.0 + ship.shallow_rise * (v / ship.shallow_speed - 1.0) ** 2 * 10.0
    return drag if v >= 0.0 else -drag


@compiled
def _clock(table: Floats, step: float, t: float, now: Floats) -> None:
    place = t / step
    k = min(max(int(place + 1e-6), 0), len(table) - 2)
    part = min(max(place - k, 0.0), 1.0)
    now[0] = table[k, 0]
    for c in range(1, table.shape[1]):
        now[c] = table[k, c] + part * (table[k + 1, c] - table[k, c])


@compiled
def _balance(
    t: float,
    y: Floats,
    ship: Any,
    waves: Floats,
    table: Floats,
    step: float,
    rate: Floats,
    out: Floats,
) -> None:
    """Write the rates of the states, and measured torque, thrust and submergence."""
    now = np.empty(table.shape[1])
    _clock(table, step, t, now)
    omega, v, x = y[0], y[1], y[2]
    rack, pitch, factor, current, generator, bubbles = now
    # a given track keeps the waves' phases alike where two ships of unlike speed are compared
    place = ship.track_speed * t if ship.track_speed > 0.0 else x
    elevation, orbital = _wave_at(waves, t, place)
    through = v - current
    wake = ship.wake
    if ship.wake_change != 0.0:
        wake += ship.wake_change * math.tanh((through - ship.wake_middle) / ship.wake_width)
    arriving = (1.0 - wake) * through + orbital
    inflow = arriving
    rate[5] = 0.0
    if ship.inflow_length > 0.0:
        inflow = y[5]
        rate[5] = (arriving - y[5]) * (0.5 + abs(through)) / ship.inflow_length
    submergence = ship.depth + elevation
    rate[6] = 0.0
    if ship.air_torque > 0.0:
        near = (ship.air_submergence - 2.0 * submergence / ship.diameter) / ship.air_width
        drawn = 1.0 / (1.0 + math.exp(min(max(-near, -40.0), 40.0)))
        rate[6] = (drawn - y[6]) / (ship.air_growth if drawn > y[6] else ship.air_washout)
    thrust, load = _screw(ship, omega, pitch, inflow, submergence, y[6], bubbles)
    rate[8] = 0.0
    if ship.order_torque > 0.0:
        rate[8] = ship.order_ratio * omega
        load += ship.order_torque * math.sin(y[8]) * (omega / 10.0) ** 2

    torque = _engine(ship, omega, rack)
    rate[3], rate[4] = 0.0, 0.0
    if ship.lag_time > 0.0:
        own = 2.0 * ship.lag_damping / ship.lag_time
        rate[3] = y[4]
        rate[4] = own * (own * (torque - y[3]) - 2.0 * ship.lag_damping * y[4])
        torque = y[3]
    torque = _turned_slowly(ship, omega, torque)
    front = torque * ship.gear * ship.efficiency
    front -= _stribeck(ship, ship.dry_front, ship.wet_front, omega) + generator
    front -= ship.rub * math.tanh(omega / 0.1)  # the friction that the file knows of
    rate[7] = 0.0
    if ship.bearing_heat > 0.0:  # heats with the power rubbed away, and rubs the more
        rate[7] = ((omega / 10.0) ** 2 - y[7]) / ship.bearing_time
        front -= ship.bearing_heat * y[7] * y[7]
    back = load + _stribeck(ship, ship.dry_back, ship.wet_back, omega)
    swirl = ship.water_inertia * (1.0 + ship.water_load * (pitch - 1.2))
    rate[0] = (front - back) / (ship.inertia_front + ship.inertia_back + swirl)
    push = ship.screws * (1.0 - ship.deduction) * thrust
    rate[1] = (push - _resistance(ship, through, factor)) / ship.mass
    rate[2] = v
    out[0] = front - ship.inertia_front * rate[0]
    out[1] = thrust
    out[2] = submergence


@compiled
def rates(
    t: float, y: Floats, ship: NDArray[Any], waves: Floats, table: Floats, step: float
) -> Floats:
    """Return the time derivative of the states; ``ship`` is an array of one record."""
    rate, out = np.zeros(STATES), np.zeros(3)
    _balance(t, y, ship[0], waves, table, step, rate, out)
    return rate


@compiled
def signals(
    times: Floats, states: Floats, ship: NDArray[Any], waves: Floats, table: Floats, step: float
) -> Floats:
    """Return measured torque [N m], thrust [N] and submergence [m] at the samples, shape (n, 3)."""
    outs, rate = np.zeros((len(times), 3)), np.zeros(STATES)
    for k in range(len(times)):
        _balance(times[k], states[k], ship[0], waves, table, step, rate, outs[k])
    return outs
