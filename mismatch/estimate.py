"""A number of a ship as recordings tell it: value, unit, range and uncertainty in one.

How a long work says how far it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import scipy

from ..plant.ship import Ship

HALF_95 = 1.96
"""Half of a normal variable's 95 % interval, in standard errors."""


def half_95(freedom: float) -> float:
    """Return half of a 95 % interval, in standard errors (Student's t).

    Args:
        freedom: degrees of freedom of the standard error; infinite where it is known.
    """
    if math.isinf(freedom):
        return HALF_95
    return float(scipy.stats.t.ppf(0.975, max(freedom, 1.0)))


@dataclass(frozen=True)
class Estimate:
    """A number of a ship's file, estimated.

    Args:
        key: dotted key of the ship's file.
        value: in ``unit``.
        unit: SI, as the key states it.
        bounds: lowest and highest value that a ship's file allows.
        neutral: value that changes nothing: the nominal ship's own, in the same unit.
        standard_error: by the noise of the recording, in ``unit``.
        form_error: by which the form of a model, which is never quite the truth's, may have moved the
            value, in ``unit``; widens the interval.
        freedom: degrees of freedom of the standard error [-]: from how much data it is itself known.
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
        """An estimate of one of a ship's numbers.

        Args:
            ship: nominal; its key says unit and bounds, and its own value is the neutral one.
            key: dotted key.
            value: in the key's unit, likewise the others.
            standard_error: by the noise of the recording, in the same unit.
            form_error: by the form of the model, in the same unit.
            neutral: another value that changes nothing, in the same unit.

        Raises:
            ShipError: unknown key.
        """
        number = ship.number(key)
        info = number.info
        if neutral is None:
            neutral = number.value
        return cls(
            key, value, info.unit, (info.low, info.high), neutral, standard_error, form_error
        )

    @property
    def name(self) -> str:
        """Name in reports: the key without its section."""
        return self.key.split(".")[-1]

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval inside the bounds, in ``unit``; by Student's t where the error is uncertain."""
        half = math.hypot(half_95(self.freedom) * self.standard_error, self.form_error)
        ends = self.value - half, self.value + half
        if not math.isfinite(half):
            return ends
        low, high = self.bounds
        return max(ends[0], min(low, self.value)), min(ends[1], max(high, self.value))

    def to_dict(self) -> dict[str, float | list[float]]:
        """As it stands in ``report.json`` under its name: ``value`` and ``ci95``."""
        return {"value": self.value, "ci95": list(self.ci95)}


Tick = Callable[[str, int, int], None]
"""Told the stage, how much of it is done, and how much there is."""


def silent(stage: str, done: int, total: int) -> None:
    """Tell nobody."""
