"""A controller that oscillates in calm water is reported with its margins; a stable one is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents import Setting
from shaftline.agents.evaluation.stability import (
    Oscillation,
    _lasting,
    calm_setting,
    check_stability,
    find_oscillation,
    margins,
)
from shaftline.baselines import Combinator, controller_loop, make_controller, make_steering
from shaftline.plant import load_ship

FRIGATE = load_ship("frigate")
CELL = Setting("x", "transit", "state-6", "random-walk-kalman", seeds=2)


def hot(factor: float) -> Combinator:
    """Return a combinator with multiplied gains of its governor."""
    made = Combinator(FRIGATE, 0.5)
    k = made.governor.gains
    made.governor.gains = k._replace(
        proportional=factor * k.proportional, integral=factor * k.integral
    )
    return made


def test_fifty_times_the_gain_of_the_governor() -> None:
    found = find_oscillation(CELL, hot(50.0))
    assert found is not None
    assert found.command == "drive"
    assert found.swing > 0.5
    assert found.period_s == pytest.approx(1.3, abs=0.5)  # two or three control intervals
    assert "fuel rack command oscillates" in found.sentence
    numbers, sentence = margins(hot(50.0), found)
    usual = controller_loop(hot(1.0), found.speed_order_m_s).margins().gain_margin_dB
    assert numbers["gain_margin_dB"] == pytest.approx(usual - 20.0 * np.log10(50.0), abs=0.01)
    assert numbers["delay_margin_s"] is None
    assert "the linear loop is unstable" in sentence


def test_the_check_agrees_with_the_linear_loop_about_the_limit() -> None:
    limit = 10.0 ** (controller_loop(hot(1.0), 8.0).margins().gain_margin_dB / 20.0)
    assert find_oscillation(CELL, hot(0.85 * limit)) is None
    assert find_oscillation(CELL, hot(1.3 * limit)) is not None


@pytest.mark.parametrize(
    ("text", "command"),
    [("speed-pilot:shaft_gain=7.5", "drive"), ("speed-pilot:pitch_gain=35", "pitch_command")],
)
def test_fifty_times_the_gain_of_a_speed_pilot(text: str, command: str) -> None:
    pilot = make_controller(text, FRIGATE, 0.5)
    found = find_oscillation(CELL, pilot)
    assert found is not None
    assert found.command == command
    assert (margins(pilot, found)[0]["gain_margin_dB"] or 0.0) < -10.0


@pytest.mark.parametrize(
    "text", ["combinator", "combinator-trimmed", "cpp-optimiser", "speed-pilot"]
)
def test_packaged_controllers_come_to_rest(text: str) -> None:
    assert find_oscillation(CELL, make_controller(text, FRIGATE, 0.5)) is None


def test_a_helmsman_with_too_much_gain() -> None:
    ship = load_ship("frigate-turning")
    cell = Setting("x", "course-keeping", "task", "none", seeds=1)
    assert find_oscillation(cell, make_steering("autopilot", ship, 0.5)) is None
    wild = make_steering("autopilot:gain=60", ship, 0.5)
    found = find_oscillation(cell, wild)
    assert found is not None
    assert found.command == "rudder_command"
    assert "margin" in margins(wild, found)[1]


def test_verdicts_are_kept_and_do_not_depend_on_the_sea(tmp_path: Path) -> None:
    made: list[Setting] = []

    def make(setting: Setting) -> Combinator:
        made.append(setting)
        return hot(50.0)

    (verdict,) = check_stability([CELL], make, tmp_path, jobs=1)
    assert not verdict.stable
    assert verdict.numbers["gain_margin_dB"] < -10.0
    again = check_stability([Setting(**{**vars(CELL), "sea": "calm"})], make, tmp_path, jobs=1)
    assert again == [verdict]
    assert len(made) == 1


def test_margins_of_what_cannot_be_linearised() -> None:
    class Policy:
        def predict(self, observation: Any, *_: Any, **__: Any) -> Any: ...

    numbers, sentence = margins(Policy(), Oscillation("drive", 7.0, 0.5, 1.0, 1.0))  # type: ignore[arg-type]
    assert set(numbers.values()) == {None}
    assert "only a classic controller" in sentence


def test_an_oscillation_of_a_stable_loop_has_positive_margins() -> None:
    numbers, sentence = margins(hot(1.0), Oscillation("drive", 8.0, 0.5, 1.0, 1.0))
    assert numbers["gain_margin_dB"] == pytest.approx(19.13, abs=0.05)
    assert "limits, rates or dead times cause the oscillation" in sentence


def test_orders_of_a_profile_set_the_range_of_the_check() -> None:
    own = Setting("x", "transit", "task", "none", 2, order_profile=((0.0, 4.0), (5.0, 6.5)))
    assert calm_setting(own).model.speed_order_m_s == (4.0, 6.5)
    assert calm_setting(own).order_profile is None
    fast = calm_setting(replace(own, ship="ferry", order_profile=((0.0, 4.0), (5.0, 9.0)))).model
    assert fast.scale_orders(load_ship("ferry")).speed_order_m_s == (4.0, 9.0)
    assert calm_setting(CELL).model.speed_order_m_s == (7.0, 9.0)
    assert calm_setting(CELL).model.resistance_swing == 0.0


def test_what_counts_as_a_lasting_oscillation() -> None:
    time = np.arange(1800) * 0.5
    steady = 0.05 * np.sin(2.0 * np.pi * time / 10.0)
    swing, period, growth = _lasting(0.3 + steady, 0.5) or (0.0, 0.0, 0.0)
    assert (swing, period, growth) == pytest.approx((0.1, 10.0, 1.0), rel=0.04)
    growing = _lasting(steady * np.exp(time / 300.0), 0.5)
    assert growing is not None
    assert growing[2] == pytest.approx(np.e, rel=0.05)
    for calm in (
        np.full(1800, 0.5),  # at rest
        0.04 * steady,  # below 1 % of the range
        steady * np.exp(-time / 600.0),  # decays
        np.exp(-time / 200.0),  # settles without an oscillation
        0.5 * np.sin(2.0 * np.pi * time / 400.0),  # less than three cycles
        steady[:12],  # too short
    ):
        assert _lasting(calm, 0.5) is None
