"""Augmented filter of a ship: prediction by the plant, estimates and standard errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import ObserverError
from shaftline.observers.ship_filter import DISTURBANCE, ShipFilter
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, load_ship, realise, simulate
from shaftline.plant.columns import MEASURED, drive_column
from shaftline.plant.replay import Replay

NOISE = {
    "pitch_ratio": 0.002,
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 1.5e3,
    "ship_speed_m_s": 0.05,
}
START = {
    "pitch_ratio": 0.02,
    "shaft_speed": 0.2,
    "ship_speed": 0.1,
    "brake_torque": 2e3,
    "inflow": 0.5,
    "ventilation": 0.1,
    "motor_current": 1.0,
}
TRUTH = {
    "hull.fouling_fraction": 0.15,
    "transmission.coulomb_friction_engine_side_N_m": 8e3,
    "hull.wake_fraction": 0.06,
}
SPREAD = dict(zip(TRUTH, (0.5, 5e4, 0.05), strict=True))


def recording(
    ship: Ship, seconds: float, noise: dict[str, float], seed: int = 0, every: int = 1
) -> pd.DataFrame:
    """Return a recording with noise of a voyage with a command step every 20 s."""
    rng = np.random.default_rng(seed)
    count = int(seconds / 20.0) + 1
    low, high = (12.0, 25.0) if ship.has_diesel else (4.0, 9.0)
    rack, pitch = rng.uniform(low, high, count), rng.uniform(0.9, 1.4, count)
    schedule = Schedule(
        lambda t: rack[(t // 20.0).astype(int)], lambda t: pitch[(t // 20.0).astype(int)]
    )
    begin = equilibrium(ship, rack[0], pitch[0] if ship.has_variable_pitch else 1.0)
    samples = simulate(ship, schedule, seconds, initial=begin.state)[::every]
    table = {"time_s": samples["time"], drive_column(ship): samples["drive"]}
    table["pitch_ratio_command"] = samples["pitch_command"]
    for column, sd in noise.items():
        table[column] = samples[MEASURED[column]] + sd * rng.standard_normal(len(samples))
    return pd.DataFrame(table)


def frigate_filter(**changes: Any) -> ShipFilter:
    settings: dict[str, Any] = {
        "parameter_spread": SPREAD,
        "noise": NOISE,
        "state_spread": START,
    }
    return ShipFilter(load_ship("frigate"), list(TRUTH), **(settings | changes))


def test_parameters_and_standard_errors_are_right() -> None:
    truth = load_ship("frigate").with_values(TRUTH)
    scores = []
    for seed in range(4):
        table = recording(truth, 300.0, NOISE, seed)
        own = frigate_filter()
        followed = own.follow(Replay(own.ship, table, 2.0))
        errors = own.parameters - np.array([*TRUTH.values()])
        own_errors = np.sqrt(np.diag(own.covariance))
        assert own.states == ("pitch_ratio", "shaft_speed", "ship_speed")
        np.testing.assert_allclose(followed.estimates[-1], own.z)
        np.testing.assert_allclose(followed.standard_errors[-1, 4:], own_errors)
        assert np.all(np.abs(errors) < (2e-3, 50.0, 5e-4))
        scores.append(errors / own_errors)
        innovations = followed.innovations[100:]
        np.testing.assert_allclose(innovations.std(axis=0), 1.0, atol=0.04)
        assert np.all(np.abs(np.mean(innovations[1:] * innovations[:-1], axis=0)) < 0.05)
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all((rms > 0.4) & (rms < 1.9))


RICH = {
    "prime_mover.lag_s": 0.4,
    "prime_mover.dead_time_s": 0.63,
    "prime_mover.rack_rate_limit_mm_s": 2.0,
    "pitch_actuator.backlash": 0.03,
    "pitch_actuator.dead_band": 0.01,
    "propeller.inflow_lag_s": 0.5,
    "ventilation.thrust_loss": 0.4,
    "ventilation.torque_loss": 0.3,
    "ventilation.onset_submergence": 1.5,
    "ventilation.hysteresis": 0.2,
    "ventilation.surface_loss": 1.0,
    "hull.episode_resistance_fraction": 0.4,
    "hull.episode_start_s": 20.0,
    "hull.episode_end_s": 40.0,
    "sensors.torque_gain": 1.02,
    "sensors.pitch_offset": 0.01,
    "sensors.torque_bias_N_m": 500.0,
}


@pytest.mark.parametrize(("every", "changes"), [(1, {}), (3, RICH), (1, RICH)])
def test_a_filter_without_measurements_is_the_simulation(
    every: int, changes: dict[str, float]
) -> None:
    """Without uncertainty the prediction is bit-identical with the replay of the plant."""
    ship = load_ship("frigate").with_values(changes)
    table = recording(ship, 60.0, NOISE, every=every)
    swell = 4.0 + 1.5 * np.sin(0.5 * table["time_s"])
    table = table.assign(propeller_submergence_m=swell)
    replay = Replay(ship, table)
    blind = ShipFilter(
        ship,
        ["hull.fouling_fraction"],
        parameter_spread={"hull.fouling_fraction": 1e-30},
        noise=dict.fromkeys(NOISE, 1e30),
        state_spread=dict.fromkeys(START, 0.0),
    )
    followed = blind.follow(replay)
    simulated = replay.simulate(ship.record())
    for name in ("pitch_ratio", "shaft_speed", "ship_speed"):
        own = followed.estimates[:, blind.states.index(name)]
        # The state is the pitch of the actuator, the sample that of the blades.
        if name != "pitch_ratio" or not changes:
            np.testing.assert_array_equal(own, simulated[name])


def test_the_slopes_of_a_prediction_are_those_of_the_simulation() -> None:
    """An exact measurement at the end changes each parameter by variance times derivative."""
    ship = load_ship("frigate")
    table = recording(ship, 30.0, NOISE)
    keys = [
        "hull.fouling_fraction",
        "prime_mover.torque_per_rack_N_m_mm",
        "pitch_actuator.time_constant_s",
        "transmission.inertia_engine_side_kg_m2",
    ]
    spread = dict(zip(keys, (1e-4, 1e-2, 1e-2, 100.0), strict=True))
    measurements = table.copy()
    measurements.loc[measurements.index[:-1], "ship_speed_m_s"] = math.nan
    one = ShipFilter(
        ship,
        keys,
        parameter_spread=spread,
        noise={"ship_speed_m_s": 1e-9},
        state_spread=dict.fromkeys(START, 0.0),
    )
    replay = Replay(ship, table)
    nominal = replay.simulate(ship.record())["ship_speed"][-1]
    measurements.loc[measurements.index[-1], "ship_speed_m_s"] = nominal + 1e-6
    replay.table = measurements
    one.follow(replay)
    slopes = []
    for key in keys:
        number, record = ship.parameter(key), ship.record()
        number.write(record, number.value * (1 + 1e-5) or 1e-5)
        moved = replay.simulate(record)["ship_speed"][-1]
        slopes.append((moved - nominal) / (number.value * 1e-5 or 1e-5))
    variances = np.square([*spread.values()])
    expected = variances * slopes / (variances @ np.square(slopes)) * 1e-6
    np.testing.assert_allclose(one.parameters - one._model.start, expected, rtol=2e-3)


def test_a_second_recording_starts_with_the_estimate_of_the_first() -> None:
    truth = load_ship("frigate").with_values(TRUTH)
    own = frigate_filter()
    sure = []
    for seed in (1, 2):
        own.follow(Replay(own.ship, recording(truth, 120.0, NOISE, seed), 2.0))
        sure.append(np.sqrt(np.diag(own.covariance)))
    assert np.all(sure[1] < 0.85 * sure[0])
    np.testing.assert_allclose(own.parameters, [*TRUTH.values()], rtol=0.02)
    own.restart([0.0, 0.0, 0.05])
    np.testing.assert_array_equal(own.parameters, [0.0, 0.0, 0.05])
    np.testing.assert_allclose(np.sqrt(np.diag(own.covariance)), [*SPREAD.values()])


def test_the_parameters_of_a_motor() -> None:
    """Estimate K_e, R_a, KQ and friction of a model tug from voltage, speed and current."""
    nominal = load_ship("tito-neri-sine")
    keys = [
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "propeller.torque_coefficient",
        "transmission.coulomb_friction_engine_side_N_m",
    ]
    size = dict(zip(keys, (0.00618, 0.5, 0.04, 0.008), strict=True))
    for key in keys:
        section, _, name = key.partition(".")
        size[key] = getattr(getattr(nominal, section), name)
    truth = nominal.with_values({key: 1.2 * value for key, value in size.items()})
    noise = {"shaft_speed_rad_s": 0.3, "motor_current_A": 0.02}
    table = recording(truth, 30.0, noise)
    own = ShipFilter(
        nominal,
        keys,
        parameter_spread={key: 0.5 * value for key, value in size.items()},
        noise=noise,
        state_spread=START,
    )
    own.follow(Replay(nominal, table, 0.05))
    np.testing.assert_allclose(own.parameters / [*size.values()], 1.2, rtol=0.02)
    assert np.all(
        np.abs(own.parameters / [*size.values()] - 1.2)
        < 4.0 * np.sqrt(np.diag(own.covariance)) / [*size.values()]
    )


def test_missing_measurements_are_left_out() -> None:
    table = recording(load_ship("frigate").with_values(TRUTH), 60.0, NOISE)
    table.loc[100:200, "shaft_torque_N_m"] = math.nan
    own = frigate_filter()
    followed = own.follow(Replay(own.ship, table.fillna(0.0), 2.0))
    assert np.isfinite(own.z).all()
    replay = Replay(own.ship, table.fillna(0.0), 2.0)
    replay.table = table
    own = frigate_filter()
    followed = own.follow(replay)
    assert np.isnan(followed.innovations[100:201, 2]).all()
    assert np.isfinite(np.delete(followed.innovations, 2, axis=1)).all()
    assert np.isfinite(followed.estimates).all()


def test_an_estimate_stays_inside_its_range() -> None:
    truth = load_ship("frigate")
    own = frigate_filter()
    followed = own.follow(Replay(truth, recording(truth, 60.0, NOISE), 2.0))
    assert followed.estimates[:, 5].min() >= 0.0  # friction is not negative


def test_waves_are_estimated_and_bias_no_parameter() -> None:
    """With the disturbance as a state, waves do not bias the parameters."""
    key = "hull.fouling_fraction"
    truth = load_ship("frigate").with_values({key: 0.2})
    begin = equilibrium(truth, 20.0, 1.3)
    sea = get_sea("state-5")
    assert sea is not None
    waves = realise(sea, depth_m=4.0, seed=5)
    samples = simulate(truth, Schedule(20.0, 1.3), 400.0, initial=begin.state, sea=waves)
    rng = np.random.default_rng(0)
    table = {"time_s": samples["time"], drive_column(truth): samples["drive"]}
    table["pitch_ratio_command"] = samples["pitch_command"]
    for column, sd in NOISE.items():
        table[column] = samples[MEASURED[column]] + sd * rng.standard_normal(len(samples))
    inflow = samples["advance_velocity"] - 0.95 * samples["ship_speed"]
    own = ShipFilter(
        load_ship("frigate"),
        [key],
        parameter_spread={key: 0.5},
        noise=NOISE,
        state_spread=START,
        state_walk={DISTURBANCE: 0.5},
    )
    followed = own.follow(Replay(own.ship, pd.DataFrame(table), 2.0))
    error = followed.estimates[200:, 3] - inflow[200:]
    assert inflow.std() > 0.4
    assert error.std() < 0.1
    assert own.parameters[0] == pytest.approx(0.2, abs=4.0 * math.sqrt(own.covariance[0, 0]))
    assert math.sqrt(own.covariance[0, 0]) < 0.02


def test_a_disturbance_without_measurements_decays() -> None:
    """It decays to 1/e in 3 s, and its standard error becomes the stationary one."""
    ship = load_ship("frigate")
    table = recording(ship, 20.0, NOISE)
    replay = Replay(ship, table)
    replay.table = table.assign(shaft_torque_N_m=table["shaft_torque_N_m"] - 2e4)
    replay.table.loc[101:, [*NOISE]] = math.nan
    own = frigate_filter(state_walk={DISTURBANCE: 0.5})
    followed = own.follow(replay)
    u, error = followed.estimates[:, 3], followed.standard_errors[:, 3]
    assert abs(u[100]) > 0.05
    assert u[160] / u[100] == pytest.approx(math.exp(-1.0), rel=0.02)
    assert error[-1] == pytest.approx(0.5 * math.sqrt(1.5), rel=0.02)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"free": []}, "name at least one key"),
        ({"noise": {"fuel_flow_kg_s": 1.0}}, "fuel_flow_kg_s: the filter can use pitch_ratio, "),
        ({"noise": {"pitch_ratio": 0.0}}, "pitch_ratio: the standard deviation must be above 0"),
        (
            {"parameter_spread": {**SPREAD, "hull.wake_fraction": math.nan}},
            "hull.wake_fraction: the stand",
        ),
    ],
)
def test_invalid_arguments_are_refused(changes: dict[str, Any], why: str) -> None:
    settings: dict[str, Any] = {
        "free": list(TRUTH),
        "parameter_spread": SPREAD,
        "noise": NOISE,
        "state_spread": START,
    }
    with pytest.raises(ObserverError, match=why):
        ShipFilter(load_ship("frigate"), **(settings | changes))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"sensors.torque_delay_s": 0.5}, r"without delay, but sensors.torque_delay_s is above 0"),
        ({"sensors.speed_delay_s": 0.5}, r"without delay, but sensors.speed_delay_s is above 0"),
        (
            {"sensors.speed_log_lag_s": 0.5},
            r"without delay, but sensors.speed_log_lag_s is above 0",
        ),
    ],
)
def test_a_delayed_measurement_is_refused(changes: dict[str, float], why: str) -> None:
    ship = load_ship("frigate").with_values(changes)
    with pytest.raises(ObserverError, match=why):
        ShipFilter(ship, list(TRUTH), parameter_spread=SPREAD, noise=NOISE, state_spread=START)


def test_the_wake_is_not_identifiable_from_a_measured_inflow() -> None:
    ship = load_ship("frigate")
    table = recording(ship, 30.0, NOISE).assign(inflow_velocity_m_s=7.0)
    own = frigate_filter()
    with pytest.raises(
        ObserverError,
        match=r"hull.wake_fraction is not identifiable from a recording with inflow_vel",
    ):
        own.follow(Replay(ship, table))


WALK = {DISTURBANCE: 0.2, "shaft_speed": 0.01}


def test_constant_noise_is_the_given_one() -> None:
    ship = load_ship("frigate")
    own = frigate_filter(state_walk=WALK)
    followed = own.follow(Replay(ship, recording(ship, 20.0, NOISE)))
    np.testing.assert_allclose(followed.noise, np.tile([*NOISE.values()], (401, 1)))
    np.testing.assert_allclose(followed.walk, np.tile([0.0, 0.01, 0.0, 0.2], (401, 1)))


def test_adaptive_noise_follows_a_change() -> None:
    """The torque meter becomes four times noisier; the others and the noise of 0 do not change."""
    ship = load_ship("frigate")
    table = recording(ship, 200.0, NOISE, seed=2)
    more = math.sqrt(15.0) * NOISE["shaft_torque_N_m"]
    later = table["time_s"] >= 100.0
    table.loc[later, "shaft_torque_N_m"] += more * np.random.default_rng(9).standard_normal(
        later.sum()
    )
    table.loc[table["time_s"] > 150.0, "pitch_ratio"] = math.nan
    given = NOISE | {"ship_speed_m_s": 0.5}
    own = frigate_filter(noise=given, noise_memory_s=20.0, state_walk={DISTURBANCE: 0.2})
    replay = Replay(ship, table)
    followed = own.follow(replay)
    found = dict(zip(NOISE, (followed.noise / [*NOISE.values()]).T, strict=True))
    assert found["shaft_torque_N_m"][1990] == pytest.approx(1.0, abs=0.15)
    assert found["shaft_torque_N_m"][-1] == pytest.approx(4.0, abs=0.4)
    assert found["shaft_speed_rad_s"][-1] == pytest.approx(1.0, abs=0.15)
    assert found["ship_speed_m_s"][[0, -1]] == pytest.approx([10.0, 1.0], rel=0.15)
    np.testing.assert_allclose(found["pitch_ratio"][3001:], found["pitch_ratio"][3001], rtol=0.02)
    assert np.all(followed.walk[:, :3] == 0.0)
    # calm water: the noise of the inflow falls until it does not matter, and not below its limit
    assert 0.002 <= followed.walk[-1, 3] < 0.05
    # a further recording goes on with these noises, a restart with the given ones
    again = own.follow(replay, rows=1)
    assert again.noise[0] == pytest.approx(followed.noise[-1], rel=0.02)
    own.restart(own.parameters)
    assert own.follow(replay, rows=1).noise[0] == pytest.approx([*given.values()], rel=0.02)


@pytest.mark.parametrize(
    ("memory_s", "why"),
    [
        (
            0.0,
            r"noise_memory_s = 0: .* must be above 0 s, such as 30; None keeps the noise constant",
        ),
        (-1.0, r"noise_memory_s = -1: "),
        (math.nan, r"noise_memory_s = nan: "),
        (0.9, r"noise_memory_s = 0.9: the rows are 0.05 s apart, .* at least 1 s \(20 rows\)"),
    ],
)
def test_a_memory_of_too_few_rows_is_refused(memory_s: float, why: str) -> None:
    ship = load_ship("frigate")
    replay = Replay(ship, recording(ship, 20.0, NOISE))
    with pytest.raises(ObserverError, match=why):
        frigate_filter(noise_memory_s=memory_s).follow(replay)
