"""``shaftline list`` and the reference page, both generated from the registries."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from ..baselines import controller_names, helmsman_names
from ..baselines.registry import describe
from ..core.files import check_writable, write_text
from ..display.tables import markdown
from ..envs import Goals, tasks
from ..mismatch import catalogue
from ..observers import get_observer, observer_names
from ..plant import load_ship, ship_names
from ..plant.load_cases import CASES
from ..plant.seas import presets
from ..plant.ship_files import ship_keys
from ..plant.signals import CONTROL_SIGNALS, SIGNALS
from ..plant.terms import NO_BOUND, TermParameter
from .console import print_table, report_errors, say

WIDTH = 100
"""Largest width of the printed tables, in columns."""

PRINTED = {
    "Observers": ["observer", "description"],
    "Controllers": ["controller", "description"],
    "Helmsmen": ["helmsman", "description"],
    "Goals of the tasks": ["task", "term", "fully reached within", "margin (value 0.1)", "weight"],
    "Effects": ["effect", "form", "balance", "description"],
    "Signals": ["column", "unit", "description"],
    "Keys of a ship file": ["key", "unit", "description"],
}
"""Columns of the tables that are too wide for the terminal; the reference page has all columns."""


def registries() -> dict[str, pd.DataFrame]:
    """Return the tables of all registered names, by heading."""
    seas = [("calm", 0.0, math.nan, math.nan)]
    seas += [(name, sea.hs_m, sea.tp_s, sea.gamma) for name, sea in presets().items()]
    signals = [
        (s.column, s.symbol, s.unit, s.source, s.description) for s in (*SIGNALS, *CONTROL_SIGNALS)
    ]
    return {
        "Ships": _descriptions("ship", {name: load_ship(name) for name in ship_names()}),
        "Seas": pd.DataFrame(seas, columns=["sea", "Hs [m]", "Tp [s]", "gamma [-]"]),
        "Observers": observers(),
        "Controllers": controllers(),
        "Helmsmen": _controllers(helmsman_names(), "helmsman"),
        "Tasks": _descriptions("task", tasks(None)),
        "Reward terms": _descriptions("term", Goals.model_fields),
        "Goals of the tasks": _goals(),
        "Load cases": _descriptions("load case", {case.name: case for case in CASES.values()}),
        "Effects": effects(),
        "Signals": pd.DataFrame(
            signals, columns=["column", "symbol", "unit", "source", "description"]
        ),
        "Keys of a ship file": pd.DataFrame(
            ship_keys(), columns=["key", "unit", "allowed", "default", "description"]
        ),
    }


def _descriptions(kind: str, things: Mapping[str, Any]) -> pd.DataFrame:
    rows = [(name, thing.description) for name, thing in things.items()]
    return pd.DataFrame(rows, columns=[kind, "description"])


def observers() -> pd.DataFrame:
    """Return the table of observers, with a row for each tuning."""
    rows = []
    for name in observer_names():
        observer = get_observer(name)
        words = " ".join((type(observer).__doc__ or "").split("\n\n")[0].split()).rstrip(".")
        tuning = name.removeprefix(f"{type(observer).name}-")
        words += f" (tuning {tuning})" if tuning != name else ""
        rows.append((name, words, observer.source))
    return pd.DataFrame(rows, columns=["observer", "description", "source"])


def controllers() -> pd.DataFrame:
    """Return the table of controllers."""
    return _controllers(controller_names(), "controller")


def _controllers(names: list[str], kind: str) -> pd.DataFrame:
    """Return the table of controllers or helmsmen with the options that `shaftline tune` can vary."""
    rows = []
    for name in names:
        facts = describe(name)
        sets = ", ".join(f"{key} = {value}" for key, value in facts.fixed.items())
        ranges = ", ".join(
            f"{key} {low:g} to {high:g}" for key, (low, high) in facts.tunable.items()
        )
        words = f"{facts.summary} (with {sets})" if sets else facts.summary
        rows.append((name, words, facts.source, ranges or "–"))
    return pd.DataFrame(rows, columns=[kind, "description", "source", "tuning ranges"])


def tuning_ranges(name: str) -> pd.DataFrame:
    """Return the options of a controller or helmsman that `shaftline tune` can vary."""
    rows = [(key, f"{low:g}", f"{high:g}") for key, (low, high) in describe(name).tunable.items()]
    return pd.DataFrame(rows, columns=["option", "lowest", "highest"])


def _goals() -> pd.DataFrame:
    """Return the goals of every task with tolerance, weight and reason."""
    rows = [
        (
            name,
            term,
            f"{goal.within:g}",
            f"{goal.margin:g}",
            "factor" if goal.weight is None else f"{goal.weight:g}",
            goal.reason,
        )
        for name, task in tasks(None).items()
        for term, goal in task.goals.used.items()
    ]
    heads = ["task", "term", "fully reached within", "margin (value 0.1)", "weight", "reason"]
    return pd.DataFrame(rows, columns=heads)


def effects() -> pd.DataFrame:
    """Return the table of the effects that `shaftline diagnose` can identify."""
    keys = {label.split()[0]: about for label, *about in reversed(ship_keys())}
    rows = []
    for effect in catalogue():
        parameters = []
        for parameter in effect.parameters:
            name, (unit, allowed, *_) = parameter.key, keys.get(parameter.key, ["", ""])
            if parameter.term is not None:  # A parameter of a term is not a key of every ship file.
                own = parameter.term.parameters[parameter.name]
                name, unit, allowed = parameter.name, own.unit, _range(own)
            parameters.append(f"{name} [{unit}], {allowed}".removesuffix(", "))
        description = effect.lacks.partition(": ")[2] or effect.lacks
        if effect.windowed:
            parameters.append("start and end [s]")
        rows.append(
            (
                effect.id,
                effect.form,
                effect.balance,
                description,
                "; ".join(parameters),
                effect.equation,
                effect.excitation,
                ", ".join(effect.confused_with),
            )
        )
    heads = [
        "effect",
        "form",
        "balance",
        "description",
        "parameters",
        "equation",
        "identifiable with",
        "confused with",
    ]
    return pd.DataFrame(rows, columns=heads)


def _range(number: TermParameter) -> str:
    """Return the allowed range of a term's parameter, without bounds that only keep it finite."""
    low = [f">= {number.low:g}"] if number.low > NO_BOUND[0] else []
    high = [f"<= {number.high:g}"] if number.high < NO_BOUND[1] else []
    return " and ".join(low + high)


def list_names(
    name: Annotated[
        str | None,
        typer.Argument(
            help="With --controllers: controller or helmsman whose tuning ranges are shown.",
            show_default=False,
        ),
    ] = None,
    only_controllers: Annotated[
        bool, typer.Option("--controllers", help="List controllers only, or show NAME.")
    ] = False,
    only_effects: Annotated[
        bool, typer.Option("--effects", help="List the effects of a diagnosis only.")
    ] = False,
    markdown_file: Annotated[
        Path | None,
        typer.Option("--markdown", help="Write the tables to this file, not the terminal."),
    ] = None,
) -> None:
    """List ships, seas, observers, controllers, tasks, effects, signals, and every key of a ship file.

    Effects are the physics that `shaftline diagnose` can identify; `--exclude` of that command takes
    their ids. Forms are alternative equations of the same effect. You can define further effects in a
    file: `shaftline diagnose --effects MY.toml`.

    `--controllers NAME` shows the options of a controller that `shaftline tune` can vary, with their
    ranges.

    Written: with `--markdown` all tables with all their columns, to one file; the printed tables show
    the most important columns.

    Examples:
        shaftline list

        shaftline list --effects

        shaftline list --controllers va-pitch

        shaftline list --markdown reference.md
    """
    with report_errors():
        if markdown_file is not None:
            check_writable(markdown_file)
        if only_controllers and only_effects:
            raise ValueError("give either --controllers or --effects")
        if name is not None and not only_controllers:
            raise ValueError(
                f"{name}: a name needs --controllers: shaftline list --controllers {name}"
            )
        tables = _selected(name, only_controllers, only_effects)
        if markdown_file is not None:
            parts = [f"## {title}\n\n{markdown(table)}\n" for title, table in tables.items()]
            head = "# Reference\n\nMade by `shaftline list --markdown docs/reference.md`.\n\n"
            write_text(markdown_file, head + "\n".join(parts))
            say(f"written: {markdown_file}")
            return
        if name is not None:
            facts = describe(name)
            say(textwrap.fill(f"{facts.summary} ({facts.source})", WIDTH) + "\n")
        for title, table in tables.items():
            print_table(table[PRINTED.get(title, list(table.columns))], title, width=WIDTH)


def _selected(
    name: str | None, only_controllers: bool, only_effects: bool
) -> Mapping[str, pd.DataFrame]:
    """Return the tables that the options select, by heading."""
    if name is not None:
        return {f"Tuning ranges of {name}": tuning_ranges(name)}
    if only_controllers:
        helmsmen = _controllers(helmsman_names(), "helmsman")
        return {"Controllers": controllers(), "Helmsmen": helmsmen}
    return {"Effects": effects()} if only_effects else registries()
