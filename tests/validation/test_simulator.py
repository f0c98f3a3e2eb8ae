"""The independent simulator: without effects the ship of the plant, and each effect in its balance."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import catalogue
from shaftline.plant import load_ship
from shaftline.plant.replay import simulate_recording
from shaftline.validation import cases
from shaftline.validation.cases import draw_case
from shaftline.validation.recording import Scenario, simulate_case
from shaftline.validation.simulator import bench, effects, instruments, motion
from shaftline.validation.simulator.effects import FRIGATE
from shaftline.validation.simulator.instruments import add_instruments
from shaftline.validation.simulator.parameters import NEUTRAL, frigate_parameters
from shaftline.validation.simulator.voyage import simulate_voyage, varies_every_sample

PERIOD = 0.1


def close(a: pd.Series, b: pd.Series, share: float) -> bool:
    """Rms difference within a share of the signal's standard deviation."""
    rms = float(np.sqrt(np.mean((a - b) ** 2)))
    return rms <= share * float(a.std())


@pytest.mark.parametrize("kind", instruments.LIVELY)
def test_without_effects_the_frigate_is_the_plants(kind: str) -> None:
    rack, pitch = instruments.voyage(kind, 300.0, PERIOD, np.random.default_rng(3))
    simulated = simulate_voyage(frigate_parameters(), rack, pitch, PERIOD)
    plant = simulate_recording(load_ship("frigate"), simulated)
    for column in ("shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s"):
        assert close(simulated[column], plant[column], 0.01), column
    assert np.abs(simulated["pitch_ratio"] - plant["pitch_ratio"]).max() < 1e-6


def test_without_effects_the_thruster_is_the_plants(tmp_path: Path) -> None:
    (tmp_path / "ship.toml").write_text(bench.SHIP_FILE, encoding="utf-8")
    volts = bench.voltage_programme("steps", 120.0, PERIOD, np.random.default_rng(3))
    simulated = bench.run_bench(bench.bench_parameters(), volts, PERIOD)
    plant = simulate_recording(load_ship(tmp_path / "ship.toml"), simulated)
    for column in ("shaft_speed_rad_s", "motor_current_A", "thrust_N"):
        assert close(simulated[column], plant[column], 0.002), column


def test_demands_that_never_rest_are_held_to_the_last_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A scenario integrates them sample by sample; error control alone steps over what is held."""
    case = next(
        c
        for c in (draw_case(31, i) for i in range(400))
        if c.kind == "null-calm" and c.ship == FRIGATE and c.programme == "sweep"
    )
    scenario = Scenario(dataclasses.replace(case, seconds=60.0))
    assert varies_every_sample(scenario.drive)
    found = scenario.simulate(scenario.true, waves=False)
    plain = simulate_voyage(scenario.true, scenario.drive, scenario.pitch, PERIOD)
    monkeypatch.setattr(
        "shaftline.validation.simulator.voyage.JUMP", 1e-9
    )  # it then stops at every sample
    exact = simulate_voyage(scenario.true, scenario.drive, scenario.pitch, PERIOD)
    for column in ("shaft_speed_rad_s", "shaft_torque_N_m"):
        off, before = (np.abs(table[column] - exact[column]).max() for table in (found, plain))
        assert off < 0.1 * before, column


def test_the_thruster_holds_its_demand_over_each_sample() -> None:
    volts = bench.voltage_programme("sines", 30.0, PERIOD, np.random.default_rng(4))
    coarse = bench.run_bench(bench.bench_parameters(), volts, PERIOD)
    fine = bench.run_bench(bench.bench_parameters(), np.repeat(volts, 50), PERIOD / 50)
    for column in ("shaft_speed_rad_s", "motor_current_A"):
        exact = fine[column].to_numpy()[::50]
        assert np.abs(coarse[column].to_numpy() - exact).max() < 1e-5 * np.abs(exact).max(), column


def test_the_sea_has_its_height_and_meets_the_ship() -> None:
    waves = motion.head_sea(3.0, 9.0, 4.0, seed=5)
    assert 4.0 * np.sqrt(0.5 * np.sum(waves[:, 0] ** 2)) == pytest.approx(3.0)
    assert (waves[:, 3] > 0.0).all()  # the faster the ship, the oftener
    peak = 2.0 * np.pi / 9.0
    assert 0.8 * peak < np.median(waves[:, 2]) < 1.6 * peak
    assert np.array_equal(waves, motion.head_sea(3.0, 9.0, 4.0, seed=5))
    assert not np.array_equal(waves, motion.head_sea(3.0, 9.0, 4.0, seed=6))


@functools.cache
def demands() -> tuple[np.ndarray, np.ndarray]:
    rack, pitch = instruments.voyage("steps", 300.0, PERIOD, np.random.default_rng(8))
    return rack, pitch


def frigate_readings(numbers: dict[str, float], rough: bool) -> pd.DataFrame:
    waves = motion.head_sea(6.0, 10.0, 4.0, 1) if rough else None
    truth = simulate_voyage(numbers, *demands(), PERIOD, waves=waves)
    return add_instruments(truth, numbers, PERIOD, None)


@functools.cache
def reference(rough: bool) -> pd.DataFrame:
    return frigate_readings(frigate_parameters() | {"track_speed": 7.0}, rough)


def shaped(effect: effects.TrueEffect) -> dict[str, float]:
    return {name: 0.5 * (low + high) for name, (low, high) in effect.shape.items()}


FRIGATES = [e for e in (*effects.EFFECTS, *effects.UNKNOWN) if e.ship == effects.FRIGATE]
BENCHES = [e for e in (*effects.EFFECTS, *effects.UNKNOWN) if e.ship == effects.BENCH]
OWN_READING = {
    "pitch-sensor-offset": "pitch_ratio",
    "torque-sensor-bias": "shaft_torque_N_m",
    "torque-sensor-gain": "shaft_torque_N_m",
    "torque-sensor-delay": "shaft_torque_N_m",
    "speed-log-gain": "ship_speed_m_s",
    "speed-log-lag": "ship_speed_m_s",
}
MOVED = {
    "engine": "shaft_speed_rad_s",
    "propeller": "shaft_speed_rad_s",
    "hull": "ship_speed_m_s",
    "pitch-actuator": "pitch_ratio",
}


@pytest.mark.parametrize("effect", FRIGATES, ids=lambda e: e.key)
def test_an_effect_moves_its_own_signals(effect: effects.TrueEffect) -> None:
    strong = effect.most if effect.id in ("cavitation-breakdown", "shallow-water") else None
    size = {effect.size: strong or min(4.0 * effect.first, effect.most)}
    numbers = frigate_parameters() | shaped(effect) | size | {"track_speed": 7.0}
    change = frigate_readings(numbers, effect.waves) - reference(effect.waves)
    moved = {c: float(change[c].abs().max()) for c in (*MOVED.values(), "shaft_torque_N_m")}
    least = {
        "pitch_ratio": 1e-4,
        "shaft_speed_rad_s": 1e-3,
        "ship_speed_m_s": 1e-3,
        "shaft_torque_N_m": 50.0,
    }
    if effect.balance == "sensor":
        own = OWN_READING[effect.id]
        assert moved.pop(own) > least[own]
        assert not any(moved.values())
    else:
        own = MOVED[effect.balance]
        assert moved[own] > least[own]
        if effect.balance != "pitch-actuator":
            assert moved["pitch_ratio"] == 0.0


@pytest.mark.parametrize("effect", BENCHES, ids=lambda e: e.key)
def test_an_effect_moves_the_thruster(effect: effects.TrueEffect) -> None:
    volts = bench.voltage_programme("reversals", 60.0, PERIOD, np.random.default_rng(2))
    numbers = bench.bench_parameters()
    changed = numbers | shaped(effect) | {effect.size: min(4.0 * effect.first, effect.most)}
    change = bench.run_bench(changed, volts, PERIOD) - bench.run_bench(numbers, volts, PERIOD)
    assert float(change["shaft_speed_rad_s"].abs().max()) > 1e-2
    assert not change["motor_voltage_V"].any()


def test_every_effect_has_a_neutral_number_and_a_form_of_the_catalogue_unless_unknown() -> None:
    for effect in (*effects.EFFECTS, *effects.UNKNOWN):
        assert NEUTRAL[effect.size] == 0.0
        assert set(effect.shape) <= set(NEUTRAL)
    named = {effect.id for effect in catalogue()}
    assert {effect.id for effect in effects.EFFECTS} <= named
    assert not {effect.id for effect in effects.UNKNOWN} & named
    assert set(effects.CONFOUNDED) <= set(effects.BY_KEY)


def test_cases_are_dealt_as_stated() -> None:
    drawn = [cases.draw_case(4, index) for index in range(200)]
    kinds = [case.kind for case in drawn]
    dull = [k for k in kinds if k.startswith("null") or k in ("unknown", "confounded")]
    assert len(dull) == 80
    single = {case.effects[0].key for case in drawn if case.kind == "single"}
    assert single == {effect.key for effect in effects.EFFECTS}
    assert drawn[17] == cases.draw_case(4, 17)
    assert drawn[17] != cases.draw_case(5, 17)
    assert all(case.exclude == (case.effects[0].effect.id,) for case in drawn if case.exclude)
    assert all(case.wave_height == 0.0 for case in drawn if case.kind == "null-calm")
    assert all(case.wave_height > 0.0 for case in drawn if case.kind == "null-waves")


def short(kind: str) -> cases.Case:
    index = next(i for i in range(100) if cases.case_kind(4, i)[0] == kind)
    return dataclasses.replace(cases.draw_case(4, index), seconds=200.0)


def test_the_same_seed_gives_the_same_recording() -> None:
    first, second = simulate_case(short("null-waves")), simulate_case(short("null-waves"))
    pd.testing.assert_frame_equal(first.recording, second.recording)
    assert cases.hash_truth(first.truth) == cases.hash_truth(second.truth)
    assert np.isfinite(first.recording.to_numpy()).all()
    assert first.truth["sizes"] == {}


def test_an_effect_is_as_strong_as_drawn() -> None:
    effect = effects.BY_KEY["coulomb-friction/engine"]
    one = cases.Concealed(effect.key, 1.0, 1.0, shaped(effect))
    case = dataclasses.replace(
        short("single"),
        ship=effects.FRIGATE,
        effects=(one,),
        programme="steps",
        wave_height=0.0,
        factors=dict.fromkeys(cases.TOLERANCES[effects.FRIGATE], 1.0),
    )
    simulated = simulate_case(case)
    assert simulated.truth["beyond_tolerances"][effect.key] == pytest.approx(1.0, abs=0.08)
    assert (
        simulated.truth["ratios"][effect.key]
        >= 0.999 * simulated.truth["beyond_tolerances"][effect.key]
    )
    channel = simulated.truth["channels"][effect.key]
    noise = (simulated.recording[channel] - simulated.concealed[channel]).std()
    assert noise == pytest.approx(simulated.truth["residual_rms"][channel], rel=0.05)
    equivalent = simulated.truth["equivalents"][effect.key]
    assert equivalent["value"] == pytest.approx(simulated.truth["sizes"][effect.key], rel=0.1)
    assert equivalent["names"][0] == "torque_N_m"


def test_a_seal_holds_for_its_truth_alone() -> None:
    truth = {"nonce": "x", "case": {"kind": "single"}, "sizes": {"a": 1.0}}
    assert cases.hash_truth(truth) == cases.hash_truth(dict(reversed(truth.items())))
    assert cases.hash_truth(truth) != cases.hash_truth(truth | {"nonce": "y"})
