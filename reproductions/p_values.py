"""Calibrate and check the p-values of a diagnosis where nothing is missing; write ``p-values.md``.

The recordings come from the independent simulator of the validation. The result of each case is kept in
the folder ``--kept``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.core.sweep import sweep
from shaftline.display.figures import PALETTE, new_figure
from shaftline.mismatch import diagnose
from shaftline.mismatch.search.selection import Calibration, chance_bound
from shaftline.validation.cases import draw_case, indices_of
from shaftline.validation.coverage import ship_of
from shaftline.validation.recording import simulate_case

from .pages import make_parser, print_dot
from .writing import share, write_results

TITLE = "p-values where nothing is missing"
NOMINAL = (0.05, 0.01)
"""Nominal levels that are checked; the diagnosis uses the second one."""


class Cell(NamedTuple):
    """One null case."""

    seed: int
    number: int

    @property
    def name(self) -> str:
        """File name of the result."""
        return f"{self.seed}_{self.number}"


def cells_of(seed: int, count: int) -> list[Cell]:
    """Return the first null cases of a seed."""
    return [
        Cell(seed, index) for index in indices_of(seed, count, lambda kind: kind.startswith("null"))
    ]


def diagnose_null(cell: Cell) -> dict[str, Any]:
    """Return the smallest bound of all candidates in a null case, and what is named."""
    case = draw_case(*cell)
    found = diagnose(ship_of(case), simulate_case(case).recording)
    ranked = [(chance_bound(c.effect, c.gain, limit), c.effect.label) for c, limit in found.ranking]
    named = [
        (chance_bound(one.effect, one.score, one.threshold), one.effect.label)
        for one in found.findings
    ]
    least, label = min(ranked + named, default=(1.0, ""))
    return {
        "kind": case.kind,
        "ship": case.ship,
        "bound": least,
        "effect": label,
        "named": ", ".join(label for _, label in named),
        "verdict": found.verdict,
    }


def cross_calibrated(bounds: Sequence[float]) -> list[float]:
    """Return the p-value of each null case by a calibration without the half to which it belongs.

    Args:
        bounds: smallest bound of each case.
    """
    halves = [Calibration.of(bounds[1 - k :: 2]) for k in (0, 1)]
    return [halves[k % 2](bound) for k, bound in enumerate(bounds)]


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Return the shares of small p-values and of false names by kind of case, with intervals."""
    rows = []
    for kind, own in [("all", table), *table.groupby("kind")]:
        row: dict[str, Any] = {"cases": kind, "count": len(own)}
        for level in NOMINAL:
            row[f"p < {level:g}"] = share(own["p_value"] < level, 3)
        row[f"bound < {NOMINAL[0]:g}"] = share(own["bound"] < NOMINAL[0], 3)
        rows.append(row | {"named": share(own["named"] != "", 3)})
    return pd.DataFrame(rows)


def draw(table: pd.DataFrame) -> Figure:
    """Draw the share of null cases below each p-value, and below each bound, beside the nominal one."""
    figure, axes = new_figure(1, 1, (4.5, 4.0))
    axis = axes.flat[0]
    ranks = np.arange(1, len(table) + 1) / len(table)
    for color, (column, label) in zip(
        PALETTE, (("p_value", "p-value"), ("bound", "without calibration")), strict=False
    ):
        ordered = np.sort(np.maximum(table[column], 1e-6))
        axis.plot(ordered, ranks, color=color, drawstyle="steps-post", label=label)
    axis.plot([1e-3, 1.0], [1e-3, 1.0], color="black", linestyle=":", label="nominal")
    axis.set(xscale="log", yscale="log", xlabel="p-value", ylabel="share of null cases below it")
    axis.legend(frameon=False)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Diagnose the cases that are not kept, and write the page."""
    folder = "out/p-values"
    parser = make_parser("p_values", __doc__, f"{folder}/page", kept=folder, jobs=None)
    parser.add_argument("--cases", type=int, default=500, help="number of null cases")
    parser.add_argument("--seed", type=int, default=6501, help="seed of the cases")
    options = parser.parse_args(arguments)
    wanted = {cell.name: cell for cell in cells_of(options.seed, options.cases)}
    found = sweep(diagnose_null, wanted, options.kept, jobs=options.jobs, tick=print_dot)
    table = pd.DataFrame([found[name] for name in wanted])
    bounds = table["bound"].tolist()
    table["p_value"] = cross_calibrated(bounds)
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {"": draw(table)},
        f"--cases {options.cases} --seed {options.seed}",
        summary=summarise(table),
        effects=table[table["p_value"] < NOMINAL[0]]
        .groupby(["effect", "kind"])
        .size()
        .rename("cases")
        .reset_index(),
        count=len(table),
        calibration=Calibration.of(bounds),
    )


if __name__ == "__main__":
    main()
