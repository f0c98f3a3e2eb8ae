"""The page on formulas: every number from :mod:`.bench`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shaftline.display.tables import markdown, write_table
from shaftline.plant.expressions import names_in
from shaftline.plant.terms import TERM_SIGNALS

from .cases import OUTSIDE

NAME, TITLE = "formulas", "Where no name fits: formulas of missing physics, and nulls"
COMMAND = "python -m reproductions formulas --seed {seed} --out docs/results"

INTRODUCTION = """\
Simulated ships lack physics that the catalogue does not name
([truths](../../studies/formulas/truths.toml)): {frigate} on the frigate (600 s at 5 Hz, six signals
from outside), {motor} on a model's motor (30 s at 50 Hz, shaft speed alone, two signals from
outside). Every recording holds all of its rig's signals, whether they matter or not. In every
fourth case the ship's numbers are wrong by 1 % (standard deviation), of which its file knows 0.15
to 0.5 %. The nulls lack nothing.

*Search*: formulas in every balance, without the catalogue before it and, of nulls, without asking
first whether more than noise is left. *Gain*: in 2 log L, over that of the true form fitted alike;
on the data that was fitted and on the data set aside, where a gain below {least:g} of the true
form's tells nothing. *Signals*: those of the formula are those of the truth; a formula is the
shortest of those that cannot be told apart, so of two signals one of which hardly moves it may name
one. *Or equally*: the truth's signals stand in the formula or in one of those that are told beside
it."""

LEAST = 6.0
"""Gain of the true form on the data set aside below which a share of it tells nothing."""


def write(folder: Path, cases: pd.DataFrame, whole: pd.DataFrame, seed: int) -> None:
    """Write ``formulas.md`` and ``formulas.csv``.

    Args:
        folder: to write into.
        cases: a row each, as of :func:`.bench.searched`.
        whole: likewise of :func:`.bench.diagnosed`; may be empty.
        seed: of the first case.
    """
    shown = cases.copy()
    for column in ("signals", "true_signals", "rivals"):
        shown[column] = [" | ".join(x) if isinstance(x, list) else "" for x in shown[column]]
    write_table(folder, NAME, TITLE, COMMAND.format(seed=seed), shown, body(cases, whole))


def body(cases: pd.DataFrame, whole: pd.DataFrame) -> str:
    """The page below its title."""
    truths, nulls = parted(cases)
    by_rig = truths["rig"].value_counts()
    parts = [
        INTRODUCTION.format(
            frigate=by_rig.get("frigate", 0), motor=by_rig.get("motor", 0), least=LEAST
        ),
        "## Figures",
        markdown(pd.DataFrame(figures(truths, nulls), columns=["figure", "found", "target"])),
        "## Truths",
        markdown(_rows(truths)),
    ]
    told = nulls[nulls["formula"] != ""]
    if len(told):
        columns = ["case", "wrong_numbers", "formula", "gain", "threshold", "held_out"]
        parts += ["## Nulls with a formula", markdown(told[columns], 1)]
    if len(whole):
        parts += ["## The whole diagnosis", _whole(whole, truths)]
    return "\n\n".join(parts)


def parted(cases: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Cases with a truth, and nulls."""
    has = cases["truth"].notna() & (cases["truth"] != "")
    return cases[has].copy(), cases[~has].copy()


def figures(truths: pd.DataFrame, nulls: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Name of each figure, what was found, and the target."""
    right = truths["right_signals"].astype(bool)
    beside = [_beside(row) for _, row in truths.iterrows()]
    share = truths["gain"] / truths["possible"]
    held = truths[truths["possible_held_out"] > LEAST]
    held_share = held["held_out"] / held["possible_held_out"]
    told, seconds = truths["formula"] != "", truths["seconds"]
    null = nulls["formula"] != ""
    gated = null & (nulls["coloured"] != "")
    plain = ~truths["wrong_numbers"].astype(bool)
    return [
        ("truths for which a formula holds", _of(told), "–"),
        ("right signals", _of(right), "80 %"),
        ("right signals, or equally", _of(np.array(beside)), "–"),
        ("right signals, ship's numbers right", _of(right[plain]), "–"),
        ("gain at least 0.8 of the possible", _of(share >= 0.8), "–"),
        ("median share of the possible gain", f"{share.median():.2f}", "0.8"),
        ("mean share of the possible gain", f"{share.mean():.2f}", "–"),
        ("median share on data set aside", f"{held_share.median():.2f}", "0.8"),
        ("nulls with a formula", _of(null), "at most 2 %"),
        ("of these, where more than noise is left", _of(gated), "at most 2 %"),
        ("seconds of a search: median, most", f"{seconds.median():.0f}, {seconds.max():.0f}", "60"),
    ]


def _beside(row: Any) -> bool:
    if row["right_signals"]:
        return True
    wanted = set(row["true_signals"])
    return any(_signals(rival, row["rig"]) == wanted for rival in row["rivals"])


def _signals(rival: str, rig: str) -> set[str]:
    """Signals of a formula that is told as ``place: expression``."""
    return {*names_in(rival.split(": ")[1])} & {*TERM_SIGNALS, *OUTSIDE[rig]}


def _of(found: Any) -> str:
    return f"{int(np.sum(found))} of {len(found)} ({100.0 * float(np.mean(found)):.0f} %)"


def _rows(truths: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "truth": truths["truth"],
            "1 % wrong": np.where(truths["wrong_numbers"].astype(bool), "yes", ""),
            "formula": truths["formula"].replace("", "none"),
            "signals": np.where(truths["right_signals"].astype(bool), "right", ""),
            "gain": truths["gain"],
            "of possible": truths["gain"] / truths["possible"],
            "set aside, of possible": (truths["held_out"] / truths["possible_held_out"]).where(
                truths["possible_held_out"] > LEAST
            ),
        }
    )


def _whole(whole: pd.DataFrame, truths: pd.DataFrame) -> str:
    wanted = dict(zip(truths["case"], truths["true_signals"], strict=True))
    rows = []
    for _, row in whole.iterrows():
        formula = row["formula"] if isinstance(row["formula"], dict) else None
        right = formula is not None and sorted(formula["signals"]) == wanted[row["case"]]
        rows.append(
            {
                "case": row["case"],
                "verdict": row["verdict"],
                "named": ", ".join(row["named"]),
                "formula": f"{formula['acts_on']}: {formula['expression']}" if formula else "",
                "signals": "right" if right else "",
                "gain set aside": row["held_out"],
            }
        )
    table = pd.DataFrame(rows)
    counts = ", ".join(f"{n} {v}" for v, n in table["verdict"].value_counts().items())
    asked = table[table["verdict"] == "unexplained"]
    return (
        "`diagnose` tries the catalogue first, and asks for a formula only where no name fits: "
        f"{counts}. Of those without a name, {int((asked['formula'] != '').sum())} of {len(asked)} "
        f"got a formula, {int((asked['signals'] == 'right').sum())} with the right signals.\n\n"
        + markdown(table, 0)
    )
