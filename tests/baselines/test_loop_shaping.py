"""Loop shaping: the two loops of Taylor, and the discrete controller."""

from __future__ import annotations

import control
import numpy as np
import pytest

from shaftline.baselines.loop_shaping import (
    COURSE_LOOP,
    TAYLOR,
    TAYLOR_GEAR,
    TRACK_LOOP,
    Factors,
    ShapedController,
    heading_plant,
    shape_controller,
    steering_dynamics,
    track_plant,
)
from shaftline.plant import ShipError, approach, load_ship
from shaftline.plant.loops import Loop

COURSE, TRACK = heading_plant(TAYLOR, TAYLOR_GEAR), track_plant(TAYLOR, TAYLOR_GEAR)


def test_the_autopilot_is_the_one_that_follows_from_the_print() -> None:
    law = control.ss2tf(shape_controller(COURSE_LOOP, COURSE))
    np.testing.assert_allclose(law.num[0][0], [9.4544, 61.633, 29.412], rtol=1e-4)
    np.testing.assert_allclose(law.den[0][0], [1.0, 30.9839, 60.0], rtol=1e-5)
    found = Loop.from_plant(COURSE.system, shape_controller(COURSE_LOOP, COURSE))
    margins, step = found.margins(), found.step_measures()
    assert margins.gain_margin_dB == pytest.approx(29.82, abs=0.005)
    assert margins.phase_margin_deg == pytest.approx(64.41, abs=0.005)
    assert step.overshoot_percent == pytest.approx(4.81, abs=0.005)
    assert step.settling == pytest.approx(4.20, abs=0.005)


def test_the_track_controller_is_the_printed_one() -> None:
    law = shape_controller(TRACK_LOOP, TRACK)
    s = 0.3 + 0.8j
    printed = 20.0 * (s + 0.5) ** 2 * (s + 6.0) * (s + 1000.0)
    printed /= (s + 11.0) * (s + 15.0) * (s + 30.0) ** 2
    assert complex(law(s)) == pytest.approx(printed, rel=1e-6)
    assert law.nstates == 4  # the pole of the destroyer cancels
    found = Loop.from_plant(TRACK.system, law)
    assert found.margins().gain_margin_dB == pytest.approx(21.57, abs=0.005)
    assert found.margins().phase_margin_deg == pytest.approx(50.99, abs=0.005)
    assert found.step_measures().overshoot_percent == pytest.approx(28.46, abs=0.005)
    assert found.step_measures().settling == pytest.approx(6.84, abs=0.005)


@pytest.mark.parametrize(("name", "speed"), [("ddg-51-surrogate", 11.318), ("esso-osaka", 3.6)])
def test_any_ship_gets_the_same_loop(name: str, speed: float) -> None:
    ship = load_ship(name)
    own = steering_dynamics(ship, approach(ship, speed))
    for loop, plant, phase in (
        (COURSE_LOOP, heading_plant, 64.406),
        (TRACK_LOOP, track_plant, 50.99),
    ):
        found = Loop.from_plant(plant(*own).system, shape_controller(loop, plant(*own)))
        assert found.margins().phase_margin_deg == pytest.approx(phase, abs=1e-3)


def test_an_unstable_ship_is_refused_by_name() -> None:
    ship = load_ship("kvlcc2")
    own = steering_dynamics(ship, approach(ship, 1.18))
    with pytest.raises(
        ShipError, match=r"stable on a straight course: T = -13.34 .*manoeuvring.N_v"
    ):
        heading_plant(*own)
    with pytest.raises(ValueError, match="must fall at least as fast as"):
        shape_controller(Factors(1.0, (), (), 1), COURSE)
    with pytest.raises(ValueError, match="needs the integrators of the loop"):
        shape_controller(TRACK_LOOP, COURSE)


def test_commands_are_those_of_the_trapezoidal_rule() -> None:
    """At constant steps the commands are those of the bilinear transform, for each ship."""
    controller = shape_controller(COURSE_LOOP, COURSE)
    law, way = ShapedController(controller), 0.04
    error = np.sin(0.3 * np.arange(60)) * 0.01
    memory = law.begin(np.zeros(2))
    found = np.array(
        [law.command(np.array([e, 2.0 * e]), np.full(2, way), memory, 0.6) for e in error]
    )
    discrete = control.sample_system(controller, way, method="bilinear")
    expected = control.forced_response(discrete, np.arange(60) * way, error).outputs
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(found[:, 1], 2.0 * expected, rtol=1e-9, atol=1e-14)


def test_it_starts_in_steady_state_and_respects_the_end_stops() -> None:
    law = ShapedController(shape_controller(COURSE_LOOP, COURSE))
    memory = law.begin(np.array([0.02]))
    steady = float(np.real(law.controller.dcgain())) * 0.02
    for _ in range(3):
        command = law.command(np.array([0.02]), np.array([0.1]), memory, 0.6)
        assert command[0] == pytest.approx(steady, rel=1e-9)
    assert law.command(np.array([-3.0]), np.array([0.1]), memory, 0.6)[0] == -0.6


def test_the_integral_removes_a_steady_error_and_is_held_at_a_stop() -> None:
    controller = shape_controller(COURSE_LOOP, COURSE)
    rest = float(np.real(controller.dcgain()))
    law = ShapedController(controller, reset_lengths=5.0)
    memory = law.begin(np.array([0.02]))
    for _ in range(50):
        command = law.command(np.array([0.02]), np.array([0.1]), memory, 0.6)
    assert command[0] == pytest.approx(rest * 0.02 * (1.0 + 5.0 / 5.0), rel=1e-6)
    for _ in range(50):
        law.command(np.array([3.0]), np.array([0.1]), memory, 0.6)
    assert memory[0, -1] == pytest.approx(rest * 0.02, rel=1e-6)  # no integrator windup
    with pytest.raises(ValueError, match="reset_lengths = 0"):
        ShapedController(controller, 0.0)
