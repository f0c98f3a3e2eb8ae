"""Base class of the observers."""

from __future__ import annotations

import math
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from numba.core.errors import NumbaError

from ..core.compiled import Record
from ..plant.shaft import inertia_behind_meter
from ..plant.ship import Ship
from .external import address_of
from .records import OBSERVER, Measurement
from .torque_curve import observer_plant


class ObserverError(ValueError):
    """Unknown observer or tuning, or a ship on which the observer cannot be used."""


class Observer(ABC):
    """Estimate the advance velocity from shaft measurements (base class).

    A subclass is a frozen dataclass whose fields are its tuning. A file of this folder that defines one
    registers it; no list has to be extended. A subclass declares ``name`` and ``source`` and defines
    ``update``; if its coefficients depend on the ship or the sample time, it extends ``discretise``. A
    subclass without a ``name`` is a variant, available as one of the ``tunings`` of another class.
    """

    name: ClassVar[str]  # registered name
    source: ClassVar[str] = ""  # publication; observers are listed by source, then by name
    tunings: ClassVar[Mapping[str, Observer]] = {}  # tunings by name; ``NAME-TUNING`` selects one
    tracks: str = ""  # dotted key of the ship parameter that is estimated as well, if any
    uses_instruments: ClassVar[bool] = (
        True  # an implausible measurement is not valid, but for oracle
    )
    uses_torque: ClassVar[bool] = True  # whether the estimate depends on the propeller torque

    @staticmethod
    @abstractmethod
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample; a function that numba can compile.

        Args:
            observer: OBSERVER record of :meth:`discretise`.
            estimate: ESTIMATE record. The function keeps its state in ``x`` and ``covariance``; the last
                measurement and estimate are stored by the caller.
            m: plausible measurement.

        Returns:
            Advance velocity [m/s] and whether it is valid.
        """

    @property
    def kind(self) -> int:
        """Code of the update function in an OBSERVER record."""
        return code_of(self.update)

    @property
    def address(self) -> int:
        """Address of the compiled update in this process; 0 for an observer of this package."""
        if type(self).__module__.startswith(f"{__package__}."):
            return 0
        try:
            return address_of(type(self).update)
        except NumbaError as error:
            raise ObserverError(
                f"observer {self.name!r}: numba cannot compile its update: {error}"
            ) from None

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a ship and a sample time.

        Args:
            ship: ship model of the observer.
            dt: sample time [s].

        Raises:
            ObserverError: the observer cannot be used on this ship, or the sample time is not positive.
        """
        if not 0.0 < dt < math.inf:
            raise ObserverError(f"dt = {dt}: the sample time must be positive [s]")
        if not ship.has_propeller:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs a propeller, because it estimates the "
                "inflow of one, but propeller.model is 'none'"
            )
        if self.uses_torque and ship.has_constant_coefficients:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs a torque that depends on the inflow, "
                "but propeller.model is 'bollard', with the same KQ at every inflow (allowed: b-series, "
                "four-quadrant, table)"
            )
        record = np.zeros(1, OBSERVER)[0]
        record["kind"], record["address"] = self.kind, self.address
        record["uses_instruments"], record["dt"] = self.uses_instruments, dt
        record["ship"] = observer_plant(ship)
        return record

    def inertia(self, ship: Ship) -> float:
        """Return the inertia I_R [kg m2] that the measured torque accelerates.

        It is the inertia behind the shaft torque meter, or that of the whole shaft line if the torque is
        that of an electric drive (:func:`.torque_curve.uses_drive_torque`).

        Raises:
            ObserverError: the inertia is 0.
        """
        inertia = float(inertia_behind_meter(observer_plant(ship)))
        if not inertia > 0.0:
            raise ObserverError(
                f"{ship.name}: the observer {self.name!r} needs the inertia behind the shaft torque "
                "meter, but transmission.inertia_propeller_side_kg_m2 is 0 (unit kg m2); give the "
                "inertia of propeller and shaft there, or take an observer without inertia, such as "
                "'power-balance'"
            )
        return inertia


def code_of(update: Callable[..., Any]) -> int:
    """Return the code of an update function in OBSERVER records, a checksum of its name.

    The code does not change when other observers are added, so cached machine code stays valid.
    """
    return zlib.crc32(f"{update.__module__}.{update.__qualname__}".encode())
