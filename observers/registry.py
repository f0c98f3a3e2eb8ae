"""Observers by name, and the kernel that updates any of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from ..core.compiled import Record, compiled, generate_kernel
from ..core.discovery import classes_in, entry_point_names, load_external_class
from .base import Observer, ObserverError, code_of
from .external import update_through_address
from .records import Measurement, is_plausible, pitch_is_known, store_sample
from .torque_curve import torque_determines_inflow

OBSERVERS = "shaftline.observers"  # group of entry points through which packages register observers
_CLASSES = sorted(
    classes_in(__package__, Observer, but=("registry", "following", "external")),  # type: ignore[type-abstract]
    key=lambda cls: (cls.source.casefold(), cls.name),
)
_NAMED = {cls.name: cls for cls in _CLASSES if "name" in vars(cls)}
_UPDATES = {code_of(cls.update): cls.update for cls in _CLASSES}


def observer_names() -> list[str]:
    """Return the names of all observers and tunings, those of installed packages last.

    ``name`` is an observer with its default tuning, ``name-tuning`` with another one.

    Example:
        >>> "luenberger-high" in observer_names()
        True
    """
    names = ([name, *(f"{name}-{t}" for t in cls.tunings)] for name, cls in _NAMED.items())
    return [*itertools.chain(*names), *entry_point_names(OBSERVERS)]


def get_observer(name: str, tuning: str | None = None) -> Observer:
    """Return an observer by name and tuning.

    Args:
        name: one of :func:`observer_names`, or ``module:Class`` for a class of your own that derives
            from :class:`.base.Observer` and is called without arguments.
        tuning: such as ``low``, ``high`` or ``printed``; the default tuning if it is None.

    Raises:
        ObserverError: unknown name or tuning.

    Example:
        >>> get_observer("luenberger-low").poles
        (-10.0, -1.0)
        >>> get_observer("luenberger", "low") == get_observer("luenberger-low")
        True
    """
    cls = _NAMED[name] if name in _NAMED else load_external_class(name, OBSERVERS)
    if cls is None:
        bare, _, ending = name.rpartition("-")
        if tuning is None and bare in _NAMED and ending in _NAMED[bare].tunings:
            return _NAMED[bare].tunings[ending]
        raise ObserverError(f"unknown observer {name!r}; known: {', '.join(observer_names())}")
    if not (isinstance(cls, type) and issubclass(cls, Observer)):
        raise ObserverError(
            f"observer {name!r}: expected a class that derives from shaftline.observers.Observer"
        )
    if tuning is not None and tuning not in cls.tunings:
        known = ", ".join(cls.tunings) or "none"
        raise ObserverError(f"observer {name!r} has no tuning {tuning!r}; tunings: {known}")
    try:
        return cls() if tuning is None else cls.tunings[tuning]
    except TypeError as error:  # The class is abstract, or its constructor needs arguments.
        raise ObserverError(f"observer {name!r}: {error}") from None


_dispatch: Callable[[Record, Record, Measurement], tuple[float, bool]] = generate_kernel(
    """
def _dispatch(observer, estimate, m):
    if observer.kind == {field}: return update_{field}(observer, estimate, m)
    if observer.address != 0: return update_through_address(observer, estimate, m)
    return estimate.advance_velocity, False
""",
    map(str, _UPDATES),
    globals()
    | {f"update_{code}": update for code, update in _UPDATES.items()}
    | {"update_through_address": update_through_address},
)
"""Compiled function that calls the update of the observer to which a record belongs."""


@compiled
def update(observer: Record, estimate: Record, m: Measurement) -> float:
    """Process one sample and return the estimate of the advance velocity [m/s].

    After a measurement that is not finite or beyond the bounds of the signal registry, the last estimate
    is returned as not valid, and the observer restarts with the next plausible sample. An estimate off
    the torque curve (the end of the curve is returned) or outside the pitch range is not valid either.

    Args:
        observer: OBSERVER record.
        estimate: ESTIMATE record, changed in place; ``valid`` is 1 if the estimate is valid.
        m: measurement.

    Example:
        >>> import numpy as np
        >>> from shaftline.observers import ESTIMATE
        >>> from shaftline.plant import load_ship
        >>> observer = get_observer("power-balance").discretise(load_ship("frigate"), dt=0.05)
        >>> estimate = np.zeros(1, ESTIMATE)[0]
        >>> round(update(observer, estimate, Measurement(10.0, 1.4e5, 1.3, 0.0, 0.0)), 2)
        6.8
        >>> int(estimate["valid"])
        1
    """
    if observer.uses_instruments != 0 and not is_plausible(m):
        estimate.started = 0
        estimate.valid = 0
        return float(estimate.advance_velocity)
    velocity, valid = _dispatch(observer, estimate, m)
    if observer.uses_instruments != 0:
        known = estimate.valid != 0 and estimate.shaft_speed * m.shaft_speed > 0.0
        valid = valid and torque_determines_inflow(
            observer.ship, velocity, m.shaft_speed, m.pitch_ratio, known
        )
    store_sample(estimate, m, velocity, valid and pitch_is_known(observer.ship, m.pitch_ratio))
    return velocity
