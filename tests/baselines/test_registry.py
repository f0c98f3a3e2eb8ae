"""Controllers by name, with options."""

from __future__ import annotations

import pytest

import shaftline.baselines
from shaftline.baselines import (
    AntiSpin,
    Combinator,
    Controller,
    ControllerError,
    SpeedPilot,
    controller_names,
    make_controller,
)
from shaftline.core.discovery import classes_in
from shaftline.plant import Ship, ShipError, load_ship

NAMES = [
    "combinator",
    "combinator-trimmed",
    "cpp-optimiser",
    "anti-spin",
    "no-anti-spin",
    "speed-pilot",
    "va-pitch",
    "va-pitch-silent",
]


def test_names_are_in_order_and_each_is_a_class_of_the_folder() -> None:
    assert controller_names() == NAMES
    found = classes_in(shaftline.baselines.__name__, Controller)  # type: ignore[type-abstract]
    names = [name for cls in found for name in (cls.name, *cls.variants)]
    assert sorted(names) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_built_with_a_ship_and_an_interval(name: str) -> None:
    ferry = load_ship("ferry")
    controller = make_controller(name, ferry, 0.25)
    assert isinstance(controller, Controller)
    assert (controller.ship, controller.interval_s) == (ferry, 0.25)
    assert name in (controller.name, *controller.variants)


def test_a_variant_is_the_same_with_another_option(frigate: Ship) -> None:
    switches = {}
    for name in ("anti-spin", "no-anti-spin"):
        controller = make_controller(name, frigate, 0.5)
        assert isinstance(controller, AntiSpin)
        switches[name] = int(controller.settings["anti_spin"])
    assert switches == {"anti-spin": 1, "no-anti-spin": 0}
    with pytest.raises(ControllerError, match="multiple values"):
        make_controller("no-anti-spin:anti_spin=1", frigate, 0.5)


def test_options_are_numbers_by_name(frigate: Ship) -> None:
    pilot = make_controller("speed-pilot:speed_gain=3,torque_gain=0.5", frigate, 0.5)
    assert isinstance(pilot, SpeedPilot)
    assert pilot.settings.torque_gain == 0.5
    combinator = make_controller("combinator:response_s=6,", frigate, 0.5)
    plain = make_controller("combinator:", frigate, 0.5)
    assert isinstance(combinator, Combinator)
    assert isinstance(plain, Combinator)
    assert combinator.governor.gains.proportional[0] < plain.governor.gains.proportional[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "autopilot",
            "unknown controller 'autopilot'; known: combinator, combinator-trimmed, cpp-optimiser",
        ),
        ("combinator:foo=1", "'combinator:foo=1': .*foo"),
        ("anti-spin:foo=1", "'anti-spin:foo=1': .*foo"),
        ("combinator:response_s", "option 'response_s' must be name=number"),
        ("combinator:response_s=fast", "option 'response_s=fast' must be name=number"),
        ("combinator:3", "option '3' must be name=number"),
    ],
)
def test_what_does_not_fit_is_named(frigate: Ship, text: str, words: str) -> None:
    with pytest.raises(ControllerError, match=words):
        make_controller(text, frigate, 0.5)


@pytest.mark.parametrize("name", NAMES)
def test_a_ship_without_a_diesel_is_refused(name: str) -> None:
    with pytest.raises((ShipError, ValueError), match=r"tito-neri-sine: .*(diesel|pitch)"):
        make_controller(name, load_ship("tito-neri-sine"), 0.5)
