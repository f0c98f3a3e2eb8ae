"""Compare the planner's criteria and its search with published ones; write ``trial-design.md``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.core.sweep import sweep

from ..pages import make_parser, print_dot
from ..writing import share, write_results
from . import bioreactor, reactor, ships
from .criteria import CRITERIA, PLANNER, PUBLISHED, RANDOM

TITLE = "Design of experiments: the planner beside published criteria"
WAYS = (RANDOM, *CRITERIA)
STARTS = 5
"""Number of random commands from which the trials of a ship are searched."""


class Cell(NamedTuple):
    """Experiments on the bioreactor with one seed of the noise, or trials of the frigate."""

    question: str
    """Of :data:`.ships.QUESTIONS`; empty: the bioreactor."""
    noise: float
    """Of the bioreactor's measurements [g/L]."""
    seed: int

    @property
    def name(self) -> str:
        """File name of the result."""
        return f"{self.question.replace(' ', '-') or f'bioreactor_{self.noise}'}_{self.seed}"


def cells_of(seed: int, seeds: int) -> list[Cell]:
    """Return all cells: ``seeds`` of the bioreactor for each noise, :data:`STARTS` for each question."""
    vessels = [Cell("", noise, seed + k) for noise in bioreactor.NOISES for k in range(seeds)]
    voyages = [Cell(name, 0.0, seed + k) for name in ships.QUESTIONS for k in range(STARTS)]
    return [*vessels, *voyages]


def compute(cell: Cell) -> dict[str, Any]:
    """Return the outcome by way of choosing the experiment."""
    if cell.question:
        found = ships.trials(cell.question, cell.seed)
        return {way: trial._asdict() for way, trial in found.items()}
    known, outcomes = bioreactor.second_experiments(cell.seed, cell.noise)
    return {"known": known, **{one.way: one._asdict() for one in outcomes}}


def vessel_table(cells: Sequence[Cell], found: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return how often the second experiment on the bioreactor finds the true law."""
    rows = []
    for noise in bioreactor.NOISES:
        some = [x for c, x in zip(cells, found, strict=True) if not c.question and c.noise == noise]
        for way in WAYS:
            ours = [one[way] for one in some]
            rows.append(
                {
                    "noise [g/L]": noise,
                    "feed chosen by": way,
                    "seeds": len(ours),
                    "laws left by the first": np.mean([one["known"] for one in some]),
                    "laws left by both": np.mean([len(one["left"]) for one in ours]),
                    "true law best (95 %)": share([one["right"] for one in ours]),
                    "true law alone (95 %)": share([one["alone"] for one in ours]),
                }
            )
    return pd.DataFrame(rows)


def discordant_table(cells: Sequence[Cell], found: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return for how many seeds only the planner's feed, and only the published one, succeeds."""
    rows = []
    for noise in bioreactor.NOISES:
        some = [x for c, x in zip(cells, found, strict=True) if not c.question and c.noise == noise]
        for key, words in {"right": "true law best", "alone": "true law alone"}.items():
            pairs = [(one[PLANNER][key], one[PUBLISHED][key]) for one in some]
            ours, theirs = pairs.count((True, False)), pairs.count((False, True))
            chance = scipy.stats.binomtest(ours, ours + theirs).pvalue if ours + theirs else 1.0
            rows.append(
                {
                    "noise [g/L]": noise,
                    "success": words,
                    "only the planner's feed": ours,
                    "only the published criterion's": theirs,
                    "p-value of no difference": chance,
                }
            )
    return pd.DataFrame(rows)


def voyage_table(cells: Sequence[Cell], found: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return the evidence of the trials of the frigate, over the starts."""
    rows = []
    for question in ships.QUESTIONS:
        some = [x for c, x in zip(cells, found, strict=True) if c.question == question]
        for way in WAYS:
            ours = [one[way] for one in some]
            least = [one["least"] for one in ours]
            wrong = np.median([one["wrong"] for one in ours])
            rows.append(
                {
                    "question": question,
                    "trial chosen by": way,
                    "closest pair, median": np.median(least),
                    "smallest": min(least),
                    "largest": max(least),
                    "pairs decided": " of ".join(
                        str(sum(one[key] for one in ours)) for key in ("decided", "pairs")
                    ),
                    "wrong choice, median of the bound": f"{wrong:.1e}",
                }
            )
    return pd.DataFrame(rows)


def better_starts(cells: Sequence[Cell], found: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return for how many starts the planner's trial has the smaller bound of a wrong choice, of all."""
    some = [x for c, x in zip(cells, found, strict=True) if c.question]
    return sum(one[PLANNER]["wrong"] < one[PUBLISHED]["wrong"] for one in some), len(some)


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing cells, and write the page."""
    folder = "out/trial-design"
    parser = make_parser("trial_design", __doc__, f"{folder}/page", kept=folder, jobs=None)
    parser.add_argument("--seed", type=int, default=6501, help="first seed")
    parser.add_argument("--seeds", type=int, default=100, help="number of seeds of the bioreactor")
    options = parser.parse_args(arguments)
    cells = cells_of(options.seed, options.seeds)
    known = sweep(
        compute,
        {cell.name: cell for cell in cells},
        options.kept,
        jobs=options.jobs,
        tick=print_dot,
    )
    found = [known[cell.name] for cell in cells]
    voyages = voyage_table(cells, found)
    printed = pd.DataFrame(reactor.printed_numbers())
    design = reactor.planned()
    write_results(
        __file__,
        options.out,
        TITLE,
        voyages,
        {},
        f"--seed {options.seed} --seeds {options.seeds}",
        printed=printed.assign(
            temperature=[f"{value:g}" for value in printed["temperature"]],
            prior=np.where(printed["prior"], "yes", ""),
            published=[f"{value:.9g}" for value in printed["published"]],
        ).rename(
            columns={"temperature": "first temperature [K]", "prior": "with earlier experiments"}
        ),
        design=design,
        temperature=reactor.PUBLISHED[-1][0],
        log10_det=reactor.PUBLISHED[-1][-1],
        step=reactor.STEP_K,
        vessels=vessel_table(cells, found),
        discordant=discordant_table(cells, found),
        voyages=voyages,
        starts=STARTS,
        better=better_starts(cells, found),
    )


if __name__ == "__main__":
    main()
