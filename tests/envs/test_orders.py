"""Order profiles: files of orders, and environments that follow them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents.evaluation.clairvoyant import Clairvoyant
from shaftline.baselines import combinator_curve
from shaftline.envs import CLASSIC, FrigateEnv, FrigateVectorEnv, Settings, SteeringEnv
from shaftline.envs.orders import check_profile, read_orders
from shaftline.plant import load_ship
from shaftline.plant.recording import RecordingError

FRIGATE = load_ship("frigate")
PROFILE = [(0.0, 5.0), (10.2, 8.0), (30.0, 6.0)]


def _single(steps: int, **keywords: Any) -> np.ndarray[Any, Any]:
    env = FrigateEnv(**keywords)
    observation, _ = env.reset(seed=3)
    rows = [np.append(observation, 0.0)]
    for k in range(steps):
        observation, reward, *_ = env.step(np.array([0.3, 0.2 * np.sin(k)], np.float32))
        rows.append(np.append(observation, reward))
    return np.array(rows)


@pytest.mark.parametrize("task", ["transit", "storm", "speed-keeping"])
def test_single_and_vector_environment_agree_to_the_bit(task: str) -> None:
    keywords = {"task": task, "order_profile": PROFILE, **CLASSIC}
    single = _single(80, **keywords)
    env = FrigateVectorEnv(3, threads=2, **keywords)
    observation, _ = env.reset(seed=3)
    rows = [np.append(observation[0], 0.0)]
    for k in range(80):
        action = np.tile(np.array([0.3, 0.2 * np.sin(k)], np.float32), (3, 1))
        observation, reward, *_ = env.step(action)
        rows.append(np.append(observation[0], reward[0]))
    env.close()
    assert np.array_equal(single, np.array(rows))


def test_each_order_holds_until_the_next_one_and_the_last_to_the_end() -> None:
    seen = _single(80, task="transit", order_profile=PROFILE, **CLASSIC)[:, 0]
    # Observation k + 1 is that of the last plant step of interval k, which begins at 0.5 k.
    begins = 0.5 * np.arange(80)
    expected = np.where(begins < 10.2, 5.0, np.where(begins < 30.0, 8.0, 6.0))
    assert seen[0] == 5.0
    assert np.array_equal(seen[1:], expected)


def test_a_profile_of_the_drawn_orders_changes_no_bit() -> None:
    """Rewards depend on the fuel at the order, so they show that it is that of the profile."""
    options = {"speed_order_m_s": [5.0, 8.0, 6.0], "order_interval_s": 10.0}
    rows = []
    for keywords, begin in (
        ({"order_profile": [(0.0, 5.0), (10.0, 8.0), (20.0, 6.0)]}, None),
        ({}, options),
    ):
        env = FrigateEnv(task="transit", sea="state-5", **CLASSIC, **keywords)  # type: ignore[arg-type]
        env.reset(seed=4, options=begin)
        rows.append([env.step([0.4, 0.1])[1] for _ in range(60)])
    assert rows[0] == rows[1]
    assert np.ptp(rows[0]) > 0.1


def test_a_steered_ship_keeps_the_headings_of_its_task() -> None:
    def run(**keywords: Any) -> np.ndarray[Any, Any]:
        env = SteeringEnv(**CLASSIC | keywords)
        env.reset(seed=1, options={"order_interval_s": 5.0})
        return np.array([env.step([0.3, 0.1, 0.0])[0][[0, 8]] for _ in range(60)])

    free, bound = run(), run(order_profile=[(0.0, 7.0), (12.0, 8.0)])
    assert np.array_equal(free[:, 1], bound[:, 1])
    assert len(set(free[:, 1])) == 6
    assert bound[:, 0].tolist() == [7.0] * 24 + [8.0] * 36


def test_an_automatic_reset_begins_the_profile_again() -> None:
    env = FrigateVectorEnv(
        2,
        max_episode_steps=6,
        autoreset_mode="NextStep",
        order_profile=[(0, 5.0), (2, 8.0)],
        **CLASSIC,
    )
    env.reset(seed=0)
    orders = [float(env.step(np.zeros((2, 2), np.float32))[0][0, 0]) for _ in range(13)]
    env.close()
    assert orders == [5, 5, 5, 5, 8, 8, 5, 5, 5, 5, 5, 8, 8]  # the seventh step only resets


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0,5", "must be pairs"),
        ([], "must be pairs"),
        ([(0, 5, 1)], "must be pairs"),
        (5, "must be"),
        ([(1, 5)], "row 1: time 1 s; times must begin at 0"),
        ([(0, 5), (0, 6)], "row 2: time 0 s"),
        ([(0, 5), (1, 41)], "row 2: 41 m/s; must be 0 to 40"),
        ([(0, float("nan"))], "row 1: nan m/s"),
    ],
)
def test_bad_profiles(rows: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"order_profile.*{words}"):
        FrigateEnv(order_profile=rows)


def test_orders_are_given_once() -> None:
    env = FrigateEnv(order_profile=PROFILE)
    with pytest.raises(ValueError, match="speed_order_m_s: the orders are those of order_profile"):
        env.reset(options={"speed_order_m_s": 7.0})
    with pytest.raises(ValueError, match="order_profile: a plan follows the orders of its task"):
        Clairvoyant(Settings(order_profile=PROFILE), 0)


def _file(folder: Path, text: str) -> Path:
    path = folder / "orders.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "time_s,speed_order_m_s\n0,5\n60,8\n180,8\n",
        "speed_order_m_s;time_min\n5,0;7,5\n8,0;8,5\n8,0;10,5\n",
        "time_h\tspeed_order_kn\n475000\t9.71922\n475000.0166666667\t15.55076\n475000.05\t15.55076\n",
    ],
)
def test_files_of_other_loggers(tmp_path: Path, text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read_orders(_file(tmp_path, text), FRIGATE)
    assert np.array(found.profile) == pytest.approx(np.array([(0, 5), (60, 8), (180, 8)]), abs=1e-4)
    assert found.duration_s == pytest.approx(180.0, abs=1e-4)


def test_lever_positions_use_the_curve_of_the_ship(tmp_path: Path) -> None:
    path = _file(tmp_path, "time_s,lever_percent\n0,30\n60,75\n100,75\n")
    curve = combinator_curve(FRIGATE)
    expected = np.interp([0.3, 0.75, 0.75], curve.lever, curve.ship_speed)
    assert [speed for _, speed in read_orders(path, FRIGATE).profile] == pytest.approx(expected)


def test_a_ramp_has_a_row_for_each_interval(tmp_path: Path) -> None:
    path = _file(tmp_path, "time_s,speed_order_m_s\n0,5\n10,7\n12,7\n")
    profile = np.array(read_orders(path, FRIGATE, ramp_s=0.5).profile)
    assert profile[:, 0] == pytest.approx(0.5 * np.arange(25))
    assert profile[[0, 5, 20, 24], 1] == pytest.approx([5.0, 5.5, 7.0, 7.0])
    assert check_profile(profile) == read_orders(path, FRIGATE, ramp_s=0.5).profile


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "time_s,speed\n0,5\n1,6\n",
            "column speed_order_m_s or .* is missing; found: time_s, speed",
        ),
        ("t,speed_order_m_s\n0,5\n1,6\n", "a column time_s or time_min or time_h is missing"),
        ("time_s,speed_order_m_s\n0,5\n10,\n20,6\n", "speed_order_m_s, row 2: nan is not a number"),
        ("time_s,speed_order_m_s\n0,5\n10,fast\n", "row 2: 'fast' is not a number from 0 to 40"),
        ("time_s,speed_order_kn\n0,5\n10,-3\n", "row 2: -3 is not a number from 0 to 77.75"),
        ("time_s,lever\n0,0.5\n10,50\n", "lever, row 2: 50 is not a number from 0 to 1"),
        ("time_s,speed_order_m_s\n0,5\n10,6\n10,7\n", "time_s, row 3: the time does not rise"),
        ("time_s,speed_order_m_s\n0,5\n", "has one row; the time of the last row is the end"),
        ("time_s,lever,speed_order_kn\n0,0.5,5\n1,0.5,5\n", "are the same quantity; keep one"),
    ],
)
def test_bad_files(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(RecordingError, match=rf"orders\.csv.*{words}"):
        read_orders(_file(tmp_path, text), FRIGATE)


def test_orders_that_have_no_effect_are_warned_of(tmp_path: Path) -> None:
    knots_as_metres = _file(tmp_path, "time_s,speed_order_m_s\n0,12\n60,16\n90,16\n")
    with pytest.warns(
        UserWarning, match=r"row 1: 12 m/s is above 11\.7 m/s, the highest speed of frigate"
    ):
        read_orders(knots_as_metres, FRIGATE)
    last = _file(tmp_path, "time_s,speed_order_m_s\n0,5\n60,8\n")
    with pytest.warns(UserWarning, match="the last row begins when the episode ends"):
        read_orders(last, FRIGATE)
