"""Observers as features: does an estimate of the advance velocity help a learned policy?

The same recipe, steps and seeds with each observer, with clean and with noisy instruments; each policy
is then judged on held-out seas with its own observer and, noisy, with every other.
"""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from ...agents import load_policy, run_episodes
from ...agents.evaluation.episodes import Setting
from ...agents.evaluation.statistics import interquartile_mean
from ...agents.learning.recipe import read_recipe
from ...core.files import write_atomically, write_text
from ...core.sweep import source_digest, sweep
from ...display.tables import markdown
from ...envs.tasks import HELD_OUT, get_task

OBSERVERS = ("none", "power-balance", "immersion-invariance", "random-walk-kalman", "oracle")
NOISES = {"clean": 0.0, "noisy": 1.0}
FIRST_SEED = 900_000
_LEGS = 4  # fewer than the recipe has, for these trainings are short
_SHOWN = ("fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m")

Cell = tuple[str, str, int]
"""Observer, noise, training seed."""


def _trained_and_judged(
    folder: Path, task: str, changes: dict[str, Any], episodes: int, cell: Cell
) -> dict[str, Any]:
    """Train one policy and judge it; scores by the observer that it was run with."""
    from ...agents.learning.training import train

    observer, noise, seed = cell
    env = {"observer": observer, "sensor_noise": NOISES[noise]}
    recipe = read_recipe("ppo", task, **changes, env_kwargs=env)
    place = folder / f"{observer}-{noise}-{seed}"
    policy = load_policy(train(recipe, seed, place, device="cpu", threads=1))
    judged = get_task(f"{task}:{HELD_OUT}").model_copy(
        update={"weights": recipe.rewarded().weights}
    )
    found: dict[str, Any] = {}
    for other in OBSERVERS if noise == "noisy" else (observer,):
        setting = Setting(
            "policy", f"{task}:{HELD_OUT}", "task", other, episodes,
            sensor_noise=NOISES[noise], task_model=judged,
        )  # fmt: skip
        kpis, _ = run_episodes(setting, policy, first_seed=FIRST_SEED, threads=1)
        found[other] = {name: kpis[name].tolist() for name in ("reward", *_SHOWN)}
    return found


def recovered(none: Any, estimate: Any, oracle: Any, draws: int = 2000) -> tuple[float, ...]:
    """Share of the oracle's gain over no estimate, with its 95 % bootstrap interval over training seeds.

    Args:
        none: scores without an estimate, shape (seeds, episodes); likewise the next two.
        estimate: with one.
        oracle: with the true advance velocity.
        draws: of the bootstrap.
    """
    scores = [np.asarray(x, dtype=np.float64) for x in (none, estimate, oracle)]
    rows = _resampled(len(scores[0]), 3, draws)
    low, middle, high = (_middle(s[rows[:, i]]) for i, s in enumerate(scores))
    span = np.where(high != low, high - low, np.nan)
    share = (middle - low) / span
    return float(share[0]), *_interval(share[1:])


def difference(first: Any, second: Any, draws: int = 2000) -> tuple[float, float, float]:
    """Interquartile mean of first minus second; its 95 % bootstrap interval over training seeds."""
    a, b = (np.asarray(x, dtype=np.float64) for x in (first, second))
    rows = _resampled(len(a), 2, draws)
    between = _middle(a[rows[:, 0]]) - _middle(b[rows[:, 1]])
    return float(between[0]), *_interval(between[1:])


def _resampled(count: int, of: int, draws: int) -> Any:
    """Rows of a bootstrap for each of several samples, the whole ones first: (1 + draws, of, count)."""
    drawn = np.random.default_rng(0).integers(count, size=(draws, of, count))
    return np.concatenate([np.broadcast_to(np.arange(count), (1, of, count)), drawn])


def _middle(samples: Any) -> Any:
    """Interquartile mean of each sample's scores, shape (samples, seeds, episodes)."""
    return interquartile_mean(samples.reshape(len(samples), -1))


def _interval(drawn: Any) -> tuple[float, float]:
    low, high = np.nanquantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _tables(found: dict[Cell, Any], seeds: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What each observer brings, and each policy with every observer."""

    def scores(observer: str, noise: str, run_with: str, name: str = "reward") -> Any:
        return np.array([found[observer, noise, s][run_with][name] for s in range(1, seeds + 1)])

    rows, crossed = [], []
    for noise in NOISES:
        none, oracle = (scores(name, noise, name) for name in ("none", "oracle"))
        for observer in OBSERVERS:
            own = scores(observer, noise, observer)
            gain, low, high = difference(own, none) if observer != "none" else (0.0, 0.0, 0.0)
            share = recovered(none, own, oracle) if observer != "none" else (0.0, 0.0, 0.0)
            rows.append(
                {
                    "instruments": noise, "observer": observer,
                    "reward": float(interquartile_mean(own.ravel())),
                    "spread over seeds": float(np.std(own.mean(axis=1), ddof=1)),
                    "gain over none": gain, "low": low, "high": high,
                    "share of the oracle's": share[0], "share low": share[1], "share high": share[2],
                }
                | {
                    name: float(interquartile_mean(scores(observer, noise, observer, name).ravel()))
                    for name in _SHOWN
                }
            )  # fmt: skip
    for trained in OBSERVERS:
        row: dict[str, Any] = {"trained with": trained}
        for other in OBSERVERS:
            reward = scores(trained, "noisy", other).ravel()
            row[f"run with {other}"] = float(interquartile_mean(reward))
        crossed.append(row)
    return pd.DataFrame(rows), pd.DataFrame(crossed)


def answer(table: pd.DataFrame, crossed: pd.DataFrame) -> str:
    """The question answered in words, from the tables."""
    said = []
    for noise, part in table[table["observer"] != "none"].groupby("instruments", sort=False):
        clear = part[(part["low"] > 0.0) | (part["high"] < 0.0)]
        best = part.loc[part["gain over none"].idxmax()]
        level = -table.loc[table["instruments"] == noise, "reward"].max()
        said.append(
            f"With {noise} instruments "
            + (
                f"the gain over no estimate is clear of zero for {', '.join(clear['observer'])}."
                if len(clear)
                else "no gain over no estimate is clear of zero."
            )
            + f" The largest is that of {best['observer']}: {best['gain over none']:+.3g} "
            f"({best['low']:+.3g} to {best['high']:+.3g}) at a cost of {level:.3g}; the oracle's is "
            f"{part.set_index('observer').loc['oracle', 'gain over none']:+.3g}."
        )
    square = crossed.set_index("trained with")
    square.columns = [name.removeprefix("run with ") for name in square.columns]
    given = [name for name in square.index if name != "none"]
    own = np.diag(square.loc[given, given])
    swapped = np.abs(square.loc[given, given].sub(own, axis=0).to_numpy())
    lost = own - square.loc[given, "none"]
    said.append(
        f"Run with another observer than it was trained with, a policy's reward moves by "
        f"{swapped.max():.2g} at most; with none at all it loses {lost.min():.3g} to {lost.max():.3g}."
    )
    return " ".join(said)


def main(
    out: Annotated[Path, typer.Option(help="Folder for page and tables.")] = Path(
        "docs/results/observer-features"
    ),
    work: Annotated[Path, typer.Option(help="Folder for the trainings.")] = Path("out/features"),
    task: Annotated[str, typer.Option(help="Task.")] = "storm",
    seeds: Annotated[int, typer.Option(min=2, help="Training seeds, from 1 on.")] = 5,
    steps: Annotated[int, typer.Option(min=1, help="Steps of each training.")] = 600_000,
    episodes: Annotated[int, typer.Option(min=1, help="Held-out episodes of each.")] = 40,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes.")] = None,
) -> None:
    """Train with each observer, clean and noisy, and compare."""
    command = (
        f"python -m shaftline.studies.policies.observer_features --task {task} --seeds {seeds} "
        f"--steps {steps} --episodes {episodes}"
    )
    changes = {"n_timesteps": steps, "legs": _LEGS}
    page = study(out, work, task, seeds, episodes, changes, jobs, command)
    typer.echo(f"page: {page}")


def study(
    out: Path,
    work: Path,
    task: str,
    seeds: int,
    episodes: int,
    changes: dict[str, Any],
    jobs: int | None,
    command: str,
) -> Path:
    """Train, judge, and write page and tables; cells that stand in ``work`` are not made again.

    Args:
        out: folder for the page, ``observers.csv`` and ``crossed.csv``.
        work: for trainings and cells.
        task: that is sailed.
        seeds: training seeds, from 1 on; at least 2.
        episodes: held-out episodes of each policy.
        changes: of the packaged recipe, see :func:`shaftline.agents.learning.recipe.read_recipe`.
        jobs: see :func:`shaftline.core.sweep.sweep`.
        command: that makes the page, for its head.

    Returns:
        The page.
    """
    cells = {
        f"{o}-{n}-{s}": (o, n, s) for n in NOISES for o in OBSERVERS for s in range(1, seeds + 1)
    }
    source = source_digest("plant", "observers", "baselines", "envs", "agents")
    recipe = read_recipe("ppo", task, **changes).model_dump(mode="json")
    plan = json.dumps([recipe, source], sort_keys=True)
    folder = work / hashlib.sha256(plan.encode()).hexdigest()[:12]
    job = functools.partial(_trained_and_judged, folder, task, changes, episodes)
    done = [0]

    def tick() -> None:
        done[0] += 1
        typer.echo(f"{done[0]} of {len(cells)} policies")

    results = sweep(job, cells, folder / f"cells-{episodes}", jobs=jobs, tick=tick)
    table, crossed = _tables({cells[name]: value for name, value in results.items()}, seeds)
    page = PAGE.format(
        command=command, task=task, seeds=seeds, episodes=episodes, answer=answer(table, crossed),
        table=markdown(table, 3), crossed=markdown(crossed, 4),
    )  # fmt: skip
    write_atomically(out / "observers.csv", lambda f: table.to_csv(f, index=False))
    write_atomically(out / "crossed.csv", lambda f: crossed.to_csv(f, index=False))
    path = out / "observer-features.md"
    write_text(path, page)
    return path


PAGE = """# Observers as features of a learned policy

Made by `{command}`.

The same recipe (`agents/learning/recipes/ppo.yml`, task {task}), the same number of steps and {seeds}
training seeds with each observer; each policy is judged on {episodes} held-out episodes with its own
observer. Rewards are those of training: less negative is better. Interquartile means over seeds and
episodes; intervals are 95 %, by bootstrap over the training seeds. *Share of the oracle's* is (this -
none) / (oracle - none): how much of what the true advance velocity brings the estimate recovers. Where
the oracle's own gain is not clear of zero, the share means nothing. A feature that never varied in
training, as the estimate of `none`, is not heard by the policy.

**Answer.** {answer}

{table}

## Trained with one, run with another

Noisy instruments; interquartile mean of the reward.

{crossed}
"""

if __name__ == "__main__":
    typer.run(main)
