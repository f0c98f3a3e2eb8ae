"""The same recording at other rates, filtered or raw, with demands that are held or are not."""

from __future__ import annotations

import functools

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, sosfiltfilt

from shaftline.mismatch import Diagnosis, diagnose
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.search.selection import Selection
from shaftline.mismatch.setting import Settings
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

from .voyages import frigate_voyage, quick_frigate

FRICTION = "transmission.coulomb_friction_engine_side_N_m"
INTERVAL_S = 0.005


@functools.cache
def rubbing(ship: Ship, line: bool = False) -> pd.DataFrame:
    """A servo with friction for 60 s at 200 Hz, its torque in steps or as smooth as a swing."""
    rng = np.random.default_rng(5)
    rows = 12_000
    time = INTERVAL_S * np.arange(rows)
    torque = np.repeat(rng.uniform(-90.0, 90.0, rows // 100), 100)
    if line:
        torque = 60.0 * np.sin(2.0 * time) + 40.0 * np.sin(5.3 * time)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": torque, "shaft_speed_rad_s": 0.0})
    table = simulate_recording(quick(ship).with_values({FRICTION: 20.0}), table)[list(table)]
    table["shaft_speed_rad_s"] += 0.005 * rng.standard_normal(rows)
    return table


def quick(ship: Ship) -> Ship:
    return ship.with_values({"integration.time_step_s": INTERVAL_S})


def seen(ship: Ship, table: pd.DataFrame, every: int, filtered: bool = False) -> Diagnosis:
    if filtered:
        low = butter(4, 0.4 / every, output="sos")
        speed = sosfiltfilt(low, table["shaft_speed_rad_s"])
        table = table.assign(shaft_speed_rad_s=speed)
    return diagnose(quick(ship), table.iloc[::every].reset_index(drop=True))


@pytest.mark.parametrize(
    ("filtered", "every"),
    [(False, 1), (False, 5), (True, 1), (True, 5)]
    + [pytest.param(filtered, 2, marks=pytest.mark.slow) for filtered in (False, True)],
)
def test_a_verdict_follows_neither_rate_nor_filter(servo: Ship, every: int, filtered: bool) -> None:
    found = seen(servo, rubbing(servo), every, filtered)
    assert found.verdict == "explained"
    assert [f.effect.id for f in found.findings] == ["coulomb-friction"]
    assert found.findings[0].estimates[0].value == pytest.approx(20.0, rel=0.05)
    report = found.to_dict()
    assert report["demands_between_rows"] == "held"
    assert report["recording"]["rows"] == pytest.approx(12_000 / every, abs=50)


def test_a_demand_that_was_not_held_is_drawn_and_it_is_said(servo: Ship) -> None:
    found = seen(servo, rubbing(servo, line=True), 20)
    assert found.line
    assert found.to_dict()["demands_between_rows"] == "lines"
    assert [f.effect.id for f in found.findings] == ["coulomb-friction"]
    assert any("interpolated linearly between rows" in said for said in found.warnings)


def test_rows_far_apart_in_a_period_are_tried_both_ways(servo: Ship) -> None:
    def settings(every: int) -> Settings:
        table = rubbing(servo).iloc[::every].reset_index(drop=True)
        return Settings(quick(servo), load_jointly(servo, [table]), [], 1.0)

    both = settings(20)
    assert len(both.tried) == 2
    likelier = both.tried[0]
    nothing = Selection(likelier.fitter.null, (), (), (), ())
    assert not both.exchange(nothing)
    assert both.tried == [likelier]  # the other one is not needed any more
    assert not both.exchange(nothing)


def test_a_slow_log_does_not_make_delays_of_when_its_demands_moved() -> None:
    """Steps at any time of a second, logged once a second."""
    table = frigate_voyage(quick_frigate(), seed=33, seconds=900.0)
    found = diagnose(quick_frigate(), table.iloc[::5].reset_index(drop=True))
    assert found.line
    assert found.verdict == "nothing-missing"


def test_coarse_steps_are_not_called_missing_physics() -> None:
    table = frigate_voyage(quick_frigate(), seed=21, seconds=400.0)
    steps = {"shaft_speed_rad_s": 0.1, "shaft_torque_N_m": 5000.0, "pitch_ratio": 0.02}
    coarse = {c: np.round(table[c] / q) * q for c, q in steps.items()}
    assert diagnose(quick_frigate(), table.assign(**coarse)).verdict == "nothing-missing"
