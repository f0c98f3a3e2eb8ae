"""Observers by name, and the one kernel that updates any of them."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import (
    ESTIMATE,
    IMMERSION_INVARIANCE,
    LUENBERGER,
    ORACLE,
    POWER_BALANCE,
    RANDOM_WALK_KALMAN,
    RANDOM_WALK_KALMAN_PRINTED,
    SHAFT_ACCELERATION,
    SHAFT_ACCELERATION_DERIVED,
    SHAFT_KALMAN,
    Measurement,
    is_plausible,
    pitch_is_known,
    remember,
)
from .direct import NoObserver, Oracle, update_none, update_oracle
from .immersion_invariance import ImmersionInvariance, update_immersion_invariance
from .linear import update_linear
from .luenberger import Luenberger
from .power_balance import PowerBalance, update_power_balance
from .random_walk_kalman import (
    RandomWalkKalman,
    update_random_walk_kalman,
    update_random_walk_kalman_printed,
)
from .shaft_acceleration import (
    ShaftAcceleration,
    ShaftAccelerationDerived,
    update_shaft_acceleration,
    update_shaft_acceleration_derived,
)
from .shaft_kalman import ShaftKalman


class Observer(Protocol):
    """What every observer offers."""

    @property
    def kind(self) -> int:
        """Code of its update in :func:`update`."""

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a ship as it is believed to be and a time step [s]."""


_CLASSES: dict[str, Any] = {
    cls.name: cls
    for cls in (
        NoObserver,
        Oracle,
        Luenberger,
        ShaftKalman,
        PowerBalance,
        ShaftAcceleration,
        ShaftAccelerationDerived,
        ImmersionInvariance,
        RandomWalkKalman,
    )
}


class ObserverError(ValueError):
    """An observer or tuning that does not exist; the message lists those that do."""


def observer_names() -> list[str]:
    """All observers and tunings: ``name`` for the default, ``name-tuning`` for the others."""
    names = []
    for name, cls in _CLASSES.items():
        names.append(name)
        names.extend(f"{name}-{tuning}" for tuning in cls.tunings)
    return names


def get_observer(name: str, tuning: str | None = None) -> Observer:
    """An observer by name and tuning.

    Args:
        name: one of :func:`observer_names`, or a bare name with ``tuning`` beside it.
        tuning: ``low``, ``moderate``, ``high`` or ``printed`` where the observer has it; the
            observer's default otherwise.

    Raises:
        ObserverError: unknown name or tuning.
    """
    if name in _CLASSES:
        cls = _CLASSES[name]
        if tuning is None:
            return cls()  # type: ignore[no-any-return]
        if tuning not in cls.tunings:
            known = ", ".join(cls.tunings) or "none, it has nothing to tune"
            raise ObserverError(f"observer {name!r} has no tuning {tuning!r}; tunings: {known}")
        return cls.tunings[tuning]  # type: ignore[no-any-return]
    bare, _, ending = name.rpartition("-")
    if tuning is None and bare in _CLASSES and ending in _CLASSES[bare].tunings:
        return get_observer(bare, ending)
    raise ObserverError(f"unknown observer {name!r}; known: {', '.join(observer_names())}")


@compiled
def _dispatch(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    kind = observer.kind
    if kind == IMMERSION_INVARIANCE:
        return update_immersion_invariance(observer, estimate, m)
    if kind in (LUENBERGER, SHAFT_KALMAN):
        return update_linear(observer, estimate, m)
    if kind == RANDOM_WALK_KALMAN:
        return update_random_walk_kalman(observer, estimate, m)
    if kind == RANDOM_WALK_KALMAN_PRINTED:
        return update_random_walk_kalman_printed(observer, estimate, m)
    if kind == POWER_BALANCE:
        return update_power_balance(observer, estimate, m)
    if kind == SHAFT_ACCELERATION:
        return update_shaft_acceleration(observer, estimate, m)
    if kind == SHAFT_ACCELERATION_DERIVED:
        return update_shaft_acceleration_derived(observer, estimate, m)
    if kind == ORACLE:
        return update_oracle(observer, estimate, m)
    return update_none(observer, estimate, m)


@compiled
def update(observer: Record, estimate: Record, m: Measurement) -> float:
    """Take one sample; gives the estimate of the advance velocity [m/s].

    Where a reading is not finite or beyond the signal registry's bounds, the estimate is held and
    flagged invalid; the observer starts afresh with the next good sample. Where the torque lies off
    the propeller's curve, the estimate is held at the curve's edge and flagged invalid; so is one at a
    pitch that the ship does not have.

    Args:
        observer: OBSERVER record.
        estimate: ESTIMATE record, changed in place; ``valid`` tells whether to trust the result.
        m: the instruments' readings.
    """
    if observer.kind != ORACLE and not is_plausible(m):
        estimate.started = 0
        estimate.valid = 0
        return float(estimate.advance_velocity)
    velocity, valid = _dispatch(observer, estimate, m)
    remember(estimate, m, velocity, valid and pitch_is_known(observer.ship, m.pitch_ratio))
    return velocity


@compiled
def _follow(
    observer: Record,
    estimate: Record,
    readings: NDArray[np.float64],
    velocity: NDArray[np.float64],
    valid: NDArray[np.bool_],
) -> None:
    for k in range(len(readings)):
        m = Measurement(
            readings[k, 0], readings[k, 1], readings[k, 2], readings[k, 3], readings[k, 4]
        )
        velocity[k] = update(observer, estimate, m)
        valid[k] = estimate.valid != 0


def readings_of(samples: NDArray[Any]) -> NDArray[np.float64]:
    """The columns of :class:`Measurement` from simulated samples; shape (n, 5)."""
    return np.column_stack(
        [
            samples["shaft_speed"],
            samples["measured_shaft_torque"],
            samples["measured_pitch_ratio"],
            samples["shaft_acceleration"],
            samples["advance_velocity"],
        ]
    )


def follow_table(observer: Observer, ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    """A table with canonical columns, with an observer's estimate added.

    Args:
        observer: from :func:`get_observer`.
        ship: the ship as the observer believes it to be.
        table: even time base; acceleration and true advance velocity may be missing.

    Returns:
        The table with ``estimated_advance_velocity_m_s`` and ``estimate_valid`` (0 or 1).
    """
    unknown = np.full(len(table), np.nan)
    readings = np.column_stack(
        [
            table["shaft_speed_rad_s"],
            table["shaft_torque_N_m"],
            table["pitch_ratio"],
            table.get("shaft_acceleration_rad_s2", unknown),
            table.get("advance_velocity_m_s", unknown),
        ]
    )
    dt = float(np.median(np.diff(table["time_s"])))
    velocity, valid = follow(observer, ship, readings, dt)
    return table.assign(estimated_advance_velocity_m_s=velocity, estimate_valid=valid.astype(int))


def follow(
    observer: Observer, ship: Ship, readings: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Let an observer follow a series of readings.

    Args:
        observer: from :func:`get_observer`.
        ship: the ship as the observer believes it to be.
        readings: shape (n, 5): omega [rad/s], M_m [N m], P/D [-], omega' [rad/s2], v_a [m/s]
            (the last for the oracle alone).
        dt: sample time [s].

    Returns:
        Estimated advance velocity [m/s] and validity, each of shape (n,).
    """
    velocity = np.empty(len(readings))
    valid = np.empty(len(readings), dtype=np.bool_)
    estimate = np.zeros(1, ESTIMATE)[0]
    _follow(
        observer.discretise(ship, dt), estimate, np.ascontiguousarray(readings), velocity, valid
    )
    return velocity, valid
