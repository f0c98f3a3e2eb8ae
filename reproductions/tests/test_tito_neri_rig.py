"""The synthetic rig: what its instruments do, and what the methods make of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from reproductions.tito_neri import experiments, rig, rig_page
from reproductions.tito_neri.experiments import Experiment
from reproductions.tito_neri.identification import DELAY
from shaftline.mismatch.identification.drive_train import CONSTANT, RESISTANCE, SIX, drive_train
from shaftline.mismatch.identification.free_parameters import number_of
from shaftline.mismatch.identification.sine import sine
from shaftline.mismatch.identification.step import step

SHIP = rig_page.truth()
SOUND = rig.Instruments(
    0.0, 0.0, 0.0, 0.0, uneven_deg=0.0, gain=1.0, lag_s=0.0, current_noise_A=0.0
)
"""Perfect instruments except the encoder's holes."""
CLEAN = replace(SOUND, holes=360)
"""Perfect instruments with an encoder of many holes, which gives the true speed."""


def steady(volts: float = 5.89, seconds: float = 1.0) -> Experiment:
    return experiments.staircase((volts,), seconds)


def test_without_faults_the_rig_is_the_plant() -> None:
    test = experiments.staircase((5.0, 6.0), 0.5)
    own, plain = rig.record_test(SHIP, test, CLEAN), experiments.simulate_test(SHIP, test)
    assert_allclose(own["motor_voltage_V"], plain["motor_voltage_V"], rtol=1e-12)
    assert_allclose(own["motor_current_A"], plain["motor_current_A"], atol=3e-3)
    assert_allclose(own["shaft_speed_rad_s"][100:], plain["shaft_speed_rad_s"][100:], rtol=3e-3)


def test_an_encoder_tells_the_last_interval_until_the_next_flank() -> None:
    """Even holes and a speed that rises evenly: the value of a flank is the mean over its interval."""
    disk = replace(SOUND, holes=4)
    time = np.arange(40001) * 1e-4
    told = rig.encoder_speed(20.0 * time + 3.0 * time**2, 1e-4, disk)
    flanks = np.arange(1, 10) * (math.pi / 2.0)
    when = (-20.0 + np.sqrt(400.0 + 12.0 * flanks)) / 6.0
    for first, second, third in zip(when[:-2], when[1:-1], when[2:], strict=True):
        inside = (time > second + 1e-4) & (time < third - 1e-4)
        assert_allclose(told[inside], (math.pi / 2.0) / (second - first), rtol=1e-4)


def test_uneven_holes_repeat_every_turn() -> None:
    own = replace(SOUND, uneven_deg=0.3)
    table = rig.record_test(SHIP, steady(), own)
    speed = 3.0 * table["shaft_speed_rad_s"].to_numpy()[2000:]
    values = speed[np.r_[True, np.diff(speed) != 0.0]]
    assert_allclose(values[15:60], values[:45], rtol=2e-3)
    assert len(np.unique(np.round(values[:15], 1))) > 10
    gaps = np.diff(np.r_[own.flanks_rad, own.flanks_rad[0] + 2.0 * math.pi])
    expected = sorted(2.0 * math.pi / 15.0 / gaps * values.mean())
    assert_allclose(sorted(values[:15]), expected, rtol=3e-3)
    places = np.degrees(own.flanks_rad) - 24.0 * np.arange(15)
    assert 0.15 < places.std() < 0.5
    assert own.flanks_rad.shape == (15,)


def test_amplifier_gives_less_and_late() -> None:
    own = replace(CLEAN, gain=0.99, lag_s=2e-3)
    table = rig.record_test(SHIP, experiments.staircase((5.0, 6.0), 0.05), own)
    volts = table["motor_voltage_V"].to_numpy()
    assert volts[:500] == pytest.approx(np.full(500, 4.95))
    time = (np.arange(500) + 0.5) * 1e-4  # a row's mean is that of its middle, nearly
    assert_allclose(volts[500:], 4.95 + 0.99 * -np.expm1(-time / 2e-3), rtol=1e-4)
    assert table["voltage_set_V"].iloc[-1] == 6.0


def test_noise_is_the_current_s_alone_and_its_seed_s() -> None:
    own = replace(CLEAN, current_noise_A=0.03)
    one, same, other = (rig.record_test(SHIP, steady(), own, seed) for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(one, same)
    assert one["motor_current_A"].std() == pytest.approx(0.03, rel=0.05)
    assert np.corrcoef(one["motor_current_A"], other["motor_current_A"])[0, 1] < 0.05
    noise = experiments.noise(5.0, 1)  # another sequence than a test's own of the same seed
    table = rig.record_test(SHIP, noise, own, 1)
    clean = rig.record_test(SHIP, noise, CLEAN, 1)
    added = table["motor_current_A"] - clean["motor_current_A"]
    for shift in range(3):
        alike = np.corrcoef(added[shift:], noise.voltage[: len(added) - shift])[0, 1]
        assert abs(alike) < 0.03


def test_orders_six_and_twelve_stand_out() -> None:
    """The paper's order tracking, over a ramp of speeds."""
    table = rig.record_test(SHIP, rig.order_ramp(12.0))
    rpm = 3.0 * table["shaft_speed_rad_s"] * 30.0 / math.pi
    assert (rpm.iloc[2000], rpm.iloc[-1]) == pytest.approx((235.0, 1990.0), rel=0.07)
    orders = rig.order_spectrum(table, 3.0, turns=16)
    assert rig_page.peaks(orders) == [6.0, 12.0]
    plain = rig.order_spectrum(rig.record_test(SHIP, rig.order_ramp(12.0), CLEAN), 3.0, turns=16)
    assert plain.query("order > 5")["current_A"].max() < 0.02 * orders["current_A"].max()


def test_cogging_hardly_shows_in_the_current_and_ripple_does() -> None:
    only, both = rig_page.cogs_in_current()
    train, speed = drive_train(SHIP), 6.0 * 214.0
    # a torque at order 6 speeds the shaft by a / (I w), which the back EMF turns into a current
    impedance = math.hypot(train.resistance, speed * train.inductance)
    moved = 3.5e-3 / (train.inertia * speed) * train.constant / impedance
    assert only == pytest.approx(moved, rel=0.15)
    assert both == pytest.approx(0.045 * train.constant * 214.0 / impedance, rel=0.1)
    assert both > 50.0 * only


def test_methods_see_through_the_instruments() -> None:
    """All six and the encoder's delay by sines: 2 %, and the time between two flanks."""
    tables = [
        rig.record_test(SHIP, test, seed=i) for i, test in enumerate(experiments.sines()[2:8])
    ]
    found = sine(rig_page.start(), tables, rig_page.LATE)
    values = dict(zip(found.keys, found.values, strict=True))
    for key in SIX:
        assert values[key] == pytest.approx(number_of(SHIP, key).value, rel=0.03), key
    assert values[DELAY] == pytest.approx(2.0 * math.pi / 15.0 / 213.0, rel=0.08)
    stairs = step(SHIP, [rig.record_test(SHIP, experiments.staircase(hold_s=2.5))], SIX)
    values = dict(zip(stairs.keys, stairs.values, strict=True))
    for key in SIX[1:]:
        assert values[key] == pytest.approx(number_of(SHIP, key).value, rel=0.025), key


def test_scores_are_the_paper_s() -> None:
    """Eqs. 20 and 21 of the plant against itself, and of a wrong constant."""
    tables = [experiments.simulate_test(SHIP, experiments.staircase((5.0, 6.0), 0.5))]
    own = rig_page._scores(SHIP, tables)
    assert own["speed_fit_percent"] > 99.99
    assert own["current_mse"] < 1e-12
    wrong = rig_page._scores(SHIP.with_values({SIX[1]: 0.02}), tables)
    assert wrong["speed_fit_percent"] < 90.0
    assert wrong["speed_mse"] > own["speed_mse"]


@pytest.mark.parametrize("method", list(rig_page.METHODS))
def test_records_of_thirty_seconds(method: str) -> None:
    test = rig_page.record_of_30_s(method, 3)
    assert len(test.voltage) * test.interval_s == pytest.approx(30.0, abs=0.1)
    assert test.interval_s == 1e-4


@pytest.mark.slow
def test_a_change_is_found_in_thirty_seconds() -> None:
    """The staircase: a fouled propeller of 2 % beside the unchanged rig."""
    key = SIX[-1]
    before = rig_page.estimates("step", SHIP, 0)
    fouled = SHIP.with_values({key: 1.02 * number_of(SHIP, key).value})
    after = rig_page.estimates("step", fouled, 1)
    for way in ("together", "alone"):
        assert after[way][key] / before[way][key] == pytest.approx(1.02, abs=2e-3)


def test_output_error_finds_the_rig() -> None:
    test = experiments.staircase((3.91, 5.89, 7.9), 0.8)
    found = rig_page.numbers_by(rig_page.OUTPUT_ERROR, [rig.record_test(SHIP, test, seed=1)])
    assert set(found) == set(rig_page.LATE)
    for key in (CONSTANT, RESISTANCE):
        assert found[key] == pytest.approx(number_of(SHIP, key).value, rel=0.02), key
