"""Simulate a Tito Neri rig: a known drive train behind the instruments that the paper describes.

The recordings of Vrijdag & Martelli 2021 were never published; section 4
describes their disturbances. Here these act on a drive train with known parameters:

- cogging: a torque of orders 6 and 12 of the motor's turn, and a ripple of its back EMF of the same
  orders (Figures 5 and 6), as terms of the ship;
- an encoder of 15 holes that are not quite evenly spaced (Figures 7 and 8): the speed is that of the
  last interval between two flanks, held until the next, and so comes late;
- an amplifier that gives 1 % less than its command, with a lag (section 4.1);
- noise of the current sensor.

Sizes that the paper does not print are assumed, and stand in :class:`Instruments`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.core.compiled import Record, compiled
from shaftline.mismatch.identification.drive_train import CONSTANT
from shaftline.plant import Ship, equilibrium
from shaftline.plant.memory import MEMORY
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, constant_inputs, prepare, step
from shaftline.plant.terms import Term
from shaftline.plant.waves import calm_sea

from .experiments import Experiment

FINE_S = 5e-5
"""Time step of the simulation [s]: a quarter of the armature's time constant, 1/50 of a cog's turn."""

COGGING, RIPPLE = "cogging", "emf-ripple"


@dataclass(frozen=True)
class Instruments:
    """Instruments between the drive train and its recording."""

    cogging_6_N_m: float = 3.5e-3  # torque of order 6 at the motor, 0.15 K_e i_0
    cogging_12_N_m: float = 1.75e-3
    # Ripple of the back EMF, as a share of it. The shaft's inertia keeps a torque of this order out of
    # the current (3.5 mN m change it by 1 mA), so the printed 10 to 15 % require a voltage.
    ripple_6: float = 0.045
    ripple_12: float = 0.03
    holes: int = 15  # of the encoder's disk
    uneven_deg: float = 0.3  # standard deviation of a hole's position
    disk: int = 7  # seed of the positions, which belong to the rig
    gain: float = 0.99  # voltage of the amplifier over its command
    lag_s: float = 7e-5  # of the amplifier; 2 degrees at 500 rad/s
    current_noise_A: float = 0.03  # rms, white

    @property
    def flanks_rad(self) -> NDArray[np.float64]:
        """Angles of the holes' flanks [rad], shape (holes,)."""
        off = np.random.default_rng(self.disk).standard_normal(self.holes) * self.uneven_deg
        off -= off.mean()
        even = np.arange(self.holes) * (2.0 * math.pi / self.holes)
        return np.asarray(even + np.radians(off))


def with_cogging(ship: Ship, instruments: Instruments) -> Ship:
    """Return the ship with its motor's cogging and ripple as terms.

    ``turned`` and ``since`` are the motor's angle [rad] at a time [s]; the simulation keeps them.
    """
    ratio, own = ship.transmission.gear_ratio, instruments
    factor = ratio * ship.transmission.efficiency
    constant = ratio * ship.parameter(CONSTANT).value  # back EMF by the shaft's speed
    angle = f"(turned + {ratio!r} * shaft_speed * (time - since))"
    swing = f"(a6 * sin(6 * {angle}) + a12 * sin(12 * {angle}))"
    torque = {"a6": factor * own.cogging_6_N_m, "a12": factor * own.cogging_12_N_m}
    voltage = {"a6": -constant * own.ripple_6, "a12": -constant * own.ripple_12}
    for name, place, expression, values in (
        (COGGING, "drive_torque", swing, torque),
        (RIPPLE, "drive", f"{swing} * shaft_speed", voltage),
    ):
        parameters = {"turned": 0.0, "since": 0.0, **values}
        term = {"id": name, "acts_on": place, "expression": expression, "parameters": parameters}
        ship = ship.with_term(Term.model_validate(term))
    return ship


@compiled
def _turn(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    voltage: NDArray[np.float64],
    slots: NDArray[np.int64],
    dt: float,
    angle: NDArray[np.float64],
    current: NDArray[np.float64],
) -> None:
    """Simulate; fill the motor's angle [rad] and current [A] at the start of every step."""
    turned = angle[0]
    for k in range(len(voltage)):
        angle[k] = turned
        for slot in slots:
            plant.term_constants[slot, 0] = turned
            plant.term_constants[slot, 1] = k * dt
        before = state.shaft_speed
        acting = constant_inputs(voltage[k], 1.0, 0.0, UNDISTURBED)
        out = step(plant, state, memory, sea, acting, dt)
        current[k] = out.motor_current
        turned += 0.5 * dt * plant.gear_ratio * (before + state.shaft_speed)


def record_test(
    ship: Ship, test: Experiment, instruments: Instruments | None = None, seed: int = 0
) -> pd.DataFrame:
    """Simulate a test on the rig, as its instruments record it.

    ``motor_voltage_V`` is the mean voltage of the amplifier from a row to the next, ``voltage_set_V``
    its command; ``shaft_speed_rad_s`` is the encoder's speed by the gear ratio. ``seed`` sets the noise
    of the current and the first angle of the motor.
    """
    own = Instruments() if instruments is None else instruments
    rng = np.random.default_rng([seed, 1])  # not that of a noise which is the test's own
    per_row = round(test.interval_s / FINE_S)
    fine = _amplified(test, own, per_row)
    host = with_cogging(ship.with_values({"integration.time_step_s": FINE_S}), own)
    start = equilibrium(ship, float(fine[0]), ship.propeller.pitch_ratio_max).state
    state, memory = np.zeros(1, STATE), np.zeros(1, MEMORY)
    state[0] = tuple(map(float, start))
    plant, sea = host.record(), calm_sea()
    slots = np.array([host.parameter(f"term.{name}.turned").place[0] for name in (COGGING, RIPPLE)])
    prepare(plant, state[0], memory[0], sea, float(fine[0]), UNDISTURBED, FINE_S)
    angle, current = np.empty((2, len(fine)))
    angle[0] = rng.uniform(0.0, 2.0 * math.pi)
    _turn(plant, state[0], memory[0], sea, fine, slots, FINE_S, angle, current)
    speed = encoder_speed(angle, FINE_S, own)[::per_row] / ship.transmission.gear_ratio
    noise = own.current_noise_A * rng.standard_normal(len(test.voltage))
    return pd.DataFrame(
        {
            "time_s": np.arange(len(test.voltage)) * test.interval_s,
            "motor_voltage_V": fine.reshape(-1, per_row).mean(axis=1),
            "shaft_speed_rad_s": speed,
            "motor_current_A": current[::per_row] + noise,
            "voltage_set_V": test.voltage,
        }
    )


def _amplified(test: Experiment, own: Instruments, per_row: int) -> NDArray[np.float64]:
    """Return the amplifier's mean voltage [V] over every fine step, initially at rest."""
    told = own.gain * np.repeat(test.voltage, per_row)
    if own.lag_s == 0.0:
        return np.asarray(told, dtype=np.float64)
    kept = math.exp(-FINE_S / own.lag_s)
    # at the steps' ends; the mean over a step lies between its ends as the lag has it
    ends, _ = scipy.signal.lfilter([1.0 - kept], [1.0, -kept], told, zi=np.array([kept * told[0]]))
    starts = np.r_[told[0], ends[:-1]]
    share = own.lag_s / FINE_S * (1.0 - kept)
    return np.asarray(told + (starts - told) * share, dtype=np.float64)


def encoder_speed(
    angle: NDArray[np.float64], interval_s: float, own: Instruments
) -> NDArray[np.float64]:
    """Return the motor speed [rad/s] that the encoder measures, at each sample of the angle.

    Args:
        angle: of the motor [rad], rising, shape (n,).
        interval_s: between samples [s].
        own: with the disk.
    """
    turn, flanks = 2.0 * math.pi, own.flanks_rad
    first, last = math.floor(angle[0] / turn) - 1, math.floor(angle[-1] / turn) + 1
    places = (turn * np.arange(first, last + 1)[:, None] + flanks).ravel()
    places = places[(places > angle[0]) & (places <= angle[-1])]
    time = np.arange(len(angle)) * interval_s
    when = np.interp(places, angle, time)
    if len(when) < 2:
        return np.full(len(angle), (angle[-1] - angle[0]) / max(time[-1], interval_s))
    speeds = turn / own.holes / np.diff(when)
    begin = (places[1] - angle[0]) / when[1]
    known = np.searchsorted(when[1:], time, side="right")
    return np.asarray(np.r_[begin, speeds][known])


def order_spectrum(table: pd.DataFrame, gear_ratio: float, turns: int = 32) -> pd.DataFrame:
    """Return the amplitude of the current by order of the motor's turn (the paper's Figures 5 and 6).

    The current is resampled at even angles, the integral of the encoder's speed, and averaged over
    windows of whole turns.
    """
    time = table["time_s"].to_numpy(dtype=np.float64)
    speed = gear_ratio * table["shaft_speed_rad_s"].to_numpy(dtype=np.float64)
    angle = scipy.integrate.cumulative_trapezoid(speed, time, initial=0)
    per_turn = 64
    count, rows = int(angle[-1] / (2.0 * math.pi) * per_turn), turns * per_turn
    even = np.arange(count) * (2.0 * math.pi / per_turn)
    current, window = np.interp(even, angle, table["motor_current_A"]), np.hanning(rows)
    parts: list[Any] = []
    for begin in range(0, count - rows + 1, rows // 2):
        part = current[begin : begin + rows]
        parts.append(np.abs(np.fft.rfft(window * (part - part.mean()))) * 2.0 / window.sum())
    order = np.arange(rows // 2 + 1) / turns
    mean, kept = np.sqrt(np.mean(np.square(parts), axis=0)), order <= 20.0
    return pd.DataFrame({"order": order[kept], "current_A": mean[kept]})


def order_ramp(seconds: float = 30.0) -> Experiment:
    """Return a ramp of the voltage from 220 to 1995 rpm, as in the paper's order tracking."""
    return Experiment("ramp", 1e-4, np.linspace(1.85, 5.82, round(seconds / 1e-4)))
