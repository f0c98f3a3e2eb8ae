"""What every observer declares."""

from __future__ import annotations

import math
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from numba.core.errors import NumbaError

from ..core.compiled import Record
from ..plant.shaft import inertia_behind_gauge
from ..plant.ship import Ship
from .of_others import address_of
from .records import OBSERVER, Measurement
from .torque_curve import believed


class ObserverError(ValueError):
    """An observer or tuning that does not exist, or a ship that it cannot serve; the message says it."""


class Observer(ABC):
    """Base class: estimates the advance velocity from shaft measurements.

    A subclass is a frozen dataclass of its tuning in a file of this folder; it is found there and
    needs to be named nowhere else. It says its ``name`` and ``source``, gives ``update``, and where it
    has coefficients it extends ``discretise``. A class that declares no name of its own is a variant,
    reached as one of the ``tunings`` of another.
    """

    name: ClassVar[str]
    """By which it is chosen."""
    source: ClassVar[str] = ""
    """Where it is published; observers are listed by source, then by name."""
    tunings: ClassVar[Mapping[str, Observer]] = {}
    """Other tunings by name; ``NAME-TUNING`` chooses one."""
    tracks: str = ""
    """Dotted key of the number of the ship that it tracks too; empty for most."""
    reads_instruments: ClassVar[bool] = True
    """Whether a reading that cannot be true stops it: for all but the oracle."""
    reads_torque: ClassVar[bool] = True
    """Whether it asks the propeller's torque for the inflow."""

    @staticmethod
    @abstractmethod
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """One sample; a compiled kernel.

        Args:
            observer: OBSERVER record of :meth:`discretise`.
            estimate: ESTIMATE record; the kernel keeps its own state in ``x`` and ``covariance``, last
                readings and estimate are stored for it.
            m: plausible readings.

        Returns:
            Advance velocity [m/s] and whether to trust it.
        """

    @property
    def kind(self) -> int:
        """Code of its update in an OBSERVER record."""
        return code_of(self.update)

    @property
    def address(self) -> int:
        """Where its update stands in this process if it is not one of ours; else 0."""
        if type(self).__module__.startswith(f"{__package__}."):
            return 0
        try:
            return address_of(type(self).update)
        except NumbaError as error:
            raise ObserverError(
                f"observer {self.name!r}: its update cannot be compiled: {error}"
            ) from None

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record.

        Args:
            ship: as the observer believes it to be.
            dt: sample time [s].

        Raises:
            ObserverError: the ship lacks what this observer needs, or the sample time is none.
        """
        if not 0.0 < dt < math.inf:
            raise ObserverError(f"dt = {dt}: the sample time must be positive [s]")
        if not ship.has_propeller:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs a propeller, whose inflow it "
                "estimates, but propeller.model is 'none'"
            )
        if self.reads_torque and ship.has_constant_coefficients:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs a torque that goes by the inflow, but "
                "propeller.model is 'bollard', one KQ for every inflow (allowed: b-series, "
                "four-quadrant, table)"
            )
        record = np.zeros(1, OBSERVER)[0]
        record["kind"] = self.kind
        record["address"] = self.address
        record["reads_instruments"] = self.reads_instruments
        record["dt"] = dt
        record["ship"] = believed(ship)
        return record

    def inertia(self, ship: Ship) -> float:
        """Inertia I_R [kg m2] that the torque read has to accelerate, for observers that divide by it.

        Behind the gauge; of an electric drive without one, the whole line
        (:mod:`shaftline.observers.torque_curve`).

        Raises:
            ObserverError: it is 0.
        """
        inertia = float(inertia_behind_gauge(believed(ship)))
        if not inertia > 0.0:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs the inertia behind the torque gauge, "
                "but transmission.inertia_propeller_side_kg_m2 is 0 (unit kg m2); give the inertia of "
                "propeller and shaft there, or take an observer that does without, such as "
                "'power-balance'"
            )
        return inertia


def code_of(update: Callable[..., Any]) -> int:
    """A kernel's code in OBSERVER records, made from its name.

    So it stays what it is when other observers come and go: machine code kept on disk goes by it.
    """
    return zlib.crc32(f"{update.__module__}.{update.__qualname__}".encode())
