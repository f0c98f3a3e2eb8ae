"""Search of the hyperparameters of a recipe with Optuna, and an unbiased comparison of the result.

The tree-structured Parzen estimator (Bergstra et al. 2011) proposes recipes. Each is trained with the
same seeds, and the reward at the last evaluation decides; a trial below the median of the earlier trials
at the same evaluation is stopped. The best of many trials is partly the luckiest. Therefore the given
recipe and the best one are both trained with seeds, and evaluated on seas, that the search did not use.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import yaml

from ...core.files import read_json, write_json, write_text
from ...core.sweep import digest_of, refuse_other_plan
from ...envs import get_task
from ...plant import load_ship
from ..policy.policy import load_policy
from .recipe import Recipe, RecipeError, build_recipe, recipe_path, recipe_section
from .training import evaluate_policy, evaluation_schedule, sources, train

FIRST_FRESH_SEA = 2_000_000
"""First seed of the seas on which the given and the best recipe are compared."""
FIRST_FRESH_SEED = 1000
"""First seed of the trainings of that comparison; the seeds of trials count from 0."""

Tick = Callable[[int, int, str], None]
Distribution = optuna.distributions.BaseDistribution

_FIXED = {
    "algorithm": "use --algorithm",
    "task": "use --task",
    "evaluations": "trials are compared by it",
    "n_timesteps": "the longest training would win",
}
_EASIER = {"sensor_noise", "max_episode_steps"}  # keys of env_kwargs that change the evaluation
_WIDE = 10.0  # ratio of the ends from which a range is searched on a logarithmic scale


class _GivenUpError(Exception):
    """A trial is below the median of the other trials."""


@dataclass
class Trial:
    """One proposal of the search."""

    values: dict[str, Any]  # values of the varied keys
    rewards: list[float] = field(default_factory=list)  # at the evaluations of its first training
    reward: float | None = None  # at the end, mean over its trainings; None if it was stopped


@dataclass(frozen=True)
class RecipeSearch:
    """Result of a recipe search."""

    trials: list[Trial]  # the first is the given recipe
    best: int  # index of the trial with the highest reward, which is biased upwards
    fresh: dict[
        str, list[float]
    ]  # rewards of new trainings on unused seas: ``given`` and ``found``
    recipe: Path  # file of the best recipe for :func:`.recipe.read_recipe`


def distribution_of(key: str, text: str) -> Distribution:
    """Return the distribution of a hyperparameter from ``LOW:HIGH`` or ``A,B,C``.

    Raises:
        RecipeError: the text has neither form; the message names the key.
    """
    if "," in text:
        choices = [yaml.safe_load(_exponent(part)) for part in text.split(",")]
        if all(choice is None or isinstance(choice, str | int | float) for choice in choices):
            return optuna.distributions.CategoricalDistribution(choices)
    low, _, high = text.partition(":")
    try:
        ends = float(low), float(high)
        if np.isfinite(ends).all() and ends[0] < ends[1]:
            if _is_whole(low) and _is_whole(high):
                return optuna.distributions.IntDistribution(int(low), int(high))
            log = ends[0] > 0.0 and ends[1] >= _WIDE * ends[0]
            return optuna.distributions.FloatDistribution(*ends, log=log)
    except ValueError:
        pass
    raise RecipeError(f"{key} = {text!r}: must be LOW:HIGH with LOW below HIGH, or a list A,B,C")


def _is_whole(text: str) -> bool:
    return text.strip().lstrip("+-").isdigit()


def _exponent(text: str) -> str:
    """Return a number as text that YAML 1.1 reads as a number; it reads 1e-3 as text."""
    try:
        return text if _is_whole(text) else repr(float(text))
    except ValueError:
        return text


def default_space(algorithm: str) -> dict[str, str]:
    """Return the hyperparameters that are searched by default, with their ranges."""
    spaces = yaml.safe_load(recipe_path("spaces").read_text(encoding="utf-8"))
    return {key: str(text) for key, text in spaces[algorithm].items()}


def change_recipe(recipe: Recipe, values: Mapping[str, Any]) -> Recipe:
    """Return a recipe with other values; a learning rate that falls (``lin_``) keeps falling.

    Args:
        recipe: recipe to change.
        values: values by key, dotted where a key is below another (``policy_kwargs.log_std_init``).

    Raises:
        RecipeError: an unknown key or a value out of range.
    """
    section = deepcopy(recipe_section(recipe))
    for key, value in values.items():
        *path, last = key.split(".")
        place = section
        for part in path:
            place[part] = place.get(part) or {}
            place = place[part]
            if not isinstance(place, dict):
                raise RecipeError(f"{key}: {part} is a value and has no keys")
        falls = str(place.get(last)).startswith("lin_")
        place[last] = f"lin_{value!r}" if falls else value
    return build_recipe(section, recipe.algorithm, recipe.task, "the search")


def _given(recipe: Recipe, key: str) -> Any:
    """Return the value of a dotted key of a recipe; None if it has none."""
    place: Any = recipe_section(recipe)
    for part in key.split("."):
        place = place.get(part) if isinstance(place, dict) else None
    text = place.removeprefix("lin_") if isinstance(place, str) else place
    return yaml.safe_load(_exponent(text)) if isinstance(text, str) else text


def _space(recipe: Recipe, vary: Mapping[str, str]) -> dict[str, Distribution]:
    """Return the search space, after trying each end of it on the recipe."""
    space = {}
    for key, text in vary.items():
        head, _, rest = key.partition(".")
        if head in _FIXED or (head == "env_kwargs" and rest in _EASIER):
            why = _FIXED.get(head, "the easiest evaluation would win")
            raise RecipeError(f"{key}: cannot be searched for ({why})")
        space[key] = found = distribution_of(key, text)
        ends = getattr(found, "choices", None) or (found.low, found.high)  # type: ignore[attr-defined]
        for end in ends:
            change_recipe(recipe, {key: end})
    return space


def search_recipe(
    recipe: Recipe,
    folder: Path,
    *,
    vary: Mapping[str, str] | None = None,
    trials: int = 20,
    seeds: int = 1,
    fresh: int = 2,
    seed: int = 0,
    ship: str | None = None,
    device: str = "auto",
    threads: int | None = None,
    tick: Tick = lambda done, total, said: None,
) -> RecipeSearch:
    """Search the hyperparameters of a recipe, or resume an interrupted search.

    Args:
        recipe: recipe to start from; its task, reward and number of steps are kept.
        folder: folder for ``search.json``, ``recipe.yml`` and the trainings.
        vary: text for :func:`distribution_of` by key; :func:`default_space` by default.
        trials: number of proposals, including the given recipe.
        seeds: number of trainings of each proposal.
        fresh: number of trainings of the given and of the best recipe for the final comparison.
        seed: seed of the proposals.
        ship: preset or path; by default the ship of the task.
        device: device of torch.
        threads: number of threads, as in :func:`.training.train`.
        tick: function called with the finished steps, all steps, and the best reward so far as text.

    Returns:
        The result, also where the best recipe is not better than the given one.

    Raises:
        RecipeError: a key is unknown or must not vary, or a range exceeds that of its key.
        ValueError: the folder contains another search, or a count is below one.
    """
    if min(trials, seeds, fresh) < 1:
        raise ValueError("trials, seeds and fresh must each be at least 1")
    asked = dict(vary or default_space(recipe.algorithm))
    space = _space(recipe, asked)
    vessel = ship or get_task(recipe.task).vessel
    plan = {
        "recipe": recipe.model_dump(),
        "vary": asked,
        "seeds": seeds,
        "seed": seed,
        "ship": digest_of(repr(load_ship(vessel))),
        "source": sources(),
    }
    note = folder / "search.json"
    refuse_other_plan(folder, note, plan, "search")
    rows = read_json(note)["trials"] if note.is_file() else []
    done = [Trial(**row) for row in rows]
    count = max(trials, len(done))
    total = (count * seeds + 2 * fresh) * recipe.n_timesteps

    def trained(tried: Recipe, one: int, at: Path, before: int, said: str, **more: Any) -> Path:
        def on_the_way(done: int, all_steps: int, state: str) -> None:
            words = said if done else f"{said}: {state}"  # Before the first step it reports plans.
            tick(before * recipe.n_timesteps + min(done, all_steps), total, words)

        return train(
            tried,
            one,
            at / str(one),
            ship=vessel,
            device=device,
            threads=threads,
            plan_folder=folder / "plans",
            tick=on_the_way,
            **more,
        )

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    for k in range(len(done), trials):
        asking = _study(done, space, seed).ask(space) if k else None
        trial = Trial(asking.params if asking else {key: _given(recipe, key) for key in space})
        tried = change_recipe(recipe, asking.params) if asking else recipe
        at, said = folder / "trials" / f"{k:03d}", _state_of(k, trials, done)
        rewards: list[float] = []
        parts = evaluation_schedule(tried)[0]
        try:
            for one in range(seeds):
                watch = None if one else _watch(trial, asking, parts)
                path = trained(tried, one, at, k * seeds + one, said, after_evaluation=watch)
                curve = load_policy(path).curve["reward"][-parts:]  # without the imitation
                trial.rewards = trial.rewards if one else [float(reward) for reward in curve]
                rewards.append(float(curve[-1]))
            trial.reward = float(np.mean(rewards))
        except _GivenUpError:
            pass
        done.append(trial)
        write_json(note, plan | {"trials": [asdict(one) for one in done]})
        shutil.rmtree(at)

    best = max(range(count), key=lambda k: -np.inf if (r := done[k].reward) is None else r)
    found = change_recipe(recipe, done[best].values) if best else recipe
    write_text(folder / "recipe.yml", _as_file(found, done[best]))

    def compare(name: str, tried: Recipe, place: str, before: int) -> list[float]:
        rewards = []
        for one in range(fresh):
            seed, said = FIRST_FRESH_SEED + one, f"{name} on fresh seeds"
            path = trained(tried, seed, folder / place, before + one, said)
            kpis = evaluate_policy(load_policy(path), tried, vessel, threads, FIRST_FRESH_SEA)
            rewards.append(kpis["reward"])
        return rewards

    as_given = compare("given", recipe, "given", count * seeds)
    as_found = compare("found", found, f"found-{best}", count * seeds + fresh) if best else as_given
    compared = {"given": as_given, "found": as_found}
    tick(total, total, _state_of(trials - 1, trials, done))
    rows = [asdict(one) for one in done]
    write_json(note, plan | {"trials": rows, "best": best, "fresh": compared})
    return RecipeSearch(done, best, compared, folder / "recipe.yml")


def _state_of(k: int, trials: int, done: list[Trial]) -> str:
    best = max((trial.reward for trial in done if trial.reward is not None), default=None)
    return f"trial {k + 1} of {trials}" + ("" if best is None else f", best {best:.5g}")


def _watch(
    trial: Trial, asking: optuna.Trial | None, evaluations: int
) -> Callable[[list[float]], None]:
    """Return a function that stores the rewards of a trial and stops it where it falls behind."""

    def after_evaluation(rewards: list[float]) -> None:
        for k in range(len(trial.rewards), len(rewards)):
            trial.rewards.append(rewards[k])
            if asking is not None:
                asking.report(rewards[k], k)
        if asking is not None and len(rewards) < evaluations and asking.should_prune():
            raise _GivenUpError

    return after_evaluation


def _study(done: list[Trial], space: dict[str, Distribution], seed: int) -> optuna.Study:
    """Return a study that contains the finished trials; its next proposal depends on nothing else."""
    own = int(np.random.SeedSequence([seed, len(done)]).generate_state(1)[0])
    sampler = optuna.samplers.TPESampler(seed=own)
    pruner = optuna.pruners.MedianPruner(n_startup_trials=4, n_warmup_steps=1)
    study = optuna.create_study(direction="maximize", sampler=sampler, pruner=pruner)
    states = optuna.trial.TrialState
    for trial in done:
        try:
            finished = optuna.trial.create_trial(
                state=states.PRUNED if trial.reward is None else states.COMPLETE,
                value=trial.reward,
                params=trial.values,
                distributions=space,
                intermediate_values=dict(enumerate(trial.rewards)),
            )
            study.add_trial(finished)
        except ValueError:  # The given recipe can be outside the search space.
            continue
    return study


def _as_file(recipe: Recipe, trial: Trial) -> str:
    """Return a recipe as the text of a file with one section."""
    text: str = yaml.safe_dump({recipe.task: recipe_section(recipe)}, sort_keys=False)
    head = f"# Best recipe of a search over {', '.join(trial.values)}; reward {trial.reward:.5g}."
    return f"{head}\n\n{text}"
