"""Registry of controllers and helmsmen: those of this package, of installed packages, and your own.

A class of your own is named ``module:Class``. A package registers its classes through entry points of
the groups ``shaftline.controllers`` and ``shaftline.helmsmen``.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..core.discovery import classes_in, entry_point_names, load_external_class
from ..plant.ship import Ship
from .controller import Controller, Ranges
from .helmsman import ShapedHelmsman
from .steering import SteeringController

CONTROLLERS, HELMSMEN = "shaftline.controllers", "shaftline.helmsmen"  # groups of entry points


class ControllerError(ValueError):
    """Unknown controller, helmsman or option, or an option out of range."""


_CLASSES = sorted(
    classes_in(__package__, Controller, but=("registry",)),  # type: ignore[type-abstract]
    key=lambda cls: (cls.source.casefold(), cls.name),
)
_KNOWN: dict[str, tuple[type[Controller], Mapping[str, Any]]] = {
    name: (cls, set_by_variant)
    for cls in _CLASSES
    for name, set_by_variant in {cls.name: {}, **cls.variants}.items()
}
_HELMSMEN: dict[str, tuple[type[ShapedHelmsman], Mapping[str, Any]]] = {
    cls.name: (cls, {})
    for cls in classes_in(__package__, ShapedHelmsman, but=("registry",))  # type: ignore[type-abstract]
}


_LARGEST = 1e9  # largest absolute value of an option without a tuning range, in its unit
_LARGEST_FACTOR = 100.0  # largest value of an option over the upper end of its tuning range [-]


def helmsman_names() -> list[str]:
    """Return the names of all helmsmen, those of installed packages last.

    Example:
        >>> helmsman_names()[:2]
        ['autopilot', 'track-keeper']
    """
    return [*_HELMSMEN, *entry_point_names(HELMSMEN)]


def make_helmsman(
    text: str, ship: Ship, interval_s: float, speed_m_s: float | None = None
) -> ShapedHelmsman:
    """Return a helmsman from ``NAME`` or ``NAME:option=number,option=number``.

    Args:
        text: name and options, such as ``autopilot:turn_deg=4``.
        ship: ship that turns.
        interval_s: control interval [s].
        speed_m_s: design speed [m/s]; that at 60 % of the highest drive command by default.

    Raises:
        ControllerError: the name or an option is unknown, or an option is out of range.
        ShipError: the ship cannot be steered.

    Example:
        >>> from shaftline.plant import load_ship
        >>> helmsman = make_helmsman("track-keeper:gain=2", load_ship("frigate-turning"), 0.5)
        >>> helmsman.change_lengths
        38.0
    """
    made: ShapedHelmsman = _make(text, "helmsman", ship, interval_s, speed_m_s)
    return made


def controller_names() -> list[str]:
    """Return the names of all controllers and variants, those of installed packages last.

    Example:
        >>> "combinator-trimmed" in controller_names()
        True
    """
    return [*_KNOWN, *entry_point_names(CONTROLLERS)]


class Description(NamedTuple):
    """Description of a controller or helmsman."""

    summary: str  # what it does, one sentence
    source: str  # publication
    fixed: Mapping[str, Any]  # options that a variant sets
    tunable: Ranges  # options that can be tuned, with their ranges


def describe(name: str) -> Description:
    """Return the description of a controller or helmsman, by registered name or ``module:Class``.

    Raises:
        ControllerError: unknown name.

    Example:
        >>> describe("autopilot").source
        'Taylor 2000, section 5.2'
    """
    kind, fixed = _find_class(name)
    summary = " ".join((kind.__doc__ or "").split("\n\n")[0].split()).rstrip(".")
    return Description(summary, getattr(kind, "source", ""), fixed, tunable(name))


def tunable(name: str) -> Mapping[str, tuple[float, float]]:
    """Return the options of a controller or helmsman that can be tuned, less those that a variant sets.

    Raises:
        ControllerError: unknown name.

    Example:
        >>> tunable("combinator-trimmed")
        {'response_s': (1.0, 20.0), 'va_weight': (0.0, 1.0)}
    """
    kind, fixed = _find_class(name)
    own: Ranges = getattr(kind, "tunable", {})
    return {key: ends for key, ends in own.items() if key not in fixed}


def make_controller(text: str, ship: Ship, interval_s: float) -> Controller:
    """Return a controller from ``NAME`` or ``NAME:option=number,option=number``.

    Args:
        text: name and options, such as ``combinator:response_s=3``. A class of your own is named
            ``module:Class`` or ``module:Class:option=number``: any class that is called with a ship, the
            control interval and its options, and has the ``predict`` method of stable-baselines3.
        ship: ship for which the controller is built.
        interval_s: control interval [s].

    Raises:
        ControllerError: the name or an option is unknown, or an option is out of range.

    Example:
        >>> from shaftline.plant import load_ship
        >>> make_controller("combinator:trim_s=30", load_ship("frigate"), 0.5).trim_s
        30.0
    """
    made: Controller = _make(text, "controller", ship, interval_s)
    return made


def _make(text: str, what: str, *given: Any) -> Any:
    """Construct a controller or helmsman with the given arguments and the options of the text."""
    name, options = read_options(text)
    kind, fixed = _find_class(name, what)
    _check_ranges(text, kind, options)
    try:
        return kind(*given, **fixed, **options)
    except TypeError as error:
        raise ControllerError(f"{text!r}: {_explain_error(error, kind, fixed)}") from None


def _explain_error(error: TypeError, kind: Any, fixed: Mapping[str, Any]) -> str:
    """Return the reason of a TypeError of a constructor, without the name of the function."""
    if found := re.search(r"unexpected keyword argument '(.*)'", str(error)):
        options = inspect.signature(kind).parameters.items()
        own = [name for name, o in options if isinstance(o.default, float) and name not in fixed]
        own += [name for name in getattr(kind, "tunable", {}) if name not in {*own, *fixed}]
        known = f"known: {', '.join(own)}" if own else "it has none"
        return f"option {found[1]!r} is unknown; {known}"
    return re.sub(r"^[\w.<>]+\(\) ", "", str(error))


def _check_ranges(text: str, kind: Any, options: Mapping[str, float]) -> None:
    """Refuse options that are far outside their tuning range, or of the wrong sign."""
    ranges: Ranges = getattr(kind, "tunable", {})
    for key, value in options.items():
        low, high = ranges.get(key, (-_LARGEST, _LARGEST))
        most = _LARGEST_FACTOR * max(abs(low), abs(high)) if key in ranges else _LARGEST
        least = 0.0 if low >= 0.0 else -most
        if not least <= value <= most:
            usual = f"; the tuning range is {low:g} to {high:g}" if key in ranges else ""
            raise ControllerError(
                f"{text!r}: option {key} = {value:g}: must be {least:g} to {most:g}{usual}"
            )


def read_options(text: str) -> tuple[str, dict[str, float]]:
    """Return name and options of ``NAME:option=number,...``; the name may be ``module:Class``.

    Raises:
        ControllerError: the value of an option is no finite number, or an option is repeated.

    Example:
        >>> read_options("combinator:response_s=3,trim_s=30")
        ('combinator', {'response_s': 3.0, 'trim_s': 30.0})
    """
    name, _, rest = text.partition(":")
    place, _, behind = rest.partition(":")
    if place and "=" not in place and name not in {*_KNOWN, *_HELMSMEN}:
        name, rest = f"{name}:{place}", behind
    options: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, _, value = item.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise ControllerError(
                f"{text!r}: option {item!r} must have the form name=number, such as gain=2"
            ) from None
        if not math.isfinite(number):
            raise ControllerError(f"{text!r}: option {item!r} must be a finite number")
        if key in options:
            raise ControllerError(f"{text!r}: option {key!r} is given twice")
        options[key] = number
    return name, options


def _find_class(name: str, what: str = "") -> tuple[Any, Mapping[str, Any]]:
    """Return the class of a name or ``module:Class``, and the options that a variant sets.

    ``what`` is ``controller`` or ``helmsman``; by default either, and a controller if it is external.
    """
    if name in _HELMSMEN and what != "controller":
        return _HELMSMEN[name]
    if name in _KNOWN and what != "helmsman":
        return _KNOWN[name]
    what = what or "controller"
    group, known = CONTROLLERS, controller_names
    if what == "helmsman":
        group, known = HELMSMEN, helmsman_names
    try:
        found = load_external_class(name, group)
    except ValueError as error:
        raise ControllerError(f"{what} {error}") from None
    if found is None:
        raise ControllerError(
            f"unknown {what} {name!r}; known: {', '.join(known())}, or your own as module:Class"
        )
    if not callable(found) or not hasattr(found, "predict"):
        raise ControllerError(f"{what} {name}: must be a class with a method predict")
    return found, {}


def make_steering(text: str, ship: Ship, interval_s: float) -> SteeringController:
    """Return a steering controller from ``HELMSMAN+CONTROLLER``, each with its options.

    Without a second name the speed pilot sets pitch and fuel rack.

    Args:
        text: names and options, such as ``autopilot:gain=2+speed-pilot``.
        ship: ship that turns.
        interval_s: control interval [s].

    Raises:
        ControllerError: a name or an option is unknown, or an option is out of range.
        ShipError: the ship cannot be steered.

    Example:
        >>> from shaftline.plant import load_ship
        >>> steering = make_steering("autopilot:gain=2", load_ship("frigate-turning"), 0.5)
        >>> steering.propulsion.name
        'speed-pilot'
    """
    helmsman, *propulsion = split_steering_name(text)
    return SteeringController(
        make_controller("+".join(propulsion) or "speed-pilot", ship, interval_s),
        make_helmsman(helmsman, ship, interval_s),
    )


def split_steering_name(text: str) -> list[str]:
    """Return the parts of ``HELMSMAN+CONTROLLER``, each with its options; one part without a plus.

    Example:
        >>> split_steering_name("autopilot:gain=2+combinator")
        ['autopilot:gain=2', 'combinator']
    """
    return re.split(r"\+(?=[A-Za-z_])", text)  # not at the plus of a number such as 1e+3
