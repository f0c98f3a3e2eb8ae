from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents import run_episodes
from shaftline.agents.evaluation.episodes import TRACE, Setting
from shaftline.agents.evaluation.kpis import KPIS
from shaftline.agents.evaluation.statistics import interquartile_mean, with_interval
from shaftline.agents.evaluation.sweeps import evaluate
from shaftline.baselines.combinator import Combinator
from shaftline.baselines.controller import OBSERVED
from shaftline.envs import FrigateEnv

CELL = Setting("combinator", "transit", "state-5", "random-walk-kalman", seeds=3, episode_s=20.0)


@pytest.fixture(scope="module")
def combinator() -> Combinator:
    return Combinator("frigate", 0.5)


class Still:
    """Commands that never change."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        return np.tile(np.array([0.5, 0.1], np.float32), (len(observation), 1)), None


def test_kpis_are_those_of_the_single_environment() -> None:
    kpis, trace = run_episodes(CELL, Still())
    env = FrigateEnv(task="transit", sea="state-5", observer=CELL.observer, episode_s=20.0)
    seen, _ = env.reset(seed=0)
    order, fuel, torque, squares, reward = float(seen[0]), 0.0, [], [], 0.0
    for _ in range(40):
        _, r, _, truncated, info = env.step(np.array([0.5, 0.1], np.float32))
        fuel += info["reward_terms"]["fuel_kg_s"] * 0.5
        torque.append(info["shaft_torque"] * 1e-3)
        squares.append((info["ship_speed"] - order) ** 2)
        reward += r
    assert truncated
    row = kpis.iloc[0]
    assert row["fuel_kg_nmi"] == pytest.approx(fuel / info["position"] * 1852.0)
    assert row["torque_sd_kN_m"] == pytest.approx(np.std(torque))
    assert row["torque_peak_kN_m"] == pytest.approx(max(torque))
    assert row["speed_error_rms_m_s"] == pytest.approx(np.sqrt(np.mean(squares)))
    assert row["reward"] == pytest.approx(reward)
    assert trace.shape == (40, len(TRACE))
    assert list(kpis.columns) == list(KPIS)


def test_equal_seeds_meet_equal_seas(combinator: Combinator) -> None:
    _, still = run_episodes(CELL, Still())
    _, steered = run_episodes(CELL, combinator)
    column = TRACE.index("speed_order")
    assert np.array_equal(still[:, column], steered[:, column])


def test_same_setting_same_figures(combinator: Combinator) -> None:
    first, _ = run_episodes(CELL, combinator)
    second, _ = run_episodes(CELL, combinator)
    assert first.equals(second)


def test_a_stall_counts_once_and_ends_the_episode() -> None:
    class Off(Still):
        def predict(self, observation: Any, *_: Any, **__: Any) -> tuple[Any, Any]:
            return np.tile(np.array([1.0, -1.0], np.float32), (len(observation), 1)), None

    kpis, trace = run_episodes(
        Setting("off", "transit", "calm", "none", seeds=2, episode_s=200.0), Off()
    )
    assert (kpis["failed"] == 1.0).all()
    assert len(trace) < 400


def test_finished_cells_are_not_sailed_again(tmp_path: Path, combinator: Combinator) -> None:
    made: list[Setting] = []

    def make(setting: Setting) -> Combinator:
        made.append(setting)
        return combinator

    other = Setting(**{**CELL.__dict__, "sea": "calm"})
    first = evaluate([CELL], make, tmp_path, jobs=1).table
    found = evaluate([CELL, other], make, tmp_path, jobs=1)
    both, traces = found.table, found.traces
    assert made == [CELL, other]
    assert both.iloc[0]["fuel_kg_nmi"] == first.iloc[0]["fuel_kg_nmi"]
    assert [tuple(trace.columns) for trace in traces] == [TRACE, TRACE]
    assert both.iloc[1]["torque_sd_kN_m"] < both.iloc[0]["torque_sd_kN_m"]


def test_interquartile_mean_leaves_the_outer_quarters_out() -> None:
    assert interquartile_mean([0.0, 1.0, 3.0, 100.0]) == 2.0


def test_interval_covers_its_middle_and_narrows_with_the_sample() -> None:
    rng = np.random.default_rng(1)
    few, many = (with_interval(rng.normal(5.0, 1.0, n)) for n in (10, 200))
    for middle, low, high in (few, many):
        assert low < middle < high
    assert many[2] - many[1] < 0.5 * (few[2] - few[1])
    assert with_interval([2.0, 2.0, 2.0]) == (2.0, 2.0, 2.0)


def test_names_of_cells_differ_where_settings_differ() -> None:
    assert CELL.name != Setting(**{**CELL.__dict__, "seeds": 4}).name
    assert set(CELL.name) <= set(
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._"
    )
    assert len(OBSERVED) == 8
