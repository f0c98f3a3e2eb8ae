"""Observers by name, and the one kernel that updates any of them."""

from __future__ import annotations

from collections.abc import Callable

from ..core.compiled import Record, compiled, spelled_out
from ..core.discovery import classes_in, of_others, offered
from .base import Observer, ObserverError, code_of
from .of_others import update_through_address
from .records import Measurement, is_plausible, pitch_is_known, remember
from .torque_curve import told_by_torque

OBSERVERS = "shaftline.observers"
"""Group of entry points by which packages offer observers of their own."""

_CLASSES = sorted(
    classes_in(__package__, Observer, but=("registry", "following", "of_others")),  # type: ignore[type-abstract]
    key=lambda cls: (cls.source.casefold(), cls.name),
)
_NAMED = {cls.name: cls for cls in _CLASSES if "name" in vars(cls)}
_UPDATES = {code_of(cls.update): cls.update for cls in _CLASSES}


def observer_names() -> list[str]:
    """All observers and tunings: ``name`` for the default, ``name-tuning`` for the others.

    Those that installed packages offer stand last.
    """
    names = []
    for name, cls in _NAMED.items():
        names.append(name)
        names.extend(f"{name}-{tuning}" for tuning in cls.tunings)
    return [*names, *offered(OBSERVERS)]


def _made(name: str, cls: type[Observer]) -> Observer:
    try:
        return cls()
    except TypeError as error:  # what its author left out
        raise ObserverError(f"observer {name!r}: {error}") from None


def get_observer(name: str, tuning: str | None = None) -> Observer:
    """An observer by name and tuning.

    Args:
        name: one of :func:`observer_names`, or a bare name with ``tuning`` beside it; one's own as
            ``module:Class``, a class that derives from :class:`.base.Observer` and is called without
            arguments.
        tuning: ``low``, ``moderate``, ``high`` or ``printed`` where the observer has it; the
            observer's default otherwise.

    Raises:
        ObserverError: unknown name or tuning.
    """
    cls = _NAMED[name] if name in _NAMED else of_others(name, OBSERVERS)
    if cls is not None:
        if not (isinstance(cls, type) and issubclass(cls, Observer)):
            raise ObserverError(f"observer {name!r}: not a class that derives from Observer")
        if tuning is None:
            return _made(name, cls)
        if tuning not in cls.tunings:
            known = ", ".join(cls.tunings) or "none, it has nothing to tune"
            raise ObserverError(f"observer {name!r} has no tuning {tuning!r}; tunings: {known}")
        return cls.tunings[tuning]
    bare, _, ending = name.rpartition("-")
    if tuning is None and bare in _NAMED and ending in _NAMED[bare].tunings:
        return get_observer(bare, ending)
    raise ObserverError(f"unknown observer {name!r}; known: {', '.join(observer_names())}")


_dispatch: Callable[[Record, Record, Measurement], tuple[float, bool]] = spelled_out(
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
"""The update of whichever observer a record is of."""


@compiled
def update(observer: Record, estimate: Record, m: Measurement) -> float:
    """Take one sample; gives the estimate of the advance velocity [m/s].

    Where a reading is not finite or beyond the signal registry's bounds, the estimate is held and
    flagged invalid; the observer starts afresh with the next good sample. Where the torque lies off
    the propeller's curve, the estimate is held at the curve's edge and flagged invalid; so is one at a
    pitch that the ship does not have.

    Args:
        observer: OBSERVER record.
        estimate: ESTIMATE record, changed in place; ``valid`` tells whether to trust the result.
        m: the instruments' readings.
    """
    if observer.reads_instruments != 0 and not is_plausible(m):
        estimate.started = 0
        estimate.valid = 0
        return float(estimate.advance_velocity)
    velocity, valid = _dispatch(observer, estimate, m)
    if observer.reads_instruments != 0:
        known = estimate.valid != 0 and estimate.shaft_speed * m.shaft_speed > 0.0
        valid = valid and told_by_torque(
            observer.ship, velocity, m.shaft_speed, m.pitch_ratio, known
        )
    remember(estimate, m, velocity, valid and pitch_is_known(observer.ship, m.pitch_ratio))
    return velocity
