"""Ranges of validity of the models, and the check of a simulation against them.

Each section of the ship file lists the ranges of its models in ``validity``. A new model adds a row
there; simulation, commands and tests then include it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .ship import Ship

ROUNDING = 1e-9
"""Share of a limit by which a value may exceed it because of rounding."""


class Validity(NamedTuple):
    """Range in which a model is valid; ``values`` and ``limits`` are functions of the ship record."""

    quantity: str  # the quantity that must lie in the range, as a noun phrase
    unit: str  # SI unit
    # Quantity of each sample of a SAMPLE array; NaN where the model is not in use.
    values: Callable[[Any, NDArray[Any]], NDArray[np.float64]]
    limits: Callable[[Any], tuple[float, float]]  # lowest and highest valid value; may be infinite
    beyond: str  # what the simulation assumes outside the range, as a clause


class ValidityWarning(UserWarning):
    """A simulation has left the range of validity of a model."""


class Departure(NamedTuple):
    """A range of validity that a simulation has left."""

    row: Validity
    limits: tuple[float, float]
    reached: tuple[float, float]  # lowest and highest value of all samples
    first_s: float  # time of the first sample outside
    share: float  # of the samples outside [-]

    def __str__(self) -> str:
        """Return the departure as one line of text."""
        unit = "" if self.row.unit == "-" else f" {self.row.unit}"
        low, high = self.limits
        allowed = f"{low:.4g} to {high:.4g}"
        if not np.isfinite(high):
            allowed = f"at least {low:.4g}"
        elif not np.isfinite(low):
            allowed = f"at most {high:.4g}"
        # The residual creep of a shaft at rest is printed as 0.
        least, most = (value if abs(value) > 1e-9 else 0.0 for value in self.reached)
        return (
            f"{self.row.quantity} left its range of validity ({allowed}{unit}) at {self.first_s:.4g} s: "
            f"it spans {least:.4g} to {most:.4g}{unit} and is outside for {100.0 * self.share:.3g} % of "
            f"the run; {self.row.beyond}"
        )


def departures(ship: Ship, samples: NDArray[Any]) -> list[Departure]:
    """Return the ranges of validity that the samples of a simulation leave.

    Args:
        ship: simulated ship.
        samples: SAMPLE array of :func:`shaftline.plant.simulate`.

    >>> from shaftline.plant import Schedule, departures, equilibrium, load_ship, simulate
    >>> ship = load_ship("frigate")
    >>> start = equilibrium(ship, drive=22.0, pitch_ratio=1.2).state
    >>> departures(ship, simulate(ship, Schedule(22.0, 1.2), 1.0, initial=start))
    []
    """
    plant = ship.record()
    found = []
    sections = [getattr(ship, name) for name in type(ship).model_fields]
    for row in (row for section in sections for row in getattr(section, "validity", ())):
        low, high = row.limits(plant)
        values = np.asarray(row.values(plant, samples), dtype=np.float64)
        outside = (values < low - ROUNDING * abs(low)) | (values > high + ROUNDING * abs(high))
        if outside.any():
            reached = float(np.nanmin(values)), float(np.nanmax(values))
            first = float(samples["time"][int(np.argmax(outside))])
            found.append(Departure(row, (low, high), reached, first, float(outside.mean())))
    return found


def warn_of_departures(ship: Ship, samples: NDArray[Any]) -> None:
    """Emit a :class:`ValidityWarning` for each range of validity that a SAMPLE array leaves."""
    for departure in departures(ship, samples):
        warnings.warn(f"{ship.name}: {departure}", ValidityWarning, stacklevel=3)
