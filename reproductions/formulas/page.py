"""Page of the formula search on simulated ships.

Run ``python -m reproductions formulas --out docs/results``; about fifteen minutes on two cores.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shaftline.core.sweep import sweep
from shaftline.display.tables import write_table
from shaftline.plant.expressions import names_in
from shaftline.plant.terms import TERM_SIGNALS

from ..pages import fill_template, make_parser
from .cases import OUTSIDE, cases, diagnose_case, search_case

NAME, TITLE = "formulas", "Formula search: physics that the catalogue does not contain"
COMMAND = "python -m reproductions formulas --seed {seed} --out docs/results"

LEAST = 6.0  # gain of the true form on held-out data below which a ratio to it is not meaningful


def main() -> None:
    """Search, diagnose, and write ``formulas.md`` and its table."""
    parser = make_parser("formulas", __doc__, "out/formulas", kept="out/formulas/cases", jobs=2)
    parser.add_argument("--seed", type=int, default=300, help="seed of the first case")
    options = parser.parse_args()
    every = cases(options.seed)
    named = {case.name: case for case in every}
    lacking = {case.name: case for case in every if case.truth is not None}
    found = sweep(search_case, named, options.kept / "searched", jobs=options.jobs)
    whole = sweep(diagnose_case, lacking, options.kept / "diagnosed", jobs=options.jobs)
    rows = pd.DataFrame([found[name] for name in named])
    lists = {
        column: [" | ".join(x) if isinstance(x, list) else "" for x in rows[column]]
        for column in ("signals", "true_signals", "rivals")
    }
    text = body(rows, pd.DataFrame([whole[name] for name in lacking]))
    write_table(
        options.out, NAME, TITLE, COMMAND.format(seed=options.seed), rows.assign(**lists), text
    )
    print(f"page: {options.out / f'{NAME}.md'}")


def body(cases: pd.DataFrame, whole: pd.DataFrame) -> str:
    """Return the page below its title."""
    truths, nulls = split_nulls(cases)
    named = nulls[nulls["formula"] != ""]
    columns = ["case", "wrong_numbers", "formula", "gain", "threshold", "held_out"]
    diagnoses = diagnoses_table(whole, truths)
    asked = diagnoses[diagnoses["verdict"] == "unexplained"] if len(whole) else diagnoses
    return fill_template(
        Path(__file__).with_name("page.md"),
        rigs=truths["rig"].value_counts(),
        least=LEAST,
        summary=pd.DataFrame(summary_rows(truths, nulls), columns=["figure", "result", "target"]),
        truths=_rows(truths),
        null_cases=named[columns],
        diagnoses=diagnoses,
        asked=asked,
    )


def split_nulls(cases: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the cases with a truth, and the null cases."""
    has = cases["truth"].notna() & (cases["truth"] != "")
    return cases[has].copy(), cases[~has].copy()


def summary_rows(truths: pd.DataFrame, nulls: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Return name, result and target of each summary figure."""
    right = truths["right_signals"].astype(bool)
    either = [_right_or_rival(row) for _, row in truths.iterrows()]
    share = truths["gain"] / truths["possible"]
    held = _held_share(truths).dropna()
    seconds, null = truths["seconds"], nulls["formula"] != ""
    plain = ~truths["wrong_numbers"].astype(bool)
    return [
        ("truths with a formula", _of(truths["formula"] != ""), "–"),
        ("right signals", _of(right), "80 %"),
        ("right signals, or in an indistinguishable formula", _of(np.array(either)), "–"),
        ("right signals, parameters exact", _of(right[plain]), "–"),
        ("gain at least 0.8 of the true form's", _of(share >= 0.8), "–"),
        ("median gain over the true form's", f"{share.median():.2f}", "0.8"),
        ("mean gain over the true form's", f"{share.mean():.2f}", "–"),
        ("the median on held-out data", f"{held.median():.2f}", "0.8"),
        ("null cases with a formula", _of(null), "at most 2 %"),
        (
            "of these, with a residual above noise",
            _of(null & (nulls["coloured"] != "")),
            "at most 2 %",
        ),
        (
            "seconds of a search: median, largest",
            f"{seconds.median():.0f}, {seconds.max():.0f}",
            "60",
        ),
    ]


def _held_share(truths: pd.DataFrame) -> pd.Series:
    """Return the held-out gain over that of the true form, NaN where this is not meaningful."""
    possible = truths["possible_held_out"]
    return (truths["held_out"] / possible).where(possible > LEAST)


def _right_or_rival(row: Any) -> bool:
    """Return whether the formula, or one written as ``LOCATION: EXPRESSION``, has the true signals."""
    known = {*TERM_SIGNALS, *OUTSIDE[row["rig"]]}
    rivals = ({*names_in(rival.split(": ")[1])} & known for rival in row["rivals"])
    return bool(row["right_signals"]) or {*row["true_signals"]} in rivals


def _of(found: Any) -> str:
    return f"{int(np.sum(found))} of {len(found)} ({100.0 * float(np.mean(found)):.0f} %)"


def _rows(truths: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "truth": truths["truth"],
            "1 % biased": np.where(truths["wrong_numbers"].astype(bool), "yes", ""),
            "formula": truths["formula"].replace("", "none"),
            "signals": np.where(truths["right_signals"].astype(bool), "right", ""),
            "gain": truths["gain"],
            "over true form": truths["gain"] / truths["possible"],
            "held out, over true form": _held_share(truths),
        }
    )


def diagnoses_table(whole: pd.DataFrame, truths: pd.DataFrame) -> pd.DataFrame:
    """Return verdict, effects and formula of each diagnosis."""
    wanted = dict(zip(truths["case"], truths["true_signals"], strict=True))
    rows = []
    for row in whole.to_dict("records"):
        formula = row["formula"] if isinstance(row["formula"], dict) else None
        right = formula is not None and sorted(formula["signals"]) == wanted[row["case"]]
        rows.append(
            {
                "case": row["case"],
                "verdict": row["verdict"],
                "identified": ", ".join(row["named"]),
                "formula": f"{formula['acts_on']}: {formula['expression']}" if formula else "",
                "signals": "right" if right else "",
                "held-out gain": row["held_out"],
            }
        )
    return pd.DataFrame(rows)
