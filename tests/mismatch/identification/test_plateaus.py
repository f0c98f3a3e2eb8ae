"""Steady states found in recordings."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.identification.drive_train import drive_train
from shaftline.mismatch.identification.steady import plateaus

from .benches import recorded, staircase, swing, tug

LEVELS = (3.91, 5.89, 4.91)


def test_every_level_is_found_and_its_means_are_the_steady_state_s() -> None:
    found = plateaus(tug(), staircase(tug(), LEVELS))
    assert [one.means["motor_voltage_V"] for one in found] == pytest.approx(LEVELS)
    assert [one.begin for one in found] == [0, 20000, 40000]
    train = drive_train(tug())
    for one in found:
        point = train.equilibrium(one.means["motor_voltage_V"])
        assert 3.0 * one.means["shaft_speed_rad_s"] == pytest.approx(point.motor_speed, rel=3e-4)
        assert one.means["motor_current_A"] == pytest.approx(point.current, rel=3e-4)


def test_what_has_not_settled_is_left_out() -> None:
    found = plateaus(tug(), staircase(tug(), LEVELS))
    # five time constants of 0.11 s, and no more than twice as many
    assert 7000 < found[1].settled - found[1].begin < 11000
    assert found[0].settled < 2500  # began settled
    short = plateaus(tug(), staircase(tug(), LEVELS, hold_s=0.3))
    assert [one.means["motor_voltage_V"] for one in short] == pytest.approx(LEVELS[:1])


def test_noise_hides_no_level_and_moves_no_edge() -> None:
    table = staircase(tug(), LEVELS)
    rng = np.random.default_rng(1)
    for column, rms in (
        ("motor_voltage_V", 0.02),
        ("shaft_speed_rad_s", 1.0),
        ("motor_current_A", 0.1),
    ):
        table[column] += rms * rng.standard_normal(len(table))
    found = plateaus(tug(), table)
    assert [one.begin for one in found] == [0, 20000, 40000]
    assert [one.means["motor_voltage_V"] for one in found] == pytest.approx(LEVELS, abs=1e-3)


def test_neither_a_ramp_nor_a_sine_is_steady() -> None:
    assert plateaus(tug(), recorded(tug(), np.linspace(4.0, 7.0, 30000))) == []
    assert plateaus(tug(), swing(tug(), 5.0, 5.0)) == []
    with pytest.raises(ValueError, match="tito-neri-sine: the recording has no motor_voltage_V"):
        plateaus(tug(), swing(tug(), 5.0, 1.0).drop(columns="motor_voltage_V"))


def test_a_constant_channel_is_settled() -> None:
    """Means of equal numbers differ by their rounding: a pitch of 0.7 does not move."""
    table = staircase(tug(), LEVELS).assign(pitch_ratio=0.7)
    assert len(plateaus(tug(), table)) == len(LEVELS)
