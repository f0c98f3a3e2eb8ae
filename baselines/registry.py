"""Controllers and helmsmen by name: ours, a user's as ``module:Class``, those of installed packages.

A package offers its own by entry points of the group ``shaftline.controllers`` or
``shaftline.helmsmen``.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..core.discovery import classes_in, of_others, offered
from ..plant.ship import Ship
from .controller import Controller
from .helmsman import ShapedHelmsman
from .steering import SteeringController

CONTROLLERS, HELMSMEN = "shaftline.controllers", "shaftline.helmsmen"
"""Groups of entry points."""


class ControllerError(ValueError):
    """A controller or option that does not exist; the message lists those that do."""


_CLASSES = sorted(
    classes_in(__package__, Controller, but=("registry",)),  # type: ignore[type-abstract]
    key=lambda cls: (cls.source.casefold(), cls.name),
)
_KNOWN: dict[str, tuple[type[Controller], Mapping[str, Any]]] = {
    name: (cls, fixed)
    for cls in _CLASSES
    for name, fixed in [(cls.name, {}), *cls.variants.items()]
}


_HELMSMEN = {
    cls.name: cls
    for cls in classes_in(__package__, ShapedHelmsman, but=("registry",))  # type: ignore[type-abstract]
}


_LARGEST = 1e9
"""Size of an option of a controller at most, in its unit."""

_TIMES = 100.0
"""Times the upper end of the range of a search that an option may have."""


def helmsman_names() -> list[str]:
    """All that lay the rudder."""
    return [*_HELMSMEN, *offered(HELMSMEN)]


def make_helmsman(
    text: str, ship: Ship, interval_s: float, speed_m_s: float | None = None
) -> ShapedHelmsman:
    """A helmsman from ``NAME`` or ``NAME:option=number,option=number``.

    Args:
        text: name and options, such as ``autopilot:turn_deg=4``.
        ship: that turns.
        interval_s: control interval [s].
        speed_m_s: at which his loop is shaped [m/s]; that of a usual load by default.

    Raises:
        ControllerError: unknown name, or an option that he does not take.
        ShipError: a ship that cannot be steered.
    """
    name, options = read_options(text)
    kind = _HELMSMEN.get(name) or _of_others(name, HELMSMEN, "helmsman", helmsman_names())
    _refuse_absurd(text, kind, options)
    try:
        made: ShapedHelmsman = kind(ship, interval_s, speed_m_s, **options)
        return made
    except TypeError as error:
        raise ControllerError(f"{text!r}: {_in_own_words(error, kind, {})}") from None


def controller_names() -> list[str]:
    """All classic controllers and their variants, and those that installed packages offer."""
    return [*_KNOWN, *offered(CONTROLLERS)]


class About(NamedTuple):
    """A controller or helmsman in words.

    Args:
        words: what it does.
        source: where it is published.
        fixed: options that a variant sets.
        tunable: options that a search may set, with their ranges.
    """

    words: str
    source: str
    fixed: Mapping[str, Any]
    tunable: Mapping[str, tuple[float, float]]


def about(name: str) -> About:
    """What a controller or helmsman is.

    Args:
        name: of it.

    Raises:
        ControllerError: unknown name.
    """
    kind, fixed = (_HELMSMEN[name], {}) if name in _HELMSMEN else _known(name)
    words = (kind.__doc__ or "").split("\n\n")[0].replace("\n", " ").split(";")[0].rstrip(".")
    return About(words, getattr(kind, "source", ""), fixed, tunable(name))


def tunable(name: str) -> Mapping[str, tuple[float, float]]:
    """Options of a controller or helmsman that a search may set, with their ranges.

    What a variant sets is not among them.

    Raises:
        ControllerError: unknown name.
    """
    kind, fixed = (_HELMSMEN[name], {}) if name in _HELMSMEN else _known(name)
    own: Mapping[str, tuple[float, float]] = getattr(kind, "tunable", {})
    return {key: ends for key, ends in own.items() if key not in fixed}


def make_controller(text: str, ship: Ship, interval_s: float) -> Controller:
    """A controller from ``NAME`` or ``NAME:option=number,option=number``.

    Args:
        text: name and options, such as ``combinator:response_s=3``; one's own is named
            ``module:Class`` or ``module:Class:option=number``, and is any class that is called with a
            ship, the interval and its options and has stable-baselines3's ``predict``.
        ship: the ship that it is built for.
        interval_s: control interval [s].

    Raises:
        ControllerError: unknown name, or an option that the controller does not take.
    """
    name, options = read_options(text)
    kind, fixed = _known(name)
    _refuse_absurd(text, kind, options)
    try:
        return kind(ship, interval_s, **fixed, **options)
    except TypeError as error:
        raise ControllerError(f"{text!r}: {_in_own_words(error, kind, fixed)}") from None


def _in_own_words(error: TypeError, kind: Any, fixed: Mapping[str, Any]) -> str:
    """Return what is wrong with the options of a call, without the name of what was called."""
    if found := re.search(r"unexpected keyword argument '(.*)'", str(error)):
        own = [
            name
            for name, option in inspect.signature(kind).parameters.items()
            if isinstance(option.default, float) and name not in fixed
        ]
        known = f"known: {', '.join(own)}" if own else "it has none"
        return f"option {found[1]!r} is unknown; {known}"
    return re.sub(r"^[\w.<>]+\(\) ", "", str(error))


def _refuse_absurd(text: str, kind: Any, options: Mapping[str, float]) -> None:
    """Refuse options far beyond the range in which a search may set them, or of the wrong sign.

    Raises:
        ControllerError: names the option and its limits.
    """
    ranges: Mapping[str, tuple[float, float]] = getattr(kind, "tunable", {})
    for key, value in options.items():
        low, high = ranges.get(key, (-_LARGEST, _LARGEST))
        most = _TIMES * max(abs(low), abs(high)) if key in ranges else _LARGEST
        least = 0.0 if low >= 0.0 else -most
        if not least <= value <= most:
            usual = f"; usual are {low:g} to {high:g}" if key in ranges else ""
            raise ControllerError(
                f"{text!r}: option {key} = {value:g}: must be {least:g} to {most:g}{usual}"
            )


def read_options(text: str) -> tuple[str, dict[str, float]]:
    """Name and options of ``NAME:option=number,option=number``; the name may be ``module:Class``.

    Raises:
        ControllerError: an option that is no number.
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
            raise ControllerError(f"{text!r}: option {item!r} must be name=number") from None
        if not math.isfinite(number):
            raise ControllerError(f"{text!r}: option {item!r} must be a finite number")
        if key in options:
            raise ControllerError(f"{text!r}: option {key!r} stands twice")
        options[key] = number
    return name, options


def _known(name: str) -> tuple[type[Controller], Mapping[str, Any]]:
    if name in _KNOWN:
        return _KNOWN[name]
    return _of_others(name, CONTROLLERS, "controller", controller_names()), {}


def _of_others(name: str, group: str, what: str, known: list[str]) -> Any:
    try:
        found = of_others(name, group)
    except ValueError as error:
        raise ControllerError(f"{what} {error}") from None
    if found is None:
        raise ControllerError(
            f"unknown {what} {name!r}; known: {', '.join(known)}, or your own as module:Class"
        )
    if not callable(found) or not hasattr(found, "predict"):
        raise ControllerError(f"{what} {name}: must be a class with a method predict")
    return found


def make_steering(text: str, ship: Ship, interval_s: float) -> SteeringController:
    """A whole controller from ``HELMSMAN+CONTROLLER``, each with its options.

    Args:
        text: such as ``autopilot:gain=2+speed-pilot``; without a second part the speed pilot sails.
        ship: that turns, with a diesel.
        interval_s: control interval [s].

    Raises:
        ControllerError: an unknown name, or an option that is not taken.
        ShipError: a ship that cannot be steered.
    """
    helmsman, *propulsion = joined_names(text)
    return SteeringController(
        make_controller("+".join(propulsion) or "speed-pilot", ship, interval_s),
        make_helmsman(helmsman, ship, interval_s),
    )


def joined_names(text: str) -> list[str]:
    """Return the parts of ``HELMSMAN+CONTROLLER``, each with its options; one part without a plus."""
    return re.split(r"\+(?=[A-Za-z_])", text)  # the plus of 1e+3 joins nothing
