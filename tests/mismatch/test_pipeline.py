"""Whole diagnoses: nothing missing, no name, cannot be decided; recordings of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Options, Recording, diagnose, fit_percent, pipeline
from shaftline.mismatch.identification.parameters import Start
from shaftline.plant import get_sea, load_ship, realise
from shaftline.plant.replay import simulate_recording

from .diagnoses import diagnosis_of
from .report.test_service import finding
from .simulate.test_time_step import slow_log
from .voyages import NOISE, frigate_voyage, quick_frigate


def voyage(values: dict[str, Any] | None = None, **options: Any) -> pd.DataFrame:
    """Of the frigate with some values of its own."""
    return frigate_voyage(quick_frigate().with_values(values or {}), **options)


@pytest.mark.parametrize(("sea", "seed"), [(None, 0), (None, 1), ("state-5", 2), ("state-6", 3)])
def test_nothing_is_named_where_nothing_is_missing(sea: str | None, seed: int) -> None:
    waves = None
    if sea is not None:
        preset = get_sea(sea)
        assert preset is not None
        waves = realise(preset, 4.0, seed)
    found = diagnose(quick_frigate(), voyage(seed=seed, seconds=300.0, sea=waves))
    assert found.verdict == "nothing-missing"
    assert found.fit_after == found.fit_before
    assert found.held_out_gain == 0.0
    assert found.corrected == found.ship
    assert found.to_dict()["effects"] == []


def test_a_wrong_number_inside_its_tolerance_is_no_missing_physics() -> None:
    values = {
        "hull.resistance_coefficient_N_s2_m2": 3306.2 * 1.01,
        "transmission.inertia_engine_side_kg_m2": 53697.0 * 0.99,
        "prime_mover.torque_per_rack_N_m_mm": 1428.6 * 1.003,
    }
    found = diagnose(quick_frigate(), voyage(values, seed=5, seconds=300.0))
    assert found.verdict == "nothing-missing"


def test_what_the_catalogue_does_not_hold_is_shown_without_a_name() -> None:
    # a shaft generator that is switched on for a while
    taken = "table(time, 199, 0, 200, -25e3, 380, -25e3, 381, 0)"
    values = {"term": [{"id": "generator", "acts_on": "drive_torque", "expression": taken}]}
    found = diagnose(quick_frigate(), voyage(values, seed=4))
    assert found.verdict == "unexplained"
    assert found.shape is not None
    assert found.shape.balance == "engine"
    (term,) = found.corrected.term
    assert term.acts_on == "drive_torque"
    assert found.held_out_gain > 0.0  # else it would be shown, not used
    assert found.fit_after["shaft_speed_rad_s"] >= found.fit_before["shaft_speed_rad_s"] - 0.5


def test_the_true_effect_left_out_of_the_catalogue_is_not_replaced_by_a_wrong_name() -> None:
    values = {"prime_mover.lag_s": 2.5}
    table = voyage(values, seed=3)
    out = ("engine-torque-lag", "engine-dead-time", "rack-rate-limit", "torque-sensor-delay")
    found = diagnose(quick_frigate(), table, options=Options(exclude=out))
    assert found.verdict == "unexplained"
    assert found.to_dict()["location"]["balances"] == ["engine"]


def test_a_dull_recording_is_not_guessed_at() -> None:
    table = voyage(seed=2, seconds=60.0)
    steady = simulate_recording(
        quick_frigate(), table.assign(fuel_rack_mm=20.0, pitch_ratio_command=1.2)
    )
    rng = np.random.default_rng(0)
    for column, rms in NOISE.items():
        steady[column] = steady[column] + rms * rng.standard_normal(len(steady))
    dull = Recording(
        Path("r.csv"), steady, 0.2, {}, limits=("insufficient excitation: the rack does not move",)
    )
    found = diagnose(quick_frigate(), dull)
    assert not found.findings
    assert (
        "annot be decided, because insufficient excitation: the rack does not move"
        in found.to_dict()["sentence"]
    )


def test_two_effects_are_both_named() -> None:
    values = {"hull.fouling_fraction": 0.2, "prime_mover.derating_fraction": 0.08}
    found = diagnose(quick_frigate(), voyage(values, seed=7, seconds=300.0))
    assert {f.effect.id for f in found.findings} == {"hull-fouling", "engine-derating"}


def test_same_recording_same_diagnosis() -> None:
    table = voyage({"hull.fouling_fraction": 0.2}, seed=1, seconds=100.0)
    first, second = (diagnose(quick_frigate(), table).to_dict() for _ in range(2))
    assert first == second


def test_a_simulation_can_be_diagnosed_too() -> None:
    """It has no noise; a pitch that never moves has no FitPercent, and its balance is not checked."""
    true = quick_frigate().with_values({"hull.fouling_fraction": 0.3})
    orders = voyage(seed=2, seconds=200.0).assign(pitch_ratio_command=1.2, pitch_ratio=1.2)
    told: list[tuple[str, int, int]] = []
    found = diagnose(
        quick_frigate(), simulate_recording(true, orders), tick=lambda *said: told.append(said)
    )
    assert [f.effect.id for f in found.findings] == ["hull-fouling"]
    assert "pitch_ratio" in found.measured
    assert "pitch_ratio" not in {**found.fit_before, **found.fit_after}
    assert found.warnings == ["pitch_ratio is constant on the held-out data: no FitPercent"]
    assert [name for name, _ in found.balances] == ["engine", "propeller", "hull"]
    assert (found.measured["pitch_ratio"] == 1.2).all()
    # the corrected ship does on the data set aside what it was corrected for
    assert found.held_out_gain > 100.0
    ((start, end),) = found.held_out
    assert end - start == pytest.approx(50.0, abs=0.5)
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages[:2] == ["loading recordings", "locating the mismatch"]
    assert stages[-1] == "judging on the held-out data"
    assert told[-1][1:] == (2, 2)


def test_whole_recordings_are_set_aside() -> None:
    values = {"hull.fouling_fraction": 0.3}
    one, two = (voyage(values, seed=seed, seconds=100.0) for seed in (1, 2))
    found = diagnose(quick_frigate(), one, hold_out=[two], options=Options(tolerance=2.0))
    assert found.held_out == [pytest.approx((100.2, 200.4))]
    assert found.findings[0].effect.id == "hull-fouling"
    rows = slice(501, None)
    assert found.fit_after["ship_speed_m_s"] == pytest.approx(
        fit_percent(found.measured["ship_speed_m_s"][rows], found.after["ship_speed_m_s"][rows])
    )


@pytest.mark.parametrize(("lag_s", "runs"), [(0.6, 1), (0.5, 2), (0.125, 3)])
def test_a_time_constant_at_the_longer_time_step_is_estimated_with_a_shorter_one(
    lag_s: float, runs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship = load_ship("frigate").with_values({"prime_mover.lag_s": lag_s})
    lag = finding("engine-torque-lag (engine)", "prime_mover.lag_s", ship, lag_s, 0.1)
    steps = []

    def find(start: Start, *_: Any) -> tuple[Any, None]:
        steps.append(start.ship.time_step_s)
        return diagnosis_of("explained", findings=[lag]), None

    monkeypatch.setattr(pipeline, "_find_cause", find)
    diagnose(load_ship("frigate"), slow_log(load_ship("frigate")))
    assert steps == pytest.approx([0.5, 0.125, load_ship("frigate").time_step_s][:runs])
