"""Every observer on every ship of the package: it follows the inflow or is refused with a message."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from shaftline.observers import (
    ObserverError,
    follow,
    get_observer,
    observer_names,
    simulated_measurements,
)
from shaftline.observers.random_walk_kalman import RandomWalkKalman
from shaftline.plant import Schedule, State, equilibrium, load_ship, ship_names, simulate

MEASURING = [name for name in observer_names() if name not in ("none", "oracle")]
KEYS = (
    "transmission.inertia_propeller_side_kg_m2 is 0",
    "propeller.model is 'bollard'",
    "prime_mover.type is",
)
LAGGING = {"luenberger-low": 0.7}
"""Largest error over standard deviation of slowly tuned observers; 0.25 for all others."""
OF_THE_FRIGATE = ("random-walk-kalman", "random-walk-kalman-extended")
"""Observers with covariances of frigate instruments, too large for a small propeller."""


@functools.cache
def simulated(name: str) -> Any:
    """Return one minute with a swell of 5 % of the advance velocity at half power."""
    ship = load_ship(name)
    drive, screw = 0.5 * float(ship.record()["drive_max"]), ship.propeller
    pitch = 0.25 * screw.pitch_ratio_min + 0.75 * screw.pitch_ratio_max
    inflow = 1.0
    state = State(pitch, 0.0, 0.0)
    if ship.moves:
        steady = equilibrium(ship, drive, pitch)
        inflow, state = float(steady.outputs.advance_velocity), steady.state
    elif ship.propeller.model != "bollard":
        state = equilibrium(ship, drive, pitch).state
        # At J of 0.6 the estimate converges from standstill.
        inflow = 0.6 * state.shaft_speed / (2.0 * np.pi) * screw.diameter_m
    swell = Schedule(
        drive,
        pitch,
        inflow=lambda t: (0.0 if ship.moves else inflow) + 0.05 * inflow * np.sin(0.8 * t),
    )
    return simulate(ship, swell, 60.0, initial=state)


@pytest.mark.parametrize("ship_name", ship_names())
@pytest.mark.parametrize("name", MEASURING)
def test_it_follows_or_is_refused(ship_name: str, name: str) -> None:
    ship, observer = load_ship(ship_name), get_observer(name)
    refusal = ""
    try:
        observer.discretise(ship, ship.time_step_s)
    except ObserverError as error:
        refusal = str(error)
    if refusal:
        assert refusal.startswith(f"{ship_name}: ")
        assert any(key in refusal for key in KEYS)
        return
    run = simulated(ship_name)
    velocity, valid = follow(observer, ship, simulated_measurements(run, ship), ship.time_step_s)
    later = slice(len(run) // 4, None)
    assert np.all(np.isfinite(velocity))
    if ship.propeller.diameter_m < 2.0 and name in OF_THE_FRIGATE:
        return
    assert valid[later].all()
    truth = run["advance_velocity"][later]
    away = velocity[later] - truth
    assert np.sqrt(np.mean(away**2)) < LAGGING.get(name, 0.25) * np.std(truth)


def test_the_random_walk_filter_with_covariances_of_a_small_ship() -> None:
    ship, run = load_ship("ferry"), simulated("ferry")
    measurements, truth = simulated_measurements(run, ship), run["advance_velocity"]

    def error(observer: RandomWalkKalman) -> float:
        velocity, _ = follow(observer, ship, measurements, ship.time_step_s)
        return float(np.sqrt(np.mean((velocity - truth)[300:] ** 2)) / np.std(truth))

    assert error(RandomWalkKalman()) > 0.9
    assert error(RandomWalkKalman(torque_noise=10.0)) < 0.1
