"""Estimate the six parameters of a drive train from steps of the motor's voltage.

Vrijdag & Martelli 2021, method 1: the plateaus between the steps identify four parameters
(:mod:`.steady`), the steps inertia and inductance (eqs. 29 to 32 and A38 to A45), with three changes:

- Eq. 31 of the paper, tau_omega = -C eta / s_2, contradicts eqs. A26 and A34, which give
  -2 C eta / s_2; the printed form gives half the inertia.
- Eq. 30 is the rise of a linear model. The torque of a propeller is quadratic, and the rise follows in
  closed form from a Riccati equation; the linear form gives an inertia 1 to 2 % off for the paper's
  step of 17 %.
- All times t* between two shares of the rise count; the paper uses the one at 63.2 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from ..estimate import Tick, ignore_progress
from .drive_train import (
    CONSTANT,
    FRICTION,
    INDUCTANCE,
    INERTIA,
    RESISTANCE,
    SIX,
    DriveTrain,
    drive_train,
    keys_of,
    needs_drive_train,
)
from .free_parameters import RATIO, UnidentifiableError, parse_free, usual_keys
from .frequency import interval_of
from .parameters import MethodResult
from .steady import CURRENT, Plateau, plateaus, solve, steady_states

Array = NDArray[np.float64]

METHOD = "step"
STEADY = (FRICTION, CONSTANT, RESISTANCE, *RATIO)
"""Parameters that are estimated from the plateaus; the steps give the other two."""
STEP_COLUMNS = ["before_V", "after_V", "motor_speed_rad_s", "motor_inertia_kg_m2", "tau_em_s"]
RISE = (0.45, 0.8)  # shares of the rise between which t* is evaluated
SHORT = 1.5  # duration of the electric transient that is used, in times to 63 % of it
SIZES = (0.02, 0.4)
"""Smallest and largest size of a step, as a share of the voltage: it must be clear and keep the sign."""
RAMP_ROWS = 20  # most rows of a voltage ramp that counts as a step at half of its area


def step(
    ship: Ship,
    tables: Iterable[pd.DataFrame],
    free: Sequence[str] | None = None,
    tick: Tick = ignore_progress,
) -> MethodResult:
    """Estimate parameters of a drive train from steady states and the steps between them.

    Args:
        ship: ship with a direct-current motor and a fixed hull, with the start of the search and the
            parameters that are not free.
        tables: recordings in canonical columns at an even interval in which the voltage steps from
            plateau to plateau. Needed: ``motor_voltage_V``, ``shaft_speed_rad_s``, and
            ``motor_current_A`` but for the inertia alone.
        free: dotted keys among the paper's six, which are the default; its four steady ones from three
            plateaus or more, inertia and inductance from one step or more.
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        Estimates. The covariance includes that of the plateaus' balances, its effect on inertia and
        inductance, and the scatter between steps (three or more) or the noise before the step. Tables:
        ``steps`` with the result of each step, and ``steady-states``.

    Raises:
        ValueError: no such drive train, a key that the method does not estimate, a missing column, no
            step, too few plateaus, or a recording too slow for the inductance.
    """
    needs_drive_train(ship, METHOD)
    chosen = parse_free(ship, free, usual_keys(ship, response=True))
    if strange := [key for key in chosen.keys if key not in {*SIX, *RATIO}]:
        raise ValueError(
            f"{METHOD}: this method does not estimate {strange[0]}; it estimates {', '.join(SIX)}"
        )
    tables = list(tables)
    currentless = [key for key in chosen.keys if key != INERTIA]
    if currentless and any(CURRENT not in table for table in tables):
        raise UnidentifiableError(
            f"{METHOD}: {currentless[0]} needs {CURRENT}, which a recording lacks",
            currentless[:1],
            chosen.keys,
        )
    states = steady_states(ship, tables)
    found = [one for table in tables for one in steps(ship, table)]
    if not found:
        raise ValueError(
            f"{METHOD}: no step of {drive_column(ship)} from one steady state to another, of "
            f"{100 * SIZES[0]:g} to {100 * SIZES[1]:g} % of it"
        )
    tick(METHOD, 1, 3)
    still = [key for key in chosen.keys if key in STEADY]
    moving = [key for key in chosen.keys if key not in STEADY]
    part = parse_free(ship, still, ()) if still else None
    values, covariance = np.empty(0), np.empty((0, 0))
    if part is not None:
        values, covariance = solve(part, states)
    tick(METHOD, 2, 3)

    def evaluate(values: Array) -> tuple[Ship, list[StepResult]]:
        """Return the ship with these steady parameters, and the results of the steps."""
        base = ship if part is None else part.on(values)
        train = drive_train(base)
        return base, [evaluate_step(train, one, base.sensors.speed_delay_s) for one in found]

    def mean(base: Ship, results: list[StepResult]) -> Array:
        return np.asarray(np.nanmean(_by_step(base, results, moving), axis=0))

    base, results = evaluate(values)
    if INDUCTANCE in moving and all(math.isnan(one.electric_s) for one in results):
        raise UnidentifiableError(
            f"{METHOD}: {INDUCTANCE}: the sampling interval of {interval_of(tables[0]):g} s is too long "
            "for the electric transient; sample faster",
            [INDUCTANCE],
            chosen.keys,
        )
    passed = np.empty((len(moving), len(still)))  # derivatives by the steady parameters
    for i, size in enumerate(() if part is None else part.scale):
        shift = 1e-4 * size * np.eye(len(still))[i]
        ends = [mean(*evaluate(values + side * shift)) for side in (1.0, -1.0)]
        passed[:, i] = (ends[0] - ends[1]) / (2e-4 * size)
    own = _own_covariance(base, results, moving)
    joint = np.block(
        [
            [covariance, covariance @ passed.T],
            [passed @ covariance, passed @ covariance @ passed.T + own],
        ]
    )
    order = [[*still, *moving].index(key) for key in chosen.keys]
    every = np.concatenate([values, mean(base, results)])[order]
    tick(METHOD, 3, 3)
    rows = [
        (one.before, one.after, one.speed, result.inertia, result.electric_s)
        for one, result in zip(found, results, strict=True)
    ]
    return MethodResult(
        chosen.keys,
        tuple(map(float, every)),
        joint[np.ix_(order, order)],
        {"steps": pd.DataFrame(rows, columns=STEP_COLUMNS), "steady-states": states},
        (f"{len(found)} step(s) between {len(states)} steady states",),
    )


def _by_step(base: Ship, results: list[StepResult], keys: list[str]) -> Array:
    """Return inertia and inductance from each step, shape (steps, keys)."""
    train = drive_train(base)
    rows = []
    for one in results:
        own = replace(train, inductance=one.electric_s * train.resistance, inertia=one.inertia)
        values = keys_of(base, own)
        rows.append([values[key] for key in keys])
    return np.array(rows).reshape(len(results), len(keys))


def _own_covariance(base: Ship, results: list[StepResult], keys: list[str]) -> Array:
    """Return the covariance of inertia and inductance from the steps alone."""
    variances = []
    for key, column in zip(keys, _by_step(base, results, keys).T, strict=True):
        sound = column[np.isfinite(column)]
        if len(sound) >= 3:
            variances.append(float(np.var(sound, ddof=1)) / len(sound))
            continue
        shares = [
            r.inertia_error / r.inertia if key == INERTIA else r.electric_error_s / r.electric_s
            for r in results
        ]
        share = float(np.nanmean(np.square(shares))) / len(sound)
        variances.append(share * float(sound.mean()) ** 2)
    return np.diag(np.array(variances, dtype=np.float64))


class Step(NamedTuple):
    """Step of the voltage, referred to the motor's shaft."""

    before: float  # voltage [V]
    after: float  # voltage [V]
    speed: float  # before [rad/s]
    time: Array  # since the step [s]
    share: Array  # of the speed's rise [-], shape of time
    current_rise: Array | None  # [A], likewise
    share_noise: float  # rms before the step [-]
    current_noise: float  # likewise [A]


class StepResult(NamedTuple):
    """Inertia and electric time constant from one step; NaN where they are not identifiable."""

    inertia: float  # at the motor [kg m2]
    inertia_error: float
    electric_s: float  # tau_em [s]
    electric_error_s: float


def steps(ship: Ship, table: pd.DataFrame) -> list[Step]:
    """Return the steps of a recording from one plateau to the next.

    Args:
        ship: ship with a direct-current motor.
        table: recording in canonical columns at an even interval.
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


def evaluate_step(train: DriveTrain, one: Step, delay_s: float = 0.0) -> StepResult:
    """Return inertia and electric time constant from a step.

    Args:
        train: drive train with known frictions, constants and load; inertia and inductance are ignored.
        one: the step.
        delay_s: delay of the speed signal [s].
    """
    inertia, error = _inertia(train, one, delay_s)
    if one.current_rise is None or not math.isfinite(inertia):
        return StepResult(inertia, error, math.nan, math.nan)
    electric, electric_error = _electric(train, one, inertia)
    if math.isfinite(electric):  # the torque and the rise come that much later than the voltage
        inertia, error = _inertia(train, one, delay_s + electric)
    return StepResult(inertia, error, electric, electric_error)


def _inertia(train: DriveTrain, one: Step, late_s: float) -> tuple[float, float]:
    """Return the inertia [kg m2] at the motor from the times t* of the rise, and its standard error.

    With M' = K_e^2 / R_a + b the slope and L the load's coefficient, the rise from w_0 to w_1 solves
    I dw/dt = L (w_1 - w) (w - w_2), D = L (w_1 - w_2): I = D t* / ln((D - L (w_1 - w)) / (1 - share) /
    (D - L (w_1 - w_0))).

    Errors of encoders and cogging repeat in each revolution, so that a twelfth of the samples of a rise
    counts as one independent sample.
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
    """Return tau_em [s] by eq. 32 over the samples of the electric transient, and its standard error."""
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

    def passed(electric: float) -> Array:
        fading = np.exp(slow * time) - np.exp(-time / electric)
        return np.asarray(model.drive * fading / (1.0 + slow * electric))

    best = scipy.optimize.minimize_scalar(
        lambda log: float(np.sum((seen - passed(math.exp(log))) ** 2)),
        method="bounded",
        bounds=(math.log(time[0] / 12.0), math.log(min(0.2 / abs(slow), 20.0 * reached))),
        options={"xatol": 1e-10},
    )
    electric = math.exp(float(best.x))
    steep = (passed(1.001 * electric) - passed(electric)) / (0.001 * electric)
    noise = one.current_noise / abs(point.current * size)
    return electric, noise / max(float(np.linalg.norm(steep)), 1e-300)
