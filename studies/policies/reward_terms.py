"""What the reward is made of: each weighted term over an episode of each task, with the combinator.

Run ``python -m shaftline.studies.policies.reward_terms``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...baselines.registry import make_controller
from ...display import figures
from ...envs import FrigateEnv, get_task, tasks
from ...envs.rewards import TERMS

SEED = 0
SEAS = dict.fromkeys(tasks(), "state-5") | {"storm": "state-7"}
"""The sea of each task's episode: a rough one."""

_INTERVAL_S = 0.5
_MEAN_S = 5.0  # running mean, about half a wave: single waves would hide the rest


def sailed(task: str) -> pd.DataFrame:
    """Weighted terms of the combinator's episode, one row a control interval; index: time [s]."""
    ship = get_task(task).sailed()
    controller = make_controller("combinator", ship, _INTERVAL_S)
    env = FrigateEnv(task=task, sea=SEAS[task], control_interval_s=_INTERVAL_S)
    weights = get_task(task).weights.model_dump()
    observation, _ = env.reset(seed=SEED)
    state, start, rows = None, True, []
    done = False
    while not done:
        action, state = controller.predict(observation, state, np.array([start]))
        observation, _, terminated, truncated, info = env.step(action)
        rows.append({term: weights[term] * info["reward_terms"][term] for term in TERMS})
        start, done = False, terminated or truncated
    return pd.DataFrame(rows, index=_INTERVAL_S * np.arange(1, len(rows) + 1))


def drawn(episodes: dict[str, pd.DataFrame]) -> Figure:
    """The terms of each task stacked over time.

    Args:
        episodes: by task, from :func:`sailed`.
    """
    figure, axes = figures.new_figure(len(episodes), 1, (9.0, 2.7 * len(episodes)))
    for axis, (task, terms) in zip(axes.flat, episodes.items(), strict=True):
        smooth = terms.rolling(round(_MEAN_S / _INTERVAL_S), min_periods=1).mean()
        share = terms.mean() / terms.mean().sum()
        labels = [f"{term} ({share[term]:.0%})" for term in TERMS]
        axis.stackplot(
            smooth.index, smooth.to_numpy().T, labels=labels, colors=figures.PALETTE, linewidth=0
        )
        axis.set_title(f"{task}, {SEAS[task]}", fontsize=10, loc="left")
        axis.set_ylabel("cost per interval", fontsize=9)
        axis.set_xlim(0.0, smooth.index[-1])
        axis.tick_params(labelsize=8)
        handles, names = axis.get_legend_handles_labels()
        axis.legend(
            handles[::-1], names[::-1], fontsize=8, frameon=False,
            loc="center left", bbox_to_anchor=(1.0, 0.5),
        )  # fmt: skip
    axes[-1, 0].set_xlabel("time [s]", fontsize=9)
    return figure


def main() -> None:
    """Sail, and save the figure to ``--out FILE``."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("out/reward-terms.png"), help="file for the figure"
    )
    out = parser.parse_args().out
    figures.save(drawn({task: sailed(task) for task in tasks()}), out)
    print(f"figure: {out}")


if __name__ == "__main__":
    main()
