"""Train the policies of the package, evaluate them, and write the page.

Run ``python -m reproductions policies --out docs/results --kept out/policies``. Trainings and episodes
are kept in the folder ``--kept``. ``--package`` puts the first training of each task into the package.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, load_controller
from shaftline.agents.evaluation.scores import bounds
from shaftline.agents.evaluation.stability import COMMANDS, find_oscillation
from shaftline.agents.evaluation.statistics import mean_with_interval
from shaftline.agents.learning.imitation import make_plans
from shaftline.agents.learning.recipe import read_recipe, tuned_controller
from shaftline.agents.policy.card import card
from shaftline.agents.policy.policy import (
    load_policy,
    packaged_policies,
    packaged_policies_folder,
)
from shaftline.core.files import read_json, write_text
from shaftline.core.sweep import SweepError, sweep
from shaftline.envs import DEFAULTS, get_task, tasks

from ..learners.references import CONTROLLERS, EPISODES, FIRST_SEED, TUNED
from ..pages import make_parser, print_dot
from ..writing import write_results
from .trainings import BLOCKS, classic_cell, policy_cell

COMBINATOR, VA_PITCH = CONTROLLERS[0], "va-pitch"
CLASSIC = (COMBINATOR, VA_PITCH, TUNED)
TITLE = "Policies of the package"

NOTES = (
    f"Each mean is over {EPISODES} episodes from seed {FIRST_SEED}, which no training and no search "
    "draws; a failed episode counts 0. Held-out seas are higher, shorter or from another side."
)

_WON = 0.1  # share of the score that a policy must gain over the tuned controller
_FIGURES = {
    "fuel_kg_nmi": "fuel [kg/nmi]",
    "speed_error_rms_m_s": "speed error, rms [m/s]",
    "speed_short_m_s": "set-point less speed, mean [m/s]",
    "wave_torque_kN_m": "shaft torque in waves [kN m]",
    "wave_engine_torque_kN_m": "engine torque in waves [kN m]",
    "heading_error_rms_deg": "heading error, rms [deg]",
    "track_error_rms_m": "track error, rms [m]",
}


def means(cell: Mapping[str, Any]) -> dict[str, float]:
    """Return the mean return of a cell in the training seas and in the held-out seas."""
    return {part: float(np.mean(cell[part]["values"])) for part in ("training", "held-out")}


def episodes_of(task: str, part: str, found: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the returns of the trained policies, shape (trainings, episodes)."""
    rows = [v[part]["values"] for k, v in found.items() if k.startswith(f"policy_{task}_")]
    return np.atleast_2d(np.array(rows, dtype=np.float64)) if rows else np.zeros((0, 0))


def _classic_key(task: str, name: str) -> str:
    return f"classic_{task}_{name}".replace(" ", "-")


def table_of(found: Mapping[str, Any]) -> pd.DataFrame:
    """Return returns, gain over the tuned controller and unit of the score by task and part."""
    rows = []
    for task in tasks(None):
        for part in BLOCKS:
            policies = episodes_of(task, part, found)
            if not len(policies):
                continue
            classic = {n: np.array(found[_classic_key(task, n)][part]["values"]) for n in CLASSIC}
            gain, low, high = mean_with_interval(policies - classic[TUNED])
            bound, steps = bounds().get(task), DEFAULTS.max_episode_steps or 1
            unit = np.nan if bound is None else steps * (bound.best - bound.combinator)
            rows.append(
                {
                    "task": task,
                    "seas": part,
                    "trainings": len(policies),
                    "policy": float(policies.mean()),
                    **{name: float(values.mean()) for name, values in classic.items()},
                    "gain": gain,
                    "gain_low": low,
                    "gain_high": high,
                    "score_unit": unit,
                }
            )
    return pd.DataFrame(rows)


def _shown(table: pd.DataFrame, part: str) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "task": row["task"],
            "action mode": _mode(row["task"]),
            "trainings": row["trainings"],
            **{name: f"{row[name]:.1f}" for name in (*CLASSIC, "policy")},
            "policy less tuned controller": "{gain:+.1f} ({gain_low:+.1f} to {gain_high:+.1f})".format(
                **row
            ),
            "in % of the score": "–"
            if np.isnan(row["score_unit"])
            else f"{100.0 * row['gain'] / row['score_unit']:+.0f}",
        }
        for row in table[table["seas"] == part].to_dict("records")
    )


def _mode(task: str) -> str:
    """Return the action mode of a task's recipe, and its number of imitated plans."""
    recipe = read_recipe("ppo", task)
    mode = str(recipe.env_kwargs.get("action_mode", DEFAULTS.action_mode)).partition(":")[0]
    return f"{mode}, {recipe.plans} plans" if recipe.plans else mode


def won(table: pd.DataFrame) -> list[str]:
    """Return the tasks in which the gain exceeds a tenth of the score in every part.

    The interval of the gain lies above zero in every part, too.
    """
    high = (table["gain_low"] > 0.0) & (table["gain"] > _WON * table["score_unit"])
    return _in_every_part(table, high)


def won_wholly(table: pd.DataFrame) -> list[str]:
    """Return the tasks in which the whole interval of the gain exceeds a tenth of the score."""
    return _in_every_part(table, table["gain_low"] > _WON * table["score_unit"])


def _in_every_part(table: pd.DataFrame, high: pd.Series) -> list[str]:
    every = high.groupby(table["task"], sort=False).all()
    return [str(task) for task in every.index[every]]


def figures(found: Mapping[str, Any]) -> pd.DataFrame:
    """Return the KPIs of policy, tuned controller and va-pitch in the training seas."""
    rows = []
    for task in tasks(None):
        cells = [v["training"] for k, v in found.items() if k.startswith(f"policy_{task}_")]
        if not cells:
            continue
        classic = [found[_classic_key(task, n)]["training"]["kpis"] for n in (TUNED, VA_PITCH)]
        row = {"task": task}
        for name, words in _FIGURES.items():
            own = float(np.mean([cell["kpis"][name] for cell in cells]))
            shown = [own, *(kpis[name] for kpis in classic)]
            row[words] = " / ".join(f"{value:.3g}" for value in shown) if any(shown) else "–"
        rows.append(row | {"failed": f"{np.mean([cell['failed'] for cell in cells]):.3g}"})
    return pd.DataFrame(rows)


def oscillations() -> pd.DataFrame:
    """Return the lasting oscillations of each policy and its tuned controller in calm water."""
    return pd.DataFrame(
        {
            "task": name,
            "policy": _oscillation(name, f"policy:{name}"),
            TUNED: _oscillation(name, tuned_controller(name)),
        }
        for name in packaged_policies()
    )


def _oscillation(name: str, controller: str) -> str:
    task = get_task(name)
    made = load_controller(controller, task.load_ship(), DEFAULTS.control_interval_s, task)
    one = find_oscillation(Setting(controller, name, "task", DEFAULTS.observer, 1), made)
    if one is None:
        return "none"
    about = f"{COMMANDS[one.command]}, {one.swing:.0%}, {one.period_s:.1f} s"
    return f"{about} at {one.speed_order_m_s:.1f} m/s"


def write(folder: Path, found: Mapping[str, Any]) -> Path:
    """Write page and table."""
    table = table_of(found)
    reached, wholly = (
        ", ".join(f"`{name}`" for name in names) or "no task"
        for names in (won(table), won_wholly(table))
    )
    titles = {
        "training": "Training seas",
        "second block": "Training seas, second block of seeds",
        "held-out": "Held-out seas",
    }
    parts = {title: _shown(table, part) for part, title in titles.items()}
    return write_results(
        __file__,
        folder,
        TITLE,
        table,
        notes=NOTES,
        won=reached,
        wholly=wholly,
        parts=parts,
        kpis=figures(found),
        oscillations=oscillations(),
    )


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing results, and write the page."""
    folder = "out/policies"
    parser = make_parser("policies", __doc__, f"{folder}/page", kept=folder, jobs=None)
    add = parser.add_argument
    add("--task", nargs="+", choices=list(tasks(None)), default=list(tasks(None)), help="tasks")
    add("--seeds", type=int, default=1, help="trainings for each task")
    add("--page-only", action="store_true", help="compute nothing, write the page")
    help_text = "put the first training of each task into the package"
    add("--package", action="store_true", help=help_text)
    options = parser.parse_args(arguments)
    kept, common = options.kept, {"jobs": options.jobs, "tick": print_dot}
    classic = {_classic_key(task, name): (task, name) for task in options.task for name in CLASSIC}
    policies = {
        f"policy_{task}_{seed}": (task, seed, kept)
        for seed in range(1, options.seeds + 1)
        for task in options.task
    }
    try:
        if not options.page_only:
            sweep(classic_cell, classic, kept, **common)
            for task in options.task:
                recipe = read_recipe("ppo", task)
                make_plans(recipe, get_task(task).vessel, kept / "plans", options.jobs, print_dot)
            sweep(policy_cell, policies, kept, **common)
            print()
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    write(options.out, {file.stem: read_json(file) for file in sorted(kept.glob("*.json"))})
    if options.package:
        for task in options.task:
            print(f"packaged: {package(task, kept)}")


def package(task: str, kept: Path) -> Path:
    """Put the first training of a task into the package, with its card; return the file."""
    place = packaged_policies_folder() / f"{task}.npz"
    shutil.copyfile(kept / "trainings" / f"{task}-1" / "policy.npz", place)
    rows = {"policy": means(read_json(kept / f"policy_{task}_1.json"))}
    for name in CLASSIC:
        rows[name] = means(read_json(kept / f"{_classic_key(task, name)}.json"))
    write_text(place.with_suffix(".md"), card(task, load_policy(place), rows, NOTES))
    return place
