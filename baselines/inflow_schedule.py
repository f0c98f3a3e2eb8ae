"""Advance velocity for scheduling: speed log and nominal wake, slowly corrected by an observer.

    v_0 = (1 - w) v_s                      measured ship speed and nominal wake fraction
    r   = mean over T of v_a / v_0 - 1     estimate v_a; without a valid one r decays, r' = -r / T
    v   = v_0 (1 + k g(r) r)
    g   = 1 for |r| <= B, falling linearly to 0 at |r| = 2 B

r is the relative deviation of the estimate, k the weight of the estimate. A wrong wake fraction gives
the same r at every speed, so r need not settle again after a new order. T is three wave periods, so the
orbital motion of the waves hardly changes r. At first the mean covers all samples since the start.

The band B admits the errors that a schedule has to correct: a wake fraction that is higher than the
nominal one by 0.1 gives an r of -0.11 to -0.15. Further away the estimate is more likely wrong than the
nominal wake, as in lasting ventilation, and v returns to v_0 without a jump.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record
from ..observers.records import Floats
from ..plant.hull import wake_inflow
from .controller import Measurements

FILTER_S = 30.0  # T [s], three wave periods
BAND = 0.15  # B, largest relative deviation that is used in full [-]
LEAST_SPEED = 1.0  # v_0 below which an estimate does not determine the wake [m/s]
_LARGEST = 0.5  # largest relative deviation of a single sample [-]
SCHEDULE_COLUMNS = 2
"""Columns of the state: deviation r [-] and number of samples in its mean [-]; both are 0 at first."""


def valid_estimate(signals: Measurements) -> NDArray[np.bool_]:
    """Return whether the estimate of the advance velocity is valid and finite, shape (n,)."""
    return (signals.estimate_valid > 0.5) & np.isfinite(signals.advance_velocity)


class InflowSchedule:
    """Schedule of the advance velocity by the equations of the module.

    Args:
        name: name of the controller, for messages.
        plant: record of the ship.
        interval_s: control interval [s].
        weight: k, 0 for the nominal wake to 1 for the estimate [-].

    Raises:
        ValueError: the weight is outside 0 to 1.

    Example:
        >>> from shaftline.plant import load_ship
        >>> schedule = InflowSchedule("combinator", load_ship("frigate").record(), 0.5, weight=1.0)
        >>> states = np.array([[0.1, 60.0], [0.225, 60.0], [0.4, 60.0]])
        >>> schedule.factor(states).round(4).tolist()
        [1.1, 1.1125, 1.0]
    """

    def __init__(self, name: str, plant: Record, interval_s: float, weight: float) -> None:
        if not 0.0 <= weight <= 1.0:
            raise ValueError(f"{name}: va_weight = {weight!r}: must be from 0 to 1")
        self.plant, self.weight = plant, weight
        self._share = min(interval_s / FILTER_S, 1.0)

    def update(self, signals: Measurements, state: Any) -> Floats:
        """Return the state of n ships after one control interval, shape (n, 2)."""
        deviation, samples = np.asarray(state).T
        nominal = wake_inflow(self.plant, signals.ship_speed)
        valid = valid_estimate(signals) & np.isfinite(nominal)
        informative = valid & (nominal >= LEAST_SPEED)
        base = np.where(informative, nominal, 1.0)
        sample = np.where(informative, signals.advance_velocity, 1.0) / base - 1.0
        samples = samples + informative
        share = np.maximum(self._share, 1.0 / np.maximum(samples, 1.0))
        share = np.where(informative, share, self._share)
        moved = deviation + share * (np.clip(sample, -_LARGEST, _LARGEST) - deviation)
        # At low speed a valid estimate does not determine the wake, and the deviation is kept.
        return np.column_stack([np.where(valid & ~informative, deviation, moved), samples])

    def factor(self, state: Any) -> Floats:
        """Return 1 + k g(r) r [-], the scheduled over the nominal advance velocity, shape (n,)."""
        deviation = np.asarray(state)[:, 0]
        trust = np.clip(2.0 - np.abs(deviation) / BAND, 0.0, 1.0)
        return np.asarray(1.0 + self.weight * trust * deviation)

    def velocity(self, signals: Measurements, state: Any) -> Floats:
        """Return the scheduled advance velocity v [m/s], shape (n,)."""
        return np.asarray(self.factor(state) * wake_inflow(self.plant, signals.ship_speed))


def make_schedule(
    name: str, plant: Record, interval_s: float, weight: float | None
) -> InflowSchedule | None:
    """Return the schedule of a controller by its option ``va_weight``; None where it has none."""
    return None if weight is None else InflowSchedule(name, plant, interval_s, weight)
