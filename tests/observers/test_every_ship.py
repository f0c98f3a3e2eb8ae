"""Every pair of a ship of the package and an observer: it follows, or is refused in words."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from shaftline.observers import ObserverError, follow, get_observer, observer_names, readings_of
from shaftline.observers.random_walk_kalman import RandomWalkKalman
from shaftline.plant import Schedule, State, equilibrium, load_ship, ship_names, simulate

MEASURING = [name for name in observer_names() if name not in ("none", "oracle")]
KEYS = (
    "transmission.inertia_propeller_side_kg_m2 is 0",
    "propeller.model is 'bollard'",
    "prime_mover.type is",
)
LAGGING = {"luenberger-low": 0.7}
"""Error over spread that those have which are slow by their tuning; others stay within 0.25."""
OF_THE_FRIGATE = ("random-walk-kalman", "random-walk-kalman-extended")
"""Whose covariances are those of a frigate's gauge and encoder, too coarse for a small propeller."""


@functools.cache
def sailed(name: str) -> Any:
    """A swell of 5 % of the advance velocity at half power, for a minute."""
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
        # J of 0.6: below the fold's dip, where an estimate comes back from standing still
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
    run = sailed(ship_name)
    velocity, valid = follow(observer, ship, readings_of(run, ship), ship.time_step_s)
    later = slice(len(run) // 4, None)
    assert np.all(np.isfinite(velocity))
    if ship.propeller.diameter_m < 2.0 and name in OF_THE_FRIGATE:
        return
    assert valid[later].all()
    truth = run["advance_velocity"][later]
    away = velocity[later] - truth
    assert np.sqrt(np.mean(away**2)) < LAGGING.get(name, 0.25) * np.std(truth)


def test_the_random_walk_filter_with_covariances_of_a_small_ship() -> None:
    ship, run = load_ship("ferry"), sailed("ferry")
    readings, truth = readings_of(run, ship), run["advance_velocity"]

    def error(observer: RandomWalkKalman) -> float:
        velocity, _ = follow(observer, ship, readings, ship.time_step_s)
        return float(np.sqrt(np.mean((velocity - truth)[300:] ** 2)) / np.std(truth))

    assert error(RandomWalkKalman()) > 0.9
    assert error(RandomWalkKalman(torque_noise=10.0)) < 0.1
