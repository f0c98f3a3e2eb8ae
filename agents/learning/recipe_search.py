"""Hyperparameters of a recipe, searched for by Optuna; what is found is trained anew to be believed.

The tree-structured Parzen estimator (Bergstra et al. 2011) proposes recipes. Each is trained on the same
seeds, and the reward at the last evaluation decides; a trial below the median of the earlier ones at the
same evaluation is stopped. The best of many is partly the luckiest. So the given recipe and the best are
both trained on seeds, and evaluated on seas, that decided nothing.
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
from ...core.sweep import digest_of, refuse_another
from ...envs import get_task
from ...plant import load_ship
from ..policy.policy import load_policy
from .recipe import Recipe, RecipeError, recipe_of, recipe_path, section_of
from .training import evaluations_of, judged, sources, train

FIRST_FRESH_SEA = 2_000_000
"""Seeds of the seas on which the found recipe and the given one are compared."""
FIRST_FRESH_SEED = 1000
"""Of those trainings; the trials' run from 0."""

Tick = Callable[[int, int, str], None]
Distribution = optuna.distributions.BaseDistribution

_FIXED = {
    "algorithm": "another command", "task": "another command", "evaluations": "they compare trials",
    "n_timesteps": "the longest would win",
}  # fmt: skip
_EASIER = {"sensor_noise", "max_episode_steps"}  # of env_kwargs, and of the judging
_WIDE = 10.0  # ends so many times apart are searched by their logarithms


class _GivenUpError(Exception):
    """A trial that stands below the median of the others."""


@dataclass
class Trial:
    """One proposal."""

    values: dict[str, Any]
    """Of what is varied, by key."""
    rewards: list[float] = field(default_factory=list)
    """Reward at each evaluation of its first training."""
    reward: float | None = None
    """After the last, mean over its trainings; None if it was given up."""


@dataclass(frozen=True)
class RecipeSearch:
    """What a search of a recipe found."""

    trials: list[Trial]
    """The first is the recipe as it was."""
    best: int
    """Trial whose reward is the highest, which flatters it."""
    fresh: dict[str, list[float]]
    """Rewards of new trainings on fresh seas: of the recipe as ``given`` and as ``found``."""
    recipe: Path
    """The best as a file for :func:`.recipe.read_recipe`."""


def distribution_of(key: str, text: str) -> Distribution:
    """What is searched, from ``LOW:HIGH`` or ``A,B,C``.

    Args:
        key: for the message.
        text: as on the command line.

    Raises:
        RecipeError: neither.
    """
    if "," in text:
        choices = [yaml.safe_load(_exponent(part)) for part in text.split(",")]
        if all(choice is None or isinstance(choice, str | int | float) for choice in choices):
            return optuna.distributions.CategoricalDistribution(choices)
    low, _, high = text.partition(":")
    try:
        ends = float(low), float(high)
        whole = all(end.strip().lstrip("+-").isdigit() for end in (low, high))
        if np.isfinite(ends).all() and ends[0] < ends[1]:
            if whole:
                return optuna.distributions.IntDistribution(int(low), int(high))
            log = ends[0] > 0.0 and ends[1] >= _WIDE * ends[0]
            return optuna.distributions.FloatDistribution(*ends, log=log)
    except ValueError:
        pass
    raise RecipeError(f"{key} = {text!r}: must be LOW:HIGH, two numbers that rise, or A,B,C")


def _exponent(text: str) -> str:
    """YAML 1.1 takes 1e-3 for a word."""
    try:
        return text if text.strip().lstrip("+-").isdigit() else repr(float(text))
    except ValueError:
        return text


def space_of(algorithm: str) -> dict[str, str]:
    """What is searched where nothing else is asked for."""
    spaces = yaml.safe_load(recipe_path("spaces").read_text(encoding="utf-8"))
    return {key: str(text) for key, text in spaces[algorithm].items()}


def varied(recipe: Recipe, values: Mapping[str, Any]) -> Recipe:
    """A recipe with other values; a learning rate that falls (``lin_``) stays one that falls.

    Args:
        recipe: to start from.
        values: by key, dotted where a key stands under another (``policy_kwargs.log_std_init``).

    Raises:
        RecipeError: an unknown key or a value out of range.
    """
    section = deepcopy(section_of(recipe))
    for key, value in values.items():
        *path, last = key.split(".")
        place = section
        for part in path:
            place[part] = place.get(part) or {}
            place = place[part]
            if not isinstance(place, dict):
                raise RecipeError(f"{key}: {part} has no keys of its own")
        falls = str(place.get(last)).startswith("lin_")
        place[last] = f"lin_{value!r}" if falls else value
    return recipe_of(section, recipe.algorithm, recipe.task, "the search")


def _given(recipe: Recipe, key: str) -> Any:
    """What a recipe says of a dotted key; None if nothing."""
    place: Any = section_of(recipe)
    for part in key.split("."):
        place = place.get(part) if isinstance(place, dict) else None
    text = place.removeprefix("lin_") if isinstance(place, str) else place
    return yaml.safe_load(_exponent(text)) if isinstance(text, str) else text


def _space(recipe: Recipe, vary: Mapping[str, str]) -> dict[str, Distribution]:
    """What is searched, each end of it tried on the recipe before the work begins."""
    space = {}
    for key, text in vary.items():
        head, _, rest = key.partition(".")
        if head in _FIXED or (head == "env_kwargs" and rest in _EASIER):
            why = _FIXED.get(head, "the easiest would win")
            raise RecipeError(f"{key}: cannot be searched for ({why})")
        found = distribution_of(key, text)
        ends = (
            found.choices
            if isinstance(found, optuna.distributions.CategoricalDistribution)
            else (found.low, found.high)  # type: ignore[attr-defined]
        )
        for end in ends:
            varied(recipe, {key: end})
        space[key] = found
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
    """Search a recipe's hyperparameters, or go on where an earlier call stopped.

    Args:
        recipe: to start from; its task, reward and number of steps stay.
        folder: for ``search.json``, ``recipe.yml`` and the trainings.
        vary: what is searched as :func:`distribution_of` reads it, by key; :func:`space_of` by default.
        trials: proposals, the recipe as it is counted.
        seeds: trainings of each.
        fresh: trainings of the recipe as it was, and of the best, that are compared in the end.
        seed: of the proposals.
        ship: preset or path; the one that the task is made for by default.
        device: of torch.
        threads: as of :func:`.training.train`.
        tick: told the steps done, all steps, and the best so far in words.

    Returns:
        What was found, also where it is no better than what was given.

    Raises:
        RecipeError: a key that is unknown or must stay, or a range that reaches beyond a key's own.
        ValueError: the folder holds another search, or numbers below one.
    """
    if min(trials, seeds, fresh) < 1:
        raise ValueError("trials, seeds and fresh must be 1 or more")
    asked = dict(vary or space_of(recipe.algorithm))
    space = _space(recipe, asked)
    vessel = ship or get_task(recipe.task).vessel
    plan = {
        "recipe": recipe.model_dump(), "vary": asked, "seeds": seeds, "seed": seed,
        "ship": digest_of(repr(load_ship(vessel))), "source": sources(),
    }  # fmt: skip
    note = folder / "search.json"
    refuse_another(folder, note, plan, "search")
    rows = read_json(note)["trials"] if note.is_file() else []
    done = [Trial(**row) for row in rows]
    count = max(trials, len(done))
    total = (count * seeds + 2 * fresh) * recipe.n_timesteps

    def trained(tried: Recipe, one: int, at: Path, before: int, said: str, **more: Any) -> Path:
        def on_the_way(done: int, all_steps: int, told: str) -> None:
            words = said if done else f"{said}: {told}"  # until the first step it tells of plans
            tick(before * recipe.n_timesteps + min(done, all_steps), total, words)

        return train(
            tried, one, at / str(one), ship=vessel, device=device, threads=threads,
            plan_folder=folder / "plans", tick=on_the_way, **more,
        )  # fmt: skip

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    for k in range(len(done), trials):
        asking = _study(done, space, seed).ask(space) if k else None
        trial = Trial(asking.params if asking else {key: _given(recipe, key) for key in space})
        tried = varied(recipe, asking.params) if asking else recipe
        at, said = folder / "trials" / f"{k:03d}", _said(k, trials, done)
        rewards: list[float] = []
        parts = evaluations_of(tried)[0]
        try:
            for one in range(seeds):
                watch = None if one else _watch(trial, asking, parts)
                path = trained(tried, one, at, k * seeds + one, said, after_evaluation=watch)
                evaluated = load_policy(path).curve["reward"][-parts:]  # the imitation is left out
                curve = [float(reward) for reward in evaluated]
                trial.rewards = trial.rewards if one else curve
                rewards.append(curve[-1])
            trial.reward = float(np.mean(rewards))
        except _GivenUpError:
            pass
        done.append(trial)
        write_json(note, plan | {"trials": [asdict(one) for one in done]})
        shutil.rmtree(at)

    best = max(range(count), key=lambda k: -np.inf if (r := done[k].reward) is None else r)
    found = varied(recipe, done[best].values) if best else recipe
    write_text(folder / "recipe.yml", _as_file(found, done[best]))
    compared: dict[str, list[float]] = {}
    for name, tried, place in (("given", recipe, "given"), ("found", found, f"found-{best}")):
        if name == "found" and not best:  # what was given is the best
            compared[name] = compared["given"]
            continue
        compared[name] = []
        for one in range(fresh):
            before = count * seeds + one + (fresh if name == "found" else 0)
            path = trained(
                tried, FIRST_FRESH_SEED + one, folder / place, before, f"{name} on fresh seeds"
            )
            told = judged(load_policy(path), tried, vessel, threads, FIRST_FRESH_SEA)
            compared[name].append(told["reward"])
    tick(total, total, _said(trials - 1, trials, done))
    write_json(
        note, plan | {"trials": [asdict(one) for one in done], "best": best, "fresh": compared}
    )
    return RecipeSearch(done, best, compared, folder / "recipe.yml")


def _said(k: int, trials: int, done: list[Trial]) -> str:
    best = max((trial.reward for trial in done if trial.reward is not None), default=None)
    return f"trial {k + 1} of {trials}" + ("" if best is None else f", best {best:.5g}")


def _watch(
    trial: Trial, asking: optuna.Trial | None, evaluations: int
) -> Callable[[list[float]], None]:
    """Keeps a trial's rewards evaluation by evaluation and gives it up where it is not worth its end."""

    def after_evaluation(rewards: list[float]) -> None:
        for k in range(len(trial.rewards), len(rewards)):
            trial.rewards.append(rewards[k])
            if asking is not None:
                asking.report(rewards[k], k)
        if asking is not None and len(rewards) < evaluations and asking.should_prune():
            raise _GivenUpError

    return after_evaluation


def _study(done: list[Trial], space: dict[str, Distribution], seed: int) -> optuna.Study:
    """A study that has seen the trials; its next proposal depends on nothing else."""
    own = int(np.random.SeedSequence([seed, len(done)]).generate_state(1)[0])
    study = optuna.create_study(
        direction="maximize",
        sampler=optuna.samplers.TPESampler(seed=own),
        pruner=optuna.pruners.MedianPruner(n_startup_trials=4, n_warmup_steps=1),
    )
    for trial in done:
        try:
            study.add_trial(
                optuna.trial.create_trial(
                    state=optuna.trial.TrialState.PRUNED
                    if trial.reward is None
                    else optuna.trial.TrialState.COMPLETE,
                    value=trial.reward,
                    params=trial.values,
                    distributions=space,
                    intermediate_values=dict(enumerate(trial.rewards)),
                )
            )
        except ValueError:  # the recipe as it was, outside of what is searched
            continue
    return study


def _as_file(recipe: Recipe, trial: Trial) -> str:
    """A recipe as a file of one section."""
    text: str = yaml.safe_dump({recipe.task: section_of(recipe)}, sort_keys=False)
    return f"# Found by a search of {', '.join(trial.values)}; reward {trial.reward:.5g}.\n\n{text}"
