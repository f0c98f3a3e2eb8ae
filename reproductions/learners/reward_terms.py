"""Draw the goal values and the reward of each task over an episode of the combinator.

Run ``python -m reproductions learners.reward_terms``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.baselines.registry import make_controller
from shaftline.display import figures
from shaftline.envs import CLASSIC, FrigateEnv, get_task, tasks
from shaftline.envs.rewards import goal_value

SEED = 0
SEAS = dict.fromkeys(tasks(), "state-5") | {"storm": "state-7"}
"""Sea of each task's episode."""

_INTERVAL_S = 0.5
_MEAN_S = 5.0  # running mean over about half a wave period


def simulated(task: str) -> pd.DataFrame:
    """Return the goal values and rewards of an episode of the combinator; index: time [s]."""
    ship = get_task(task).load_ship()
    controller = make_controller("combinator", ship, _INTERVAL_S)
    env = FrigateEnv(task=task, sea=SEAS[task], control_interval_s=_INTERVAL_S, **CLASSIC)
    goals = get_task(task).goals.used
    observation, _ = env.reset(seed=SEED)
    state, start, rows = None, True, []
    done = False
    while not done:
        action, state = controller.predict(observation, state, np.array([start]))
        observation, reward, terminated, truncated, info = env.step(action)
        terms = info["reward_terms"]
        values = {
            name: goal_value(terms[name], goal.within, goal.margin) for name, goal in goals.items()
        }
        rows.append(values | {"reward": reward})
        start, done = False, terminated or truncated
    return pd.DataFrame(rows, index=_INTERVAL_S * np.arange(1, len(rows) + 1))


def drawn(episodes: dict[str, pd.DataFrame]) -> Figure:
    """Draw the value of each goal and the reward over time."""
    figure, axes = figures.new_figure(len(episodes), 1, (9.0, 2.7 * len(episodes)))
    for axis, (task, values) in zip(axes.flat, episodes.items(), strict=True):
        smooth = values.rolling(round(_MEAN_S / _INTERVAL_S), min_periods=1).mean()
        for k, name in enumerate(values):
            is_reward = name == "reward"
            axis.plot(
                smooth.index,
                smooth[name],
                label=f"{name} ({values[name].mean():.2f})",
                color="black" if is_reward else figures.PALETTE[k % len(figures.PALETTE)],
                linewidth=1.6 if is_reward else 1.0,
            )
        axis.set_title(f"{task}, {SEAS[task]}", fontsize=10, loc="left")
        axis.set_ylabel("value [-]", fontsize=9)
        axis.set_xlim(0.0, smooth.index[-1])
        axis.set_ylim(0.0, 1.05)
        axis.tick_params(labelsize=8)
        axis.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1, 0].set_xlabel("time [s]", fontsize=9)
    return figure


def main() -> None:
    """Simulate, and save the figure to ``--out FILE``."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("out/reward-terms.png"), help="file for the figure"
    )
    out = parser.parse_args().out
    figures.save(drawn({task: simulated(task) for task in tasks()}), out)
    print(f"figure: {out}")


if __name__ == "__main__":
    main()
