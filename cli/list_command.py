"""``shaftline list`` and the reference page, both from the registries themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from ..baselines import controller_names, helmsman_names
from ..baselines.registry import about
from ..core.files import check_writable, write_text
from ..display.tables import markdown
from ..envs import Goals, tasks
from ..mismatch import catalogue
from ..observers import observer_names
from ..plant import load_ship, ship_names
from ..plant.load_cases import CASES
from ..plant.seas import presets
from ..plant.ship_files import ship_keys
from ..plant.signals import CONTROL_SIGNALS, SIGNALS
from ..plant.terms import NO_BOUND, TermParameter
from .console import clear_errors, print_table, say


def registries() -> dict[str, pd.DataFrame]:
    """Everything that has a name, by heading."""
    return {
        "Ships": pd.DataFrame(
            [(name, load_ship(name).description) for name in ship_names()],
            columns=["ship", "description"],
        ),
        "Seas": pd.DataFrame(
            [("calm", 0.0, float("nan"), float("nan"))]
            + [(n, s.hs_m, s.tp_s, s.gamma) for n, s in presets().items()],
            columns=["sea", "Hs [m]", "Tp [s]", "gamma [-]"],
        ),
        "Observers": pd.DataFrame({"observer": observer_names()}),
        "Controllers": _controllers(controller_names(), "controller"),
        "Helmsmen": _controllers(helmsman_names(), "helmsman"),
        "Tasks": pd.DataFrame(
            [(name, task.description) for name, task in tasks(None).items()],
            columns=["task", "description"],
        ),
        "Reward terms": pd.DataFrame(
            [(name, field.description) for name, field in Goals.model_fields.items()],
            columns=["term", "description"],
        ),
        "Goals of the tasks": _goals(),
        "Load cases": pd.DataFrame(
            [(case.name, case.description) for case in CASES.values()],
            columns=["load case", "description"],
        ),
        "Effects": effects(),
        "Signals": pd.DataFrame(
            [
                (s.column, s.symbol, s.unit, s.source, s.description)
                for s in (*SIGNALS, *CONTROL_SIGNALS)
            ],
            columns=["column", "symbol", "unit", "source", "description"],
        ),
        "Keys of a ship file": pd.DataFrame(
            ship_keys(), columns=["key", "unit", "allowed", "default", "description"]
        ),
    }


def _goals() -> pd.DataFrame:
    """Return the goals of every task with tolerance, weight and reason."""
    rows = [
        (name, term, f"{goal.within:g}", f"{goal.margin:g}",
         "factor" if goal.weight is None else f"{goal.weight:g}", goal.reason)
        for name, task in tasks(None).items()
        for term, goal in task.goals.used.items()
    ]  # fmt: skip
    heads = ["task", "term", "fully reached within", "margin (value 0.1)", "weight", "reason"]
    return pd.DataFrame(rows, columns=heads)


def _controllers(names: list[str], kind: str) -> pd.DataFrame:
    """What each does, what a variant sets, and what `shaftline tune` may search."""
    rows = []
    for name in names:
        told = about(name)
        sets = ", ".join(f"{key} = {value}" for key, value in told.fixed.items())
        ranges = ", ".join(
            f"{key} {low:g} to {high:g}" for key, (low, high) in told.tunable.items()
        )
        words = f"{told.words} (with {sets})" if sets else told.words
        rows.append((name, words, told.source, ranges or "–"))
    return pd.DataFrame(rows, columns=[kind, "what it does", "source", "may be tuned"])


def effects() -> pd.DataFrame:
    """What `shaftline diagnose` knows by name."""
    keys = {
        (label.split()[0]): (unit, allowed) for label, unit, allowed, *_ in reversed(ship_keys())
    }
    rows = []
    for effect in catalogue():
        parameters = []
        for parameter in effect.parameters:
            name, (unit, allowed) = parameter.key, keys.get(parameter.key, ("", ""))
            if parameter.term is not None:  # a number of the term, no key of every ship's file
                own = parameter.term.parameters[parameter.name]
                name, unit, allowed = parameter.name, own.unit, _range(own)
            parameters.append(f"{name} [{unit}], {allowed}".removesuffix(", "))
        if effect.windowed:
            parameters.append("start and end [s]")
        rows.append(
            (effect.id, effect.form, effect.balance, "; ".join(parameters), effect.equation,
             effect.excitation, ", ".join(effect.confused_with))
        )  # fmt: skip
    heads = ["effect", "form", "balance", "parameters", "equation", "shows with", "confused with"]
    return pd.DataFrame(rows, columns=heads)


def _range(number: TermParameter) -> str:
    """What a term's number may be; a bound that is only there to keep it finite is not told."""
    told = []
    if number.low > NO_BOUND[0]:
        told.append(f">= {number.low:g}")
    if number.high < NO_BOUND[1]:
        told.append(f"<= {number.high:g}")
    return " and ".join(told)


def list_names(
    only_effects: Annotated[
        bool, typer.Option("--effects", help="Only the effects that a diagnosis knows by name.")
    ] = False,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="Write the lists to this file instead.")
    ] = None,
) -> None:
    """List ships, seas, observers, controllers, tasks, effects, signals, and every key of a ship file.

    Effects are what `shaftline diagnose` knows by name; their ids go to its `--exclude`. Forms are
    several equations of one piece of physics. What is missing can be written in a file of your own:
    `shaftline diagnose --effects MY.toml`.
    """
    with clear_errors():
        if markdown_file is not None:
            check_writable(markdown_file)
        tables = {"Effects": effects()} if only_effects else registries()
        if markdown_file is not None:
            parts = [f"## {title}\n\n{markdown(table)}\n" for title, table in tables.items()]
            head = "# Reference\n\nMade by `shaftline list --markdown docs/reference.md`.\n\n"
            write_text(markdown_file, head + "\n".join(parts))
            say(f"written: {markdown_file}")
            return
        for title, table in tables.items():
            print_table(table, title)
