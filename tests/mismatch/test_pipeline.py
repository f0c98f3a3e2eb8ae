"""Verdicts: nothing missing, no name, cannot be decided; and the arithmetic under them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shaftline.mismatch import Options, Recording, diagnose, fit_percent
from shaftline.mismatch.judge.location import active_windows, change_points, regime
from shaftline.mismatch.search.spectra import Likelihood, make_bands, moments
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import get_sea, load_ship, realise
from shaftline.plant.replay import simulate_recording

from .voyages import NOISE, frigate_voyage


@pytest.mark.parametrize(("sea", "seed"), [(None, 0), (None, 1), ("state-5", 2), ("state-6", 3)])
def test_nothing_is_named_where_nothing_is_missing(sea: str | None, seed: int) -> None:
    waves = None
    if sea is not None:
        preset = get_sea(sea)
        assert preset is not None
        waves = realise(preset, 4.0, seed)
    found = diagnose(load_ship("frigate"), frigate_voyage(seed=seed, sea=waves))
    assert found.verdict == "nothing-missing"
    assert found.fit_after == found.fit_before
    assert found.to_dict()["effects"] == []


def test_a_wrong_number_inside_its_tolerance_is_no_missing_physics() -> None:
    values = {
        "hull.resistance_coefficient_N_s2_m2": 3306.2 * 1.01,
        "transmission.inertia_engine_side_kg_m2": 53697.0 * 0.99,
        "prime_mover.torque_per_rack_N_m_mm": 1428.6 * 1.003,
    }
    found = diagnose(load_ship("frigate"), frigate_voyage(values, seed=5))
    assert found.verdict == "nothing-missing"


def test_what_the_catalogue_does_not_hold_is_shown_without_a_name() -> None:
    # a shaft generator that is switched on for a while
    values = {
        "unexplained.balance": "engine",
        "unexplained.signal": "time",
        "unexplained.knots": [0.0, 199.0, 200.0, 380.0, 381.0, 600.0],
        "unexplained.values": [0.0, 0.0, -25000.0, -25000.0, 0.0, 0.0],
    }
    found = diagnose(load_ship("frigate"), frigate_voyage(values, seed=4))
    assert found.verdict == "unexplained"
    assert found.shape is not None
    assert found.shape.balance == "engine"
    assert found.corrected.unexplained is not None
    assert found.fit_after["shaft_speed_rad_s"] >= found.fit_before["shaft_speed_rad_s"] - 0.5


def test_the_true_effect_left_out_of_the_catalogue_is_not_replaced_by_a_wrong_name() -> None:
    values = {"prime_mover.lag_s": 2.5}
    table = frigate_voyage(values, seed=3)
    out = ("engine-torque-lag", "engine-dead-time", "rack-rate-limit", "torque-sensor-delay")
    found = diagnose(load_ship("frigate"), table, options=Options(exclude=out))
    assert found.verdict == "unexplained"
    assert found.to_dict()["location"]["balances"] == ["engine"]


def test_a_dull_recording_is_not_guessed_at() -> None:
    table = frigate_voyage(seed=2, seconds=60.0)
    steady = simulate_recording(
        load_ship("frigate"), table.assign(fuel_rack_mm=20.0, pitch_ratio_command=1.2)
    )
    rng = np.random.default_rng(0)
    for column, rms in NOISE.items():
        steady[column] = steady[column] + rms * rng.standard_normal(len(steady))
    dull = Recording(Path("r.csv"), steady, 0.2, {}, limits=("dull: the rack does not move",))
    found = diagnose(load_ship("frigate"), dull)
    assert not found.findings
    assert "annot be decided, because dull: the rack does not move" in found.to_dict()["sentence"]


def test_two_effects_are_both_named() -> None:
    values = {"hull.fouling_fraction": 0.2, "prime_mover.derating_fraction": 0.08}
    found = diagnose(load_ship("frigate"), frigate_voyage(values, seed=7))
    assert {f.effect.id for f in found.findings} == {"hull-fouling", "engine-derating"}


def test_same_recording_same_diagnosis() -> None:
    table = frigate_voyage({"hull.fouling_fraction": 0.2}, seed=1, seconds=300.0)
    first, second = (diagnose(load_ship("frigate"), table).to_dict() for _ in range(2))
    assert first == second


def test_balances_of_the_ship_itself_lack_nothing() -> None:
    balances = Balances(JointReplay(load_ship("frigate"), frigate_voyage(seed=0)))
    lacking = balances.residuals(balances.nominal)
    speed = balances.names.index("propeller")
    # a central difference over steps of the demands is all that is left
    assert np.median(np.abs(lacking[speed])) < 100.0
    assert balances.names == ["pitch-actuator", "engine", "propeller", "hull"]


def test_moments_are_sums_over_bands() -> None:
    rng = np.random.default_rng(0)
    bands = make_bands([(0, 400), (400, 900)], 0.1, 2, 4.0)
    z = rng.standard_normal((3, len(bands.order))) + 1j * rng.standard_normal((3, len(bands.order)))
    sums = moments(bands, z, z)
    first = slice(bands.edges[0], bands.edges[1])
    expected = (z[:, first] * bands.weights[first]) @ z[:, first].conj().T
    assert np.allclose(sums[0], expected)
    assert bands.edges[-1] == len(bands.order)


def test_a_regressor_in_the_noise_is_found_with_its_share() -> None:
    rng = np.random.default_rng(1)
    bands = make_bands([(0, 4000)], 0.1, 1, 4.0)
    signal = np.repeat(rng.standard_normal(40), 100)
    coloured = np.convolve(rng.standard_normal(4200), np.ones(20) / 20.0, mode="valid")[:4000]
    column = bands.transform(signal)[None, None]
    found = Likelihood(bands, column)(bands.transform((coloured + 0.7 * signal)[None]))
    assert found.shares[0] == pytest.approx(0.7, abs=0.05)


def test_windows_and_regimes() -> None:
    trace = np.zeros(6000)
    trace[2000:3000] = 5.0
    assert active_windows(trace, 0.1, 600.0) == [pytest.approx((200.0, 300.0), abs=6.0)]
    assert active_windows(np.ones(6000), 0.1, 600.0) == [(0.0, 600.0)]
    rng = np.random.default_rng(0)
    changes = change_points(trace + rng.standard_normal(6000), 0.1)
    assert changes == [pytest.approx(200.0, abs=20.0), pytest.approx(300.0, abs=20.0)]
    assert change_points(rng.standard_normal(6000), 0.1) == []
    speed = np.linspace(5.0, 15.0, 6000)
    assert "above" in regime(np.where(speed > 12.0, 1.0, 0.0), {"shaft speed": (speed, "rad/s")})


def test_fit_percent() -> None:
    y = np.sin(np.linspace(0.0, 9.0, 100))
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(100, y.mean())) == pytest.approx(0.0, abs=1e-9)
