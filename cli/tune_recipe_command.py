"""``shaftline tune-recipe``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from .. import display
from ..envs import get_task
from . import task_options as training
from .console import (
    announce_loading,
    check_folder,
    print_table,
    report_errors,
    require_extra,
    say,
    stages,
)

_SHOWN = 8  # best trials in the table


def tune_recipe(
    task: training.TaskName = "rough-sea",
    algorithm: training.Algorithm = "ppo",
    recipe: Annotated[
        Path | None,
        typer.Option(help="Recipe file (.yml) to start from.", show_default="that of the package"),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(help="KEY=LOW:HIGH or KEY=A,B,C; repeatable.", show_default="see below"),
    ] = None,
    trials: Annotated[
        int, typer.Option(min=1, help="Number of proposals, including the given recipe.")
    ] = 20,
    seeds: Annotated[int, typer.Option(min=1, help="Number of trainings of each proposal.")] = 1,
    fresh: Annotated[
        int,
        typer.Option(min=1, help="Number of final trainings of the given and of the best recipe."),
    ] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the proposals.")] = 0,
    timesteps: training.Timesteps = None,
    envs: training.Envs = None,
    plans: training.Plans = None,
    ship: training.TaskShip = None,
    device: training.OnDevice = training.Device.AUTO,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the recipe, the trials and the picture.",
            show_default="out/tune/TASK-ALGORITHM-SEED",
        ),
    ] = None,
) -> None:
    """Search the hyperparameters of a recipe for a task.

    Optuna's tree-structured Parzen estimator proposes values; each proposal is trained with the same
    seeds, and the reward at the last evaluation decides. A trial below the median of the others is
    stopped. The best of many trials is partly the luckiest. Therefore the given and the best recipe are
    finally both trained with unused seeds and evaluated on unused seas: use these figures to decide.

    By default the search varies learning rate, gamma, lambda and others, as listed in
    `agents/learning/recipes/spaces.yml`. A key is any key of the recipe, dotted where it is below
    another; a range whose ends have a ratio of ten or more is searched on a logarithmic scale. Keys that
    change the evaluation or make the task easier cannot be searched.

    Written: `recipe.yml` for `shaftline train --recipe`; `search.json` with every trial; `search.png`.
    Stop with Ctrl-C; the same command resumes, and a larger number of `--trials` continues a finished
    search.

    Examples:
        shaftline tune-recipe --task rough-sea --timesteps 200000

        shaftline tune-recipe --vary learning_rate=1e-4:1e-2 --vary frame_stack=1,4,8 --trials 12

        shaftline tune-recipe --vary env_kwargs.observer=luenberger,random-walk-kalman --seeds 3
    """
    with report_errors(resumes=True):
        get_task(task).load_ship(ship)
        with require_extra("train", "a search"), announce_loading("torch"):
            from ..agents.learning.recipe import read_recipe
            from ..agents.learning.recipe_search import search_recipe
        plan = read_recipe(algorithm, task, recipe, **training.sizes(timesteps, envs, plans))
        folder = out or Path("out/tune") / f"{task}-{algorithm}-{seed}"
        check_folder(folder)
        training.check_device(device)
        with stages("searching") as tick:
            found = search_recipe(
                plan,
                folder,
                vary=dict(map(_pair, vary)) if vary else None,
                trials=trials,
                seeds=seeds,
                fresh=fresh,
                seed=seed,
                ship=ship,
                device=device.value,
                tick=lambda done, total, said: tick(said, done, total),
            )
        _print(found, folder, task, algorithm)


def _pair(text: str) -> tuple[str, str]:
    key, equals, ends = text.partition("=")
    if not (key and equals and ends):
        raise ValueError(f"--vary {text!r}: must be KEY=LOW:HIGH or KEY=A,B,C")
    return key, ends


def _print(found: Any, folder: Path, task: str, algorithm: str) -> None:
    """Print the best trials, the comparison, and the next command."""
    values = pd.DataFrame([trial.values for trial in found.trials])
    rewards = pd.DataFrame(
        [(trial.reward, trial.rewards[-1]) for trial in found.trials], columns=["reward", "last"]
    ).astype(float)
    table = pd.concat([rewards["reward"], values.map(_short)], axis=1).rename_axis("trial")
    whole = table.dropna(subset="reward").sort_values("reward", ascending=False)
    print_table(
        whole.head(_SHOWN).reset_index(),
        f"{len(table)} trials (0 is the given recipe), {len(table) - len(whole)} stopped early; the "
        "best of the others",
    )
    picture = folder / "search.png"
    display.figures.save(display.recipe_search.trials_figure(rewards, values), picture)
    say("on unused seeds and seas:")
    for name in ("given", "found"):
        each = ", ".join(f"{reward:.5g}" for reward in found.fresh[name])
        say(f"  {name}: reward {np.mean(found.fresh[name]):.5g} (trainings: {each})")
    as_given, as_found = (np.mean(found.fresh[name]) for name in ("given", "found"))
    spread = max(map(np.ptp, found.fresh.values()))
    if as_found <= as_given:
        say("the best recipe is not better: keep the given one")
    elif as_found - as_given < spread:
        say("the gain is smaller than the spread of trainings: increase --seeds and --fresh")
    say(f"recipe: {found.recipe}   trials: {folder / 'search.json'}   picture: {picture}")
    say(f"  shaftline train --task {task} --algorithm {algorithm} --recipe {found.recipe}")


def _short(value: Any) -> Any:
    return "–" if pd.isna(value) else f"{value:.3g}" if isinstance(value, float) else str(value)
