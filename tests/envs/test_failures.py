"""A failure loses the rewards that would have followed, so it does not pay."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.baselines import make_controller, make_steering
from shaftline.envs import CLASSIC, FrigateEnv, FrigateVectorEnv, SteeringVectorEnv, tasks
from shaftline.envs.tasks import HELD_OUT

from .programmes import scripted

INTERVALS = 160
SEEDS = 12
FIRST_SEED = 1000
CASES = [
    (f"{name}{part}", steered)
    for steered in (False, True)
    for name in tasks(steered)
    for part in ("", f":{HELD_OUT}")
]
FORMS: list[dict[str, Any]] = [
    {"action_mode": "absolute", "command": "fuel-rack"},
    {"action_mode": "absolute", "command": "limited-rack"},
    {"action_mode": "absolute", "command": "shaft-speed"},
    {"action_mode": "increment", "command": "fuel-rack"},
    {"action_mode": "increment", "command": "limited-rack"},
    {"action_mode": "increment", "command": "shaft-speed"},
    {"action_mode": "residual:combinator", "command": "fuel-rack"},
    {"action_mode": "residual", "command": "limited-rack"},
]


def made(task: str, steered: bool, n: int, **settings: Any) -> FrigateVectorEnv | SteeringVectorEnv:
    kind = SteeringVectorEnv if steered else FrigateVectorEnv
    return kind(
        n,
        task=task,
        max_episode_steps=INTERVALS,
        observer="none",
        threads=1,
        autoreset_mode="NextStep",
        **settings,
    )


@functools.lru_cache(maxsize=4)
def by_combinator(task: str, steered: bool, fails: bool = False) -> NDArray[np.float64]:
    """Return the rewards of the combinator by interval and seed, shape (INTERVALS, SEEDS).

    Args:
        task: name.
        steered: whether the rudder is an action.
        fails: whether the shaft of episode i is accelerated beyond the trip in interval
            :data:`FAILING` [i].
    """
    env = made(task, steered, SEEDS, **CLASSIC)
    ship = env.batch.ship
    controller: Any = (
        make_steering("autopilot+combinator", ship, 0.5)
        if steered
        else make_controller("combinator", ship, 0.5)
    )
    seen, _ = env.reset(seed=FIRST_SEED)
    rewards, alive, state = np.zeros((INTERVALS, SEEDS)), np.ones(SEEDS, dtype=bool), None
    for k in range(INTERVALS):
        if fails:
            env.batch.arrays.states["shaft_speed"][k == FAILING] *= 50.0
        action, state = controller.predict(seen, state, np.full(SEEDS, k == 0))
        seen, reward, terminated, _, _ = env.step(action)
        rewards[k] = np.where(alive, reward, 0.0)
        if fails:
            assert terminated[k == FAILING].all()
        alive &= ~terminated
    return rewards


FAILING = np.linspace(0, INTERVALS - 1, SEEDS).astype(int)


@pytest.mark.parametrize(("task", "steered"), CASES)
def test_a_failure_loses_what_remains_and_nothing_before(task: str, steered: bool) -> None:
    whole, failed = by_combinator(task, steered), by_combinator(task, steered, fails=True)
    assert (whole.sum(axis=0) > 0.0).all()
    for i, k in enumerate(FAILING):
        assert np.array_equal(failed[:k, i], whole[:k, i])
        assert not failed[k:, i].any()
    assert (failed.sum(axis=0) <= whole.sum(axis=0)).all()


@pytest.mark.parametrize(
    ("task", "steered", "form"),
    [
        pytest.param(*case, form, id="-".join((case[0], *form.values())))
        for case in CASES
        for form in (FORMS[:1] if case[0].endswith(HELD_OUT) else FORMS)
    ],
)
def test_programmes_that_fail_do_not_beat_the_combinator_with_the_same_seed(
    task: str, steered: bool, form: dict[str, Any]
) -> None:
    plan = scripted(INTERVALS, 3 if steered else 2, np.random.default_rng(1))
    n = plan.shape[1]
    assert n >= 200
    env = made(task, steered, n, **form)
    seeds = np.arange(n) % SEEDS
    env.reset(seed=[FIRST_SEED + int(seed) for seed in seeds])
    returned, failed, alive = np.zeros(n), np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    for actions in plan:
        _, reward, terminated, truncated, _ = env.step(actions)
        assert ((reward >= 0.0) & (reward <= 1.0)).all()
        assert not reward[terminated].any()
        returned += np.where(alive, reward, 0.0)
        failed |= alive & terminated
        alive &= ~(terminated | truncated)
    assert not alive.any()
    lost = by_combinator(task, steered).sum(axis=0)[seeds[failed]] - returned[failed]
    # a programme that follows the order sooner and fails in the last intervals may still be ahead
    assert np.sum(lost < 0.0) <= 2
    assert not failed.any() or lost.mean() > 0.0
    if form == {"action_mode": "absolute", "command": "fuel-rack"}:
        assert failed.sum() > 50


@pytest.mark.parametrize("length", [1, 14, 180])
@pytest.mark.parametrize("command", ["fuel-rack", "limited-rack", "shaft-speed"])
def test_single_and_vector_environment_fail_alike_to_the_bit(length: int, command: str) -> None:
    settings: dict[str, Any] = {
        "task": "rough-sea",
        "max_episode_steps": length,
        "command": command,
    }
    vector, single = FrigateVectorEnv(3, **settings), FrigateEnv(**settings)
    vector.reset(seed=4)
    single.reset(seed=4)
    for k in range(length):
        if k == length - 1:
            for env in (vector, single):
                env.batch.arrays.states["shaft_speed"] *= 50.0
        many, one = vector.step(np.full((3, 2), 0.1)), single.step(np.full(2, 0.1))
        assert (many[1][0], many[2][0], many[3][0]) == one[1:4]
        assert (one[1] > 0.0) == (k < length - 1)
    assert one[2:4] == (True, True)  # both, in the last interval
    assert many[4]["final_info"]["ended"][0] == one[4]["ended"] == "overspeed trip"
