"""Seas that are drawn, steady states in which episodes begin, single and vector alike."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringEnv, SteeringVectorEnv
from shaftline.envs.starts import LOADS, steady_states, steady_tables
from shaftline.plant import load_ship


def drawn(sea: Any, n: int = 400) -> Any:
    """Return significant heights [m], amplitudes [m] and phases [rad] of the seas of n episodes."""
    env = FrigateVectorEnv(n, task="transit", sea=sea, threads=1)
    env.reset(seed=0)
    seas = env.batch.arrays.seas
    heights = 4.0 * np.sqrt(0.5 * np.sum(seas["amplitude"] ** 2, axis=1))
    return heights, seas["amplitude"], seas["phase"]


def test_a_sea_is_drawn_evenly_from_its_range() -> None:
    heights, _, phases = drawn({"hs_m": (1.0, 5.0), "tp_s": 9.0})
    assert 0.9 < heights.min() < heights.max() < 5.1
    assert np.mean(heights) == pytest.approx(3.0, abs=0.2)
    assert np.std(heights) == pytest.approx(4.0 / math.sqrt(12.0), rel=0.1)
    assert len(np.unique(phases[:, 0])) == 400  # each has waves of its own


def test_seas_of_a_list_are_drawn_equally_often() -> None:
    heights, *_ = drawn(["calm", {"hs_m": 1.0, "tp_s": 9.0}, {"hs_m": 4.0, "tp_s": 9.0}])
    counts = [
        np.sum(heights == 0.0),
        np.sum((heights > 0.0) & (heights < 2.0)),
        np.sum(heights > 2),
    ]
    assert sum(counts) == 400
    assert min(counts) > 100


def test_every_sea_and_every_episode_takes_the_same_random_numbers() -> None:
    """So that a seed has the same orders and resistances in every sea."""
    episodes = []
    for sea in ("calm", "state-5", ["calm", {"hs_m": (1.0, 3.0), "tp_s": 9.0}]):
        env = FrigateEnv(task="transit", sea=sea)
        for seed in (3, None):  # an episode, and the one that follows it
            env.reset(seed=seed)
            now = env.batch.arrays.episodes[0]
            names = ("orders", "resistance_mean", "resistance_frequency", "resistance_phase")
            episodes.append([now[name].tolist() for name in names])
    assert episodes[0] == episodes[2] == episodes[4]
    assert episodes[1] == episodes[3] == episodes[5]
    assert episodes[0] != episodes[1]


OPTIONS: list[dict[str, Any]] = [
    {},
    {"sea": ["calm", {"hs_m": (1.0, 3.0), "tp_s": (7.0, 9.0)}], "resistance_rise": 0.4},
    {"initial_speed_m_s": 6.0, "speed_order_m_s": (7.0, 8.0)},
]


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize(
    ("one", "many", "settings"),
    [
        (FrigateEnv, FrigateVectorEnv, {"task": "speed-keeping"}),
        (FrigateEnv, FrigateVectorEnv, {"task": "storm", "command": "fuel-rack"}),
        (
            FrigateEnv,
            FrigateVectorEnv,
            {
                "task": "rough-sea:held-out",
                "randomise": {"hull.mass_kg": 0.2, "propeller.depth_m": 0.1},
            },
        ),
        (FrigateEnv, FrigateVectorEnv, {"action_mode": "residual:combinator-trimmed"}),
        (SteeringEnv, SteeringVectorEnv, {"task": "track-keeping:held-out"}),
        (SteeringEnv, SteeringVectorEnv, {"action_mode": "residual", "normalised": False}),
    ],
)
def test_vector_environments_begin_as_single_ones_to_the_bit(
    one: Any, many: Any, settings: dict[str, Any], options: dict[str, Any]
) -> None:
    """Two resets: the random numbers of an environment do not depend on the others that start."""
    vector, singles = many(5, **settings), [one(**settings) for _ in range(5)]
    seen = [vector.reset(seed=7, options=options)[0]]
    alone = [np.stack([env.reset(seed=7 + i, options=options)[0] for i, env in enumerate(singles)])]
    mask = np.array([True, False, True, True, False])
    seen.append(vector.reset(options=options | {"reset_mask": mask})[0])
    for i in np.flatnonzero(mask):
        singles[i].reset(options=options)
    alone.append(np.concatenate([env.batch.observation() for env in singles]))
    assert np.array_equal(seen, alone)
    for k, env in enumerate(singles):
        for name in ("plant", "state", "memory", "estimate", "episode", "observation", "ended"):
            mine, its = vector.batch.environments[name][k], env.batch.environments[name][0]
            assert mine.tobytes() == its.tobytes(), name
        for name in ("inflow", "elevation", "phase", "amplitude", "head_sea"):
            mine, its = vector.batch.arrays.seas[name][k], env.batch.arrays.seas[name][0]
            assert np.array_equal(mine, its), name


def test_tables_hold_the_steady_states_of_every_load() -> None:
    ship = load_ship("frigate-at-sea")
    tables = steady_tables(ship)
    assert set(tables.loads) <= set(LOADS)
    for k, load in enumerate(tables.loads):
        rows = steady_states(ship, float(load))
        part = tables.columns[:, tables.ends[k] : tables.ends[k + 1]]
        assert np.array_equal(part, [rows[name] for name in rows.dtype.names or ()])
    calm = steady_states(ship)["ship_speed"]
    assert (tables.slowest, tables.fastest) == (calm[0], calm[-1])


def test_beyond_the_heaviest_load_of_the_tables_a_ship_begins_at_that_load() -> None:
    ship = load_ship("frigate")
    heavy = FrigateEnv(ship=ship, task="transit", sea="calm", sensor_noise=0.0)
    racks = []
    for rise in (3.0, 9.0, 10.0):  # the last two lie beyond the heaviest load of the tables
        heavy.reset(seed=0, options={"resistance_rise": rise, "initial_speed_m_s": 6.0})
        racks.append(float(heavy.batch.arrays.episodes[0]["drive"]))
    assert racks[0] < racks[1] == racks[2]
    assert math.isfinite(racks[2])
