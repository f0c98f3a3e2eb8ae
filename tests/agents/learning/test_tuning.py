"""Constants searched for: they gain on fresh episodes, what is given stays, and a search repeats."""

from __future__ import annotations

from typing import Any

import pytest

from shaftline.agents.learning.tuning import tune
from shaftline.baselines import ControllerError
from shaftline.baselines.registry import read_options
from shaftline.envs import get_task

pytest.importorskip("cma")
QUICK: dict[str, Any] = {"rounds": 3, "episodes": 3, "episode_s": 60.0, "threads": 1}


def test_a_search_gains_and_repeats() -> None:
    """The untuned pilot follows a new speed order slowly, so any search finds faster gains."""
    text = "speed-pilot:torque_gain=0,pitch_gain=0"
    found = tune(text, "acceleration", ranges={"speed_gain": (0.5, 16.0)}, **QUICK)
    assert found.fresh > found.untuned
    name, options = read_options(found.controller)
    assert name == "speed-pilot"
    assert options["torque_gain"] == options["pitch_gain"] == 0.0  # given, so they stay
    assert options["speed_gain"] > 2.0
    assert set(options) == {"torque_gain", "pitch_gain", "speed_gain"}
    assert tune(text, "acceleration", ranges={"speed_gain": (0.5, 16.0)}, **QUICK) == found


def test_a_task_that_is_not_in_the_package_decides_by_its_own_goals() -> None:
    """A goal of a rack that rests asks for a small gain, where the speed asks for a large one."""
    ranges = {"speed_gain": (0.5, 16.0)}
    own = get_task("acceleration").model_dump(exclude_none=True)
    own["goals"] = {"rack_travel_mm": {"within": 0.0, "margin": 1.0}}
    gains = [
        read_options(tune("speed-pilot", task, ranges=ranges, **QUICK).controller)[1]["speed_gain"]
        for task in (own, get_task("acceleration"))
    ]
    assert gains[0] < gains[1]


def test_what_a_variant_sets_is_not_searched_for() -> None:
    name, options = read_options(tune("combinator-trimmed", "transit", **QUICK).controller)
    assert (name, set(options)) == ("combinator-trimmed", {"response_s", "va_weight"})


def test_the_helmsman_of_a_task_with_a_rudder_is_searched_too() -> None:
    found = tune("combinator-trimmed", "course-keeping", **QUICK)
    helmsman, propulsion = map(read_options, found.controller.split("+"))
    assert helmsman[0] == "autopilot"
    assert set(helmsman[1]) == {"gain", "reset_lengths", "turn_deg"}
    assert set(propulsion[1]) == {"response_s", "va_weight"}
    ranges = {"gain": (1.0, 2.0)}
    found = tune("autopilot:turn_deg=9+va-pitch", "course-keeping", ranges=ranges, **QUICK)
    helmsman, propulsion = map(read_options, found.controller.split("+"))
    assert set(helmsman[1]) == {"gain", "turn_deg"}
    assert helmsman[1]["turn_deg"] == 9.0
    assert 1.0 <= helmsman[1]["gain"] <= 2.0
    assert propulsion == ("va-pitch", {})


def test_what_a_search_cannot_do_is_refused() -> None:
    with pytest.raises(ControllerError, match="unknown controller 'helm'"):
        tune("helm", "acceleration", **QUICK)
    with pytest.raises(ControllerError, match=r"own_controller:Steady.*no constant"):
        tune("examples.own_controller:Steady", "acceleration", **QUICK)
    with pytest.raises(ValueError, match=r"range of speed_gain: 3\.0 to 3\.0"):
        tune("speed-pilot", "acceleration", ranges={"speed_gain": (3.0, 3.0)}, **QUICK)
    with pytest.raises(ControllerError, match="option 'weight' is unknown"):
        tune("speed-pilot:weight=1", "acceleration", ranges={"speed_gain": (1.0, 3.0)}, **QUICK)
    with pytest.raises(ControllerError, match="option 'weight' is unknown"):
        tune("speed-pilot", "acceleration", ranges={"weight": (1.0, 3.0)}, **QUICK)


def test_a_candidate_that_oscillates_in_calm_water_is_refused() -> None:
    """On this ship the loop of the speed pilot is stable up to a shaft gain of about 1.9."""
    options: dict[str, Any] = {**QUICK, "rounds": 1}
    with pytest.raises(
        ControllerError, match=r"best candidates of all 1 generations oscillate in calm"
    ):
        tune("speed-pilot", "transit", ranges={"shaft_gain": (7.0, 9.0)}, **options)
    found = tune("speed-pilot", "transit", ranges={"shaft_gain": (0.1, 3.0)}, **QUICK)
    assert read_options(found.controller)[1]["shaft_gain"] < 1.9
