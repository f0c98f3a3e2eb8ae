"""What is drawn for an episode, and that many ships begin as one alone does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringEnv, SteeringVectorEnv, get_task
from shaftline.envs.options import Begin
from shaftline.envs.settings import seas_of
from shaftline.envs.starts import LOADS, draw_episodes, steady_states, steady_tables
from shaftline.plant import load_ship

TRANSIT = get_task("transit")
NOTHING = Begin.of(None, TRANSIT, (4.0, 10.0))


def drawn(sea: Any, rngs: list[np.random.Generator]) -> Any:
    return draw_episodes(rngs, seas_of(sea, TRANSIT), NOTHING, 0, False)[0]["sea"]


def test_a_sea_is_drawn_evenly_from_its_range() -> None:
    rngs = [np.random.default_rng(seed) for seed in range(400)]
    found = drawn({"hs_m": (1.0, 5.0), "tp_s": 9.0, "heading_deg": (0.0, 90.0)}, rngs)
    heights, periods, gammas, headings = found.T
    assert set(periods) == {9.0}
    assert set(gammas) == {3.3}
    assert 1.0 < heights.min() < heights.max() < 5.0
    assert np.mean(heights) == pytest.approx(3.0, abs=0.15)
    assert np.std(heights) == pytest.approx(4.0 / math.sqrt(12.0), rel=0.07)
    assert abs(np.corrcoef(heights, headings)[0, 1]) < 0.15


def test_calm_water_draws_no_parameters() -> None:
    calm, plain = np.random.default_rng(0), np.random.default_rng(0)
    assert drawn("calm", [calm]).tolist() == [[0.0] * 4]
    plain.integers(2**31)
    plain.integers(2**63, dtype=np.uint64)
    plain.random(67)
    assert calm.bit_generator.state == plain.bit_generator.state


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
        (FrigateEnv, FrigateVectorEnv, {"task": "storm", "action_mode": "shaft-speed"}),
        (FrigateEnv, FrigateVectorEnv, {"task": "rough-sea:held-out",
                                        "randomise": {"hull.mass_kg": 0.2, "propeller.depth_m": 0.1}}),
        (SteeringEnv, SteeringVectorEnv, {"task": "track-keeping:held-out"}),
    ],
)  # fmt: skip
def test_many_ships_begin_as_each_alone_to_the_bit(
    one: Any, many: Any, settings: dict[str, Any], options: dict[str, Any]
) -> None:
    """Twice over, so that the streams go on alike, whichever ships begin together."""
    vector, singles = many(5, **settings), [one(**settings) for _ in range(5)]
    seen = [vector.reset(seed=7, options=options)[0]]
    alone = [np.stack([env.reset(seed=7 + i, options=options)[0] for i, env in enumerate(singles)])]
    mask = np.array([True, False, True, True, False])
    seen.append(vector.reset(options=options | {"reset_mask": mask})[0])
    for i in np.flatnonzero(mask):
        singles[i].reset(options=options)
    alone.append(np.stack([env.batch.told(0) for env in singles]))
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


def test_a_ship_that_bears_few_loads_begins_at_the_nearest() -> None:
    ship = load_ship("frigate")
    heavy = FrigateEnv(ship=ship, task="transit", sea="calm", sensor_noise=0.0)
    racks = []
    for rise in (3.0, 9.0, 10.0):  # the last two lie beyond the heaviest load of the tables
        heavy.reset(seed=0, options={"resistance_rise": rise, "initial_speed_m_s": 6.0})
        racks.append(float(heavy.batch.arrays.episodes[0]["drive"]))
    assert racks[0] < racks[1] == racks[2]
    assert math.isfinite(racks[2])
