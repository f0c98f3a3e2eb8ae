"""Recipes searched for: what may be, what an interruption changes (nothing), what is believed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("optuna")

from shaftline.agents import RecipeError, read_recipe
from shaftline.agents.learning import recipe_search
from shaftline.agents.learning.recipe_search import (
    FIRST_FRESH_SEA,
    FIRST_FRESH_SEED,
    _study,
    _watch,
    change_recipe,
    default_space,
    distribution_of,
    search_recipe,
)
from shaftline.agents.learning.training import FIRST_EVALUATION_SEED, train

from ..tiny import StopTestError, recipe

VARY = {"gamma": "0.5,0.9,0.99", "learning_rate": "1e-5:1e-1"}
QUICK: dict[str, Any] = {"vary": VARY, "trials": 4, "fresh": 1, "device": "cpu", "threads": 1}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A search that nothing interrupted, and its folder."""
    folder = tmp_path_factory.mktemp("search")
    return search_recipe(recipe(), folder, **QUICK), folder


def test_the_recipe_is_the_first_trial_and_the_best_is_a_recipe(whole: Any) -> None:
    found, folder = whole
    assert found.trials[0].values == {"gamma": None, "learning_rate": 1e-3}  # as given, lin_1e-3
    assert [len(trial.rewards) for trial in found.trials] == [2] * 4
    rewards = [trial.reward for trial in found.trials]
    assert rewards[found.best] == max(rewards)
    assert len(set(rewards)) == 4
    best = read_recipe("ppo", "transit", found.recipe)
    expected = found.trials[found.best].values if found.best else {"learning_rate": 1e-3}
    assert best.hyperparameters["learning_rate"] == f"lin_{expected['learning_rate']!r}"
    assert best.env_kwargs == recipe().env_kwargs
    assert best.n_timesteps == recipe().n_timesteps
    kept = json.loads((folder / "search.json").read_text())
    assert kept["best"] == found.best
    assert not list((folder / "trials").iterdir())  # the numbers are kept, not the trainings


def test_an_interruption_changes_nothing(
    whole: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    def stopped(plan: Any, seed: int, folder: Path, **more: Any) -> Path:
        begun.append(folder)
        if len(begun) == 3:  # in the middle of the third

            def stop(rewards: list[float]) -> None:
                raise StopTestError

            more["after_evaluation"] = stop
        return train(plan, seed, folder, **more)

    monkeypatch.setattr(recipe_search, "train", stopped)
    with pytest.raises(StopTestError):
        search_recipe(recipe(), tmp_path, **QUICK)
    monkeypatch.undo()
    assert len(json.loads((tmp_path / "search.json").read_text())["trials"]) == 2
    resumed = search_recipe(recipe(), tmp_path, **QUICK)
    assert resumed.trials == whole[0].trials
    assert resumed.fresh == whole[0].fresh
    with pytest.raises(ValueError, match="holds a search of another vary"):
        search_recipe(recipe(), tmp_path, **QUICK | {"vary": {"gamma": "0.5,0.6"}})


def test_what_is_believed_has_decided_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fresh trainings of both recipes, on the same fresh seeds and the same fresh seas."""
    trained: list[tuple[str, int]] = []
    seas: list[int] = []

    def watched(plan: Any, seed: int, folder: Path, **more: Any) -> Path:
        trained.append((folder.parent.name.split("-")[0], seed))
        return train(plan, seed, folder, **more)

    def told(policy: Any, plan: Any, ship: str, threads: int | None, first: int) -> Any:
        seas.append(first)
        return {"reward": float(policy.about["seed"])}

    monkeypatch.setattr(recipe_search, "train", watched)
    monkeypatch.setattr(recipe_search, "evaluate_policy", told)
    given: dict[str, Any] = {
        "vary": {"learning_rate": "1e-3:1e-2"},
        "trials": 3,
        "seeds": 2,
        "fresh": 2,
    }
    found = search_recipe(recipe(evaluations=1), tmp_path, **given, threads=1, device="cpu")
    assert trained[:6] == [(f"{k:03d}", seed) for k in range(3) for seed in (0, 1)]
    ours = [("given", FIRST_FRESH_SEED), ("given", FIRST_FRESH_SEED + 1)]
    theirs = [("found", FIRST_FRESH_SEED), ("found", FIRST_FRESH_SEED + 1)] if found.best else []
    assert trained[6:] == ours + theirs
    assert set(seas) == {FIRST_FRESH_SEA}
    assert FIRST_FRESH_SEA > FIRST_EVALUATION_SEED + 1000
    assert found.fresh["given"] == found.fresh["found"] == [1000.0, 1001.0]


def test_a_trial_far_below_the_others_is_given_up() -> None:
    good = [recipe_search.Trial({"gamma": 0.9}, [-1.0, -1.0, -1.0], -1.0) for _ in range(5)]
    space = {"gamma": distribution_of("gamma", "0.5,0.9")}
    for reward, kept in ((-2.0, False), (-0.5, True)):
        trial = recipe_search.Trial({"gamma": 0.5})
        watch = _watch(trial, _study(good, space, 0).ask(space), 3)
        watch([reward])  # the first evaluation stops no trial
        if kept:
            watch([reward, reward])
        else:
            with pytest.raises(recipe_search._GivenUpError):
                watch([reward, reward])
        assert trial.rewards == [reward, reward]


def test_proposals_learn_from_what_was_tried() -> None:
    space = {"gamma": distribution_of("gamma", "0:1.0")}
    tried = [recipe_search.Trial({"gamma": k / 40}, [0.0], -abs(k / 40 - 0.3)) for k in range(41)]
    asked = [_study(tried[: 41 - k], space, 0).ask(space).params["gamma"] for k in range(10)]
    assert sum(abs(value - 0.3) < 0.1 for value in asked) >= 7
    again = [_study(tried[: 41 - k], space, 0).ask(space).params["gamma"] for k in range(10)]
    assert again == asked


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("3:12", {"low": 3, "high": 12, "log": False}),
        ("0.1:0.3", {"low": 0.1, "high": 0.3, "log": False}),
        ("1e-4:1e-2", {"low": 1e-4, "high": 1e-2, "log": True}),
        ("-3.5:-1.0", {"low": -3.5, "high": -1.0, "log": False}),
        ("0.9,1e-3,tanh", {"choices": (0.9, 1e-3, "tanh")}),
    ],
)
def test_a_range_is_read(text: str, expected: dict[str, Any]) -> None:
    found = distribution_of("key", text)._asdict()
    assert {key: found[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ({"gamma": "0.9"}, r"gamma = '0.9': must be LOW:HIGH"),
        ({"gamma": "0.9:0.5"}, r"gamma = '0.9:0.5': must be LOW:HIGH"),
        ({"gamma": "0.9:nan"}, "must be LOW:HIGH"),
        ({"gamma": "0.5:5.0"}, r"gamma = 5: must be above 0 and at most 1"),
        ({"gama": "0.5:0.9"}, "unknown key 'gama'"),
        ({"env_kwargs.max_episode_steps": "10:20"}, "the easiest evaluation would win"),
        ({"env_kwargs.sensor_noise": "0.0:1.0"}, "the easiest evaluation would win"),
        ({"env_kwargs.task": "storm,transit"}, "cannot be set by a recipe"),
        ({"env_kwargs.observer": "luenberger,unknown"}, "unknown observer 'unknown'"),
        ({"n_timesteps": "100:200"}, "the longest training would win"),
        ({"frame_stack": "0:4"}, "frame_stack"),
        ({"gamma.high": "0:1"}, "gamma"),
    ],
)
def test_what_cannot_be_searched_is_refused_before_the_work(
    tmp_path: Path, vary: dict[str, str], said: str
) -> None:
    with pytest.raises(RecipeError, match=said):
        search_recipe(recipe(hyperparameters={"gamma": 0.9}), tmp_path / "new", vary=vary)
    assert not (tmp_path / "new").exists()


def test_a_dotted_key_stands_under_another() -> None:
    found = change_recipe(
        recipe(), {"policy_kwargs.log_std_init": -1.0, "env_kwargs.observer": "none", "n_envs": 2}
    )
    assert found.hyperparameters["policy_kwargs"] == {"net_arch": [8, 8], "log_std_init": -1.0}
    assert (found.env_kwargs["observer"], found.n_envs) == ("none", 2)
    assert recipe().hyperparameters["policy_kwargs"] == {"net_arch": [8, 8]}  # left alone


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_the_packages_spaces_fit_its_recipes(algorithm: str) -> None:
    plan = read_recipe(algorithm, "rough-sea")
    space = default_space(algorithm)
    assert len(recipe_search._space(plan, space)) == len(space) > 3
    if algorithm == "ppo":  # so that the search begins with something
        values = {key: recipe_search._given(plan, key) for key in space}
        trial = recipe_search.Trial(values, [0.0], 0.0)
        assert len(_study([trial], recipe_search._space(plan, space), 0).trials) == 1


def test_the_evaluation_of_an_imitation_is_none_of_a_trial(tmp_path: Path) -> None:
    """A trial that runs is compared with the others evaluation by evaluation."""
    rack = {"action_mode": "absolute", "command": "limited-rack", "max_episode_steps": 20}
    planned = recipe(plans=1, env_kwargs=rack)
    found = search_recipe(planned, tmp_path, trials=1, fresh=1, device="cpu")
    assert len(found.trials[0].rewards) == planned.evaluations
