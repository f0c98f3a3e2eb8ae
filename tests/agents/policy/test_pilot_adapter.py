"""What a policy sees of an observation, and how its answers become commands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents.policy.pilot_adapter import (
    ANSWERS,
    FEATURES,
    SIGNALS,
    SLOW_S,
    PilotAdapter,
    Reach,
)
from shaftline.baselines.actions import actions
from shaftline.baselines.combinator import combinator_curve
from shaftline.baselines.controller import OBSERVED
from shaftline.baselines.speed_pilot import PilotSettings, Slowed, SpeedPilot
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


def test_features_by_hand(adapter: PilotAdapter, observed: Any) -> None:
    """The readings with the error in place of the speed, then some slowed by 2 s and by 8 s."""
    assert SLOW_S == (2.0, 8.0)
    memory, slowed = None, None
    for rows in observed:
        features, memory = adapter.see(rows, memory)
        order, omega, torque, pitch, rack, speed, estimate, valid = np.asarray(rows, np.float64).T
        heard = np.stack([order - speed, omega, torque, estimate * (valid > 0.5)])
        if slowed is None:
            slowed = [heard, heard]
        slowed = [np.exp(-0.5 / tau) * old + (1.0 - np.exp(-0.5 / tau)) * heard
                  for tau, old in zip((2.0, 8.0), slowed, strict=True)]  # fmt: skip
        expected = [order, heard[0], omega, torque, pitch, rack, heard[3], valid, *slowed[0],
                    *slowed[1], *np.zeros((6, 3))]  # fmt: skip
        assert pytest.approx(np.asarray(expected, np.float32), rel=1e-6) == features.T
        assert features.dtype == np.float32
        assert memory == pytest.approx(np.stack(expected[8:], axis=1))
    assert FEATURES[8:16] == tuple(f"{name} over {tau} s" for tau in (2, 8) for name in SIGNALS)
    assert FEATURES[16:] == ("integral", *ANSWERS)


def test_an_estimate_that_is_not_valid_is_not_shown(adapter: PilotAdapter, observed: Any) -> None:
    row = observed[0].copy()
    row[:, OBSERVED.index("estimate_valid")] = 0.0, 1.0, 0.0
    row[:, OBSERVED.index("estimated_advance_velocity")] = 1e6
    features, _ = adapter.see(row)
    for name in ("advance_velocity", "advance_velocity over 2 s", "advance_velocity over 8 s"):
        assert features[:, FEATURES.index(name)].tolist() == [0.0, 1e6, 0.0]
    assert features[:, FEATURES.index("estimate_valid")].tolist() == [0.0, 1.0, 0.0]


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


def test_answers_are_settings_of_the_speed_pilot(observed: Any) -> None:
    ship = load_ship("frigate")
    reach = Reach(speed_offset=0.4, pitch_offset=0.2, torque_gain=(0.8, 0.5), shaft_gain=(0.2, 0.1),
                  pitch_gain=(0.6, 1.5), speed_gain=1.5, slow_s=3.0)  # fmt: skip
    adapter, pilot = PilotAdapter(ship, INTERVAL_S, reach), SpeedPilot(ship, INTERVAL_S, 1.5)
    rng = np.random.default_rng(2)
    memory, followed, integral = None, np.zeros((3, len(ANSWERS))), np.zeros(3)
    keep = np.exp(-INTERVAL_S / 3.0)
    for rows in observed:
        features, memory = adapter.see(rows, memory)
        seen = dict(zip(FEATURES, np.asarray(features, np.float64).T, strict=True))
        answer = rng.uniform(-1.4, 1.4, (3, len(ANSWERS)))
        action = adapter.command(answer, memory, features)
        followed = keep * followed + (1.0 - keep) * np.clip(answer, -1.0, 1.0)
        settings = PilotSettings(
            0.4 * followed[:, 0], 0.2 * followed[:, 1], 0.8 + 0.5 * followed[:, 2],
            0.2 + 0.1 * followed[:, 3], 0.6 + 1.5 * followed[:, 4],
        )  # fmt: skip
        slowed = Slowed(memory[:, 0], memory[:, 5], memory[:, 6], integral)
        assert slowed.shaft_torque == pytest.approx(seen["shaft_torque over 8 s"], rel=1e-6)
        pitch, rack, integral = pilot.command(
            seen["speed_order"], seen["shaft_speed"], seen["shaft_torque"], slowed, settings
        )
        assert action == pytest.approx(actions(ship.record(), pitch, rack), abs=1e-7)
        assert memory[:, 8] == pytest.approx(integral)
        assert memory[:, 9:] == pytest.approx(followed)
    assert np.abs(integral).max() > 0.0


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


def test_the_usual_reach() -> None:
    reach = Reach()
    assert reach.middles.tolist() == [0.0, 0.0, 1.0, 0.15, 0.7]
    assert reach.spans.tolist() == [0.5, 0.25, 1.0, 0.3, 2.0]
    assert (reach.speed_gain, reach.slow_s) == (2.0, 4.0)
    assert PilotAdapter(load_ship("frigate"), INTERVAL_S).reach == reach


@pytest.mark.parametrize(
    "values",
    [
        {"slow_s": 0.0}, {"slow_s": 100.1}, {"speed_gain": -0.1}, {"pitch_gain": (0.0, 100.1)},
        {"torque_gain": (-0.1, 1.0)}, {"speed_offset": float("nan")},
    ],
)  # fmt: skip
def test_reach_out_of_range_is_refused(values: dict[str, Any]) -> None:
    (name,) = values
    with pytest.raises(ValueError, match=rf"reach\.{name} = .*must be from 0 to 100"):
        Reach(**values)


def test_reach_may_lie_at_the_ends_of_its_range() -> None:
    Reach(speed_offset=0.0, pitch_offset=100.0, torque_gain=(0.0, 100.0), slow_s=100.0)
