from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.mismatch.recordings.noise import (
    Noise,
    estimate_command_noise,
    estimate_noise,
    quantisation,
    saturated_ends,
    white_rms,
)
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, realise, simulate

from .trials import longest_rest

# instrument noise at 10 Hz: rad/s, N m, m/s, P/D
KNOWN = {
    "shaft_speed": 0.02,
    "measured_shaft_torque": 1000.0,
    "measured_ship_speed": 0.02,
    "measured_pitch_ratio": 0.004,
}
MANOEUVRES = ("steady", "steps", "random")


def sailed(ship: Ship, sea: str | None, manoeuvre: str, seconds: float = 300.0) -> Any:
    """Samples at 20 Hz of a ship under way."""
    rng = np.random.default_rng(1)
    time = ship.time_step_s * np.arange(round(seconds / ship.time_step_s))
    rack, pitch = np.full(len(time), 22.0), np.full(len(time), 1.3)
    if manoeuvre == "steps":
        rack, pitch = 20.0 + 6.0 * (time // 40 % 2), 1.3 - 0.2 * (time // 60 % 2)
    if manoeuvre == "random":  # a new order every 5 s
        rack = 22.0 + 3.0 * np.repeat(rng.choice([-1.0, 1.0], len(time) // 100), 100)
    waves = get_sea(sea) if sea else None
    realised = realise(waves, depth_m=ship.propeller.depth_m, seed=1) if waves else None
    start = equilibrium(ship, rack[0], pitch[0]).state
    return simulate(ship, Schedule(rack, pitch), seconds, initial=start, sea=realised)


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
@pytest.mark.parametrize("sea", [None, "state-3", "state-6"])
def test_known_noise_is_found_in_waves_and_manoeuvres(
    frigate: Ship, sea: str | None, manoeuvre: str
) -> None:
    rng = np.random.default_rng(2)
    samples = sailed(frigate, sea, manoeuvre)[::2]
    for name, rms in KNOWN.items():
        noisy = samples[name] + rms * rng.standard_normal(len(samples))
        assert estimate_noise(noisy, 0.1).white_rms == pytest.approx(rms, rel=0.1), name


@pytest.mark.parametrize("sea", [None, "state-6"])
def test_without_noise_almost_none_is_found(frigate: Ship, sea: str | None) -> None:
    samples = sailed(frigate, sea, "steps")[::2]
    for name, rms in KNOWN.items():
        assert estimate_noise(samples[name], 0.1).white_rms < 0.3 * rms, name


@given(
    rms=st.floats(1e-6, 1e6),
    level=st.floats(-1e3, 1e3),
    seed=st.integers(0, 2**31),
    slope=st.floats(-1.0, 1.0),
)
def test_level_slope_and_unit_do_not_matter(
    rms: float, level: float, seed: int, slope: float
) -> None:
    noise = np.random.default_rng(seed).standard_normal(3000)
    values = rms * (noise + level + slope * np.arange(3000))
    assert white_rms(values) == pytest.approx(rms, rel=0.1)


@pytest.mark.parametrize("step", [0.05, 0.5, 2.0])
def test_quantisation_is_found_and_counts_as_noise(step: float) -> None:
    noise = np.random.default_rng(3).standard_normal(4000)
    found = estimate_noise(step * np.round(noise / step), 0.1)
    assert found.quantisation == pytest.approx(step)
    assert found.white_rms == pytest.approx(np.hypot(1.0, step / np.sqrt(12.0)), rel=0.1)


def test_orders_and_smooth_signals_are_not_quantised() -> None:
    time = np.arange(2000) * 0.1
    assert quantisation(np.where(time // 30 % 2, 18.0, 24.0)) == 0.0
    assert quantisation(np.sin(time)) == 0.0
    assert quantisation(np.zeros(100)) == 0.0


def test_a_slow_instrument_is_seen_and_its_noise_found() -> None:
    held = np.repeat(np.random.default_rng(4).standard_normal(600), 10)
    found = estimate_noise(held, 0.1)
    assert found.update_s == pytest.approx(1.0)
    assert found.white_rms == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("values", [np.full(50, 3.0), np.array([1.0, 2.0]), np.array([])])
def test_nothing_to_see_is_no_noise(values: Any) -> None:
    assert estimate_noise(values, 0.1) == Noise(0.0, 0.0, 0.1)


@pytest.mark.parametrize("values", [np.array([1.0, np.nan]), np.zeros((3, 2))])
def test_noise_of_bad_values_is_refused(values: Any) -> None:
    with pytest.raises(ValueError, match="one-dimensional array of finite values"):
        estimate_noise(values, 0.1)


def test_clipping_is_found_at_the_end_that_clips() -> None:
    noise = np.random.default_rng(5).standard_normal(3000)
    ((end, share, row),) = saturated_ends(np.minimum(noise, 1.0), estimate_noise(noise, 0.1))
    assert end == 1.0
    assert share == pytest.approx(0.16, abs=0.02)
    assert row == int(np.argmax(noise >= 1.0))
    assert saturated_ends(noise, estimate_noise(noise, 0.1)) == []


def test_a_frozen_stretch_is_found() -> None:
    noise = np.random.default_rng(6).standard_normal(3000)
    assert longest_rest(noise, estimate_noise(noise, 0.1)) == (0, 0)
    noise[1000:1100] = noise[1000]
    assert longest_rest(noise, estimate_noise(noise, 0.1)) == (1000, 100)


@pytest.mark.parametrize("share", [0.1, 0.3, 0.45, 0.5, 0.55, 0.9])
def test_a_sensor_that_stops_has_the_noise_that_it_had_before(frigate: Ship, share: float) -> None:
    samples = sailed(frigate, "state-3", "steps")[::2]
    for name, rms in KNOWN.items():
        noisy = samples[name] + rms * np.random.default_rng(2).standard_normal(len(samples))
        stop = round((1.0 - share) * len(noisy))
        noisy[stop:] = noisy[stop - 1]
        noise = estimate_noise(noisy, 0.1)
        assert noise.white_rms == pytest.approx(rms, rel=0.15), name
        assert longest_rest(noisy, noise) == (stop - 1, len(noisy) - stop + 1), name


def test_an_order_that_is_held_and_led_by_turns_has_no_noise() -> None:
    ramps = np.interp(np.arange(0.0, 800.0), np.arange(0, 800, 100), [0, 0, 1, 1, 0, 0, 1, 1])
    assert white_rms(ramps) < 1e-12


def test_the_steps_of_a_command_are_no_noise_and_its_rests_no_slow_instrument() -> None:
    steps = np.resize(np.repeat([20.0, 25.0, 16.0, 22.0], 60), 1200)
    assert estimate_command_noise(steps, 0.5) == Noise(0.0, quantisation(steps), 0.5)
    measured = steps + 0.1 * np.random.default_rng(7).standard_normal(1200)
    assert estimate_command_noise(measured, 0.5).white_rms == pytest.approx(0.1, rel=0.1)
    for values in (np.array([1.0]), np.array([])):
        assert estimate_command_noise(values, 0.5) == Noise(0.0, 0.0, 0.5)
    with pytest.raises(ValueError, match="one-dimensional array of finite values"):
        estimate_command_noise(np.array([1.0, np.nan]), 0.5)
