"""The six numbers of a drive train from a staircase of voltages (Vrijdag & Martelli 2021, method 1).

The plateaus tell four of them (:mod:`.steady`), the steps between them inertia and inductance
(:mod:`.transient`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from ..progress import Tick, silent
from .drive_train import (
    CONSTANT,
    FRICTION,
    INDUCTANCE,
    INERTIA,
    RESISTANCE,
    SIX,
    drive_train,
    keys_of,
    needs_drive_train,
)
from .found import Found
from .free import RATIO, Free, freed, usual_keys
from .frequency import interval_of
from .identifiable import UntoldError
from .steady import CURRENT, solve, steady_states
from .transient import SIZES, Step, Told, steps, told

METHOD = "step"
STEADY = (FRICTION, CONSTANT, RESISTANCE, *RATIO)
"""Numbers that the plateaus tell; the steps tell the other two."""


def step(
    ship: Ship, tables: Iterable[pd.DataFrame], free: Sequence[str] | None = None,
    tick: Tick = silent,
) -> Found:  # fmt: skip
    """Numbers of a drive train from steady states and the steps between them.

    Args:
        ship: a direct-current motor, its hull fixed; start of the search, and the numbers that are not
            free.
        tables: recordings in canonical columns at an even interval in which the voltage steps from
            plateau to plateau. Needed: ``motor_voltage_V``, ``shaft_speed_rad_s``, and
            ``motor_current_A`` but for the inertia alone.
        free: dotted keys among the paper's six, which are the default; its four steady ones from three
            plateaus or more, inertia and inductance from one step or more.
        tick: told how far it is.

    Returns:
        Values; the covariance is that of the plateaus' balances, carried on into inertia and
        inductance, and in these the spread between steps (three or more), or the noise before the
        step. Tables: ``steps`` with what each tells, and ``steady-states``.

    Raises:
        ValueError: no such drive train, a key that the method does not find, a column that is missing,
            no step, too few plateaus, or a recording too slow for the inductance.
    """
    needs_drive_train(ship, METHOD)
    chosen = freed(ship, free, usual_keys(ship, response=True))
    if strange := [key for key in chosen.keys if key not in {*SIX, *RATIO}]:
        raise ValueError(f"{METHOD}: does not find {strange[0]}; it finds {', '.join(SIX)}")
    tables = list(tables)
    currentless = [key for key in chosen.keys if key != INERTIA]
    if currentless and any(CURRENT not in table for table in tables):
        raise UntoldError(
            f"{METHOD}: {currentless[0]} needs {CURRENT}, which a recording lacks", currentless[:1],
            chosen.keys,
        )  # fmt: skip
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
    part = freed(ship, still, ()) if still else None
    values, covariance = np.empty(0), np.empty((0, 0))
    if part is not None:
        values, covariance = solve(part, states)
    tick(METHOD, 2, 3)
    base = ship if part is None else part.on(values)
    tells = _tells(base, found)
    if INDUCTANCE in moving and all(math.isnan(one.electric_s) for one in tells):
        raise UntoldError(
            f"{METHOD}: {INDUCTANCE}: no sample falls into the electric transient; one every "
            f"{interval_of(tables[0]):g} s is too slow for it", [INDUCTANCE], chosen.keys,
        )  # fmt: skip
    passed = _carried(part, values, found, moving)
    own = _own_covariance(base, tells, moving)
    joint = np.block(
        [
            [covariance, covariance @ passed.T],
            [passed @ covariance, passed @ covariance @ passed.T + own],
        ]
    )
    order = [[*still, *moving].index(key) for key in chosen.keys]
    every = np.concatenate([values, _means(base, tells, moving)])[order]
    tick(METHOD, 3, 3)
    return Found(
        chosen.keys, tuple(map(float, every)), joint[np.ix_(order, order)],
        {"steps": _table(found, tells), "steady-states": states},
        (f"{len(found)} step(s) between {len(states)} steady states",),
    )  # fmt: skip


def _tells(base: Ship, found: list[Step]) -> list[Told]:
    train = drive_train(base)
    return [told(train, one, base.sensors.speed_delay_s) for one in found]


def _by_step(base: Ship, tells: list[Told], keys: list[str]) -> NDArray[np.float64]:
    """Inertia and inductance as keys by what each step tells, shape (steps, keys)."""
    train = drive_train(base)
    rows = []
    for one in tells:
        own = replace(train, inductance=one.electric_s * train.resistance, inertia=one.inertia)
        values = keys_of(base, own)
        rows.append([values[key] for key in keys])
    return np.array(rows).reshape(len(tells), len(keys))


def _means(base: Ship, tells: list[Told], keys: list[str]) -> NDArray[np.float64]:
    return np.asarray(np.nanmean(_by_step(base, tells, keys), axis=0)) if keys else np.empty(0)


def _own_covariance(base: Ship, tells: list[Told], keys: list[str]) -> NDArray[np.float64]:
    """Of inertia and inductance, by the steps alone."""
    rows = _by_step(base, tells, keys)
    variances = []
    for k, key in enumerate(keys):
        sound = rows[np.isfinite(rows[:, k]), k]
        if len(sound) >= 3:
            variances.append(float(np.var(sound, ddof=1)) / len(sound))
            continue
        shares = [
            one.inertia_error / one.inertia
            if key == INERTIA
            else one.electric_error_s / one.electric_s
            for one in tells
        ]
        share = float(np.nanmean(np.square(shares))) / len(sound)
        variances.append(share * float(sound.mean()) ** 2)
    return np.diag(variances) if keys else np.empty((0, 0))


def _carried(
    part: Free | None, values: NDArray[np.float64], found: list[Step], keys: list[str]
) -> NDArray[np.float64]:
    """Change of inertia and inductance with the steady numbers, shape (keys, steady numbers)."""
    columns: list[Any] = []
    for i, size in enumerate(part.scale if part is not None else ()):
        assert part is not None
        ends = []
        for shift in (1e-4 * size, -1e-4 * size):
            shifted = values.copy()
            shifted[i] += shift
            base = part.on(shifted)
            ends.append(_means(base, _tells(base, found), keys))
        columns.append((ends[0] - ends[1]) / (2e-4 * size))
    return np.array(columns).T.reshape(len(keys), len(columns))


def _table(found: list[Step], tells: list[Told]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "before_V": one.before,
                "after_V": one.after,
                "motor_speed_rad_s": one.speed,
                "motor_inertia_kg_m2": tell.inertia,
                "tau_em_s": tell.electric_s,
            }
            for one, tell in zip(found, tells, strict=True)
        ]
    )
