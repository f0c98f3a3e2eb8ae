"""Linear loops of controllers on their ships."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.baselines import (
    Autopilot,
    Combinator,
    TrackKeeper,
    controller_loop,
    helmsman_loop,
    make_controller,
)
from shaftline.baselines.controller import Measurements
from shaftline.baselines.loops import linear_plant, linearise_controller, observe, settle_controller
from shaftline.plant import Ship, Voyage, approach, load_ship


def test_the_combinator_s_loop_is_its_governor_s(frigate: Ship) -> None:
    """The closed-loop pole is exp(-h / T), with a small effect of the ship speed."""
    combinator = Combinator(frigate, 0.5)
    rest = settle_controller(combinator, 8.0)
    law = linearise_controller(combinator, rest)
    shaft = law.input_labels.index("shaft_speed")
    gains = combinator.governor.gains
    here = rest.point.state.shaft_speed
    proportional, integral = (np.interp(here, gains.shaft_speed, part) for part in gains[1:])
    assert law.D[1, shaft] == pytest.approx(-(proportional + integral), rel=1e-6)
    loop = controller_loop(combinator, 8.0)
    assert loop.stable
    assert loop.interval == 0.5
    crossover = loop.margins().crossover
    assert crossover == pytest.approx(1.0 / 2.0, rel=0.2)  # T of 2 s


def test_the_linearised_controller_is_the_controller(frigate: Ship) -> None:
    """At small random measurements the linear controller gives the commands of the pilot."""
    pilot = make_controller("speed-pilot", frigate, 0.5)
    rest = settle_controller(pilot, 7.0)
    law = linearise_controller(pilot, rest)
    rng = np.random.default_rng(1)
    names = [Measurements._fields.index(name) for name in law.input_labels]
    memory, states = rest.memory[None].copy(), np.zeros(len(rest.memory))
    still, _ = pilot.act(Measurements(*rest.observation[:, None]), rest.memory[None].copy())
    for _ in range(20):
        signals = rest.observation.copy()
        small = 1e-5 * np.abs(signals[names]) * rng.standard_normal(len(names))
        signals[names] += small
        pitch, rack = pilot.act(Measurements(*signals[:, None]), memory)
        expected = law.C @ states + law.D @ small
        states = law.A @ states + law.B @ small
        assert pitch[0] - still[0] == pytest.approx(expected[0], abs=1e-9)
        assert rack[0] - rest.point.inputs.drive == pytest.approx(expected[1], abs=1e-6)


@pytest.mark.parametrize("name", ["combinator-trimmed", "cpp-optimiser", "va-pitch"])
def test_controllers_that_hold_the_speed_come_to_rest_at_the_order(name: str) -> None:
    loop = controller_loop(make_controller(name, load_ship("frigate-at-sea"), 0.5), 8.0)
    assert loop.stable
    assert loop.step_measures().last_value == pytest.approx(1.0, abs=1e-4)


def test_an_unstable_controller_is_linearised_at_its_steady_state(frigate: Ship) -> None:
    """A limit cycle whose commands are equal at two instants is no steady state."""
    usual, wild = Combinator(frigate), Combinator(frigate)
    factor, gains = 50.0, usual.governor.gains
    wild.governor.gains = gains._replace(
        proportional=factor * gains.proportional, integral=factor * gains.integral
    )
    rest, own = settle_controller(wild, 8.0), settle_controller(usual, 8.0)
    assert rest.point.inputs.drive == pytest.approx(own.point.inputs.drive, abs=1e-6)
    assert rest.memory == pytest.approx(own.memory, abs=1e-6)
    loop = controller_loop(wild, 8.0)
    assert not loop.stable
    margin = controller_loop(usual, 8.0).margins().gain_margin_dB - 20.0 * math.log10(factor)
    assert loop.lacking_margins().gain_margin_dB == pytest.approx(margin, abs=1e-4)


def test_the_step_is_that_of_the_ship_under_the_controller(frigate: Ship) -> None:
    """A small step of the order: the simulation agrees with the linear loop."""
    pilot = make_controller("speed-pilot", frigate, 0.5)
    rest = settle_controller(pilot, 8.0)
    time, answer = controller_loop(pilot, 8.0).step()
    voyage = Voyage(frigate, rest.point.state, rest.point.inputs.drive)
    signals, memory, speeds = rest.observation.copy(), rest.memory[None].copy(), []
    for _ in range(400):
        speeds.append(voyage.state.ship_speed)
        signals[0] = 8.02
        pitch, rack = pilot.act(Measurements(*signals[:, None]), memory)
        voyage.run(float(rack[0]), float(pitch[0]), 0.0, round(0.5 / frigate.time_step_s))
        signals = observe(voyage, 8.02)
    found = (np.array(speeds) - rest.point.state.ship_speed) / 0.02
    np.testing.assert_allclose(found, answer[: len(found)], atol=0.01)
    assert time[1] == 0.5
    assert found.max() > 1.15


def test_loops_of_helmsmen_include_sway_gear_and_interval() -> None:
    ship = load_ship("ddg-51-surrogate")
    course = helmsman_loop(Autopilot(ship, 0.5, 11.318))
    track = helmsman_loop(TrackKeeper(ship, 0.5, 11.318))
    assert course.stable
    assert track.stable
    assert course.margins().phase_margin_deg == pytest.approx(69.37, abs=0.05)
    assert track.margins().gain_margin_dB == pytest.approx(11.71, abs=0.05)
    slow = helmsman_loop(Autopilot(ship, 5.0, 11.318)).margins().phase_margin_deg
    crossover = course.margins().crossover
    lost = course.margins().phase_margin_deg - slow
    # A command is held for an interval, on average half an interval late.
    assert lost == pytest.approx(math.degrees(0.5 * 4.5 * crossover), rel=0.15)


def test_outputs_of_a_ship_that_turns() -> None:
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 11.0)
    plant = linear_plant(ship, point)
    assert {"fuel_rack", "heading", "cross_track"} <= {*plant.output_labels}
    s = 0.02 + 0.05j
    by_rudder = plant[["heading", "sway_speed", "cross_track"], "rudder_command"](s)
    heading, sway, track = np.asarray(by_rudder).reshape(-1)
    assert track == pytest.approx((11.0 * heading + sway) / s, rel=1e-6)
    drive = plant["fuel_rack", "drive"](s)
    assert complex(np.asarray(drive).reshape(())) == pytest.approx(1.0)


def test_a_controller_that_cannot_be_linearised_is_refused(frigate: Ship) -> None:
    with pytest.raises(ValueError, match="anti-spin: the controller cannot be linearised"):
        controller_loop(make_controller("anti-spin", frigate, 0.5), 8.0)
