"""Frequency responses, and what a ship's linear model says to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from shaftline.mismatch.identification.drive_train import drive_train
from shaftline.mismatch.identification.frequency import (
    FrequencyResponse,
    attenuation,
    channels_of,
    interval_of,
    modelled_response,
    slowest_s,
    zero_order_hold,
)
from shaftline.plant import Ship, equilibrium, linearise, load_ship

from .benches import recorded, responses, swing, tug

FREQUENCY = np.array([0.3, 5.0, 20.0, 500.0, 3000.0])


def about(ship: Ship, interval_s: float = 0.0) -> FrequencyResponse:
    """A response at the ship's own steady state, all 0."""
    point = drive_train(ship).equilibrium(5.89)
    means = {"shaft_speed_rad_s": point.motor_speed / 3.0, "motor_current_A": point.current}
    none = {column: np.zeros(len(FREQUENCY), complex) for column in means}
    size = {column: np.full(len(FREQUENCY), np.nan) for column in means}
    return FrequencyResponse(5.89, means, FREQUENCY, none, size, interval_s, {})


def test_the_model_is_the_drive_train_s() -> None:
    ship = tug()
    train = drive_train(ship)
    model = train.linear(train.equilibrium(5.89))
    found = modelled_response(ship, about(ship))
    speed, current = responses(model, FREQUENCY)
    assert_allclose(found["shaft_speed_rad_s"], speed, rtol=1e-6)
    assert_allclose(found["motor_current_A"], current, rtol=1e-6)


def test_a_late_sensor_turns_the_phase_alone() -> None:
    ship = tug().with_values({"sensors.speed_delay_s": 0.0015})
    prompt, late = modelled_response(tug(), about(tug())), modelled_response(ship, about(ship))
    turned = prompt["shaft_speed_rad_s"] * np.exp(-0.0015j * FREQUENCY)
    assert_allclose(late["shaft_speed_rad_s"], turned, rtol=1e-9)
    assert_allclose(late["motor_current_A"], prompt["motor_current_A"], rtol=1e-12)


def test_sampled_model_is_the_simulation_s_at_a_coarse_interval() -> None:
    """A held sine of 8 rows a period, where a continuous model is 5 % and 8 degrees off."""
    ship, step = tug().with_values({"integration.time_step_s": 5e-5}), 4e-4
    frequency = 2.0 * np.pi / (8 * step)
    time = np.arange(40000) * step
    table = recorded(ship, 5.89 * (1.0 + 0.002 * np.sin(frequency * time)), step)
    rows = slice(-8000, None)
    carrier = np.exp(-1j * frequency * time[rows])
    cause = 2.0 * np.mean((table["motor_voltage_V"] / 5.89 - 1.0).to_numpy()[rows] * carrier)
    measured = replace(
        about(ship, step),
        frequency=np.array([frequency]),
        response={"motor_current_A": np.zeros(1, complex)},
    )
    mean = measured.means["motor_current_A"]
    effect = 2.0 * np.mean((table["motor_current_A"] / mean - 1.0).to_numpy()[rows] * carrier)
    found = modelled_response(ship, measured)["motor_current_A"][0] * zero_order_hold(
        frequency, step
    )
    assert effect / cause == pytest.approx(found, rel=2e-3)
    plain = modelled_response(ship, replace(measured, interval_s=0.0))["motor_current_A"][0]
    assert abs(effect / cause / plain - 1.0) > 0.05


def test_holding_delays_by_half_an_interval() -> None:
    assert zero_order_hold(100.0, 1e-3) == pytest.approx(
        np.sinc(0.05 / np.pi) * np.exp(-0.05j), rel=1e-12
    )
    assert zero_order_hold([0.0, 5.0], 0.0) == pytest.approx([1.0, 1.0])


def test_the_slowest_pole_of_a_ship_that_moves() -> None:
    ship = load_ship("frigate")
    steady = equilibrium(ship, 22.0, 1.4)
    means = {
        "shaft_speed_rad_s": steady.state.shaft_speed,
        "ship_speed_m_s": steady.state.ship_speed,
    }
    point = FrequencyResponse(22.0, means, FREQUENCY, {}, {}, 0.0, {})
    poles = linearise(ship, steady).poles().real
    assert slowest_s(ship, point) == pytest.approx(-1.0 / poles.max(), rel=1e-6)
    assert slowest_s(tug(), about(tug())) == pytest.approx(1 / 9.0, rel=0.02)


def test_table_has_gains_phases_errors_and_coherence() -> None:
    some = replace(
        about(tug()),
        response={"motor_current_A": np.full(5, 2j)},
        error={"motor_current_A": np.full(5, 0.1)},
        coherence={"motor_current_A": np.ones(5)},
    )
    table = some.table()
    assert table["motor_current_gain"].tolist() == [2.0] * 5
    assert table["motor_current_phase_deg"].tolist() == [90.0] * 5
    assert {"frequency_rad_s", "motor_current_standard_error", "motor_current_coherence"} <= {
        *table
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.drop(columns="shaft_speed_rad_s"),
            "sine: tito-neri-sine needs shaft_speed_rad_s",
        ),
        (lambda t: t.assign(shaft_speed_rad_s=t["time_s"] - 0.05), "the shaft stops or reverses"),
        (lambda t: t.assign(motor_voltage_V=0.0), "the mean of motor_voltage_V is 0"),
    ],
)
def test_recordings_without_a_response(change: object, message: str) -> None:
    table = recorded(tug(), np.full(1000, 5.89))
    assert callable(change)
    with pytest.raises(ValueError, match=message):
        channels_of(tug(), change(table), "sine")
    assert interval_of(pd.DataFrame({"time_s": [1.0, 1.5, 2.0]})) == 0.5


def test_a_channel_that_is_held_may_lack_something() -> None:
    values = np.repeat(np.random.default_rng(0).standard_normal(500), 10)
    lacking = attenuation(values, 1e-4, np.array([1.0, 1000.0, 2000.0, 1e5]))
    expected = 1.0 - np.sinc(np.array([1.0, 1000.0, 2000.0, 2e3 * np.pi]) * 5e-4 / np.pi) ** 2
    assert_allclose(lacking, expected, rtol=5e-3, atol=1e-9)
    assert lacking[-1] == pytest.approx(1.0, abs=1e-2)
    assert_allclose(attenuation(values[::10], 1e-3, [10.0, 3000.0]), 0.0, atol=0.0)


def test_a_channel_without_a_mean_has_no_response() -> None:
    """The speed of a fixed hull is 0, a constant torque does not move."""
    table = swing(tug(), 30.0, 1.0).assign(ship_speed_m_s=0.0, shaft_torque_N_m=0.3)
    found = channels_of(tug(), table, "sine")
    assert list(found) == ["motor_voltage_V", "shaft_speed_rad_s", "motor_current_A"]
