"""Measure the coverage of the intervals that evaluations report.

Samples are drawn from distributions with a known true value. The page has the percentage of intervals
that contain this value. No ship is simulated.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.agents.evaluation import statistics

from .pages import make_parser
from .writing import write_results

COUNTS = (4, 5, 6, 8, 10, 20, 60)  # numbers of episodes of a controller
TRAININGS = ((2, 24), (3, 24), (5, 60), (10, 60))  # numbers of trainings and episodes of a recipe
SHARES = (0.0, 0.1, 1.0, 10.0)  # variance of the mean by trainings over that by episodes
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


def coverage_by_episodes(repeats: int) -> Iterator[dict[str, object]]:
    """Yield the coverage for the interquartile mean by distribution and sample size."""
    for (name, draw), count in itertools.product(DISTRIBUTIONS.items(), COUNTS):
        rng = np.random.default_rng([_SEED, count])
        truth = float(statistics.interquartile_mean(draw(rng, (_LARGE,))))
        samples = draw(rng, (repeats, count))
        spread = float(np.std(statistics.interquartile_mean(samples)))
        ends = np.array(
            [statistics.estimate_with_interval(row, seed)[1:] for seed, row in enumerate(samples)]
        )
        plain = np.array([_percentile(row, seed) for seed, row in enumerate(samples)])
        oracle = 2.0 * float(scipy.stats.norm.ppf(0.975)) * spread
        yield {
            "distribution": name,
            "episodes": count,
            "bootstrap": _share(plain, truth),
            "stretched": _share(ends, truth),
            "width": round(float(np.mean(ends[:, 1] - ends[:, 0])) / oracle, 2),
        }


def _percentile(row: NDArray[np.float64], seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    drawn = statistics.interquartile_mean(row[rng.integers(len(row), size=(1000, len(row)))])
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)


def coverage_by_trainings(repeats: int) -> Iterator[dict[str, object]]:
    """Yield the coverage for means over trainings and episodes by size and share of variance."""
    for (runs, episodes), share in itertools.product(TRAININGS, SHARES):
        rng = np.random.default_rng([_SEED, runs, episodes])
        between = math.sqrt(share * runs / episodes)
        means, changes = [], []
        for _ in range(repeats):
            sea = rng.gamma(9.0, 1.0 / 9.0, episodes)  # mean 1, SD 1/3
            own = sea + rng.normal(0.0, 1.0 / 3.0, episodes)
            run = rng.normal(0.0, between * math.hypot(1.0 / 3.0, 1.0 / 3.0), (runs, 1))
            table = 2.0 + own + run + rng.normal(0.0, 0.1, (runs, episodes))
            means.append(statistics.mean_with_interval(table)[1:])
            changes.append(statistics.relative_change(table, 2.0 + sea)[1:])
        yield {
            "trainings": runs,
            "episodes": episodes,
            "variance": share,
            "mean": _share(np.array(means), 3.0),
            "change": _share(np.array(changes), 0.0),
        }


def _share(ends: NDArray[np.float64], truth: float) -> float:
    return round(100.0 * float(np.mean((ends[:, 0] <= truth) & (truth <= ends[:, 1]))), 1)


def main(arguments: list[str] | None = None) -> None:
    """Measure the coverage, and write ``intervals.md`` and its table."""
    parser = make_parser("intervals", __doc__, "out/intervals")
    parser.add_argument("--repeats", type=int, default=1000, help="samples for each row")
    options = parser.parse_args(arguments)
    if options.repeats < 20:
        parser.error("--repeats must be at least 20")
    episodes = pd.DataFrame(coverage_by_episodes(options.repeats))
    trainings = pd.DataFrame(coverage_by_trainings(options.repeats))
    write_results(
        __file__,
        options.out,
        "Coverage of the intervals of evaluations",
        pd.concat([episodes, trainings]),
        repeats=options.repeats,
        least=statistics.LEAST_SEEDS,
        error=100.0 * math.sqrt(0.95 * 0.05 / options.repeats),
        episodes=episodes,
        trainings=trainings,
    )


if __name__ == "__main__":
    main()
