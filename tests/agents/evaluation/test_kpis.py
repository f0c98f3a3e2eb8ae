"""Each key performance indicator by hand, from a made-up run of two ships."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents.evaluation.kpis import KPIS, EpisodeSums
from shaftline.envs import TERMS
from shaftline.envs.records import TRUTHS

ALIVE = ((True, True), (True, True), (True, False))
"""The second ship's episode ends after two intervals; what follows is another one's."""


def made_up(k: int) -> dict[str, Any]:
    def column(first: tuple[float, ...], second: tuple[float, ...]) -> Any:
        return np.array([first[k], second[k]])

    nothing = {name: np.zeros(2) for name in TERMS}
    return {
        "ship_speed": column((8.0, 9.0, 10.0), (5.0, 6.0, 90.0)),
        "shaft_speed": column((10.0, 12.0, 11.0), (6.0, 5.0, 90.0)),
        "shaft_torque": column((100e3, 140e3, 90e3), (50e3, 60e3, 900e3)),
        "brake_torque": column((20e3, 10e3, 15e3), (5e3, 8e3, 90e3)),
        "thrust": column((60e3, 90e3, 30e3), (20e3, 40e3, 900e3)),
        "ventilation": column((0.5, 0.6, 0.9), (0.0, 0.4, 0.9)),
        "position": column((4.0, 8.0, 13.0), (0.2, 0.5, 90.0)),
        "blade_pitch": column((1.0, 1.1, 1.05), (0.8, 0.9, 9.0)),
        "angle_of_attack": column((3.0, 5.0, 4.0), (1.0, 2.0, 90.0)),
        "outside_bucket": column((0.0, 0.5, 0.1), (0.0, 0.0, 9.0)),
        "reward_terms": nothing
        | {
            "fuel_kg_s": column((1.0, 2.0, 3.0), (0.5, 0.7, 9.0)),
            "nox_g_s": column((10.0, 20.0, 60.0), (5.0, 9.0, 90.0)),
            "rack_travel_mm": column((1.0, 0.0, 2.0), (4.0, 0.5, 9.0)),
            "overload": column((0.004, 0.1, 0.2), (0.0, 0.0, 0.9)),
            "near_limit": column((0.91, 1.0, 1.0), (0.89, 1.0, 1.0)),
            "overspeed": column((0.0, 0.0, 0.01), (0.02, 0.03, 0.9)),
            "cavitation": column((0.5, 0.5, 0.5), (0.0, 0.0, 0.9)),
            "heading_error_deg": column((3.0, 4.0, 5.0), (1.0, 7.0, 90.0)),
            "track_error_m": column((6.0, 8.0, 10.0), (2.0, 14.0, 90.0)),
            "rudder_rate_deg_s": column((2.0, 0.0, 4.0), (1.0, 3.0, 9.0)),
        },
        "_ended": np.array([False, k > 0]),
        "ended": np.array([None, "overspeed trip" if k > 0 else None], dtype=object),
    }


@pytest.fixture(scope="module")
def rows() -> list[dict[str, float]]:
    sums = EpisodeSums(2, interval_s=0.5, gear_ratio=2.0)
    orders = ((8.0, 6.0), (8.0, 6.0), (9.0, 0.0))
    rewards = ((-1.0, -2.0), (-3.0, -500.0), (-0.5, -900.0))
    for k in range(3):
        sums.add(np.array(ALIVE[k]), made_up(k), np.array(rewards[k]), np.array(orders[k]))
    table = sums.kpis()
    assert list(table.columns) == list(KPIS)
    return [row.to_dict() for _, row in table.iterrows()]


def swing(*signal: float) -> float:
    """Rms about a mean that fades in over 20 s, samples every 0.5 s."""
    mean, squares = signal[0], []
    for value in signal:
        mean += 0.025 * (value - mean)
        squares.append((value - mean) ** 2)
    return math.sqrt(float(np.mean(squares)))


def test_a_whole_episode(rows: list[dict[str, float]]) -> None:
    assert rows[0] == pytest.approx(
        {
            "fuel_kg_nmi": 0.5 * (1.0 + 2.0 + 3.0) / 13.0 * 1852.0,
            "nox_g_nmi": 0.5 * (10.0 + 20.0 + 60.0) / 13.0 * 1852.0,
            "speed_error_rms_m_s": math.sqrt((0.0 + 1.0 + 1.0) / 3.0),
            "speed_mean_m_s": 13.0 / 1.5,
            "speed_short_m_s": -2.0 / 3.0,
            "torque_sd_kN_m": float(np.std([100.0, 140.0, 90.0])),
            "torque_peak_kN_m": 140.0,
            "rack_travel_mm_min": 3.0 / 1.5 * 60.0,
            "overload_s": 1.0,
            "limit_s": 1.5,
            "shaft_speed_peak_rad_s": 12.0,
            "overspeed_s": 0.5,
            "cavitation_s": 1.5,
            "ventilation_s": 1.0,
            "thrust_mean_kN": 60.0,
            "power_mean_kW": 2.0 * (200.0 + 120.0 + 165.0) / 3.0,
            "power_peak_kW": 400.0,
            "wave_torque_kN_m": swing(100.0, 140.0, 90.0),
            "wave_engine_torque_kN_m": swing(20.0, 10.0, 15.0),
            "wave_power_kW": swing(400.0, 240.0, 330.0),
            "wave_attack_deg": swing(3.0, 5.0, 4.0),
            "attack_99_deg": 4.98,
            "outside_bucket_s": 1.0,
            "pitch_travel_min": 0.15 / 1.5 * 60.0,
            "rise_s": 0.5,
            "heading_error_rms_deg": math.sqrt((9.0 + 16.0 + 25.0) / 3.0),
            "track_error_rms_m": math.sqrt((36.0 + 64.0 + 100.0) / 3.0),
            "rudder_travel_deg_min": 0.5 * 6.0 / 1.5 * 60.0,
            "failed": 0.0,
            "tripped": 0.0,
            "reward": -4.5,
        }
    )


def test_an_episode_that_ended_early_counts_no_further(rows: list[dict[str, float]]) -> None:
    assert rows[1] == pytest.approx(
        {
            "fuel_kg_nmi": 0.6 * 1852.0,  # over a metre at least
            "nox_g_nmi": 7.0 * 1852.0,
            "speed_error_rms_m_s": math.sqrt(0.5),
            "speed_mean_m_s": 0.5,
            "speed_short_m_s": 0.5,
            "torque_sd_kN_m": 5.0,
            "torque_peak_kN_m": 60.0,
            "rack_travel_mm_min": 270.0,
            "overload_s": 0.0,
            "limit_s": 0.5,
            "shaft_speed_peak_rad_s": 6.0,
            "overspeed_s": 1.0,
            "cavitation_s": 0.0,
            "ventilation_s": 0.0,
            "thrust_mean_kN": 30.0,
            "power_mean_kW": 70.0,
            "power_peak_kW": 80.0,
            "wave_torque_kN_m": swing(50.0, 60.0),
            "wave_engine_torque_kN_m": swing(5.0, 8.0),
            "wave_power_kW": swing(60.0, 80.0),
            "wave_attack_deg": swing(1.0, 2.0),
            "attack_99_deg": 1.99,
            "outside_bucket_s": 0.0,
            "pitch_travel_min": 0.1 / 1.0 * 60.0,
            "rise_s": 0.0,
            "heading_error_rms_deg": 5.0,
            "track_error_rms_m": 10.0,
            "rudder_travel_deg_min": 0.5 * 4.0 / 1.0 * 60.0,
            "failed": 1.0,
            "tripped": 1.0,
            "reward": 0.0,
        }
    )


def test_fluctuations_in_waves_count_from_a_minute_after_a_new_order() -> None:
    """A jump of the torque with the order does not count, where a calm minute follows it."""
    sums = EpisodeSums(1, 0.5, 2.0)
    base: dict[str, Any] = dict.fromkeys(TRUTHS, np.zeros(1))
    terms: dict[str, Any] = {"reward_terms": dict.fromkeys(TERMS, np.zeros(1))}
    for k in range(280):
        new = k >= 10
        info = base | terms | {"shaft_torque": np.array([9e4 if new else 1e4])}
        sums.add(np.array([True]), info, np.ones(1), np.array([8.0 if new else 5.0]))
        if k == 100:
            assert sums.rms("torque")[0] > 10.0
    assert sums.settled[0] == 280 - 10 - 120
    assert sums.rms("torque")[0] < 2.5


def test_a_rise_ends_at_nine_tenths_or_with_the_next_order() -> None:
    """Two orders: 4 to 8 m/s, nine tenths done after 3 intervals; then back, never done."""
    sums = EpisodeSums(1, interval_s=0.5, gear_ratio=2.0)
    orders = [4.0, 8.0, 8.0, 8.0, 8.0, 8.2, 4.0, 4.0]
    speeds = [4.0, 5.0, 7.0, 7.5, 7.7, 7.9, 7.9, 7.0]
    for order, speed in zip(orders, speeds, strict=True):
        info = {name: np.array([speed]) for name in made_up(0)}
        terms = {name: np.zeros(1) for name in TERMS}
        sums.add(np.array([True]), info | {"reward_terms": terms}, np.zeros(1), np.array([order]))
    # the first step was 3 m/s when its first interval had ended: done at 7.7; 8.2 is no new step
    assert sums.kpis()["rise_s"][0] == pytest.approx(0.5 * (4 + 2) / 2)


def test_a_torque_that_never_moves_has_no_deviation() -> None:
    sums = EpisodeSums(1, interval_s=0.5, gear_ratio=2.0)
    info = {name: column for name, column in made_up(0).items() if name != "reward_terms"}
    info = {name: np.array([1e5 / 3.0]) for name in info}
    terms = {name: np.zeros(1) for name in TERMS}
    for _ in range(7):
        sums.add(np.array([True]), info | {"reward_terms": terms}, np.zeros(1), np.zeros(1))
    assert sums.kpis()["torque_sd_kN_m"][0] == pytest.approx(0.0, abs=1e-5)


def test_the_page_tells_every_kpi_as_it_is_declared() -> None:
    page = (Path(__file__).parents[3] / "docs/evaluate.md").read_text(encoding="utf-8")
    table = re.search(r"\| figure \|.*?\n\n", page, re.DOTALL)
    assert table is not None
    assert dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", table[0], re.MULTILINE)) == KPIS


def test_every_kpi_is_told_with_its_unit() -> None:
    units = {
        "_m_s": "[m/s]",
        "_kN_m": "[kN m]",
        "_kN": "[kN]",
        "_s": "[s]",
        "_kW": "[kW]",
        "_rad_s": "[rad/s]",
        "_nmi": "[kg]",
        "_g_nmi": "[g]",
        "_mm_min": "[mm/min]",
    }
    for name, meaning in KPIS.items():
        ends = [end for end in units if name.endswith(end)]
        assert not ends or meaning.endswith(units[max(ends, key=len)]), name
