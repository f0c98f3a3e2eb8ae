"""Augmented Kalman filter: matrix equations, fouling and friction, faulty measurements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from shaftline.observers import (
    ESTIMATE,
    ObserverError,
    follow,
    follow_parameter,
    follow_table,
    get_observer,
    simulated_measurements,
    variance_accounted_for,
)
from shaftline.observers.augmented import correct, propagate
from shaftline.observers.augmented_kalman import AugmentedKalman, _correct, _propagate
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, load_ship, realise, simulate
from shaftline.plant.dynamics import evaluate
from shaftline.plant.state import Inputs, State

from .screw import DT, INERTIA, SHIP, noisy_measurements, sampled

FOULING = "hull.fouling_fraction"
COULOMB = "transmission.coulomb_friction_propeller_side_N_m"
VISCOUS = "transmission.viscous_friction_propeller_side_N_m_s_rad"
RNG = np.random.default_rng(4)


def some_covariance() -> Any:
    root = RNG.normal(size=(4, 4))
    return root @ root.T


def test_covariance_is_propagated_as_in_the_general_filter() -> None:
    p = some_covariance()
    f, process = np.zeros((4, 4)), RNG.uniform(0.1, 1.0, 4)
    f[0], f[2], f[1, 1] = RNG.normal(size=4), RNG.normal(size=4), -0.7
    expected = p.copy()
    propagate(expected, f, 3, process, 0.1, np.zeros((2, 4, 4)))
    _propagate(p, tuple(f[0]), tuple(f[2]), 0.7, process, 0.1)
    np.testing.assert_allclose(p, expected, rtol=1e-12)


def test_a_measurement_corrects_as_in_the_general_filter() -> None:
    p, x = some_covariance(), RNG.normal(size=4)
    expected, moved = p.copy(), x.copy()
    correct(moved, expected, np.array([1.0, 0.0, 0.0, 0.0]), 0.3, 0.2, np.zeros((3, 4)))
    _correct(x, p, 0.3, 0.2)
    np.testing.assert_allclose(x, moved, rtol=1e-12)
    np.testing.assert_allclose(p, expected, rtol=1e-11, atol=1e-13)


def plants_rates(key: str, z: NDArray[np.float64], torque: float, pitch: float) -> Any:
    """Return the rates of shaft and ship speed of the plant with the parameter in its record."""
    plant = SHIP.record()
    SHIP.parameter(key).write(plant, z[3])
    state = State(pitch, z[0], z[2], 0.0, 0.0, 0.0, 0.0, 0.0)
    rate, out = evaluate(plant, state, Inputs(20.0, pitch, z[1]), pitch)
    behind = out.propeller_torque
    if key == COULOMB:
        behind += z[3] * math.copysign(1.0, z[0])
    elif key == VISCOUS:
        behind += z[3] * z[0]
    return np.array([(torque - behind) / INERTIA, rate.ship_speed])


@pytest.mark.parametrize(("key", "number"), [(FOULING, 0.1), (COULOMB, 3e3), (VISCOUS, 400.0)])
def test_one_step_is_that_of_the_plant_and_its_slopes(key: str, number: float) -> None:
    """Estimate and covariance after a sample agree with central differences of the plant."""
    record = AugmentedKalman(key).discretise(SHIP, DT)
    z = np.array([10.4, 0.4, 8.1, number])
    p = np.diag([1e-3, 0.2, 0.1, (0.1 * number) ** 2]) + 1e-9 * some_covariance()
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["started"] = estimate["valid"] = 1
    estimate["x"], estimate["covariance"] = z, p
    before = (10.4, 1.42e5, 1.30)
    now = (10.41, 1.44e5, 1.31)
    estimate["shaft_speed"], estimate["shaft_torque"], estimate["pitch_ratio"] = before
    (after,) = sampled(record, [(*now, 0.0, 0.0)], estimate)

    torque, pitch = 1.43e5, 1.305
    middle = z.copy()
    middle[0] += 0.5 * DT * plants_rates(key, z, torque, pitch)[0]
    f = np.zeros((4, 4))
    for i, step in enumerate((1e-4, 1e-4, 1e-4, 1e-4 * number)):
        up, down = middle.copy(), middle.copy()
        up[i] += step
        down[i] -= step
        slope = plants_rates(key, up, torque, pitch) - plants_rates(key, down, torque, pitch)
        f[[0, 2], i] = slope / (2.0 * step)
    f[1, 1] = -1.0 / 3.0
    shaft, ship = plants_rates(key, middle, torque, pitch)
    z += DT * np.array([shaft, -z[1] / 3.0, ship, 0.0])
    propagate(p, f, 3, np.array(record["process"]), DT, np.zeros((2, 4, 4)))
    slope = np.array([1.0, 0.0, 0.0, 0.0])
    correct(z, p, slope, now[0] - z[0], float(record["measurement"]), np.zeros((3, 4)))
    np.testing.assert_allclose(after["x"], z, rtol=1e-7)
    np.testing.assert_allclose(after["covariance"], p, rtol=1e-5, atol=1e-12 * np.abs(p).max())
    assert after["advance_velocity"] == pytest.approx(0.95 * z[2] + z[1], rel=1e-7)
    assert after["valid"] == 1


def voyage(
    truth: Ship, seconds: float, sea: str | None = None, fouling: Any = 0.0, seed: int = 1
) -> tuple[Any, NDArray[np.float64]]:
    """Return samples and noisy measurements with a step of the fuel rack every two minutes."""
    rng = np.random.default_rng(seed)
    rack = rng.uniform(14.0, 24.0, int(seconds / 120.0) + 1)
    begin = equilibrium(truth, rack[0], 1.3)
    known = get_sea(sea) if sea else None
    waves = realise(known, depth_m=4.0, seed=seed) if known else None
    schedule = Schedule(
        lambda t: rack[(t // 120.0).astype(int)],
        1.3,
        resistance_factor=lambda t: 1.0 + np.interp(t, *fouling) if fouling else 1.0 + 0.0 * t,
    )
    samples = simulate(truth, schedule, seconds, initial=begin.state, sea=waves)
    measurements = simulated_measurements(samples)
    measurements[:, :3] += (0.01, 1.5e3, 0.004) * rng.standard_normal((len(measurements), 3))
    return samples, measurements


def test_fouling_is_estimated_at_sea_and_while_it_grows() -> None:
    growing = ([0.0, 900.0, 2700.0, 3600.0], [0.1, 0.1, 0.2, 0.2])
    ship = load_ship("frigate")
    samples, measurements = voyage(ship, 3600.0, "state-5", growing)
    number, deviation = follow_parameter(get_observer("augmented-kalman"), ship, measurements, DT)
    error = number - np.interp(samples["time"], *growing)
    assert number[0] == 0.0
    assert deviation[0] == pytest.approx(0.2)
    assert np.abs(error[12_000:18_000]).max() < 0.01  # 600 to 900 s, steady
    assert np.all(error[30_000:54_000] < 0.0)  # the estimate lags behind the growing fouling
    assert np.abs(error[18_000:]).max() < 0.04
    assert np.all(np.abs(error[12_000:]) < 2.0 * deviation[12_000:])
    assert deviation[12_000:].max() < 0.03
    velocity, valid = follow(get_observer("augmented-kalman"), ship, measurements, DT)
    other, _ = follow(get_observer("random-walk-kalman"), ship, measurements, DT)
    truth = samples["advance_velocity"][1000:]
    assert variance_accounted_for(truth, velocity[1000:]) > 98.0
    assert np.std(velocity[1000:] - truth) < 1.15 * np.std(other[1000:] - truth)
    assert valid.mean() > 0.999


@pytest.mark.parametrize(("key", "number"), [(COULOMB, 4e3), (VISCOUS, 350.0)])
def test_friction_is_estimated(key: str, number: float) -> None:
    nominal = load_ship("frigate")
    _, measurements = voyage(nominal.with_values({key: number}), 1800.0, "state-4")
    observer = AugmentedKalman(key, spread=0.02, walk=5e-5)
    found, deviation = follow_parameter(observer, nominal, measurements, DT)
    assert found[-1] == pytest.approx(number, rel=0.2)
    assert abs(found[-1] - number) < 2.0 * deviation[-1]
    assert deviation[-1] < 0.25 * number


def test_the_estimated_parameter_is_a_column_by_its_key() -> None:
    measurements = noisy_measurements(30)
    names = [
        "shaft_speed_rad_s",
        "shaft_torque_N_m",
        "pitch_ratio",
        "shaft_acceleration_rad_s2",
        "advance_velocity_m_s",
    ]
    table = pd.DataFrame(measurements, columns=names).assign(time_s=DT * np.arange(30))
    found = follow_table(get_observer("augmented-kalman-friction"), SHIP, table)
    number, deviation = follow_parameter(
        get_observer("augmented-kalman-friction"), SHIP, measurements, DT
    )
    np.testing.assert_allclose(found[f"estimated_{COULOMB}"], number, rtol=1e-9)
    np.testing.assert_allclose(found[f"estimated_{COULOMB}_sd"], deviation, rtol=1e-9)
    plain = follow_table(get_observer("luenberger"), SHIP, table)
    assert not [name for name in plain if "hull" in name or "transmission" in name]


def test_an_observer_without_a_parameter_is_refused() -> None:
    with pytest.raises(ObserverError, match="'luenberger' estimates no parameter of the ship"):
        follow_parameter(get_observer("luenberger"), SHIP, noisy_measurements(3), DT)


def test_a_lost_measurement_keeps_the_parameter() -> None:
    ship = load_ship("frigate").with_values({FOULING: 0.15})
    _, measurements = voyage(ship, 900.0)
    spoilt = measurements.copy()
    spoilt[12_000:12_100, 1] = math.nan
    observer = get_observer("augmented-kalman")
    nominal = load_ship("frigate")
    number, deviation = follow_parameter(observer, nominal, spoilt, DT)
    straight, _ = follow_parameter(observer, nominal, measurements, DT)
    assert np.all(number[12_000:12_100] == number[11_999])
    assert abs(number[-1] - straight[-1]) < 0.01
    assert deviation[12_100] == pytest.approx(deviation[11_999], rel=0.01)


def test_torque_off_the_curve_corrects_nothing() -> None:
    """While the torque meter fails, the estimate is not valid, and ship speed and parameter are kept."""
    record = get_observer("augmented-kalman").discretise(SHIP, DT)
    measurements = noisy_measurements(400)
    measurements[200:300, 1] = 9e5
    after = sampled(record, measurements)
    held = after[200:300]
    assert not any(e["valid"] for e in held)
    assert {(e["x"][2], e["x"][3]) for e in held} == {tuple(after[199]["x"][2:])}
    # The first plausible sample restarts with the last ship speed.
    assert after[300]["valid"] == 1
    assert after[300]["x"][2] == after[199]["x"][2]
    assert after[300]["x"][1] == pytest.approx(
        after[300]["advance_velocity"] - 0.95 * after[199]["x"][2]
    )


def test_a_ship_at_rest_begins_when_its_shaft_turns() -> None:
    record = get_observer("augmented-kalman").discretise(SHIP, DT)
    measurements = noisy_measurements(20)
    measurements[:5, :2] = 0.0
    after = sampled(record, measurements)
    assert [e["valid"] for e in after[:6]] == [0, 0, 0, 0, 0, 1]
    assert after[5]["x"][1] == pytest.approx(0.0, abs=1e-12)
    assert after[5]["x"][2] == pytest.approx(after[5]["advance_velocity"] / 0.95)


def test_an_estimate_stays_in_the_range_of_its_key() -> None:
    ship = load_ship("frigate")
    _, measurements = voyage(ship, 300.0)
    measurements[:, 1] -= 8e3  # a negative load torque
    observer = get_observer("augmented-kalman-friction")
    number, _ = follow_parameter(observer, ship, measurements, DT)
    assert number.min() == 0.0


def test_noises_scale_with_the_ship() -> None:
    ship = load_ship("ferry")
    record = AugmentedKalman().discretise(ship, DT)
    speed = 2200.0 / 3.5 * math.pi / 30.0
    torque = 434.0 * 3.5 * 0.97
    settled = math.sqrt(0.25 * 1.5)
    assert record["measurement"] == pytest.approx((0.002 * speed) ** 2)
    assert record["spread"] == pytest.approx([0.002 * speed, settled, settled, 0.2])
    gauge = DT * (0.0075 * torque / 5.0) ** 2
    assert record["process"] == pytest.approx([gauge, 0.25, 0.0, 1e-6])
    record = get_observer("augmented-kalman-friction").discretise(ship, DT)
    assert record["spread"][3] == pytest.approx(0.02 * torque)
    viscous = AugmentedKalman(VISCOUS, spread=0.1).discretise(ship, DT)
    assert viscous["spread"][3] == pytest.approx(0.1 * torque / speed)


def test_other_parameters_and_ships_are_refused() -> None:
    with pytest.raises(
        ObserverError, match=r"cannot estimate 'hull.mass_kg'; allowed: hull.fouling_frac"
    ):
        AugmentedKalman("hull.mass_kg").discretise(SHIP, DT)
    held = load_ship("frigate").with_values({"hull.fixed": True})
    with pytest.raises(ObserverError, match="augmented-kalman needs a diesel ship that moves"):
        AugmentedKalman().discretise(held, DT)
