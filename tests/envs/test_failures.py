"""In no task does a programme that fails outscore one that does not, nor the combinator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.baselines import make_controller, make_steering
from shaftline.baselines.actions import encode_all
from shaftline.baselines.controller import OBSERVED, readings
from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringVectorEnv, tasks
from shaftline.envs.tasks import HELD_OUT

from .programmes import STALL, TRIP, scripted

EPISODE_S = 40.0
GOOD = 12
"""Episodes of the combinator; as many again are spoilt at their end."""
CASES = [
    (f"{name}{part}", steered)
    for steered in (False, True)
    for name in tasks(steered)
    for part in ("", f":{HELD_OUT}")
]


def command(controller: Any, env: Any, seen: Any, state: Any, start: Any) -> Any:
    """Return what the combinator commands, as actions of the environment's mode, and its state."""
    action, state = controller.predict(seen, state, start)
    if env.batch.settings.action_mode == "shaft-speed":  # the governor gets the speed of the lever
        propulsion = getattr(controller, "propulsion", controller)
        asked = propulsion.curve.at(readings(seen[:, : len(OBSERVED)]).speed_order).shaft_speed
        plant = env.batch.ship.record()
        ends = [float(plant[f"engine_speed_{end}"] / plant["gear_ratio"]) for end in ("min", "max")]
        action = action.copy()
        action[:, 1] = encode_all(asked, *ends)
    return action, state


def sail(task: str, steered: bool, mode: str) -> tuple[Any, ...]:
    """Run the combinator, spoilt combinators and scripted programmes, an episode each.

    Returns:
        Return of each episode, whether it failed, and its length in intervals.
    """
    kind = SteeringVectorEnv if steered else FrigateVectorEnv
    numbers = 3 if steered else 2
    intervals = round(EPISODE_S / 0.5)
    plan = scripted(intervals, numbers, np.random.default_rng(1))
    n = 2 * GOOD + plan.shape[1]
    env = kind(n, task=task, episode_s=EPISODE_S, action_mode=mode, observer="none", threads=1)
    ship = env.batch.ship
    controller: Any = (
        make_steering("autopilot+combinator", ship, 0.5)
        if steered
        else make_controller("combinator", ship, 0.5)
    )
    # pairs of good and spoilt episodes have a seed in common, and so have many programmes
    seeds = [*range(GOOD), *range(GOOD), *(k % GOOD for k in range(plan.shape[1]))]
    seen, _ = env.reset(seed=[1000 + seed for seed in seeds])
    returned, lasted = np.zeros(n), np.zeros(n, np.int64)
    failed, alive, state = np.zeros(n, dtype=bool), np.ones(n, dtype=bool), None
    spoilt_at = np.linspace(1, intervals - 1, GOOD).astype(int)
    plant, speeds = ship.record(), env.batch.arrays.states["shaft_speed"]
    for k in range(intervals):
        begins = np.full(2 * GOOD, k == 0)
        good, state = command(controller, env, seen[: 2 * GOOD], state, begins)
        late = GOOD + np.flatnonzero(spoilt_at <= k)
        good[late, :2] = np.where((late % 2 == 0)[:, None], TRIP, STALL)
        # where the governor saves the engine all the same, the shaft is thrown beyond the trip
        thrown = late[(spoilt_at[late - GOOD] == k) & (late % 3 == 0)]
        if k == intervals - 1:
            thrown = late
        good[thrown, :2] = TRIP
        speeds[thrown] = 10.0 * plant["engine_speed_max"] / plant["gear_ratio"]
        seen, reward, terminated, truncated, _ = env.step(np.concatenate([good, plan[k]]))
        returned += np.where(alive, reward, 0.0)
        lasted += alive
        failed |= alive & terminated
        alive &= ~(terminated | truncated)
    assert not alive.any()
    return returned, failed, lasted, env.batch.task.worst_cost * intervals


@pytest.mark.parametrize("mode", ["rack", "shaft-speed"])
@pytest.mark.parametrize(("task", "steered"), CASES)
def test_no_programme_that_fails_outscores_one_that_does_not(
    task: str, steered: bool, mode: str
) -> None:
    returned, failed, lasted, worst = sail(task, steered, mode)
    assert len(returned) - 2 * GOOD >= 200
    assert not failed[:GOOD].any()
    assert failed[GOOD : 2 * GOOD].all()
    assert (~failed[2 * GOOD :]).sum() > 20
    if mode == "rack":
        assert failed[2 * GOOD :].sum() > 50
    assert returned[failed].max() < returned[~failed].min()
    assert returned[failed].max() < returned[:GOOD].min()
    # exactly: above no sum of worst intervals; and what did not fail lies above it
    assert (returned[failed] <= -worst).all()
    assert (returned[~failed] >= -worst).all()
    assert lasted[failed].max() == round(EPISODE_S / 0.5)  # one fails in the last interval


@pytest.mark.parametrize("episode_s", [0.5, 7.0, 90.0])
@pytest.mark.parametrize("mode", ["rack", "shaft-speed"])
def test_single_and_vector_charge_a_failure_to_the_bit(episode_s: float, mode: str) -> None:
    settings: dict[str, Any] = {"task": "rough-sea", "episode_s": episode_s, "action_mode": mode}
    vector, single = FrigateVectorEnv(3, **settings), FrigateEnv(**settings)
    vector.reset(seed=4)
    single.reset(seed=4)
    plan = np.tile([-1.0, 0.0], (3, 1))
    last = vector.batch.settings.intervals - 1
    for k in range(last + 1):
        if k == last:
            for env in (vector, single):
                env.batch.arrays.states["shaft_speed"] *= 20.0
        many = vector.step(plan)
        one = single.step(plan[0])
        assert many[1][0] == one[1]
        assert many[2][0] == one[2]
        if one[2]:
            break
    assert one[2]
    intervals, worst = vector.batch.settings.intervals, vector.batch.task.worst_cost
    assert one[1] == -worst * (2 * intervals - k)
