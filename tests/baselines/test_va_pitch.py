"""Pitch control by the advance velocity: inversions, means, and the effect in waves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.controller import measurements_of
from shaftline.baselines.registry import ControllerError, make_controller
from shaftline.baselines.va_pitch import LOAD_MEAN, VaPitch, blade_load, pitch_at_load
from shaftline.envs import CLASSIC, FrigateVectorEnv, get_task
from shaftline.envs.tasks import controller_for
from shaftline.plant import load_ship
from shaftline.plant.hull import wake_inflow

SHIP = load_ship("frigate")


@pytest.mark.parametrize("cavitation", [False, True])
@pytest.mark.parametrize(("velocity", "pitch"), [(7.0, 1.2), (6.0, 0.9), (8.5, 1.35)])
def test_the_pitch_of_a_load_has_that_load(cavitation: bool, velocity: float, pitch: float) -> None:
    plant = SHIP.record()
    aim = blade_load(plant, cavitation, velocity, 10.0, pitch)
    assert pitch_at_load(plant, cavitation, velocity, 10.0, aim) == pytest.approx(pitch, abs=1e-6)
    faster = pitch_at_load(plant, cavitation, velocity + 0.3, 10.0, aim)
    assert faster > pitch  # more inflow reduces the load, more pitch restores it


@pytest.mark.parametrize(("aim", "end"), [(-1e9, 0.6), (1e9, 1.4)])
def test_a_load_out_of_reach_takes_the_end_of_the_range(aim: float, end: float) -> None:
    assert pitch_at_load(SHIP.record(), False, 7.0, 10.0, aim) == pytest.approx(end, abs=1e-6)


def observe(velocity: float = 7.2, valid: float = 1.0, pitch: float = 1.3) -> Any:
    return np.array([[8.0, 9.6, 1.4e5, pitch, 20.0, 8.0, velocity, valid]])


def test_in_steady_motion_the_pitch_is_that_of_the_pilot() -> None:
    law, pilot = (make_controller(name, SHIP, 0.5) for name in ("va-pitch", "speed-pilot"))
    base = pilot.initial_state(measurements_of(observe()))
    expected, _ = pilot.act(measurements_of(observe()), base)
    pitch, _ = law.act(
        measurements_of(observe(pitch=float(expected[0]))),
        law.initial_state(measurements_of(observe())),
    )
    assert pitch == pytest.approx(expected, abs=2e-3)  # without the response of the pilot to torque


def test_the_command_brings_the_pitch_there_within_an_interval() -> None:
    law = VaPitch(SHIP, ahead_s=0.0)
    memory = law.initial_state(measurements_of(observe()))
    aim = float(memory[0, LOAD_MEAN])
    pitch, _ = law.act(measurements_of(observe(velocity=7.5)), memory)
    assert memory[0, LOAD_MEAN] == pytest.approx(aim, rel=0.01)
    target = pitch_at_load(SHIP.record(), False, 7.5, 9.6, float(memory[0, LOAD_MEAN]))
    arrived = pitch[0] + (1.3 - pitch[0]) * math.exp(-0.5 / 2.0)
    assert arrived == pytest.approx(target, abs=1e-9)
    assert target > 1.3


@pytest.mark.parametrize("seconds", [0.5, 1.0])
def test_it_extrapolates_by_the_slope_of_the_estimate(seconds: float) -> None:
    rising, plain = VaPitch(SHIP, ahead_s=seconds), VaPitch(SHIP, ahead_s=0.0)
    pitches = []
    for law in (rising, plain):
        memory = law.initial_state(measurements_of(observe()))
        for velocity in (7.21, 7.22, 7.23):
            pitch, _ = law.act(measurements_of(observe(velocity=velocity)), memory)
        pitches.append(float(pitch[0]))
    assert pitches[0] > pitches[1]


@pytest.mark.parametrize(("velocity", "valid"), [(9.0, 0.0), (math.nan, 1.0), (math.inf, 1.0)])
def test_without_an_estimate_the_ship_speed_is_used(velocity: float, valid: float) -> None:
    law = VaPitch(SHIP)
    assert law.velocity(measurements_of(observe(velocity, valid))) == pytest.approx(0.95 * 8.0)


def test_options_out_of_range_and_a_fixed_pitch_are_refused() -> None:
    with pytest.raises(ValueError, match=r"ahead_s = -1\.0 s"):
        VaPitch(SHIP, ahead_s=-1.0)
    fixed = SHIP.with_values({"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2})
    with pytest.raises(ValueError, match="controllable pitch"):
        VaPitch(fixed)


def swing(name: str, observer: str) -> float:
    """Return the rms shaft torque about its mean in a rough sea [kN m]."""
    env = FrigateVectorEnv(
        6,
        task="transit",
        sea="state-6",
        observer=observer,
        sensor_noise=0.0,
        max_episode_steps=300,
        **CLASSIC,
    )
    law = make_controller(name, env.batch.ship, 0.5)
    observation, _ = env.reset(seed=1, options={"speed_order_m_s": 6.0})
    state, found = None, []
    for _ in range(299):
        action, state = law.predict(observation, state)
        observation, *_, info = env.step(action)
        found.append(info["shaft_torque"] * 1e-3)
    return float(np.std(found[100:], axis=0).mean())


def test_the_advance_velocity_reduces_the_torque_fluctuation() -> None:
    assert swing("va-pitch", "oracle") < 0.75 * swing("va-pitch", "none")


def ahead(inflow: list[float]) -> Any:
    """Return an observation with a wrong estimate, followed by the inflow of the waves."""
    return np.hstack([observe(velocity=3.0), [inflow]])


def test_with_a_preview_the_future_inflow_is_used() -> None:
    """1.5 s ahead the inflow of the waves is -0.3 m/s at a ship speed of 8 m/s."""
    law = make_controller("va-pitch-preview:ahead_s=1.5", SHIP, 0.5)
    calm = measurements_of(ahead([0.0] * 7), preview=True)
    memory = law.initial_state(calm)
    aim = float(memory[0, LOAD_MEAN])
    velocity = wake_inflow(SHIP.record(), 8.0)
    base = pitch_at_load(SHIP.record(), False, velocity, 9.6, aim)
    pitch, _ = law.act(
        measurements_of(ahead([0.0, -0.2, -0.4, 0.0, 0.0, 0.0, 0.0]), preview=True), memory
    )
    target = pitch_at_load(SHIP.record(), False, velocity - 0.3, 9.6, float(memory[0, LOAD_MEAN]))
    arrived = pitch[0] + (1.3 - pitch[0]) * math.exp(-0.5 / 2.0)
    assert arrived == pytest.approx(target, abs=1e-9)
    assert target < base - 0.01


def test_a_task_without_a_preview_refuses_a_controller_that_needs_it() -> None:
    task = get_task("rough-sea")
    with pytest.raises(ControllerError, match=r"'va-pitch-preview': .* needs the waves ahead"):
        controller_for(task, "va-pitch-preview", task.load_ship(), 0.5, False)
    steered = get_task("course-keeping")
    for name in ("va-pitch-preview", "autopilot+va-pitch-preview"):
        with pytest.raises(ControllerError, match="needs the waves ahead"):
            controller_for(steered, name, steered.load_ship(), 0.5, True)
    assert controller_for(steered, "va-pitch", steered.load_ship(), 0.5, True)
    task = get_task("wave-preview")
    assert controller_for(task, "va-pitch-preview", task.load_ship(), 0.5, False)
