"""Estimates of parameters with their uncertainty, and the type of progress callbacks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..core.statistics import half_95
from ..plant.ship import Ship


@dataclass(frozen=True)
class Estimate:
    """Estimate of a parameter of the ship file.

    Args:
        key: dotted key of the ship file.
        value: estimate, in ``unit``.
        unit: SI unit of the key.
        bounds: lowest and highest value that a ship file allows, in ``unit``.
        neutral: value without an effect, that of the nominal ship, in ``unit``.
        standard_error: standard error from the noise of the recording, in ``unit``.
        form_error: error from the form of the model, which is only approximately true, in ``unit``; it
            widens the interval.
        freedom: degrees of freedom of the standard error [-].

    >>> torque = Estimate("engine.friction_N_m", 8000.0, "N m", (0.0, 1e6), 0.0, standard_error=500.0)
    >>> torque.name, torque.ci95
    ('friction_N_m', (7020.0, 8980.0))
    """

    key: str
    value: float
    unit: str
    bounds: tuple[float, float]
    neutral: float
    standard_error: float
    form_error: float = 0.0
    freedom: float = math.inf

    @classmethod
    def of(
        cls,
        ship: Ship,
        key: str,
        value: float,
        standard_error: float,
        *,
        form_error: float = 0.0,
        neutral: float | None = None,
    ) -> Estimate:
        """Return the estimate of a parameter, with unit, bounds and neutral value from the ship.

        Args:
            ship: nominal ship.
            key: dotted key.
            value: estimate, in the key's unit.
            standard_error: standard error from the noise of the recording, in the key's unit.
            form_error: error from the form of the model, in the key's unit.
            neutral: value without an effect in the key's unit, if it is not that of the ship.

        Raises:
            ShipError: unknown key.
        """
        number = ship.parameter(key)
        info, neutral = number.info, number.value if neutral is None else neutral
        bounds = info.low, info.high
        return cls(key, value, info.unit, bounds, neutral, standard_error, form_error)

    @property
    def name(self) -> str:
        """Name in reports: the last part of the key."""
        return self.key.split(".")[-1]

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval inside the bounds, in ``unit``, with Student's t for finite ``freedom``."""
        half = math.hypot(half_95(self.freedom) * self.standard_error, self.form_error)
        ends = self.value - half, self.value + half
        if not math.isfinite(half):
            return ends
        low, high = self.bounds
        return max(ends[0], min(low, self.value)), min(ends[1], max(high, self.value))

    @property
    def is_undetermined(self) -> bool:
        """Whether the interval contains every value that is allowed.

        >>> Estimate("term.roughness.r", 0.8, "-", (0.1, 1.5), 0.0, 5.0).is_undetermined
        True
        """
        return self.ci95 == self.bounds

    def to_dict(self) -> dict[str, float | list[float] | str]:
        """Return ``value``, ``ci95``, ``key`` and the standard error ``se`` for ``report.json``."""
        ends = list(self.ci95)
        return {"value": self.value, "ci95": ends, "key": self.key, "se": self.standard_error}


Tick = Callable[[str, int, int], None]
"""Progress callback: called with the stage, the number of steps done, and the number of all steps."""


def ignore_progress(stage: str, done: int, total: int) -> None:
    """Do nothing: the progress callback of a caller that shows no progress."""
