"""Helmsmen as printed, tuned, and under a policy: ``docs/results/steering-learned.md``."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from ...agents.evaluation.statistics import relative_to
from ...baselines.loops import helmsman_loop
from ...baselines.registry import make_steering
from ...display.tables import markdown, write_table
from ...envs import SteeringVectorEnv
from ...envs.settings import DEFAULTS
from .learning import KPIS, REACH, TASKS, Sailed, judged, trained, tuned

TITLE = "Helmsmen, tuned and under a policy"
SEEDS, INTERVALS, EPISODES, ROUNDS = 5, 600_000, 64, 25

ABOUT = f"""\
Held-out seas, currents and side forces, which neither the search nor a training draws; {EPISODES}
episodes, the same for all. `as printed`: Taylor's law with his turns and track changes. `tuned`: its
gain, integral and turns by CMA-ES ({ROUNDS} rounds) on the task's own seas. `policy`: {SEEDS}
trainings by PPO of a linear map from seven readings to a correction of the tuned helmsman's rudder of
at most {math.degrees(REACH):g} degrees, {INTERVALS:,} control intervals each; intervals over trainings
and episodes together. Pitch and rack stay with the speed pilot.

What is published is the reward that was trained. The trap: held against the helmsman as printed the
policy looks {{flattered}} better, all of which the search has found before it. What it adds to the
tuned helmsman is in the table. No bound is known here: a plan that knows the waves steers no rudder
yet."""


def measured() -> tuple[pd.DataFrame, dict[str, str], str]:
    """A row a task and controller; the tuned helmsmen; what comparing with the print would claim."""
    rows, found, claims = [], {}, []
    for task, name in TASKS.items():
        ship = SteeringVectorEnv(1, task=task).batch.ship
        text = found[task] = tuned(task, ROUNDS)
        policies = []
        for seed in range(1, SEEDS + 1):
            policies.append(trained(task, text, seed, INTERVALS))
            print(f"{task}: training {seed} of {SEEDS} done", file=sys.stderr, flush=True)
        classic = {
            kind: [make_steering(own, ship, DEFAULTS.control_interval_s)]
            for kind, own in (("as printed", name), ("tuned", text))
        }
        sailed = judged({**classic, "policy": policies}, task, EPISODES)
        for kind, several in sailed.items():
            rows.append(_row(task, kind, several, sailed["tuned"][0]))
        best = np.mean([one.reward.mean() for one in sailed["policy"]])
        claims.append(f"{100.0 * (1.0 - best / sailed['as printed'][0].reward.mean()):.0f} %")
    return pd.DataFrame(rows), found, " and ".join(claims)


def _row(task: str, kind: str, several: list[Sailed], base: Sailed) -> dict[str, object]:
    """Means of a controller; its reward against the tuned helmsman's, with the interval."""
    rewards = np.array([one.reward for one in several])
    row: dict[str, object] = {"task": task, "controller": kind, "reward": f"{rewards.mean():.0f}"}
    if kind != "tuned":
        change, low, high = relative_to(-rewards, -base.reward)
        row["cost against tuned"] = f"{change:+.1f} % ({low:+.1f} to {high:+.1f})"
    else:
        row["cost against tuned"] = "–"
    means = pd.concat([one.kpis for one in several])[list(KPIS)].mean()
    return row | {name.replace("_", " "): f"{value:.3g}" for name, value in means.items()}


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/steering"))
    folder = parser.parse_args().out
    table, texts, claims = measured()
    margins = []
    for task, text in texts.items():
        ship = SteeringVectorEnv(1, task=task).batch.ship
        loop = helmsman_loop(make_steering(text, ship, DEFAULTS.control_interval_s).helmsman)
        told = loop.margins()
        margins.append(
            f"- {task}: `{text}`, phase margin {told.phase_margin_deg:.0f} deg, gain margin "
            f"{told.gain_margin_dB:.0f} dB"
        )
    body = (
        f"{ABOUT.format(flattered=claims)}\n\n{markdown(table)}\n\nThe tuned helmsmen, with the "
        "margins of their loops on the ship:\n\n" + "\n".join(margins)
    )
    command = "python -m shaftline.studies.steering.learned"
    write_table(folder, "steering-learned", TITLE, command, table, body)
    print(body)


if __name__ == "__main__":
    main()
