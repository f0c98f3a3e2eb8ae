"""LQG autopilot: optimality, margins, recovery, and a ship that is unstable on a straight course."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy

from shaftline.baselines import (
    Autopilot,
    LqgAutopilot,
    SteeringMeasurements,
    helmsman_loop,
    make_helmsman,
)
from shaftline.baselines.lqg_autopilot import steering_states
from shaftline.plant import Ship, ShipError, Voyage, load_ship, nomoto

SHIP, SPEED = load_ship("ddg-51-surrogate"), 11.318


def test_the_model_is_that_of_nomoto_in_ship_lengths() -> None:
    pilot = LqgAutopilot(SHIP, 0.5, SPEED)
    a, b, c = steering_states(SHIP, pilot.point)
    model = nomoto(SHIP, pilot.point)
    turn = np.array([[0.0, 1.0, 0.0, 0.0]])
    moving = np.ix_([0, 1, 3], [0, 1, 3])
    gain = -turn[:, [0, 1, 3]] @ np.linalg.solve(a[moving], b[[0, 1, 3]])
    assert gain[0, 0] == pytest.approx(model.gain, rel=1e-6)
    poles = sorted(np.linalg.eigvals(a[:2, :2]).real)
    assert poles == pytest.approx(sorted(pole.real for pole in model.poles), rel=1e-6)
    assert c.tolist() == [[0.0, 0.0, 1.0, 0.0]]


def cost(a: Any, b: Any, gain: Any, weight: float) -> float:
    """Return the mean of psi^2 + w delta^2 under white disturbances of all states."""
    closed = a - b @ gain
    covariance = scipy.linalg.solve_continuous_lyapunov(closed, -np.eye(4))
    command = (gain @ covariance @ gain.T)[0, 0]
    return float(covariance[2, 2] + weight * command)


def test_the_feedback_is_optimal_for_its_weight() -> None:
    pilot = LqgAutopilot(SHIP, 0.5, SPEED, rudder_weight=3.0)
    a, b, _ = steering_states(SHIP, pilot.point)
    gain = np.array(pilot.law.controller.C)
    best = cost(a, b, gain, 3.0)
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert cost(a, b, gain * (1.0 + 0.05 * rng.standard_normal(gain.shape)), 3.0) > best
    assert cost(a, b, np.array(LqgAutopilot(SHIP, 0.5, SPEED).law.controller.C), 3.0) > best


def test_a_larger_recovery_comes_to_the_margins_of_state_feedback() -> None:
    """State feedback has 60 deg of phase margin and any gain above 1/2 (Safonov and Athans 1977)."""
    found = [
        helmsman_loop(LqgAutopilot(SHIP, 0.02, SPEED, recovery=q)).margins()
        for q in (1.0, 1e2, 1e5)
    ]
    phases = [margins.phase_margin_deg for margins in found]
    gains = [margins.gain_margin_dB for margins in found]
    assert phases == sorted(phases)
    assert gains == sorted(gains)
    assert phases[-1] > 60.0
    assert gains[0] > 6.0


def test_a_larger_weight_moves_the_rudder_less_and_the_loop_is_slower() -> None:
    slow, fast = (
        helmsman_loop(LqgAutopilot(SHIP, 0.5, SPEED, rudder_weight=w)).margins()
        for w in (10.0, 0.3)
    )
    assert slow.crossover < 0.5 * fast.crossover


def held(ship: Ship, pilot: LqgAutopilot, order_deg: float, lengths: float) -> list[float]:
    """Return the headings [deg] of a voyage from a straight course."""
    point, length = pilot.point, ship.manoeuvring.length_m
    voyage, state, found = Voyage(ship, point.state, point.inputs.drive), point.state, []
    steps = round(pilot.interval_s / ship.time_step_s)
    memory: Any = None
    for _ in range(round(lengths * length / point.state.ship_speed / pilot.interval_s)):
        values = (
            math.radians(order_deg),
            state.heading,
            state.yaw_rate,
            state.rudder_angle,
            0.0,
            0.0,
            state.ship_speed,
        )
        now = SteeringMeasurements(*(np.array([value]) for value in values))
        memory = pilot.initial_state(now) if memory is None else memory
        command = float(pilot.rudder(now, memory)[0])
        found.append(math.degrees(state.heading))
        state = voyage.run(point.inputs.drive, point.inputs.pitch_command, command, steps)
    return found


def test_it_steers_a_ship_that_is_unstable_on_a_straight_course() -> None:
    ship = load_ship("kvlcc2")
    with pytest.raises(ShipError, match="stable on a straight course"):
        Autopilot(ship, 0.5)
    pilot = LqgAutopilot(ship, 0.5)
    assert max(pole.real for pole in nomoto(ship, pilot.point).poles) > 0.0
    margins = helmsman_loop(pilot).margins()
    assert margins.phase_margin_deg > 30.0
    assert margins.gain_margin_down_dB > 6.0  # an unstable ship needs a least gain
    found = held(ship, pilot, 10.0, 25.0)
    assert found[-1] == pytest.approx(10.0, abs=0.3)
    assert max(found) < 14.0


def test_options_are_checked() -> None:
    pilot = make_helmsman("lqg-autopilot:rudder_weight=4,recovery=20", SHIP, 0.5, SPEED)
    assert isinstance(pilot, LqgAutopilot)
    assert (pilot.rudder_weight, pilot.recovery) == (4.0, 20.0)
    for name in ("rudder_weight", "recovery"):
        with pytest.raises(ValueError, match=f"{name} = 0"):
            make_helmsman(f"lqg-autopilot:{name}=0", SHIP, 0.5, SPEED)
    with pytest.raises(ShipError, match="cannot be steered"):
        LqgAutopilot("frigate")
