"""The page of the package's policies: returns, gains over the tuned law, and physical figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.agents.evaluation.scores import bounds
from shaftline.agents.evaluation.statistics import middle_of_runs
from shaftline.agents.learning.recipe import read_recipe
from shaftline.display.tables import markdown, write_table
from shaftline.envs import DEFAULTS, tasks

from ..learners.references import CONTROLLERS, EPISODES, FIRST_SEED, TUNED
from .trainings import BLOCKS

COMBINATOR, VA_PITCH = CONTROLLERS[0], "va-pitch"
CLASSIC = (COMBINATOR, VA_PITCH, TUNED)
NAME, COMMAND = "policies", "python -m reproductions policies --out docs/results"

NOTES = (
    f"Each mean is over {EPISODES} episodes from seed {FIRST_SEED}, which no training and no search "
    "draws; a failed episode counts 0. Held-out seas are higher, shorter or from another side."
)

_WON = 0.1  # of the score, which a policy has to gain over the tuned controller
_FIGURES = {
    "fuel_kg_nmi": "fuel [kg/nmi]", "speed_error_rms_m_s": "speed error, rms [m/s]",
    "speed_short_m_s": "order less speed, mean [m/s]",
    "wave_torque_kN_m": "shaft torque in waves [kN m]",
    "wave_engine_torque_kN_m": "engine torque in waves [kN m]",
    "heading_error_rms_deg": "heading error, rms [deg]", "track_error_rms_m": "track error, rms [m]",
}  # fmt: skip


def means(cell: Mapping[str, Any]) -> dict[str, float]:
    """Return the mean return of a cell in the training's seas and in those held out."""
    return {part: float(np.mean(cell[part]["values"])) for part in ("training", "held-out")}


def episodes_of(task: str, part: str, found: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the returns of the trained policies, shape (trainings, episodes)."""
    rows = [v[part]["values"] for k, v in found.items() if k.startswith(f"policy_{task}_")]
    return np.atleast_2d(np.array(rows, dtype=np.float64)) if rows else np.zeros((0, 0))


def classic_of(task: str, name: str, part: str, found: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the returns of a classic controller, shape (episodes,)."""
    key = f"classic_{task}_{name}".replace(" ", "-")
    return np.array(found[key][part]["values"], dtype=np.float64)


def table_of(found: Mapping[str, Any]) -> pd.DataFrame:
    """Return a row for each task and part: returns, gain over the tuned law, unit of the score."""
    rows = []
    for task in tasks(None):
        for part in BLOCKS:
            policies = episodes_of(task, part, found)
            if not len(policies):
                continue
            classic = {name: classic_of(task, name, part, found) for name in CLASSIC}
            gain, low, high = middle_of_runs(policies - classic[TUNED])
            bound = bounds().get(task)
            steps = DEFAULTS.max_episode_steps or 1
            unit = np.nan if bound is None else steps * (bound.best - bound.combinator)
            rows.append(
                {"task": task, "seas": part, "trainings": len(policies),
                 "policy": float(policies.mean()),
                 **{name: float(values.mean()) for name, values in classic.items()},
                 "gain": gain, "gain_low": low, "gain_high": high, "score_unit": unit}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _shown(table: pd.DataFrame, part: str) -> pd.DataFrame:
    rows = table[table["seas"] == part]
    unit = rows["score_unit"]
    return pd.DataFrame(
        {
            "task": rows["task"],
            "begins as": [_mode(task) for task in rows["task"]],
            "trainings": rows["trainings"],
            **{name: [f"{x:.1f}" for x in rows[name]] for name in (*CLASSIC, "policy")},
            "policy less tuned controller": [
                f"{r['gain']:+.1f} ({r['gain_low']:+.1f} to {r['gain_high']:+.1f})"
                for _, r in rows.iterrows()
            ],
            "the same, % of the score": [
                "–" if np.isnan(u) else f"{100.0 * g / u:+.0f}"
                for g, u in zip(rows["gain"], unit, strict=True)
            ],
        }
    )


def _mode(task: str) -> str:
    """Return how a task's recipe begins: its action mode, and plans where it imitates any."""
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
    """Return physical figures of policy, tuned controller and va-pitch, seas of the training."""
    rows = []
    for task in tasks(None):
        cells = [v for k, v in found.items() if k.startswith(f"policy_{task}_")]
        if not cells:
            continue
        classic = [
            found[f"classic_{task}_{name}".replace(" ", "-")]["training"]["kpis"]
            for name in (TUNED, VA_PITCH)
        ]
        row: dict[str, Any] = {"task": task}
        for name, words in _FIGURES.items():
            own = float(np.mean([cell["training"]["kpis"][name] for cell in cells]))
            shown = [own, *(kpis[name] for kpis in classic)]
            row[words] = " / ".join(f"{value:.3g}" for value in shown) if any(shown) else "–"
        failed = float(np.mean([cell["training"]["failed"] for cell in cells]))
        rows.append(row | {"failed": f"{failed:.3g}"})
    return pd.DataFrame(rows)


_TEXT = """\
The recipe of each task (`agents/learning/recipes/ppo.yml`), chosen once on the task's own seas: its mean
over the trainings, none of which is chosen, beside the classic controllers. `tuned controller` is the
best classic law that `shaftline tune` found for the task. In the mode `residual` a policy adds to the
commands of that tuned controller, so the gain is what learning added. With plans it first imitated
[plans](../train.md#imitate-plans-first) that begin from that controller; the trainings of a task share
them. In the mode `increment` it was learned from nothing. The gain is given with its 95 % interval over
trainings and episodes together, and as a share of the score (0 the combinator, 1 the clairvoyant bound
of [standard learners](learners.md)), where the task has a bound.

{notes}

A policy has to gain a tenth of the score, with the whole interval above zero, in both blocks of seeds
and in the held-out seas. Reached in: {won}. The whole interval exceeds a tenth of the score in:
{wholly}."""


def write(folder: Path, found: Mapping[str, Any]) -> Path:
    """Write page and table.

    Args:
        folder: of the results.
        found: results by name of their cells.
    """
    table = table_of(found)
    reached, wholly = (
        ", ".join(f"`{name}`" for name in names) or "no task"
        for names in (won(table), won_wholly(table))
    )
    titles = {"training": "Seas of the training", "second block": "A second block of seeds",
              "held-out": "Held-out seas"}  # fmt: skip
    body = [_TEXT.format(notes=NOTES, won=reached, wholly=wholly)]
    for part, title in titles.items():
        body += [f"## {title}", markdown(_shown(table, part))]
    body += [
        "## In physical units",
        "Policy / tuned controller / va-pitch, seas of the training.",
        markdown(figures(found)),
    ]
    write_table(folder, NAME, "The policies of the package", COMMAND, table, "\n\n".join(body))
    return folder / f"{NAME}.md"
