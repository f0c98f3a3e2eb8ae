"""Controllers by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..plant.ship import Ship
from .anti_spin import AntiSpin
from .combinator import Combinator
from .controller import Controller
from .cpp_optimiser import CppOptimiser
from .speed_pilot import SpeedPilot


class ControllerError(ValueError):
    """A controller or option that does not exist; the message lists those that do."""


def _without_anti_spin(*arguments: Any, **options: Any) -> Controller:
    return AntiSpin(*arguments, anti_spin=False, **options)


CONTROLLERS: dict[str, Callable[..., Controller]] = {
    "combinator": Combinator,
    "cpp-optimiser": CppOptimiser,
    "anti-spin": AntiSpin,
    "no-anti-spin": _without_anti_spin,
    "speed-pilot": SpeedPilot,
}
"""Classic controllers, each called with a ship and a control interval [s]."""


def make_controller(text: str, ship: Ship, interval_s: float) -> Controller:
    """A controller from ``NAME`` or ``NAME:option=number,option=number``.

    Args:
        text: name and options, such as ``combinator:response_s=3``.
        ship: the ship that it is built for.
        interval_s: control interval [s].

    Raises:
        ControllerError: unknown name, or an option that the controller does not take.
    """
    name, _, rest = text.partition(":")
    if name not in CONTROLLERS:
        raise ControllerError(f"unknown controller {name!r}; known: {', '.join(CONTROLLERS)}")
    options: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, equals, value = item.partition("=")
        try:
            options[key] = float(value)
        except ValueError:
            raise ControllerError(f"{text!r}: option {item!r} must be name=number") from None
        if not equals:
            raise ControllerError(f"{text!r}: option {item!r} must be name=number")
    try:
        return CONTROLLERS[name](ship, interval_s, **options)
    except TypeError as error:
        raise ControllerError(f"{text!r}: {error}") from None
