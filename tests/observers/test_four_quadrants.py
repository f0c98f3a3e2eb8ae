"""Observers in a reversal of shaft and inflow, and in the ring vortex."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shaftline.observers import (
    ESTIMATE,
    Measurement,
    follow,
    get_observer,
    simulated_measurements,
    update,
)
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.luenberger import Luenberger
from shaftline.observers.random_walk_kalman import RandomWalkKalman
from shaftline.observers.shaft_acceleration import ShaftAccelerationDerived
from shaftline.observers.torque_curve import (
    limit_to_curve,
    model_torque,
    shaft_turns,
    torque_determines_inflow,
    torque_slopes,
    velocity_from_torque,
)
from shaftline.plant.propeller import propeller_load

from .rig import DIAMETER, EFFICIENCY, PITCH, RIG, advance_ratio, against_inflow, reversed_run
from .screw import SHIP

PLANT = RIG.record()
QUADRANTS = [(1.0, 50.0), (-1.0, 50.0), (1.0, -50.0), (-1.0, -50.0), (0.7, 0.5), (-0.7, -0.5)]
OBSERVERS = {
    "shaft-acceleration": (get_observer("shaft-acceleration"), 1e-3),
    "shaft-acceleration-derived": (ShaftAccelerationDerived(0.005), 0.06),
    "luenberger": (Luenberger((-300.0, -301.0)), 0.03),
    "luenberger-high": (get_observer("luenberger-high"), 0.03),
    "shaft-kalman": (get_observer("shaft-kalman"), 0.03),
    "immersion-invariance": (ImmersionInvariance(4.0), 0.03),
    "random-walk-kalman": (RandomWalkKalman(1.0, 0.0, 0.1, 0.02), 0.05),
    "immersion-invariance-adaptive": (get_observer("immersion-invariance-adaptive"), 0.08),
}
"""Observers with a tuning for the rig, and the rms error [m/s] of their valid estimates."""


@pytest.fixture(scope="module")
def run() -> Any:
    return reversed_run()


@pytest.mark.parametrize(("v", "w"), QUADRANTS)
def test_torque_and_slopes_are_the_plants(v: float, w: float) -> None:
    def plants(v: float, w: float) -> float:
        return float(propeller_load(PLANT, v, w, PITCH, 0.3, 0.0).torque) / EFFICIENCY

    assert model_torque(PLANT, v, w, PITCH) == pytest.approx(plants(v, w), rel=1e-12)
    h = 1e-5
    by_speed = (plants(v, w + h) - plants(v, w - h)) / (2.0 * h)
    by_velocity = (plants(v + h, w) - plants(v - h, w)) / (2.0 * h)
    assert torque_slopes(PLANT, v, w, PITCH) == pytest.approx((by_speed, by_velocity), rel=1e-6)


@pytest.mark.parametrize(("v", "w"), QUADRANTS)
def test_velocity_is_the_inverse_either_way(v: float, w: float) -> None:
    torque = model_torque(PLANT, v, w, PITCH)
    found, valid = velocity_from_torque(PLANT, torque, w, PITCH, 0.9 * v)
    assert found == pytest.approx(v, rel=1e-8)
    assert valid == (v * w > 0.0)


def test_a_shaft_at_rest_holds_the_guess() -> None:
    slowest = 1e-3 * 2.0 * math.pi
    for w in (0.99 * slowest, -0.99 * slowest, 0.0):
        assert velocity_from_torque(PLANT, 0.1, w, PITCH, -0.4) == (-0.4, False)
        assert not torque_determines_inflow(PLANT, 0.4, w, PITCH, True)


def test_curves_of_one_quadrant_know_one_direction() -> None:
    for w in (2e-3, -2e-3, 5e-4, -5e-4):
        assert shaft_turns(PLANT, w) == (abs(w) > 1e-3)
        assert shaft_turns(SHIP.record(), w) == (w > 1e-3)
    assert torque_determines_inflow(SHIP.record(), -3.0, -5.0, 1.2, False)  # one branch only


def test_an_estimate_is_held_where_its_curves_end() -> None:
    top = 1.6 * 10.0 / (2.0 * math.pi) * 4.2
    one = SHIP.record()
    assert limit_to_curve(one, 5.0, 10.0) == (5.0, True)
    assert limit_to_curve(one, -0.1, 10.0) == (0.0, False)
    assert limit_to_curve(one, -0.1, 10.0, 0.25) == (-0.1, False)
    for velocity, share, end in ((-50.0, 0.25, -0.25 * top), (99.0, 0.0, top)):
        held, trusted = limit_to_curve(one, velocity, 10.0, share)
        assert held == pytest.approx(end)
        assert not trusted
    assert limit_to_curve(PLANT, -30.0, 10.0) == (-30.0, True)  # limited by the signal bounds only
    assert limit_to_curve(PLANT, -50.0, 10.0) == (-40.0, False)
    assert limit_to_curve(PLANT, 3.0, 5e-4) == (3.0, False)


@pytest.mark.parametrize("name", OBSERVERS)
def test_each_follows_through_a_reversal(run: Any, name: str) -> None:
    observer, close = OBSERVERS[name]
    velocity, valid = follow(observer, RIG, simulated_measurements(run, RIG), RIG.time_step_s)
    error = velocity - run["advance_velocity"]
    assert np.sqrt(np.mean(error[valid] ** 2)) < close
    # The estimate is valid most of the time in both directions.
    for side in (run["shaft_speed"] > 10.0, run["shaft_speed"] < -10.0):
        assert valid[side].mean() > 0.8
    last = valid[-1000:]
    assert last.all()


@pytest.mark.parametrize("name", ["shaft-acceleration", "luenberger-high", "shaft-kalman"])
def test_the_ring_vortex_is_never_valid(run: Any, name: str) -> None:
    _, valid = follow(OBSERVERS[name][0], RIG, simulated_measurements(run, RIG), RIG.time_step_s)
    zone = against_inflow(run)
    assert zone.sum() > 200
    assert not valid[zone].any()


def test_valid_again_only_by_an_unmistakable_torque(run: Any) -> None:
    """At J 0.2 an estimate that comes from J 0.8 is valid, one that starts there is not."""
    w = 40.0
    record = get_observer("power-balance").discretise(RIG, RIG.time_step_s)

    def ends(ratios: list[float]) -> list[int]:
        estimate, said = np.zeros(1, ESTIMATE)[0], []
        for j in ratios:
            v = j * w * DIAMETER / (2.0 * math.pi)
            torque = model_torque(PLANT, v, w, PITCH)
            update(record, estimate, Measurement(w, torque, PITCH, 0.0, 0.0))
            assert advance_ratio(estimate["advance_velocity"], w) == pytest.approx(j, abs=1e-6)
            said.append(int(estimate["valid"]))
        return said

    assert ends([0.2, 0.2]) == [0, 0]
    assert ends([0.8, 0.5, 0.2, 0.1]) == [1, 1, 1, 1]
    assert ends([0.8, 0.2, -0.08, 0.2, 0.8, 0.2]) == [1, 1, 0, 0, 1, 1]


def test_validity_restarts_after_a_reversal() -> None:
    w = 40.0
    v = 0.2 * w * DIAMETER / (2.0 * math.pi)
    record = get_observer("power-balance").discretise(RIG, RIG.time_step_s)
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"], estimate["valid"] = 1, 1
    torque = model_torque(PLANT, -v, -w, PITCH)
    estimate["shaft_speed"] = -w
    update(record, estimate, Measurement(-w, torque, PITCH, 0.0, 0.0))
    assert estimate["valid"] == 1
    estimate["shaft_speed"], estimate["advance_velocity"] = w, 0.0
    update(record, estimate, Measurement(-w, torque, PITCH, 0.0, 0.0))
    assert estimate["valid"] == 0


measurement = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, 1e-3, -1e-3, 40.0, -40.0, 5.0, -5.0, 1.0, 1e8, math.nan]),
)


@pytest.mark.parametrize("name", OBSERVERS)
@settings(max_examples=40)
@given(rows=st.lists(st.tuples(measurement, measurement, measurement, measurement), max_size=12))
def test_no_measurement_makes_the_estimate_anything_but_a_number(
    name: str, rows: list[tuple[float, float, float, float]]
) -> None:
    record = OBSERVERS[name][0].discretise(RIG, RIG.time_step_s)
    estimate = np.zeros(1, ESTIMATE)[0]
    for row in rows:
        assert math.isfinite(update(record, estimate, Measurement(*row, 0.0)))
