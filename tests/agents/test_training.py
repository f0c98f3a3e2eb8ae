"""Trainings repeat, go on where they were stopped, and say what they cannot use."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from shaftline.agents import load_policy
from shaftline.agents.learning.recipe import RecipeError, read_recipe
from shaftline.agents.learning.training import digest, train
from shaftline.agents.policy.policy import trained

from .tiny import SAC, interrupted_after_a_leg, recipe


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A training that nothing interrupted, by algorithm."""
    made: dict[str, Path] = {}

    def policy(algorithm: str) -> Path:
        if algorithm not in made:
            folder = tmp_path_factory.mktemp(algorithm)
            made[algorithm] = train(recipe(algorithm), 3, folder, device="cpu")
        return made[algorithm]

    return policy


def checkpoints(policy: Path) -> list[str]:
    return [digest(file) for file in sorted((policy.parent / "checkpoints").glob("policy-*.npz"))]


def test_equal_seeds_give_equal_policies(whole: Any, tmp_path: Path) -> None:
    again = train(recipe(), 3, tmp_path / "again", device="cpu", threads=1)
    other = train(recipe(), 4, tmp_path / "other", device="cpu")
    assert checkpoints(again) == checkpoints(whole("ppo"))
    assert not set(checkpoints(other)) & set(checkpoints(again))


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_an_interruption_changes_nothing(whole: Any, tmp_path: Path, algorithm: str) -> None:
    interrupted_after_a_leg(recipe(algorithm), 3, tmp_path)
    assert len(json.loads((tmp_path / "curve.json").read_text())) == 1
    resumed = train(recipe(algorithm), 3, tmp_path, device="cpu")
    assert checkpoints(resumed) == checkpoints(whole(algorithm))
    before, after = (load_policy(path).curve for path in (whole(algorithm), resumed))
    assert before["reward"] == after["reward"]
    assert after["seconds"] == sorted(after["seconds"])
    assert len(list((tmp_path / "log").glob("progress-*.csv"))) == 2


def test_legs_are_judged_and_one_is_kept(whole: Any) -> None:
    policy = load_policy(whole("ppo"))
    assert policy.curve["steps"] == [64, 128]
    assert policy.about["leg"] in (1, 2)
    assert 0.0 < policy.curve["environment_share"][0] < 1.0
    assert policy.about["seed"] == 3
    assert policy.about["recipe"]["hyperparameters"]["n_steps"] == 16


def test_a_finished_training_is_left_alone(whole: Any) -> None:
    before = checkpoints(whole("ppo"))
    ticks: list[int] = []
    train(recipe(), 3, whole("ppo").parent, tick=lambda done, total, said: ticks.append(done))
    assert not ticks
    assert checkpoints(whole("ppo")) == before


def test_few_steps_are_few_legs(tmp_path: Path) -> None:
    policy = load_policy(train(recipe(n_timesteps=70, legs=10), 0, tmp_path, device="cpu"))
    assert policy.curve["steps"] == [64]


@pytest.mark.parametrize(
    ("change", "seed", "word"), [({"n_timesteps": 256}, 3, "recipe"), ({}, 4, "seed")]
)
def test_another_training_needs_another_folder(
    whole: Any, change: dict[str, Any], seed: int, word: str
) -> None:
    with pytest.raises(ValueError, match=f"holds a training of another {word}"):
        train(recipe(**change), seed, whole("ppo").parent)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"env_kwargs": {"observer": "eye"}}, "unknown observer 'eye'"),
        ({"env_kwargs": {"fog": 1}}, "'fog'; known"),
        ({"hyperparameters": {"batch_size": "many"}}, "PPO refuses the recipe"),
        ({"hyperparameters": {"learning_rate": "lin_fast"}}, "PPO refuses the recipe.*fast"),
        (
            {"algorithm": "sac", "hyperparameters": SAC | {"use_sde": True}},
            "SAC refuses.*clip_mean",
        ),
    ],
)
def test_what_cannot_begin_leaves_nothing(
    tmp_path: Path, change: dict[str, Any], word: str
) -> None:
    with pytest.raises(ValueError, match=word):
        train(recipe(**change), 0, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("transit: {n_envs: 0, n_timesteps: 10}", r"n_envs = 0: .*greater than or equal to 1"),
        ("transit: {n_envs: 1}", "n_timesteps.*required"),
        ("transit: {n_envs: 1, n_timesteps: 1, n_step: 2}", "'n_step'; PPO knows .*n_steps"),
        ("transit: {n_envs: 1, n_timesteps: 1, reach: {slow_s: 0}}", "slow_s"),
        ("transit: {n_envs: 1, n_timesteps: 1, weights: {joy: 1}}", "joy"),
        ("transit: {n_envs: 1, n_timesteps: 1, env_kwargs: {ship: ferry}}", r"env_kwargs\.ship"),
        ("storm: {n_envs: 1}", "no section 'transit'; it has storm"),
        ("transit: 3", "no section 'transit'"),
        ("- a\n- b", "no section 'transit'; it has none"),
        ("transit: {", "cannot be read as YAML"),
    ],
)
def test_recipes_that_cannot_be_used(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "mine.yml"
    file.write_text(text)
    with pytest.raises(RecipeError, match=f"(?s)mine.yml.*{words}"):
        read_recipe("ppo", "transit", file)


def test_the_packages_recipe_is_read_and_changed() -> None:
    plan = read_recipe("ppo", "transit", n_envs=8, env_kwargs={"observer": "oracle"})
    assert plan.n_envs == 8
    assert plan.env_kwargs["observer"] == "oracle"
    assert "sea" in plan.env_kwargs
    with pytest.raises(RecipeError, match="unknown algorithm 'dqn'; known: ppo, sac"):
        read_recipe("dqn", "transit")


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("task", ["transit", "speed-keeping", "storm"])
def test_every_task_has_a_recipe(algorithm: str, task: str) -> None:
    plan = read_recipe(algorithm, task)
    assert (plan.algorithm, plan.task) == (algorithm, task)


@pytest.mark.parametrize("name", sorted(trained()))
def test_packaged_policies_are_of_the_packaged_recipes(name: str) -> None:
    """Or the command on their cards would train something else."""
    kept = load_policy(name).about["recipe"]
    assert kept == read_recipe(kept["algorithm"], kept["task"]).model_dump(mode="json")
