"""Episodes of many seeds against the single environment, step by step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shaftline.agents import KPIS, Setting, run_episodes
from shaftline.agents.evaluation.episodes import TRACE
from shaftline.baselines.combinator import Combinator
from shaftline.envs import CLASSIC, DEFAULTS, FrigateEnv, FrigateVectorEnv, get_task
from shaftline.envs.records import TRUTHS
from shaftline.envs.settings import EPISODE_S

CELL = Setting("combinator", "transit", "state-5", "random-walk-kalman", seeds=3, episode_s=20.0)


@pytest.fixture(scope="module")
def combinator() -> Combinator:
    return Combinator("frigate", 0.5)


class Still:
    """Controller with constant commands that records its observations."""

    action = (0.5, 0.1)

    def __init__(self) -> None:
        self.starts: list[list[bool]] = []

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        assert deterministic
        assert (state or 0) == len(self.starts)  # what was returned comes back
        self.starts.append(np.asarray(episode_start).tolist())
        return np.tile(np.asarray(self.action, np.float32), (len(observation), 1)), len(self.starts)


class Off(Still):
    """Stops the engine."""

    action = (1.0, -1.0)


def test_kpis_and_trace_are_those_of_the_single_environment() -> None:
    task = get_task("speed-keeping").model_copy(update={"order_interval_s": 3.0})
    cell = replace(CELL, task_model=task, sensor_noise=0.5, first_seed=40)
    kpis, trace = run_episodes(cell, Still())
    for seed in range(3):
        env = FrigateEnv(
            task=task,
            sea="state-5",
            observer=CELL.observer,
            max_episode_steps=40,
            sensor_noise=0.5,
            **CLASSIC,
        )
        seen, _ = env.reset(seed=40 + seed)
        order, fuel, torque, errors, reward = float(seen[0]), 0.0, [], [], 0.0
        for k in range(40):
            shown = float(seen[0])
            seen, r, _, truncated, info = env.step(np.array([0.5, 0.1], np.float32))
            fuel += info["reward_terms"]["fuel_kg_s"] * 0.5
            torque.append(info["shaft_torque"] * 1e-3)
            errors.append(info["ship_speed"] - shown)
            reward += r
            if seed == 0:
                expected = [
                    0.5 * k,
                    shown,
                    seen[3],
                    seen[4],
                    *(info[name] for name in TRUTHS),
                    seen[6],
                    seen[7],
                ]
                assert trace[k] == pytest.approx(np.asarray(expected, np.float64), rel=1e-7)
        assert truncated
        assert order != shown
        row = kpis.iloc[seed]
        assert row["fuel_kg_nmi"] == pytest.approx(fuel / info["position"] * 1852.0)
        assert row["torque_sd_kN_m"] == pytest.approx(np.std(torque))
        assert row["torque_peak_kN_m"] == pytest.approx(max(torque))
        assert row["speed_error_rms_m_s"] == pytest.approx(np.sqrt(np.mean(np.square(errors))))
        assert row["speed_short_m_s"] == pytest.approx(-np.mean(errors))
        assert row["reward"] == pytest.approx(reward)
        assert row["power_peak_kW"] > row["power_mean_kW"] > 100.0
    assert trace.shape == (40, len(TRACE))
    assert TRACE[4:-2] == TRUTHS
    assert list(kpis.columns) == list(KPIS)


def test_every_field_of_a_setting_decides_the_run() -> None:
    plain = run_episodes(CELL, Still())[0]
    for change in (
        {"task": "storm"},
        {"sea": "calm"},
        {"observer": "none"},
        {"episode_s": 10.0},
        {"sensor_noise": 0.0},
        {"ship": "ferry"},
        {"first_seed": 1},
    ):
        field = next(iter(change))
        kpis, trace = run_episodes(replace(CELL, **change), Still())
        if field in ("observer", "sensor_noise"):  # seen by the controller alone
            assert kpis.equals(plain)
            assert not np.array_equal(trace, run_episodes(CELL, Still())[1])
        else:
            assert not kpis.equals(plain), field
    assert len(run_episodes(replace(CELL, seeds=2), Still())[0]) == 2


def test_the_seed_given_goes_before_the_settings() -> None:
    later = run_episodes(replace(CELL, first_seed=2), Still())[0]
    assert run_episodes(CELL, Still(), first_seed=2)[0].equals(later)
    assert run_episodes(replace(CELL, first_seed=2), Still(), first_seed=0)[0].equals(
        run_episodes(CELL, Still())[0]
    )
    assert later["reward"][0] == run_episodes(CELL, Still())[0]["reward"][2]


def test_the_task_may_choose_the_sea() -> None:
    own = run_episodes(replace(CELL, sea="task"), Still())[0]
    env = FrigateVectorEnv(
        3, task="transit", max_episode_steps=40, observer=CELL.observer, **CLASSIC
    )
    env.reset(seed=0)
    rewards = sum(env.step(np.tile([0.5, 0.1], (3, 1)))[1] for _ in range(40))
    assert own["reward"].to_numpy() == pytest.approx(rewards)


def test_controllers_are_told_where_episodes_begin() -> None:
    controller = Still()
    run_episodes(replace(CELL, episode_s=2.0), controller)
    assert controller.starts == [[True] * 3, *[[False] * 3] * 3]


def test_equal_seeds_meet_equal_seas(combinator: Combinator) -> None:
    _, still = run_episodes(CELL, Still())
    _, steered = run_episodes(CELL, combinator)
    column = TRACE.index("speed_order")
    assert np.array_equal(still[:, column], steered[:, column])


def test_nothing_is_left_running(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[FrigateVectorEnv] = []
    monkeypatch.setattr(FrigateVectorEnv, "close", lambda env, **_: closed.append(env))
    run_episodes(replace(CELL, episode_s=1.0), Still())
    assert len(closed) == 1


def test_same_setting_same_figures_whatever_the_threads(combinator: Combinator) -> None:
    first, _ = run_episodes(CELL, combinator, threads=1)
    second, _ = run_episodes(CELL, combinator, threads=3)
    assert first.equals(second)


def test_a_stall_counts_once_and_ends_the_episode() -> None:
    cell = Setting("off", "transit", "calm", "none", seeds=2, episode_s=200.0)
    kpis, trace = run_episodes(cell, Off())
    assert (kpis["failed"] == 1.0).all()
    assert len(trace) < 400
    speeds = trace[:, TRACE.index("shaft_speed")]
    assert speeds[-1] < 0.35 * 350.0 / 1000.0 * 14.19  # the last row is of the end, not of the next
    assert (np.diff(speeds[-5:]) < 0.0).all()
    assert (kpis["reward"] == 0.0).all()  # though the first intervals had rewards


def test_defaults_are_the_environments() -> None:
    cell = Setting("off", "transit", "calm", "none", seeds=2)
    assert (cell.ship, cell.episode_s, cell.sensor_noise, cell.task_model, cell.first_seed) == (
        DEFAULTS.ship,
        EPISODE_S,
        DEFAULTS.sensor_noise,
        None,
        0,
    )


def test_names_of_cells_differ_where_settings_differ() -> None:
    others: dict[str, Any] = {
        "controller": "lever",
        "task": "storm",
        "sea": "calm",
        "observer": "none",
        "seeds": 4,
        "ship": "ferry",
        "episode_s": 21.0,
        "sensor_noise": {"ship_speed": 0.1},
        "first_seed": 1,
    }
    names = {CELL.name, *(replace(CELL, **{key: value}).name for key, value in others.items())}
    assert len(names) == 1 + len(others)
    assert replace(CELL, task_model=get_task("transit")).name == CELL.name
    long = [replace(CELL, controller="law:" + "k" * 400 + end).name for end in "ab"]
    assert long[0] != long[1]
    assert max(map(len, long)) < 200  # with a digest and an ending, file systems take it
    for name in (*names, *long):
        assert set(name) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._")
