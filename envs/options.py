"""How an episode begins: the options of ``reset``, declared and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .records import MAX_ORDERS
from .settings import SeaRange, seas_of
from .tasks import LEAST_RESISTANCE, LIMITS, Task

OPTIONS = ("sea", "speed_order_m_s", "order_interval_s", "initial_speed_m_s", "resistance_rise")
"""What ``reset(options=...)`` takes."""

STEERED_OPTIONS = ("heading_order_deg", "track_order_m", "cross_current_m_s", "drift_force_kN")
"""And besides, of a ship that is steered."""


def options_of(options: Any) -> dict[str, Any]:
    """Return the options of a reset as a dictionary of their own; None is none.

    Raises:
        ValueError: no dictionary.
    """
    if not isinstance(options, Mapping | None):
        raise ValueError(f"options = {options!r}: must be a dictionary of options by name")
    return dict(options or {})


@dataclass(frozen=True)
class Begin:
    """How an episode begins, where ``reset(options=...)`` says it.

    Args:
        seas: to draw from; None leaves them to the environment.
        orders: ordered ship speeds [m/s], one an order interval, the last held; None draws them.
        order_interval_s: [s].
        initial_speed_m_s: ship speed [m/s] at which the episode begins; by default the first of given
            orders, else drawn.
        resistance_rise: of the mean resistance [-]; None draws it.
        heading_orders: [rad], one an order interval, the last held; None draws them.
        track_orders: cross tracks [m], likewise.
        cross_current_m_s: of the water, to starboard of the first course [m/s]; None draws it.
        drift_force_N: mean of the slow side force, to starboard [N]; None draws it.
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
    ) -> Begin:
        """From the options of a reset, :data:`OPTIONS` and, steered, :data:`STEERED_OPTIONS`.

        Args:
            options: of the reset, or None.
            task: decides what the options leave open.
            speeds: lowest and highest at which the ship can begin [m/s].
            steered: whether the rudder is an action.

        Raises:
            ValueError: an unknown option, or a value out of range.
        """
        given = options_of(options)
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
        return Begin(
            seas_of(given["sea"], task) if "sea" in given else None,
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
    """Orders of an option, the last held to the end; None where it is not given."""
    if name not in given:
        return None
    asked = np.atleast_1d(given[name])
    if asked.ndim != 1 or not 1 <= len(asked) <= MAX_ORDERS:
        raise ValueError(f"options: {name}: 1 to {MAX_ORDERS} orders are needed")
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
