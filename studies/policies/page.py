"""The page on the policies: :mod:`.comparison` in words, tables and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from ...core.files import write_atomically, write_text
from ...display.figures import save
from ...display.tables import markdown
from ...envs.tasks import HELD_OUT, get_task
from . import figures
from .comparison import (
    ALL,
    FIRST_SEED,
    OBSERVER,
    POLICY,
    QUANTITIES,
    RARE,
    Comparison,
    Difference,
    differences,
    frame,
    table_of,
)
from .recipes import reproduce, resistance, trained_in
from .targets import verdicts

COMMAND = "python -m shaftline.studies.policies --out docs/results/policies"


def write(folder: Path, comparisons: Sequence[Comparison]) -> list[Difference]:
    """Write ``policies.md``, ``policies.csv``, ``differences.csv``, ``episodes.csv`` and figures.

    Args:
        folder: for all of them.
        comparisons: at least one.

    Returns:
        The paired differences.
    """
    tables = pd.concat([table_of(one) for one in comparisons], ignore_index=True)
    found = [difference for one in comparisons for difference in differences(one)]
    every = pd.concat(
        [
            kpis.assign(task=one.task, controller=controller, sea=sea,
                        seed=FIRST_SEED + kpis.index.to_numpy())
            for one in comparisons
            for (controller, sea), kpis in one.kpis.items()
        ]
    )  # fmt: skip
    for name, table in (("policies", tables), ("differences", frame(found)), ("episodes", every)):
        write_atomically(
            folder / f"{name}.csv",
            lambda file, table=table: table.to_csv(file, index=False, float_format="%.6g"),  # type: ignore[misc]
        )
    pictures = _pictures(folder, comparisons)
    write_text(folder / "policies.md", _page(comparisons, tables, found, pictures))
    return found


def _pictures(folder: Path, comparisons: Sequence[Comparison]) -> dict[str, str]:
    """File names of the figures that were drawn, with what they show."""
    storms = [one for one in comparisons if one.task == "storm"]
    drawn = {
        "pareto": (figures.pareto(comparisons), "Fuel against speed error, with intervals"),
        "profiles": (
            figures.profiles(comparisons),
            "Performance profiles (Agarwal et al. 2021) with 95 % bootstrap bands. The score is the "
            "combinator's cost in the same episode (minus its reward) over the controller's own",
        ),
        "torque": (figures.torque(comparisons), "Torque fluctuation by sea"),
        "envelope": (
            figures.envelope(comparisons),
            "One episode in the engine's envelope (line: torque limit; dots: highest speed)",
        ),
        "storm": (figures.storm(storms[0]) if storms else None, "One storm in time"),
        "training": (figures.training(comparisons), "The trainings, judged after each leg"),
    }
    shown = {}
    for name, (figure, caption) in drawn.items():
        if figure is not None:
            save(figure, folder / f"{name}.png")
            shown[f"{name}.png"] = caption
    return shown


def _page(
    comparisons: Sequence[Comparison],
    tables: pd.DataFrame,
    found: Sequence[Difference],
    pictures: dict[str, str],
) -> str:
    first = comparisons[0]
    exponents = ", ".join(f"{one.exponent:.2f} in {one.task}" for one in comparisons)
    parts = [
        "# Learned policies against classic controllers",
        f"Made by `{COMMAND} --seeds {first.seeds}`.",
        f"{first.seeds} episodes of {first.episode_s:g} s a sea, seeds from {FIRST_SEED:,} (training's "
        f"stay below), observer `{OBSERVER}`, the usual instruments' noise. Equal seeds meet equal "
        "waves, orders and resistance whatever the controller. What each policy was trained in, and "
        "what it meets here, stands in its section.",
        "Values are interquartile means over the episodes with 95 % bootstrap intervals; `failed` is a "
        "plain mean. Differences are policy minus baseline, seed by seed. Of "
        f"{', '.join(f'`{name}`' for name in RARE)} the mean difference is judged, for the "
        "interquartile mean does not see what fewer than a quarter of the episodes have. Over all seas "
        "a seed counts once, with its mean over the seas. No correction is made for the number of "
        "comparisons.",
        "`reward` and the profiles are by the task's own weights. The policies were trained with other "
        "weights, towards what was asked for below; their cards list them. By the task's own weights "
        "the speed pilot may well be ahead of them.",
        "`fuel_even_kg_nmi` compares at equal speed: each episode's fuel per mile times (mean order / "
        "mean speed)^k, k from the combinator's curve in calm water between the lowest and the highest "
        f"order: {exponents}. This is approximate: waves, resistance and another pitch change k, and "
        "where orders change within an episode their mean does not tell all.",
        "## What was asked for",
        '"Less" is met where the whole interval is, "no more" and "no less" unless the whole '
        "interval is on the bad side.",
        "\n".join(verdicts(found)) or "Nothing was asked for in these tasks.",
        "## Reproduce",
        "Each training, with the time that it took on one of two cores, the other one being at work "
        "too; then this page. The packaged policies are compared unless `--policy "
        "out/TASK/policy.npz` names another. Equal seeds give equal policies on a CPU with equal "
        "versions of torch and NumPy.",
        reproduce(comparisons, f"{COMMAND} --seeds {first.seeds}"),
    ]
    parts += [f"{caption}.\n\n![{caption}]({name})" for name, caption in pictures.items()]
    for one in comparisons:
        parts += _task(one, tables[tables["task"] == one.task], found)
    meanings = "\n".join(f"- `{name}`: {meaning}" for name, meaning in QUANTITIES.items())
    parts += ["## Columns", meanings,
              "Every digit: [policies.csv](policies.csv), [differences.csv](differences.csv), "
              "[episodes.csv](episodes.csv)."]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _task(one: Comparison, table: pd.DataFrame, found: Sequence[Difference]) -> list[str]:
    here = get_task(f"{one.task}:{HELD_OUT}")
    parts = [
        f"## {one.task}",
        f"Trained in: {trained_in(one.policy.about['recipe'])}. Sailed here: {', '.join(one.seas)}; "
        f"{resistance(here)}.",
    ]
    for sea in one.seas:
        rows = table[table["sea"] == sea].set_index("controller")
        cells = [
            [name, *(_cell(rows.loc[c, [name, f"{name}_low", f"{name}_high"]]) for c in rows.index)]
            for name in QUANTITIES
        ]
        parts += [f"### {one.task}, {sea}",
                  markdown(pd.DataFrame(cells, columns=["", *rows.index]))]  # fmt: skip
    for baseline in one.controllers:
        if baseline != POLICY:
            parts += [f"### {one.task}: policy minus {baseline}",
                      differences_table(one, baseline, found)]  # fmt: skip
    return parts


def _cell(values: pd.Series[float]) -> str:
    middle, low, high = values
    if low == high:
        return f"{middle:.4g}"
    return f"{middle:.4g} ({low:.4g} to {high:.4g})"


def differences_table(one: Comparison, baseline: str, found: Sequence[Difference]) -> str:
    """The paired differences to one baseline: over all seas, and in percent in each."""
    by = {(d.sea, d.quantity): d for d in found if (d.task, d.baseline) == (one.task, baseline)}
    rows = []
    for name in QUANTITIES:
        whole = by[ALL, name]
        rows.append(
            {
                "": f"{name} ({whole.statistic})",
                "all seas": f"{whole.difference:+.3g} ({whole.low:+.3g} to {whole.high:+.3g})",
                "in percent": _percent(whole),
                "excludes zero": "yes" if whole.excludes_zero else "no",
            }
            | ({} if len(one.seas) == 1 else {sea: _in_sea(by[sea, name]) for sea in one.seas})
        )
    note = "" if len(one.seas) == 1 else "\n\nOf single seas, *: the interval excludes zero."
    return markdown(pd.DataFrame(rows)) + note


def _percent(found: Difference) -> str:
    if found.percent != found.percent:  # the baseline has none
        return "–"
    return f"{found.percent:+.1f} ({found.percent_low:+.1f} to {found.percent_high:+.1f})"


def _in_sea(found: Difference) -> str:
    text = f"{found.difference:+.3g} ({found.low:+.3g} to {found.high:+.3g})"
    return text + ("*" if found.excludes_zero else "")
