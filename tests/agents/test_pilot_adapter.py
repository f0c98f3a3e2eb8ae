"""What a policy sees of an observation, and how its answers become commands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents.policy.pilot_adapter import ANSWERS, FEATURES, PilotAdapter, Reach
from shaftline.baselines.combinator import combinator_curve
from shaftline.baselines.controller import OBSERVED
from shaftline.baselines.steady_points import steady_point
from shaftline.envs import FrigateVectorEnv
from shaftline.plant import load_ship

INTERVAL_S = 0.5


@pytest.fixture(scope="module")
def adapter() -> PilotAdapter:
    return PilotAdapter(load_ship("frigate"), INTERVAL_S)


@pytest.fixture(scope="module")
def observed() -> Any:
    """Observations of three episodes, shape (20, 3, 8)."""
    env = FrigateVectorEnv(3, task="transit", sea="state-6", observer="random-walk-kalman")
    seen, _ = env.reset(seed=1)
    rows = [seen]
    for _ in range(19):
        rows.append(env.step(np.tile(np.array([0.5, 0.1], np.float32), (3, 1)))[0])
    env.close()
    return np.array(rows)


def test_features_are_finite_and_named(adapter: PilotAdapter, observed: Any) -> None:
    memory = None
    for row in observed:
        features, memory = adapter.see(row, memory)
        assert features.shape == (3, len(FEATURES))
        assert np.isfinite(features).all()
    row = dict(zip(FEATURES, features[0], strict=True))
    assert row["speed_order"] == observed[-1][0, OBSERVED.index("speed_order")]
    assert row["speed_error over 8 s"] != row["speed_error"]


def test_an_estimate_that_is_not_valid_is_not_shown(adapter: PilotAdapter, observed: Any) -> None:
    row = observed[0].copy()
    row[:, OBSERVED.index("estimate_valid")] = 0.0
    row[:, OBSERVED.index("estimated_advance_velocity")] = 1e6
    features, _ = adapter.see(row)
    assert (features[:, FEATURES.index("advance_velocity")] == 0.0).all()


def test_seeing_leaves_the_memory_as_it_was(adapter: PilotAdapter, observed: Any) -> None:
    _, memory = adapter.see(observed[0])
    before = memory.copy()
    _, after = adapter.see(observed[1], memory, np.array([True, False, False]))
    assert np.array_equal(memory, before)
    assert not np.array_equal(after, before)


def test_an_episode_that_begins_forgets(adapter: PilotAdapter, observed: Any) -> None:
    _, memory = adapter.see(observed[0])
    memory[:, -len(ANSWERS) :] = 0.7
    features, after = adapter.see(observed[1], memory, np.array([True, False, False]))
    fresh, _ = adapter.see(observed[1])
    assert np.array_equal(features[0], fresh[0])
    assert (after[0, -len(ANSWERS) :] == 0.0).all()
    assert (after[1:, -len(ANSWERS) :] == 0.7).all()


def test_one_observation_is_a_batch_of_one(adapter: PilotAdapter, observed: Any) -> None:
    memory, alone = None, None
    answer = np.tile(np.linspace(-0.6, 0.3, len(ANSWERS)), (3, 1))
    for row in observed:
        features, memory = adapter.see(row, memory)
        single, alone = adapter.see(row[1], alone)
        assert np.array_equal(single[0], features[1])
        all_actions = adapter.command(answer, memory, features)
        one_action = adapter.command(answer[:1], alone, single)
        assert np.array_equal(one_action[0], all_actions[1])


def test_saying_nothing_gives_the_combinators_steady_commands(
    adapter: PilotAdapter, observed: Any
) -> None:
    curve = combinator_curve(adapter.ship)
    k = len(curve.ship_speed) // 2
    row = observed[0][:1].copy()
    for name in ("speed_order", "measured_ship_speed"):  # no error to correct
        row[:, OBSERVED.index(name)] = curve.ship_speed[k]
    features, memory = adapter.see(row)
    action = adapter.command(np.zeros((1, len(ANSWERS))), memory, features)
    plant = adapter.ship.record()
    low = np.array([plant["pitch_ratio_min"], plant["drive_min"]])
    high = np.array([plant["pitch_ratio_max"], plant["drive_max"]])
    pitch, rack = low + 0.5 * (action[0] + 1.0) * (high - low)
    steady = steady_point(adapter.ship, float(curve.shaft_speed[k]), float(curve.pitch_ratio[k]))
    assert pitch == pytest.approx(curve.pitch_ratio[k], abs=1e-5)
    assert rack == pytest.approx(steady.fuel_rack, abs=1e-4)


def test_answers_are_followed_slowly(observed: Any) -> None:
    adapter = PilotAdapter(load_ship("frigate"), INTERVAL_S, Reach(slow_s=2.0))
    features, memory = adapter.see(observed[0])
    answer = np.zeros((3, len(ANSWERS)))
    which = ANSWERS.index("pitch_offset")
    answer[:, which] = -1.0
    pitches = [adapter.command(answer, memory, features)[0, 0] for _ in range(20)]
    assert (np.diff(pitches) < 0.0).all()
    followed = memory[0, -len(ANSWERS) + which]
    assert followed == pytest.approx(np.exp(-20 * INTERVAL_S / 2.0) - 1.0)


def test_reach_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"reach\.slow_s = .*must be from 0 to 100"):
        Reach(slow_s=0.0)
