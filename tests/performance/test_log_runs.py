"""Runs of a speed trial that are found in a log: means, excluded stretches, refusals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

from shaftline.performance import TrialError, analyse_trial, find_runs
from shaftline.plant.surroundings import KNOT

from .test_speed_trial import ship

MINUTE = 60.0
LEGS = ((20.0, 12e3), (200.0, 12e3), (20.0, 20e3), (200.0, 20e3))
"""Heading [deg] and power [kW] of each leg."""


def trial_log(
    legs: Sequence[tuple[float, float]] = LEGS,
    steady: float = 15.0,
    turn: float = 8.0,
    interval: float = 10.0,
    seed: int = 0,
    current: float = 0.6,
    waves: float = 1.0,
) -> pd.DataFrame:
    """A log of legs in a current [kn] along 20 deg, with the turns between them.

    The first minutes of a turn change the heading; the speed settles with a time constant of 2 minutes.
    """
    rng = np.random.default_rng(seed)
    before, speed, rows = legs[0][0], 12.0, []
    for heading, power in legs:
        for k in range(round((turn + steady) * MINUTE / interval)):
            share = min(k * interval / (4.0 * MINUTE), 1.0)
            course = before + share * (heading - before)
            target = 14.0 * (power / 16e3) ** (1 / 3.2) * (1.0 if share >= 1.0 else 0.8)
            speed += (target - speed) * (1.0 - math.exp(-interval / (2.0 * MINUTE)))
            ground = speed + current * math.cos(math.radians(course - 20.0))
            rows.append((ground, power, course))
        before = heading
    ground, power, course = np.array(rows).T
    noise = waves * rng.standard_normal((3, len(rows)))
    return pd.DataFrame(
        {
            "time_s": interval * np.arange(len(rows)),
            "SOG [kn]": ground + 0.15 * noise[0],
            "Power [kW]": power * (1.0 + 0.04 * noise[1]),
            "HDG (deg)": (course + 2.0 * noise[2]) % 360.0,
        }
    )


def test_each_leg_is_one_run_without_its_turn() -> None:
    found = find_runs(trial_log())
    assert found.left_out == ()
    runs = found.runs
    assert np.degrees(runs["heading"].to_numpy()) == pytest.approx([20, 200, 20, 200], abs=1.0)
    assert runs["shaft_power"].to_numpy() / 1e3 == pytest.approx([12e3, 12e3, 20e3, 20e3], rel=0.02)
    through = np.repeat([14.0 * 0.75 ** (1 / 3.2), 14.0 * 1.25 ** (1 / 3.2)], 2)
    current = 0.6 * np.array([1, -1, 1, -1])
    assert runs["speed_over_ground"].to_numpy() / KNOT == pytest.approx(through + current, abs=0.06)
    assert (runs["duration"] >= 600.0).all()
    assert (runs["duration"] <= 19.0 * MINUTE).all()  # the turn takes four of 23 minutes
    trial = analyse_trial(ship(), runs)
    assert trial.runs["speed_m_s"].to_numpy() / KNOT == pytest.approx(through, abs=0.05)


def test_the_interval_of_the_log_changes_no_run() -> None:
    fine, coarse = (find_runs(trial_log(interval=dt, waves=0.0)).runs for dt in (2.0, 60.0))
    assert len(fine) == len(coarse) == 4
    assert fine["speed_over_ground"].to_numpy() == pytest.approx(
        coarse["speed_over_ground"].to_numpy(), abs=0.05
    )
    assert fine["time"].to_numpy() == pytest.approx(coarse["time"].to_numpy(), abs=90.0)


def test_an_uneven_clock_and_stamps_of_whole_minutes_change_no_run() -> None:
    log = trial_log(interval=60.0, waves=0.0)
    even = find_runs(log).runs
    late = np.random.default_rng(3).uniform(0.0, 40.0, len(log))
    uneven = find_runs(log.assign(time_s=log["time_s"] + late)).runs
    fine = trial_log(interval=20.0, waves=0.0)
    minutes = find_runs(fine.assign(time_s=60.0 * (fine["time_s"] // 60.0))).runs
    for found in (uneven, minutes):
        assert found["speed_over_ground"].to_numpy() == pytest.approx(
            even["speed_over_ground"].to_numpy(), abs=0.03
        )


def test_a_heading_across_north_is_steady_and_averaged_as_a_direction() -> None:
    runs = find_runs(trial_log([(359.5, 12e3), (179.5, 12e3)])).runs
    assert math.remainder(runs["heading"][0] - math.radians(359.5), 2 * math.pi) == pytest.approx(
        0.0, abs=0.02
    )
    assert len(runs) == 2


def test_the_wind_is_averaged_as_a_vector() -> None:
    log = trial_log(waves=0.0)
    side = np.where(np.arange(len(log)) % 2, 30.0, 330.0)
    runs = find_runs(log.assign(**{"wind_speed_m/s": 10.0, "wind_angle_deg": side})).runs
    assert runs["wind_speed"].to_numpy() == pytest.approx(
        10.0 * math.cos(math.radians(30.0)), rel=1e-3
    )
    assert np.cos(runs["wind_angle"].to_numpy()) == pytest.approx(1.0, abs=1e-3)


def test_a_leg_on_another_course_is_left_out_and_does_not_separate_a_double_run() -> None:
    legs = [(20.0, 12e3), (110.0, 12e3), (200.0, 12e3), (20.0, 20e3)]
    found = find_runs(trial_log(legs))
    assert np.degrees(found.runs["heading"].to_numpy()) == pytest.approx([20, 200], abs=1.0)
    assert len(found.left_out) == 2
    assert "heading 11" in found.left_out[0]
    assert "heading 2" in found.left_out[1]


def test_a_ramp_of_power_and_a_gap_are_no_run() -> None:
    log = trial_log([(20.0, 12e3), (200.0, 12e3)])
    ramp = log.assign(**{"Power [kW]": log["Power [kW]"] * np.linspace(0.6, 1.4, len(log))})
    with pytest.raises(TrialError, match="no runs on reciprocal courses"):
        find_runs(ramp)
    gap = log[(log["time_s"] < 700.0) | (log["time_s"] > 1100.0)]
    with pytest.raises(TrialError, match="no runs on reciprocal courses"):
        find_runs(gap)


def test_a_ship_at_rest_is_no_run_and_no_error() -> None:
    log = trial_log()
    still = pd.DataFrame(
        {"time_s": 10.0 * np.arange(200), "SOG [kn]": 0.0, "Power [kW]": -5.0, "HDG (deg)": 20.0}
    )
    shifted = log.assign(time_s=log["time_s"] + 2000.0)
    assert len(find_runs(pd.concat([still, shifted])).runs) == 4


def test_a_log_that_cannot_be_used_is_refused_with_the_reason() -> None:
    log = trial_log()
    with pytest.raises(TrialError, match="a log needs the time of every row"):
        find_runs(log.drop(columns="time_s"))
    with pytest.raises(TrialError, match="times must ascend; row 6 is before row 5"):
        find_runs(log.iloc[[0, 1, 2, 3, 4, 2, 5]])
    with pytest.raises(TrialError, match="at least two times, not 2 rows at one"):
        find_runs(log.iloc[[3, 3]])
    far = log.assign(time_s=np.where(log["time_s"] > 100.0, 1e10, log["time_s"]))
    with pytest.raises(ValueError, match="parts of 10 s in log"):
        find_runs(far)
    with pytest.raises(TrialError, match="a row every 300 s is too few for runs of 10 min"):
        find_runs(trial_log(interval=300.0, steady=60.0))
    with pytest.raises(TrialError, match=r"rack\.csv: no runs.*heading 20 deg"):
        find_runs(trial_log(LEGS[:1], steady=40.0), "rack.csv")
