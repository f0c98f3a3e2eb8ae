"""Options of ``reset``: declaration and check."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .records import MAX_ORDERS
from .settings import SeaRange, read_seas
from .tasks import LEAST_RESISTANCE, LIMITS, Task

OPTIONS = ("sea", "speed_order_m_s", "order_interval_s", "initial_speed_m_s", "resistance_rise")
"""Names of the options of ``reset(options=...)``."""

STEERED_OPTIONS = ("heading_order_deg", "track_order_m", "cross_current_m_s", "drift_force_kN")
"""Names of the additional options where the rudder is an action."""


def check_options(options: Any) -> dict[str, Any]:
    """Return a copy of the options of a reset as a dictionary; an empty one for None.

    Raises:
        ValueError: ``options`` is not a dictionary.
    """
    if not isinstance(options, Mapping | None):
        raise ValueError(f"options = {options!r}: must be a dictionary such as {{'sea': 'calm'}}")
    return dict(options or {})


@dataclass(frozen=True)
class ResetOptions:
    """Checked options of a reset: values that replace those that the task draws.

    Args:
        seas: seas to draw from; None means those of the environment.
        orders: ordered ship speeds [m/s], one for each order interval, the last one held; None means
            that the task draws them.
        order_interval_s: time between two orders [s].
        initial_speed_m_s: ship speed [m/s] at the start; None means the first of the given orders, or a
            drawn speed where no orders are given.
        resistance_rise: increase of the mean resistance [-]; None means that the task draws it.
        heading_orders: ordered headings [rad], one for each order interval, the last one held; None
            means that the task draws them.
        track_orders: ordered cross-track positions [m], in the same form.
        cross_current_m_s: current to starboard of the first course [m/s]; None means drawn.
        drift_force_N: mean of the slow side force, to starboard [N]; None means drawn.
    """

    seas: list[SeaRange | None] | None
    orders: NDArray[np.float64] | None
    order_interval_s: float
    initial_speed_m_s: float | None
    resistance_rise: float | None
    heading_orders: NDArray[np.float64] | None = None
    track_orders: NDArray[np.float64] | None = None
    cross_current_m_s: float | None = None
    drift_force_N: float | None = None

    @staticmethod
    def of(
        options: Mapping[str, Any] | None,
        task: Task,
        speeds: tuple[float, float],
        steered: bool = False,
    ) -> ResetOptions:
        """Return the checked options of a reset.

        Args:
            options: options of the reset, or None.
            task: task, whose values hold where no option is given.
            speeds: lowest and highest ship speed at which an episode can start [m/s].
            steered: whether the rudder is an action.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        given = check_options(options)
        known = (*OPTIONS, *(STEERED_OPTIONS if steered else ()))
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ValueError(f"unknown option {unknown[0]!r}; known: {', '.join(known)}")
        interval = _within(
            "order_interval_s", given.get("order_interval_s", task.order_interval_s),
            1e-3, math.inf, "s",
        )  # fmt: skip

        def one(name: str, low: float, high: float, unit: str) -> float | None:
            return None if given.get(name) is None else _within(name, given[name], low, high, unit)

        headings = _orders(given, "heading_order_deg")
        force = one("drift_force_kN", *LIMITS["drift_force_kN"])
        low, high, unit = LIMITS["resistance_rise"]
        low = max(low, LEAST_RESISTANCE + task.resistance_swing - 1.0)
        return ResetOptions(
            read_seas(given["sea"], task) if "sea" in given else None,
            _orders(given, "speed_order_m_s"),
            interval,
            one("initial_speed_m_s", *speeds, "m/s"),
            one("resistance_rise", low, high, unit),
            None if headings is None else np.radians(headings),
            _orders(given, "track_order_m"),
            one("cross_current_m_s", *LIMITS["cross_current_m_s"]),
            None if force is None else 1e3 * force,
        )


def _orders(given: Mapping[str, Any], name: str) -> NDArray[np.float64] | None:
    """Return the orders of an option, the last one held to the end; None if it is not given."""
    if name not in given:
        return None
    asked = np.atleast_1d(given[name])
    if asked.ndim != 1 or not 1 <= len(asked) <= MAX_ORDERS:
        raise ValueError(
            f"options: {name}: must be one order, or a list of 1 to {MAX_ORDERS} orders"
        )
    orders = np.empty(MAX_ORDERS)
    orders[: len(asked)] = [_within(name, order, *LIMITS[name]) for order in asked.tolist()]
    orders[len(asked) :] = orders[len(asked) - 1]
    return orders


def _within(name: str, value: Any, low: float, high: float, unit: str) -> float:
    number = math.nan
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        number = float(value) if np.isreal(value) else math.nan
    if not low <= number <= high:
        raise ValueError(f"options: {name} = {value!r}: must be {low:g} to {high:g} {unit}")
    return number
