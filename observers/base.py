"""What every observer declares, and what all share: their records and the measurement.

An observer in use is a pair of records. OBSERVER holds what is fixed: which observer, its discrete
coefficients, and the ship as the observer believes it to be (a PLANT record of its own, so that a
wrong belief is one assignment). ESTIMATE holds what changes.
"""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..plant.record import PLANT
from ..plant.shaft import inertia_behind_gauge
from ..plant.ship import Ship
from ..plant.signals import SIGNALS
from .torque_reading import believed

OBSERVER = np.dtype(
    [
        ("kind", np.int64),  # whose update, see code_of
        ("address", np.int64),  # of another's update in this process; 0 for ours
        ("reads_instruments", np.int64),
        ("dt", np.float64),
        # linear observers: x+ = transition x + now u(t+dt) + before u(t), u = (omega, M_m)
        ("transition", np.float64, (2, 2)),
        ("before", np.float64, (2, 2)),
        ("now", np.float64, (2, 2)),
        ("gain", np.float64),  # of the immersion-and-invariance observer; 1 / T of an inflow [1/s]
        # of Kalman filters: variances per step of shaft speed and advance velocity, or densities
        ("process", np.float64, (4,)),
        ("measurement", np.float64),  # variance of the shaft speed
        ("spread", np.float64, (4,)),  # standard deviations at the start
        ("tracks", np.int64),  # which number of the ship
        ("number", np.float64),  # as the ship's file has it
        ("lowest", np.float64),  # that it may be
        ("highest", np.float64),
        ("ship", PLANT),
    ],
    align=True,
)

ESTIMATE = np.dtype(
    [
        ("started", np.int64),
        ("x", np.float64, (4,)),  # states; the number of the ship that is tracked stands last
        ("covariance", np.float64, (4, 4)),
        ("shaft_speed", np.float64),  # measured at the last sample
        ("shaft_torque", np.float64),
        ("pitch_ratio", np.float64),
        ("advance_velocity", np.float64),
        ("valid", np.int64),
        (
            "answer",
            np.float64,
            (2,),
        ),  # of an update that is not ours: velocity, whether it is valid
    ],
    align=True,
)


TRACKED = 3
"""Place in ``x`` and ``covariance`` of a number of the ship that an observer tracks."""


class Measurement(NamedTuple):
    """What the instruments say at one instant.

    ``advance_velocity`` is the truth, for the oracle alone; ``shaft_acceleration`` is for the one
    observer that asks for an accelerometer.
    """

    shaft_speed: float  # [rad/s]
    shaft_torque: float  # [N m]
    pitch_ratio: float  # [-]
    shaft_acceleration: float  # [rad/s2]
    advance_velocity: float  # [m/s]


READINGS = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio", "shaft_acceleration_rad_s2"]
"""Columns of a recording that the observers read, in the order of a :class:`Measurement`."""


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
        from numba.core.errors import NumbaError

        from .of_others import address_of

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
            ObserverError: the ship lacks what this observer needs.
        """
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
        (:mod:`shaftline.observers.torque_reading`).

        Raises:
            ObserverError: it is 0.
        """
        inertia = inertia_behind_gauge(believed(ship))
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


_HIGHEST = {signal.name: float(signal.high) for signal in SIGNALS}
_MAX_SPEED = _HIGHEST["shaft_speed"]
_MAX_TORQUE = _HIGHEST["measured_shaft_torque"]
_MAX_PITCH = _HIGHEST["measured_pitch_ratio"]

PITCH_MARGIN = 0.1
"""How far a measured P/D may lie beyond the ship's range [-], for noise and offsets."""


@compiled
def is_plausible(m: Measurement) -> bool:
    """Whether speed, torque and pitch are numbers within the bounds of the signal registry."""
    return (
        abs(m.shaft_speed) <= _MAX_SPEED
        and abs(m.shaft_torque) <= _MAX_TORQUE
        and abs(m.pitch_ratio) <= _MAX_PITCH
    )


@compiled
def pitch_is_known(ship: Record, pitch_ratio: float) -> bool:
    """Whether a pitch lies in the ship's range, with :data:`PITCH_MARGIN`."""
    lowest, highest = ship.pitch_ratio_min - PITCH_MARGIN, ship.pitch_ratio_max + PITCH_MARGIN
    return bool(lowest <= pitch_ratio <= highest)


@compiled
def remember(estimate: Record, m: Measurement, velocity: float, valid: bool) -> None:
    """Store this sample's measurement and estimate."""
    estimate.started = 1
    estimate.shaft_speed = m.shaft_speed
    estimate.shaft_torque = m.shaft_torque
    estimate.pitch_ratio = m.pitch_ratio
    estimate.advance_velocity = velocity
    estimate.valid = 1 if valid else 0
