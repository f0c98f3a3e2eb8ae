"""Plans are computed once, simulated with the observations of a policy, and imitated before learning."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reproductions.learners.references import EPISODES
from reproductions.policies.trainings import BLOCKS
from shaftline.agents import RecipeError, load_policy, read_recipe, train
from shaftline.agents.learning import datasets, imitation
from shaftline.agents.learning.imitation import FIRST_SEED, Demonstrations, imitate, make_plans
from shaftline.agents.learning.recipe import Recipe, tuned_controller
from shaftline.agents.learning.recipe_search import FIRST_FRESH_SEA
from shaftline.agents.learning.training import (
    EVALUATION_EPISODES,
    FIRST_EVALUATION_SEED,
    build_model,
    weights_digest,
)
from shaftline.agents.policy.policy import Policy
from shaftline.baselines import make_controller
from shaftline.envs import FrigateEnv, get_task
from shaftline.plant import load_ship
from shaftline.plant.ship_files import write_ship

from ..tiny import interrupted_after_an_evaluation, plain_policy, recipe

STEPS = 40
FIXED = {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
RACK: dict[str, Any] = {
    "action_mode": "absolute",
    "command": "limited-rack",
    "max_episode_steps": STEPS,
}
TASK, SHIP = "transit", "frigate"


def planned_recipe(**changes: Any) -> Recipe:
    return recipe(plans=2, env_kwargs=RACK, **changes)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plans that the tests share."""
    return tmp_path_factory.mktemp("plans")


@pytest.fixture(scope="module")
def made(folder: Path) -> dict[int, Any]:
    return make_plans(planned_recipe(), SHIP, folder, jobs=1)


def sailed(seed: int, choose: Any, **more: Any) -> float:
    env = FrigateEnv(task=TASK, **RACK | more)
    seen, _ = env.reset(seed=seed)
    total = 0.0
    for k in range(STEPS):
        seen, reward, *_ = env.step(choose(k, seen))
        total += float(reward)
    return total


def test_a_plan_earns_more_than_the_controller_that_it_starts_from(made: dict[int, Any]) -> None:
    assert list(made) == [FIRST_SEED, FIRST_SEED + 1]
    for seed, actions in made.items():
        assert actions.shape == (40, 2)
        controller = make_controller(tuned_controller(TASK), get_task(TASK).load_ship(), 0.5)
        memory: list[Any] = [None]

        def tuned(k: int, seen: Any, memory: Any = memory, controller: Any = controller) -> Any:
            action, memory[0] = controller.predict(seen[None], memory[0], np.array([k == 0]))
            return action[0]

        planned = sailed(seed, lambda k, _, actions=actions: actions[k])
        classic = sailed(seed, tuned, normalised=False, observer="none", command="fuel-rack")
        assert planned > 1.03 * classic


def test_plans_are_made_once_whatever_the_instruments(
    made: dict[int, Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imitation, "plan_cell", None)  # nothing is planned any more
    other = recipe(plans=2, frame_stack=4, env_kwargs=RACK | {"observer": "none"})
    again = make_plans(other, SHIP, folder, jobs=1)
    for seed, actions in made.items():
        np.testing.assert_array_equal(again[seed], actions)


def test_returns_are_discounted_and_continued_beyond_the_time_limit(made: dict[int, Any]) -> None:
    plan = planned_recipe(hyperparameters={"gamma": 0.9})
    shown = imitation.demonstrate(plan, SHIP, made)
    env = FrigateEnv(task=TASK, **RACK)
    env.reset(seed=FIRST_SEED)
    rewards = [float(env.step(action)[1]) for action in made[FIRST_SEED]]
    expected: float = sum(0.9**k * reward for k, reward in enumerate(rewards))
    follows = sum(rewards) / STEPS / 0.1
    expected += 0.9**STEPS * follows
    assert shown.returns[0] == pytest.approx(expected, rel=1e-5)
    assert shown.returns[39] == pytest.approx(rewards[39] + 0.9 * follows, rel=1e-5)
    assert len(shown.returns) == 80


def test_a_failed_episode_earns_nothing_behind_its_end() -> None:
    plan = planned_recipe(hyperparameters={"gamma": 0.9}).model_copy(
        update={"env_kwargs": RACK | {"command": "fuel-rack"}}
    )
    stall = np.tile(np.array([1.0, -1.0], np.float32), (40, 1))  # full pitch and no fuel
    shown = imitation.demonstrate(plan, SHIP, {FIRST_SEED: stall})
    assert len(shown.returns) < 40
    assert shown.returns[-1] == 0.0


def test_observations_are_stacked_as_a_policy_stacks_them(made: dict[int, Any]) -> None:
    plan = planned_recipe(frame_stack=3)
    shown = imitation.demonstrate(plan, SHIP, {FIRST_SEED: made[FIRST_SEED]})
    fields = {"frame_stack": 3, "action_mode": "absolute", "command": "limited-rack"}
    policy = plain_policy(TASK, **fields)
    env = FrigateEnv(task=TASK, **RACK)
    seen, _ = env.reset(seed=FIRST_SEED)
    state = None
    for k in range(5):
        _, state = policy.predict(seen[None], state, np.array([k == 0]))
        np.testing.assert_array_equal(shown.observations[k], state[0])
        seen, *_ = env.step(made[FIRST_SEED][k])


def test_an_imitation_commands_what_was_shown_and_values_what_followed() -> None:
    model, venv, _ = build_model(planned_recipe(hyperparameters={"n_steps": 16}), 0, SHIP, "cpu", 1)
    width = venv.observation_space.shape[0]
    rng = np.random.default_rng(0)
    seen = rng.uniform(-1.0, 1.0, (2000, width)).astype(np.float32)
    wanted = np.column_stack([0.5 * seen[:, 0], -0.3 * seen[:, 1]])
    shown = Demonstrations(seen, wanted, 100.0 + 50.0 * seen[:, 2])
    error = imitate(model, shown)
    assert error < 1e-3 < 0.1 * float(np.mean(wanted**2))
    chosen, _ = model.predict(seen[:50], deterministic=True)
    np.testing.assert_allclose(chosen, wanted[:50], atol=0.1)
    value = model.policy.predict_values(model.policy.obs_to_tensor(seen[:200])[0])
    assert np.corrcoef(value.detach().numpy()[:, 0], seen[:200, 2])[0, 1] > 0.9
    venv.close()


def test_a_training_with_plans_repeats_and_resumes(folder: Path, tmp_path: Path) -> None:
    keywords: Any = {"device": "cpu", "threads": 1, "plan_folder": folder}
    whole = train(planned_recipe(), 3, tmp_path / "whole", **keywords)
    interrupted_after_an_evaluation(planned_recipe(), 3, tmp_path / "again")
    assert len(json.loads((tmp_path / "again/curve.json").read_text())) == 2
    resumed = train(planned_recipe(), 3, tmp_path / "again", **keywords)
    assert weights_digest(whole) == weights_digest(resumed)
    without = train(recipe(env_kwargs=RACK), 3, tmp_path / "without", device="cpu", threads=1)
    assert weights_digest(without) != weights_digest(whole)
    assert load_policy(whole).about["recipe"]["plans"] == 2
    assert load_policy(whole).curve["steps"] == [0, 64, 128]  # the first is the imitation's


def test_progress_tells_how_many_plans_are_made(tmp_path: Path, folder: Path) -> None:
    told: list[str] = []
    train(
        planned_recipe(),
        3,
        tmp_path,
        device="cpu",
        threads=1,
        plan_folder=folder,
        tick=lambda done, total, said: told.append(said),
    )
    assert told[:3] == ["1 of 2 plans", "2 of 2 plans", "imitating the plans"]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"action_mode": "increment"}, "not ppo with increment and limited-rack"),
        ({"command": "shaft-speed"}, "not ppo with absolute and shaft-speed"),
        ({"max_episode_steps": None}, "needs an episode with an end"),
    ],
)
def test_a_policy_that_cannot_follow_a_plan_is_refused(changes: Any, reason: str) -> None:
    with pytest.raises(RecipeError, match=f"plans = 4: .*{reason}"):
        read_recipe("ppo", TASK, plans=4, env_kwargs=RACK | changes)


def test_a_task_with_a_rudder_has_no_plan() -> None:
    with pytest.raises(
        RecipeError, match="a plan has no rudder command, which course-keeping needs"
    ):
        read_recipe("ppo", "course-keeping", plans=4, env_kwargs=RACK)


def test_the_policy_runs_without_the_plans(folder: Path, tmp_path: Path) -> None:
    policy = load_policy(
        train(planned_recipe(), 0, tmp_path, device="cpu", threads=1, plan_folder=folder)
    )
    assert isinstance(policy, Policy)
    assert policy.interface["command"] == "limited-rack"


def test_a_residual_follows_a_plan_within_its_reach(made: dict[int, Any]) -> None:
    mode = f"residual:{tuned_controller(TASK)}"
    plan = recipe(plans=2, env_kwargs={"action_mode": mode, "max_episode_steps": STEPS})
    shown = imitation.demonstrate(plan, SHIP, {FIRST_SEED: made[FIRST_SEED]})
    env = FrigateEnv(task=TASK, action_mode=mode, max_episode_steps=STEPS)
    env.reset(seed=FIRST_SEED)
    for k in range(STEPS):
        base = env.batch.base
        assert base is not None
        given = base.add(shown.actions[k][None])[0]
        inside = np.abs(shown.actions[k]) < 1.0
        np.testing.assert_allclose(given[inside], made[FIRST_SEED][k][inside], atol=1e-5)
        env.step(shown.actions[k])
    assert np.mean(np.abs(shown.actions) < 1.0) > 0.5


def test_no_other_seed_is_planned() -> None:
    """Blocks of seeds: of training, evaluations, plans, a search's last word, judging, data sets."""
    training_seeds = (0, 400_000 + 4096)
    blocks = [
        training_seeds,
        (FIRST_EVALUATION_SEED, FIRST_EVALUATION_SEED + EVALUATION_EPISODES),
        (FIRST_SEED, FIRST_SEED + 1000),
        (FIRST_FRESH_SEA, FIRST_FRESH_SEA + EVALUATION_EPISODES),
        *((first, first + EPISODES) for _, first in BLOCKS.values()),
        (datasets.FIRST_SEED, datasets.FIRST_SEED + 500_000),
    ]
    ordered = sorted(set(blocks))
    assert all(end <= begin for (_, end), (begin, _) in pairwise(ordered))


def test_another_ship_under_the_same_path_is_planned_anew(tmp_path: Path) -> None:
    ship = tmp_path / "mine.toml"
    write_ship(load_ship(SHIP), ship)
    plan = planned_recipe().model_copy(update={"plans": 1})
    before = make_plans(plan, str(ship), tmp_path / "plans", jobs=1)
    heavier = load_ship(SHIP).with_values({"hull.mass_kg": 2.0 * load_ship(SHIP).hull.mass_kg})
    write_ship(heavier, ship)
    after = make_plans(plan, str(ship), tmp_path / "plans", jobs=1)
    assert not np.array_equal(before[FIRST_SEED], after[FIRST_SEED])


@pytest.mark.parametrize("content", ["[]", "[[0.1, 0.2]]", '{"a": 1}', "[[NaN, 0.0]]", "[[1], 2]"])
def test_a_damaged_plan_is_refused_by_name(tmp_path: Path, content: str) -> None:
    plan = planned_recipe().model_copy(update={"plans": 1})
    make_plans(plan, SHIP, tmp_path, jobs=1)
    (file,) = tmp_path.glob("plan-*.json")
    file.write_text(content)
    with pytest.raises(ValueError, match=rf"{file.name}: must contain 40 pairs .* remove the file"):
        make_plans(plan, SHIP, tmp_path, jobs=1)


def test_commands_beyond_the_range_are_no_plan(tmp_path: Path) -> None:
    plan = planned_recipe().model_copy(update={"plans": 1})
    make_plans(plan, SHIP, tmp_path, jobs=1)
    (file,) = tmp_path.glob("plan-*.json")
    file.write_text(json.dumps([[0.0, 0.0]] * 39 + [[0.0, 1.5]]))
    with pytest.raises(ValueError, match="from -1 to 1"):
        make_plans(plan, SHIP, tmp_path, jobs=1)


def test_a_fixed_pitch_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    ship = tmp_path / "fixed.toml"
    write_ship(load_ship(SHIP).with_values(FIXED), ship)
    with pytest.raises(
        RecipeError, match="plans = 2: a plan commands the pitch, which is fixed on"
    ):
        train(planned_recipe(), 0, tmp_path / "out", ship=str(ship), device="cpu", threads=1)
    assert not (tmp_path / "out" / "training.json").exists()


@pytest.mark.parametrize("gamma", [1.0, "lin_0.99"])
def test_returns_need_a_discount(gamma: Any) -> None:
    with pytest.raises(ValueError, match=f"needs a gamma below 1, not {gamma!r}"):
        planned_recipe(hyperparameters={"gamma": gamma})
