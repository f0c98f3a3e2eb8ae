"""Four-quadrant thrust controller of an electric drive."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reproductions.towing_tank.experiment import Air, Instruments, Programme, TankRun, simulate_test
from shaftline.baselines import AntiSpin, ThrustControl, ThrustControlTuning
from shaftline.baselines.thrust_control import desired_speed, thrust_per_torque
from shaftline.baselines.ventilation import (
    TORQUE_LOSS,
    bollard_gain,
    excess_inflow,
    shaft_load,
    torque_ratio,
)
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load

RIG = load_ship("towing-tank")
DIAMETER, DENSITY = 0.25, 1000.0


@pytest.fixture(scope="module")
def controller() -> ThrustControl:
    return ThrustControl(RIG)


def load(inflow: float, shaft_speed: float) -> tuple[float, float]:
    """Return thrust [N] and torque [N m] of the propeller of the rig in deep water."""
    found = propeller_load(RIG.record(), inflow, shaft_speed, 1.0, 5.0, 0.0)
    return float(found.thrust), float(found.torque)


def estimate_of(shaft_speed: float, loss: float) -> Any:
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    estimate["shaft_speed"], estimate["torque_loss"], estimate["measured_pitch"] = (
        shaft_speed,
        loss,
        1.0,
    )
    return estimate


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_bollard_gain_is_that_of_the_direction(direction: float) -> None:
    plant = RIG.record()
    _, torque = load(0.0, direction * 40.0)
    assert bollard_gain(plant, 1.0, direction) * 1600.0 * direction == pytest.approx(torque)
    assert bollard_gain(plant, 1.0, 1.0) > 1.02 * bollard_gain(plant, 1.0, -1.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_load_has_all_friction_of_the_line(controller: ThrustControl, direction: float) -> None:
    observer = controller.settings["law"]["observer"]
    speed = direction * 40.0
    dry = RIG.transmission.coulomb_friction_engine_side_N_m + 0.3 * math.atan(0.2 * 40.0)
    expected = load(0.0, speed)[1] + direction * dry
    assert shaft_load(observer, 1.0, speed) == pytest.approx(expected, rel=1e-9)
    assert observer["viscous"] == 0.008
    assert observer["inertia"] == 0.05


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("advance", [0.25, 0.4, 0.6])
def test_thrust_per_torque_both_ways(
    controller: ThrustControl, direction: float, advance: float
) -> None:
    speed = direction * 50.0
    inflow = direction * advance * 50.0 / (2.0 * math.pi) * DIAMETER
    thrust, torque = load(inflow, speed)
    found = thrust_per_torque(controller.settings["law"], torque, speed, 1.0)
    assert found == pytest.approx(thrust / torque, rel=1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_zone_1_takes_the_ratio_at_bollard_pull(
    controller: ThrustControl, direction: float
) -> None:
    speed = direction * 50.0
    thrust, torque = load(0.0, speed)
    expected = thrust / torque
    for more in (1.05, 1.3, 2.0):
        found = thrust_per_torque(controller.settings["law"], more * torque, speed, 1.0)
        assert found == pytest.approx(expected, rel=0.04)
    # Against the inflow KQ is above that at zero advance speed.
    against, _ = load(-direction * 0.2, speed)
    assert direction * against > 0.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_thrust_per_torque_stays_positive(controller: ThrustControl, direction: float) -> None:
    """Astern the thrust is 0 at a lower J; a negative G_QT would reverse the set-point."""
    law = controller.settings["law"]
    for torque in (1e-3, 0.0, -5.0):
        assert thrust_per_torque(law, direction * torque, direction * 0.3, 1.0) > 5.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("inflow", [0.0, 0.6])
def test_desired_speed_gives_the_thrust(
    controller: ThrustControl, direction: float, inflow: float
) -> None:
    speed = direction * 48.0
    thrust, torque = load(direction * inflow, speed)
    loss = torque - direction * bollard_gain(RIG.record(), 1.0, direction) * 48.0**2
    found = desired_speed(controller.settings["law"], estimate_of(speed, loss), thrust, 1.0)
    assert found == pytest.approx(speed, rel=1e-5)
    top = desired_speed(controller.settings["law"], estimate_of(speed, loss), 9.0 * thrust, 1.0)
    assert top == direction * 75.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_lost_torque_is_estimated_in_both_directions(
    controller: ThrustControl, direction: float
) -> None:
    law = controller.settings["law"]
    speed, water = direction * 55.0, direction * 0.6
    _, torque = load(water, speed)
    ship = law["observer"]["ship"]
    whole = torque_ratio(law["detector"], ship, torque, speed, 1.0, water)
    half = torque_ratio(law["detector"], ship, 0.5 * torque, speed, 1.0, water)
    blend = math.exp(-0.02 * 55.0**1.5)
    assert whole == pytest.approx(1.0)
    assert half == pytest.approx(blend + (1.0 - blend) * 0.5)
    assert excess_inflow(ship, 0.7 * torque, speed, 1.0, water) > 0.2
    assert excess_inflow(ship, torque, speed, 1.0, water) == pytest.approx(0.0, abs=1e-9)


def short(**values: Any) -> Programme:
    return replace(Programme(half_s=12.0, mean_submergence=3.2, motion=0.0), **values)


@pytest.fixture(scope="module")
def calm(controller: ThrustControl) -> TankRun:
    return simulate_test(RIG, controller, short())


def test_thrust_is_held_ahead_and_astern(calm: TankRun) -> None:
    times, thrust = calm.times, calm.samples["thrust"]
    for settled in ((times > 8.0) & (times < 12.0), times > 20.0):
        np.testing.assert_allclose(thrust[settled], calm.thrust_order[settled], rtol=0.02)
    assert not calm.detected[times > 2.0][times[times > 2.0] < 12.0].any()
    assert np.abs(calm.samples["shaft_speed"] - calm.reference).max() < 2.0


def test_observer_estimates_the_propeller_torque(calm: TankRun) -> None:
    error = calm.torque_estimate - calm.samples["propeller_torque"]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.abs(calm.samples["propeller_torque"]).max()


def test_same_run_twice_and_batched(controller: ThrustControl) -> None:
    one, three = controller.initial_state(), controller.initial_state(3)
    rng = np.random.default_rng(2)
    for order, speed, water in rng.normal([80.0, 50.0, 0.5], [40.0, 5.0, 0.2], (50, 3)):
        alone = controller.act(order, speed, water, one)
        assert controller.act(order, speed, water, three).tolist() == [float(alone[0])] * 3


def test_measurements_that_are_not_finite_are_replaced(controller: ThrustControl) -> None:
    good, bad = controller.initial_state(), controller.initial_state()
    for memory in (good, bad):
        controller.act(100.0, 50.0, 0.6, memory)
    held = controller.act(100.0, 50.0, 0.6, good)
    assert controller.act(100.0, math.nan, math.inf, bad) == held
    with pytest.raises(ValueError, match="thrust"):
        controller.act(math.nan, 50.0, 0.6, good)


def test_limits_ahead_and_astern_in_air() -> None:
    ship = Air().ship(RIG)
    programme = Programme(half_s=12.0)
    on = simulate_test(ship, ThrustControl(ship), programme)
    off = simulate_test(ship, ThrustControl(ship, anti_spin=False), programme)
    speed, air = on.samples["shaft_speed"], on.samples["ventilation"] > 0.97
    air[200:] &= on.detected[:-200]  # detected 0.4 s ago, so the limit is reached
    ahead, astern = air & (on.times < 12.0), air & (on.times > 14.0)
    assert ahead.sum() > 200
    assert astern.sum() > 200
    np.testing.assert_allclose(speed[ahead], 45.0, atol=1.0)
    np.testing.assert_allclose(speed[astern], -54.0, atol=1.0)
    assert off.samples["shaft_speed"].max() == pytest.approx(75.0, abs=1.5)
    assert off.samples["shaft_speed"].min() == pytest.approx(-75.0, abs=1.5)
    assert on.motor_power.mean() < 0.85 * off.motor_power.mean()


@pytest.mark.parametrize("limit", [30.0, 38.0])
def test_a_reversal_is_possible_at_every_limit(limit: float) -> None:
    """Regression test: a G_QT of the wrong sign near standstill kept the shaft at rest."""
    ship = Air().ship(RIG)
    controller = ThrustControl(
        ship, ventilated_ahead_rad_s=limit, ventilated_astern_rad_s=1.2 * limit
    )
    run = simulate_test(ship, controller, Programme(half_s=30.0))
    assert run.samples["thrust"][run.times > 40.0].mean() < -60.0


def test_noise_and_a_wrong_motor_model_are_tolerated() -> None:
    for wrong in (Instruments(shaft_speed=0.05), Instruments(torque_gain=0.95)):
        run = simulate_test(RIG, ThrustControl(RIG), short(), wrong)
        settled = run.times > 20.0
        mean = run.samples["thrust"][settled].mean()
        assert mean == pytest.approx(run.thrust_order[-1], rel=0.06)


def test_with_curves_of_one_direction_it_turns_ahead_only() -> None:
    ship = RIG.with_values({"propeller.model": "b-series"})
    controller = ThrustControl(ship)
    assert controller.settings["law"]["speed_min"] == 0.0
    run = simulate_test(ship, controller, short(carriage_m_s=0.4))
    assert run.samples["thrust"][2000] == pytest.approx(run.thrust_order[2000], rel=0.03)
    assert run.samples["shaft_speed"].min() > -2.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gamma": 0.0}, "B1"),
        ({"proportional_rate": 0.2}, "B2"),
        ({"integral_rate": 0.0}, "B3"),
        ({"speed_rate": -1.0}, "A1"),
        ({"loss_rate": 1e3}, "A2"),
        ({"ventilated_astern_rad_s": 0.0}, "positive"),
        ({"cutoff_rad_s": 0.0}, "cutoff_rad_s = 0"),
    ],
)
def test_bad_tuning_is_refused_by_condition(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ThrustControl(RIG, **change)  # type: ignore[arg-type]


def test_other_ships_are_refused(frigate: Ship) -> None:
    with pytest.raises(ValueError, match="not 'diesel'"):
        ThrustControl(frigate)
    with pytest.raises(ValueError, match="fixed pitch"):
        ThrustControl(RIG.with_values({"propeller.pitch_ratio_min": 0.6}))
    with pytest.raises(ValueError, match="ThrustControl"):
        AntiSpin(RIG)
    with pytest.raises(ValueError, match="time step"):
        simulate_test(RIG, ThrustControl(RIG, 0.004), short())
    with pytest.raises(TypeError, match="nonsense"):
        ThrustControl(RIG, nonsense=1.0)  # type: ignore[call-arg]


def test_defaults_are_the_papers_where_it_prints_them() -> None:
    tuning = ThrustControlTuning()
    assert (tuning.ventilated_ahead_rad_s, tuning.ventilated_astern_rad_s) == (45.0, 54.0)
    assert tuning.top_speed_rad_s == 75.0
