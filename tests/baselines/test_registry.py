"""Registry of the controllers: names and options."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import shaftline.baselines
from shaftline.baselines import (
    AntiSpin,
    Combinator,
    Controller,
    ControllerError,
    SpeedPilot,
    controller_names,
    helmsman_names,
    make_controller,
)
from shaftline.baselines.registry import describe, tunable
from shaftline.core.discovery import classes_in
from shaftline.plant import Ship, ShipError, load_ship

NAMES = [
    "combinator",
    "combinator-trimmed",
    "cpp-optimiser",
    "cpp-optimiser-at-actual",
    "anti-spin",
    "no-anti-spin",
    "anti-spin-overspeed",
    "mpc",
    "mpc-preview",
    "speed-pilot",
    "va-pitch",
    "va-pitch-silent",
    "va-pitch-preview",
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
        switches[name] = int(controller.settings["law"]["anti_spin"])
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
        ("combinator:response_s", "option 'response_s' must have the form name=number"),
        ("combinator:response_s=fast", "option 'response_s=fast' must have the form name=number"),
        ("combinator:3", "option '3' must have the form name=number"),
    ],
)
def test_invalid_options_are_refused(frigate: Ship, text: str, words: str) -> None:
    with pytest.raises(ControllerError, match=words):
        make_controller(text, frigate, 0.5)


@pytest.mark.parametrize("name", NAMES)
def test_a_ship_without_a_diesel_is_refused(name: str) -> None:
    with pytest.raises((ShipError, ValueError), match=r"tito-neri-sine: .*(diesel|pitch)"):
        make_controller(name, load_ship("tito-neri-sine"), 0.5)


LAW = """
import numpy as np

class HalfAhead:
    def __init__(self, ship, interval_s, rack=0.0):
        self.action = np.float32([0.0, rack])

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.tile(self.action, (len(observation), 1)), state

class NoLaw:
    pass
"""


def test_a_controller_of_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frigate: Ship
) -> None:
    (tmp_path / "laws_of_a_test.py").write_text(LAW)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    made = make_controller("laws_of_a_test:HalfAhead:rack=0.25", frigate, 0.5)
    action, _ = made.predict([[0.0] * 8] * 3)
    assert action.tolist() == [[0.0, 0.25]] * 3
    assert (
        make_controller("laws_of_a_test:HalfAhead", frigate, 0.5).predict([[0.0] * 8])[0][0, 1] == 0
    )
    assert tunable("laws_of_a_test:HalfAhead") == {}
    for text, found in (
        ("laws_of_a_test:NoLaw", "must be a class with a method predict"),
        ("laws_of_a_test:NoClass", "has no attribute 'NoClass'"),
        ("laws_of_a_test:HalfAhead:rock=1", "option 'rock' is unknown"),
        ("nowhere_at_all:Law", "No module named 'nowhere_at_all'"),
    ):
        with pytest.raises(ControllerError, match=found):
            make_controller(text, frigate, 0.5)


@pytest.mark.parametrize("name", [*NAMES, *helmsman_names()])
def test_each_has_a_summary_and_a_source(name: str) -> None:
    found = describe(name)
    assert len(found.summary) > 15
    assert ";" not in found.summary
    assert found.source
    assert not set(found.fixed) & set(found.tunable)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "va-pitch:speed_gain=-1e300",
            "speed_gain = -1e+300: must be 0 to 1600; the tuning range is 0.25 to 16",
        ),
        ("va-pitch:speed_gain=-1", "speed_gain = -1: must be 0 to 1600"),
        ("speed-pilot:pitch_offset=-31", "must be -30 to 30"),
        ("combinator:trim_s=1e5", "must be 0 to 10000"),
        ("anti-spin:top_speed=1e300", "must be -1e+09 to 1e+09"),
    ],
)
def test_an_absurd_option_is_refused_with_its_range(text: str, words: str) -> None:
    with pytest.raises(ControllerError, match=re.escape(words)):
        make_controller(text, load_ship("frigate"), 0.5)
