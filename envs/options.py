"""Options of ``reset``: declaration and check."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..observers.records import Floats
from .records import MAX_ORDERS
from .settings import SeaRange, read_seas
from .tasks import LEAST_RESISTANCE, LIMITS, Task

OPTIONS = ("sea", "speed_order_m_s", "order_interval_s", "initial_speed_m_s", "resistance_rise")
STEERED_OPTIONS = ("heading_order_deg", "track_order_m", "cross_current_m_s", "drift_force_kN")
"""Names of the options of ``reset(options=...)``, and further ones where the rudder is an action."""


def check_options(options: Any) -> dict[str, Any]:
    """Return a copy of the options of a reset as a dictionary; an empty one for None."""
    if not isinstance(options, Mapping | None):
        raise ValueError(f"options = {options!r}: must be a dictionary such as {{'sea': 'calm'}}")
    return dict(options or {})


@dataclass(frozen=True)
class ResetOptions:
    """Checked options of a reset: values that replace those that the task draws; None means drawn.

    There is one order for each order interval, the last one held. Without an initial speed the ship
    starts at the first of the given orders.
    """

    seas: list[SeaRange | None] | None  # None means those of the environment
    orders: Floats | None  # ordered ship speeds [m/s]
    order_interval_s: float  # time between two orders [s]
    initial_speed_m_s: float | None  # ship speed at the start [m/s]
    resistance_rise: float | None  # increase of the mean resistance [-]
    heading_orders: Floats | None = None  # ordered headings [rad]
    track_orders: Floats | None = None  # ordered cross-track positions [m]
    cross_current_m_s: float | None = None  # to starboard of the first course [m/s]
    drift_force_N: float | None = None  # mean of the slow side force, to starboard [N]

    @staticmethod
    def of(
        options: Any, task: Task, speeds: tuple[float, float], steered: bool = False
    ) -> ResetOptions:
        """Return the checked options of a reset; the values of the task hold where no option is given.

        ``speeds`` are the lowest and highest ship speed at which an episode can start [m/s].

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        given = check_options(options)
        known = (*OPTIONS, *(STEERED_OPTIONS if steered else ()))
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ValueError(f"unknown option {unknown[0]!r}; known: {', '.join(known)}")
        interval = given.get("order_interval_s", task.order_interval_s)

        def one(name: str, low: float, high: float, unit: str) -> float | None:
            return None if given.get(name) is None else _within(name, given[name], low, high, unit)

        headings = _orders(given, "heading_order_deg")
        force = one("drift_force_kN", *LIMITS["drift_force_kN"])
        low, high, unit = LIMITS["resistance_rise"]
        low = max(low, LEAST_RESISTANCE + task.resistance_swing - 1.0)
        return ResetOptions(
            read_seas(given["sea"], task) if "sea" in given else None,
            _orders(given, "speed_order_m_s"),
            _within("order_interval_s", interval, 1e-3, math.inf, "s"),
            one("initial_speed_m_s", *speeds, "m/s"),
            one("resistance_rise", low, high, unit),
            None if headings is None else np.radians(headings),
            _orders(given, "track_order_m"),
            one("cross_current_m_s", *LIMITS["cross_current_m_s"]),
            None if force is None else 1e3 * force,
        )


def _orders(given: Mapping[str, Any], name: str) -> Floats | None:
    """Return the orders of an option, the last one held to the end; None if it is not given."""
    if name not in given:
        return None
    asked = np.atleast_1d(given[name])
    if asked.ndim != 1 or not 1 <= len(asked) <= MAX_ORDERS:
        raise ValueError(
            f"options: {name}: must be one order, or a list of 1 to {MAX_ORDERS} orders"
        )
    orders = [_within(name, order, *LIMITS[name]) for order in asked.tolist()]
    return np.array(orders + orders[-1:] * (MAX_ORDERS - len(orders)))


def _within(name: str, value: Any, low: float, high: float, unit: str) -> float:
    number = math.nan
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        number = float(value) if np.isreal(value) else math.nan
    if not low <= number <= high:
        raise ValueError(f"options: {name} = {value!r}: must be {low:g} to {high:g} {unit}")
    return number
