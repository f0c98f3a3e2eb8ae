"""Measure how often the intervals of evaluations cover the truth.

Samples are drawn from distributions whose true value is known, an interval is worked out for each, and
the share of intervals that hold the true value is counted. Nothing of the package's ships takes part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import scipy
import typer
from numpy.typing import NDArray

from shaftline.agents.evaluation.statistics import (
    LEAST_SEEDS,
    interquartile_mean,
    middle_of_runs,
    relative_to,
    with_interval,
)
from shaftline.display.tables import markdown, write_table

COUNTS = (4, 5, 6, 8, 10, 20, 60)
"""Episodes of a controller."""

TRAININGS = ((2, 24), (3, 24), (5, 60), (10, 60))
"""Trainings and episodes of a recipe."""

SHARES = (0.0, 0.1, 1.0, 10.0)
"""Variance between trainings over that between episodes, each as it enters the mean."""

_LARGE = 1_000_000
_SEED = 20_261

Draw = Callable[[np.random.Generator, tuple[int, ...]], NDArray[np.float64]]


def _two_peaks(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float64]:
    return rng.normal(np.where(rng.random(shape) < 0.3, 8.0, 0.0), 1.0)


DISTRIBUTIONS: dict[str, Draw] = {
    "normal": lambda rng, shape: rng.normal(5.0, 1.0, shape),
    "lognormal, sigma 0.5": lambda rng, shape: rng.lognormal(0.0, 0.5, shape),
    "Student, 3 degrees of freedom": lambda rng, shape: rng.standard_t(3, shape),
    "exponential": lambda rng, shape: rng.exponential(1.0, shape),
    "two peaks, 30 % eight SD away": _two_peaks,
    "uniform": lambda rng, shape: rng.random(shape),
}

WORDS = """The share of intervals that hold the true value, in percent; 95 is claimed. `bootstrap` is
the plain percentile bootstrap; `stretched` is what `shaftline evaluate` gives. Each figure rests on
{repeats} samples (standard error {error:.1f} points). `width` is the mean width over that of an oracle
that knows the estimator's standard deviation.

## Interquartile mean of the episodes of a controller

{episodes}

With two peaks and fewer than eight episodes the interquartile mean itself is biased, as a quarter cannot
be cut off; no interval from the sample alone corrects that. With fewer than {least} episodes no interval
is given.

## Mean over trainings and episodes

`variance` is the variance between trainings over that between episodes, each as it enters the mean;
`change` is the percentage against a baseline in the same episodes. With two or three trainings that
differ much more than episodes do, the interval is too narrow: five trainings are needed.

{trainings}
"""


def of_episodes(repeats: int) -> Iterator[dict[str, object]]:
    """Count the coverage of the interquartile mean's interval, a row a distribution and sample size.

    Args:
        repeats: samples a row.
    """
    for (name, draw), count in ((pair, n) for pair in DISTRIBUTIONS.items() for n in COUNTS):
        rng = np.random.default_rng([_SEED, count])
        truth = float(interquartile_mean(draw(rng, (_LARGE,))))
        samples = draw(rng, (repeats, count))
        spread = float(np.std(interquartile_mean(samples)))
        ends = np.array([with_interval(row, seed)[1:] for seed, row in enumerate(samples)])
        plain = np.array([_percentile(row, seed) for seed, row in enumerate(samples)])
        oracle = 2.0 * float(scipy.stats.norm.ppf(0.975)) * spread
        yield {
            "distribution": name, "episodes": count, "bootstrap": _share(plain, truth),
            "stretched": _share(ends, truth),
            "width": round(float(np.mean(ends[:, 1] - ends[:, 0])) / oracle, 2),
        }  # fmt: skip


def _percentile(row: NDArray[np.float64], seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    drawn = interquartile_mean(row[rng.integers(len(row), size=(1000, len(row)))])
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)


def of_trainings(repeats: int) -> Iterator[dict[str, object]]:
    """Count the coverage of intervals over trainings and episodes, a row a size and share of variance.

    Args:
        repeats: samples a row.
    """
    for (runs, episodes), share in ((size, part) for size in TRAININGS for part in SHARES):
        rng = np.random.default_rng([_SEED, runs, episodes])
        between = math.sqrt(share * runs / episodes)
        means, changes = [], []
        for _ in range(repeats):
            sea = rng.gamma(9.0, 1.0 / 9.0, episodes)  # mean 1, SD 1/3
            own = sea + rng.normal(0.0, 1.0 / 3.0, episodes)
            run = rng.normal(0.0, between * math.hypot(1.0 / 3.0, 1.0 / 3.0), (runs, 1))
            table = 2.0 + own + run + rng.normal(0.0, 0.1, (runs, episodes))
            means.append(middle_of_runs(table)[1:])
            changes.append(relative_to(table, 2.0 + sea)[1:])
        yield {
            "trainings": runs, "episodes": episodes, "variance": share,
            "mean": _share(np.array(means), 3.0), "change": _share(np.array(changes), 0.0),
        }  # fmt: skip


def _share(ends: NDArray[np.float64], truth: float) -> float:
    return round(100.0 * float(np.mean((ends[:, 0] <= truth) & (truth <= ends[:, 1]))), 1)


def main(
    out: Annotated[Path, typer.Option(help="Folder for intervals.md and intervals.csv.")],
    repeats: Annotated[int, typer.Option(min=20, help="Samples a row.")] = 1000,
) -> None:
    """Measure the coverage of the intervals that evaluations print."""
    episodes = pd.DataFrame(of_episodes(repeats))
    trainings = pd.DataFrame(of_trainings(repeats))
    body = WORDS.format(
        repeats=repeats, error=100.0 * math.sqrt(0.95 * 0.05 / repeats), least=LEAST_SEEDS,
        episodes=markdown(episodes, 1), trainings=markdown(trainings, 1),
    )  # fmt: skip
    write_table(
        out, "intervals", "Coverage of the intervals of evaluations",
        "python -m reproductions intervals --out docs/results",
        pd.concat([episodes, trainings]), body,
    )  # fmt: skip


if __name__ == "__main__":
    typer.run(main)
