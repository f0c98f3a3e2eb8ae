"""Steps of a motor's voltage in a recording, and the two time constants that each tells.

Vrijdag & Martelli 2021, eqs. 29 to 32 and A38 to A45, with three changes:

- their eq. 31 prints tau_omega = -C eta / s_2, where eqs. A26 and A34 ask for -2 C eta / s_2: the
  printed form finds half the inertia;
- their eq. 30 is the rise of a linear model. A propeller's torque is quadratic, and the rise then
  solves a Riccati equation in closed form; the paper's own step of 17 % would otherwise find the
  inertia 1 to 2 % off;
- every t* between two shares of the rise counts, where the paper takes the one at 63.2 %.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from .drive_train import DriveTrain
from .frequency import interval_of
from .plateaus import Plateau, plateaus
from .steady import CURRENT

RISE = (0.45, 0.8)
"""Shares of the rise between which t* lies."""

SHORT = 1.5
"""Part of the electric transient that is looked at, in times to 63 % of it."""

SIZES = (0.02, 0.4)
"""Least and most size of a step, as a share of the voltage: it must stand out, and keep the
direction."""


RAMP_ROWS = 20
"""Most rows that a supply may take for a step, which then counts from where half of its area is."""


class Step(NamedTuple):
    """One step of the voltage, at the motor's shaft."""

    before: float  # voltage [V]
    after: float  # voltage [V]
    speed: float  # before [rad/s]
    time: NDArray[np.float64]  # since the step [s]
    share: NDArray[np.float64]  # of the speed's rise [-], shape of time
    current_rise: NDArray[np.float64] | None  # [A], likewise
    share_noise: float  # rms before the step [-]
    current_noise: float  # likewise [A]


class Told(NamedTuple):
    """What one step tells; NaN where it does not."""

    inertia: float  # at the motor [kg m2]
    inertia_error: float
    electric_s: float  # tau_em [s]
    electric_error_s: float


def steps(ship: Ship, table: pd.DataFrame) -> list[Step]:
    """The steps of a recording from one plateau to the next.

    Args:
        ship: with a direct-current motor.
        table: canonical columns at an even interval.
    """
    found = []
    for before, after in pairwise(plateaus(ship, table)):
        if after.begin - before.end <= RAMP_ROWS:
            one = _step(ship, table, before, after)
            size = abs(one.after / one.before - 1.0) if one.before != 0.0 else math.inf
            if SIZES[0] <= size <= SIZES[1] and one.speed > 0.0:
                found.append(one)
    return found


def _step(ship: Ship, table: pd.DataFrame, before: Plateau, after: Plateau) -> Step:
    column, shaft = drive_column(ship), "shaft_speed_rad_s"
    rows, rest = slice(before.end, after.end), slice(before.settled, before.end)
    supply = table[column].to_numpy(dtype=np.float64)[before.end : after.begin]
    size = after.means[column] - before.means[column]
    late = float(np.sum((after.means[column] - supply) / size))  # rows
    speed = table[shaft].to_numpy(dtype=np.float64)
    rise = after.means[shaft] - before.means[shaft]
    current, noise = None, math.nan
    if CURRENT in table:
        measured = table[CURRENT].to_numpy(dtype=np.float64)
        current = measured[rows] - before.means[CURRENT]
        noise = float(np.std(measured[rest]))
    return Step(
        before.means[column],
        after.means[column],
        before.means[shaft] * ship.transmission.gear_ratio,
        (np.arange(after.end - before.end, dtype=np.float64) - late) * interval_of(table),
        (speed[rows] - before.means[shaft]) / rise,
        current,
        float(np.std(speed[rest])) / abs(rise),
        noise,
    )


def told(train: DriveTrain, one: Step, delay_s: float = 0.0) -> Told:
    """Inertia and electric time constant that a step tells.

    Args:
        train: whose frictions, constants and load are known; its inertia and inductance do not matter.
        one: the step.
        delay_s: of the speed's signal [s].
    """
    inertia, error = _inertia(train, one, delay_s)
    if one.current_rise is None or not math.isfinite(inertia):
        return Told(inertia, error, math.nan, math.nan)
    electric, electric_error = _electric(train, one, inertia)
    if math.isfinite(
        electric
    ):  # the torque, hence the rise, comes that much later than the voltage
        inertia, error = _inertia(train, one, delay_s + electric)
    return Told(inertia, error, electric, electric_error)


def _inertia(train: DriveTrain, one: Step, late_s: float) -> tuple[float, float]:
    """Inertia [kg m2] at the motor by the time t* of every share of the rise, and its standard error.

    With M' = K_e^2 / R_a + b the slope and L the load's coefficient, the rise from w_0 to w_1 solves
    I dw/dt = L (w_1 - w) (w - w_2), D = L (w_1 - w_2): I = D t* / ln((D - L (w_1 - w)) / (1 - share) /
    (D - L (w_1 - w_0))).

    Encoders and cogging repeat over a turn: of the samples of a rise, a twelfth of its length counts
    as one.
    """
    first, last = (train.equilibrium(voltage).motor_speed for voltage in (one.before, one.after))
    slope = train.constant**2 / train.resistance + train.viscous + 2.0 * train.load * last  # D
    width = max(1, int(np.argmax(one.share > 0.6)) // 12)
    smooth = np.convolve(one.share, np.ones(width) / width, mode="valid")
    begin = int(np.argmax(smooth > RISE[0]))
    end = max(int(np.argmax(smooth > RISE[1])), begin + 1)
    share = smooth[begin:end]
    when = one.time[begin:end] + 0.5 * (width - 1) * (one.time[1] - one.time[0]) - late_s
    usable = (share > 0.0) & (share < 1.0) & (when > 0.0)
    if not usable.any():
        return math.nan, math.nan
    share, when = share[usable], when[usable]
    left = train.load * (last - first)
    bent = np.log((slope - left * (1.0 - share)) / (slope - left)) - np.log1p(-share)
    values = slope * when / bent
    error = one.share_noise * float(np.mean(values / bent / (1.0 - share)))
    return float(values.mean()), error / math.sqrt(max(1.0, len(values) / width))


def _electric(train: DriveTrain, one: Step, inertia: float) -> tuple[float, float]:
    """tau_em [s] by eq. 32 over the samples of the electric transient, and its standard error."""
    assert one.current_rise is not None
    point = train.equilibrium(one.before)
    model = train.linear(point)
    slope = train.constant**2 / train.resistance + train.viscous
    slow = -(slope + 2.0 * train.load * point.motor_speed) / inertia  # s_2
    size = one.after / one.before - 1.0
    current = one.current_rise / point.current / size
    band = current + model.current_gain * np.expm1(slow * one.time)  # less the low-pass part
    first = int(np.argmax(one.time > 0.0))
    time, seen = one.time[first:], band[first:]
    crossed = np.flatnonzero(seen > 0.632 * model.drive)
    over = model.drive * math.exp(slow * time[0])  # what the first sample has if it comes too late
    if not len(crossed) or seen[0] > 0.98 * over:
        return math.nan, math.nan
    reached = SHORT * time[int(crossed[0])]
    inside = slice(0, max(1, int(np.sum(time <= reached))))
    time, seen = time[inside], seen[inside]

    def passed(electric: float) -> NDArray[np.float64]:
        fading = np.exp(slow * time) - np.exp(-time / electric)
        return np.asarray(model.drive * fading / (1.0 + slow * electric))

    best = scipy.optimize.minimize_scalar(
        lambda log: float(np.sum((seen - passed(math.exp(log))) ** 2)), method="bounded",
        bounds=(math.log(time[0] / 12.0), math.log(min(0.2 / abs(slow), 20.0 * reached))),
        options={"xatol": 1e-10},
    )  # fmt: skip
    electric = math.exp(float(best.x))
    steep = (passed(1.001 * electric) - passed(electric)) / (0.001 * electric)
    noise = one.current_noise / abs(point.current * size)
    return electric, noise / max(float(np.linalg.norm(steep)), 1e-300)
