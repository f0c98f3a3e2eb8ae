"""Recipes: what is read, what goes before it, and what cannot be used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from shaftline.agents import RecipeError, load_policy, read_recipe
from shaftline.agents.learning.recipe import Recipe, tuned_controller
from shaftline.agents.policy.policy import packaged_policies
from shaftline.baselines import make_controller
from shaftline.envs import get_task, tasks
from shaftline.envs.settings import Settings

CHOSEN = {
    "observer",
    "tuning",
    "sea",
    "sensor_noise",
    "max_episode_steps",
    "randomise",
    "action_mode",
    "command",
}
ELSEWHERE = sorted(set(Settings.model_fields) - CHOSEN)
"""Keywords of the environment that a recipe may not set."""

MINE = """
transit:
  n_envs: 32
  n_timesteps: 2e5
  evaluations: 3
  frame_stack: 4
  env_kwargs: {observer: oracle, max_episode_steps: 120}
  n_steps: 256
  learning_rate: lin_3e-4
"""


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.yml"
    file.write_text(MINE.replace("2e5", "!!float 2e5"))
    return file


def test_a_section_becomes_a_recipe(mine: Path) -> None:
    plan = read_recipe("ppo", "transit", mine)
    assert plan == Recipe(
        algorithm="ppo",
        task="transit",
        n_envs=32,
        n_timesteps=200_000,
        evaluations=3,
        frame_stack=4,
        env_kwargs={"observer": "oracle", "max_episode_steps": 120},
        hyperparameters={"n_steps": 256, "learning_rate": "lin_3e-4"},
    )


def test_changes_go_before_the_file(mine: Path) -> None:
    plan = read_recipe(
        "ppo",
        "transit",
        mine,
        n_envs=8,
        evaluations=1,
        env_kwargs={"observer": "none", "sea": "calm"},
    )
    assert (plan.n_envs, plan.evaluations, plan.n_timesteps) == (8, 1, 200_000)
    assert plan.env_kwargs == {"observer": "none", "max_episode_steps": 120, "sea": "calm"}


def test_a_recipe_without_more_than_its_size_is_plain() -> None:
    plan = Recipe.model_validate(
        {"algorithm": "sac", "task": "storm", "n_envs": 1, "n_timesteps": 1}
    )
    assert (plan.evaluations, plan.frame_stack, plan.policy) == (10, 1, "MlpPolicy")
    assert (plan.env_kwargs, plan.hyperparameters) == ({}, {})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("transit: {n_envs: 0, n_timesteps: 10}", r"n_envs = 0: .*greater than or equal to 1"),
        ("transit: {n_envs: 4097, n_timesteps: 10}", "n_envs = 4097: .*less than or equal to 4096"),
        ("transit: {n_envs: 1, n_timesteps: 0}", "n_timesteps = 0"),
        ("transit: {n_envs: 1, n_timesteps: 1.5}", r"n_timesteps = 1\.5"),
        ("transit: {n_envs: 1, n_timesteps: 1, evaluations: 0}", "evaluations = 0"),
        ("transit: {n_envs: 1}", "n_timesteps.*required"),
        (
            "transit: {n_envs: 1, n_timesteps: 1, n_step: 2}",
            "'n_step'; known keys of PPO: .*n_steps.*n_envs",
        ),
        ("transit: {n_envs: 1, n_timesteps: 1, seed: 2}", "unknown key 'seed'"),
        (
            "transit: {n_envs: 1, n_timesteps: 1, buffer_size: 2}",
            "unknown key 'buffer_size'; known keys of PPO",
        ),
        ("transit: {n_envs: 1, n_timesteps: 1, frame_stack: 65}", "frame_stack = 65"),
        (
            "transit: {n_envs: 1, n_timesteps: 1, env_kwargs: 3}",
            "env_kwargs = 3: must be a mapping",
        ),
        ("transit: {n_envs: 1, n_timesteps: 1, env_kwargs: {ship: ferry}}", r"env_kwargs\.ship"),
        *(
            (
                f"transit: {{n_envs: 1, n_timesteps: 1, env_kwargs: {{{key}: 1}}}}",
                rf"env_kwargs\.{key}: cannot be set by a recipe; allowed are observer, tuning, sea,",
            )
            for key in ELSEWHERE
        ),
        ("storm: {n_envs: 1}", "no section 'transit'; its sections are storm"),
        ("transit: 3", "no section 'transit'"),
        ("- a\n- b", "no section 'transit'; its sections are none"),
        ("transit: {", "cannot be read as YAML"),
    ],
)
def test_recipes_that_cannot_be_used(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "mine.yml"
    file.write_text(text)
    with pytest.raises(RecipeError, match=f"(?s)mine.yml.*{words}"):
        read_recipe("ppo", "transit", file)


def test_unknown_algorithms_and_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match="unknown algorithm 'dqn'; known: ppo, sac, td3"):
        read_recipe("dqn", "transit")
    with pytest.raises(RecipeError, match=r"nowhere\.yml: cannot be read"):
        read_recipe("sac", "transit", tmp_path / "nowhere.yml")


def test_each_algorithm_has_keys_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "mine.yml"
    file.write_text("transit: {n_envs: 1, n_timesteps: 1, buffer_size: 2}")
    assert read_recipe("sac", "transit", file).hyperparameters == {"buffer_size": 2}


@pytest.mark.parametrize(
    ("algorithm", "task"),
    [
        *(("ppo", task) for task in (*tasks(), *tasks(steered=True))),
        *(("sac", task) for task in ("rough-sea", "speed-keeping", "storm", "flank")),
    ],
)
def test_tasks_have_recipes(algorithm: str, task: str) -> None:
    plan = read_recipe(algorithm, task)
    assert (plan.algorithm, plan.task) == (algorithm, task)


def test_the_packages_recipe_is_read_and_changed() -> None:
    changes: dict[str, Any] = {"n_envs": 8, "env_kwargs": {"observer": "oracle"}}
    plan = read_recipe("ppo", "rough-sea", **changes)
    assert plan.n_envs == 8
    assert plan.env_kwargs["observer"] == "oracle"
    assert read_recipe("ppo", "rough-sea", frame_stack=4).frame_stack == 4
    assert changes["env_kwargs"] == {"observer": "oracle"}


@pytest.mark.parametrize("task", tasks())
def test_every_task_has_a_tuned_controller(task: str) -> None:
    controller = make_controller(tuned_controller(task), get_task(task).load_ship(), 0.5)
    assert controller.name in ("va-pitch", "speed-pilot")


def test_a_task_without_a_tuned_controller_is_named() -> None:
    with pytest.raises(RecipeError, match="no tuned controller is known for 'race'; known: speed"):
        tuned_controller("race")


@pytest.mark.parametrize("name", sorted(packaged_policies()))
def test_packaged_policies_are_of_the_packaged_recipes(name: str) -> None:
    """Or the command on their cards would train something else."""
    kept = load_policy(name).about["recipe"]
    assert kept == read_recipe(kept["algorithm"], kept["task"]).model_dump(mode="json")
