"""What fuel, speed error and torque fluctuation can be had together in transit, without learning.

The speed pilot with fixed settings: a gain makes it hold the speed more tightly, an offset makes it sail
slower than ordered. The points show what a policy can hope for, and what its targets exclude each other.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from matplotlib.figure import Figure

from ...agents.evaluation.controllers import label, load_controller
from ...agents.evaluation.episodes import Setting
from ...agents.evaluation.sweeps import episodes
from ...baselines.controller import Controller
from ...core.files import write_atomically, write_text
from ...display import figures
from ...display.tables import markdown
from ...envs.tasks import HELD_OUT, get_task
from .comparison import FIRST_SEED, OBSERVER, difference

GAINS = (1.0, 2.0, 4.0)
OFFSETS = (-0.05, -0.1, -0.15)
WAVES = "torque_gain=1.5,shaft_gain=0.25,pitch_gain=0.5"
TASK, POLICY = "transit", "policy:transit"
BASELINES = ("combinator", "cpp-optimiser")
_QUANTITIES = {
    "fuel": ("fuel_kg_nmi", "combinator"),
    "speed_error": ("speed_error_rms_m_s", "combinator"),
    "torque": ("torque_sd_kN_m", "cpp-optimiser"),
}


def specification(gain: float, offset: float) -> str:
    """The pilot's name and settings."""
    return f"speed-pilot:speed_gain={gain:g},speed_offset={offset:g},{WAVES}"


def _make(names: dict[str, str], setting: Setting) -> Controller:
    ship = get_task(setting.task).sailed(setting.ship)
    return load_controller(names[setting.controller], ship, 0.5)


def frontier(
    folder: Path,
    seeds: int,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
    gains: tuple[float, ...] = GAINS,
    offsets: tuple[float, ...] = OFFSETS,
) -> pd.DataFrame:
    """Paired differences in percent, with 95 % intervals, one row a controller.

    Args:
        folder: for the cells.
        seeds: episodes a sea.
        jobs: see :func:`shaftline.core.sweep.sweep`.
        tick: called after each cell.
        gains: of the pilot.
        offsets: of its order [m/s].
    """
    model = get_task(f"{TASK}:{HELD_OUT}")
    pilots = {(g, d): specification(g, d) for g in gains for d in offsets}
    names = {label(name): name for name in (*BASELINES, POLICY, *pilots.values())}
    settings = [
        Setting(name, f"{TASK}:{HELD_OUT}", sea, OBSERVER, seeds, first_seed=FIRST_SEED)
        for name in names
        for sea in model.presets
    ]
    found = episodes(settings, functools.partial(_make, names), folder, jobs=jobs, tick=tick)
    count = len(model.presets)
    columns = [kpi for kpi, _ in _QUANTITIES.values()]
    over_seas = {
        names[settings[i].controller]: pd.DataFrame(
            np.mean([one.kpis[columns].to_numpy() for one in found[i : i + count]], axis=0),
            columns=columns,
        )
        for i in range(0, len(settings), count)
    }
    rows = []
    for name, kpis in over_seas.items():
        gain, offset = next((key for key, text in pilots.items() if text == name), (np.nan, np.nan))
        row = {"controller": name.partition(":")[0], "speed_gain": gain, "speed_offset_m_s": offset}
        for what, (kpi, baseline) in _QUANTITIES.items():
            one = difference(TASK, baseline, "all", kpi, kpis[kpi], over_seas[baseline][kpi])
            row |= {what: one.percent, f"{what} low": one.percent_low,
                    f"{what} high": one.percent_high}  # fmt: skip
        rows.append(row)
    return pd.DataFrame(rows)


def drawn(table: pd.DataFrame) -> Figure:
    """Fuel against speed error, both against the combinator; the torque beside each point."""
    figure, axes = figures.new_figure(1, 1, (7.5, 4.8))
    axis = axes[0, 0]
    shown = table[table["controller"] != "cpp-optimiser"]  # far away: +130 % of speed error
    groups = [(f"speed pilot, gain {g:g}", part) for g, part in shown.groupby("speed_gain")]
    groups += [
        (str(name), part) for name, part in shown[shown["speed_gain"].isna()].groupby("controller")
    ]
    for i, ((name, part), colour) in enumerate(zip(groups, figures.PALETTE, strict=False)):
        bars = {
            what: np.abs(part[[f"{what} low", f"{what} high"]].to_numpy().T - part[what].to_numpy())
            for what in ("fuel", "speed_error")
        }
        axis.errorbar(part["speed_error"], part["fuel"], xerr=bars["speed_error"], yerr=bars["fuel"],
                      fmt="o-", color=colour, label=name, capsize=2, linewidth=1)  # fmt: skip
        for x, y, torque in part[["speed_error", "fuel", "torque"]].to_numpy():
            aside = (6, 6 - 9 * (i - 2)) if len(part) > 1 else (-70, 24 * i - 88)
            axis.annotate(f"torque {torque:+.0f} %", (x, y), textcoords="offset points",
                          xytext=aside, fontsize=7, color=colour)  # fmt: skip
    axis.axhline(0.0, color=figures.THESIS, linewidth=0.8)
    axis.axvline(0.0, color=figures.THESIS, linewidth=0.8)
    axis.set_xlabel("speed error against the combinator's [%]")
    axis.set_ylabel("fuel per mile against the combinator's [%]")
    axis.set_title(
        "Transit, held-out seas; torque fluctuation against the CPP optimiser's", fontsize=10
    )
    axis.legend(fontsize=8, frameon=False)
    return figure


def _cell(row: pd.Series, what: str) -> str:  # type: ignore[type-arg]
    return f"{row[what]:+.1f} ({row[f'{what} low']:+.1f} to {row[f'{what} high']:+.1f})"


def main(
    out: Annotated[Path, typer.Option(help="Folder.")] = Path("docs/results/policies"),
    seeds: Annotated[int, typer.Option(min=3, help="Episodes a sea.")] = 60,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes.")] = None,
) -> None:
    """Sail the pilot's settings and draw what they can do."""
    table = frontier(out, seeds, jobs, lambda: typer.echo(".", nl=False))
    figures.save(drawn(table), out / "frontier.png")
    write_atomically(
        out / "frontier.csv", lambda f: table.to_csv(f, index=False, float_format="%.5g")
    )
    shown = table[["controller", "speed_gain", "speed_offset_m_s"]].astype(object).fillna("")
    for what, (_, baseline) in _QUANTITIES.items():
        shown[f"{what.replace('_', ' ')} against {baseline} [%]"] = [
            _cell(row, what) for _, row in table.iterrows()
        ]
    write_text(out / "frontier.md", PAGE.format(seeds=seeds, table=markdown(shown)))
    typer.echo(f"\npage: {out / 'frontier.md'}")


PAGE = """# What can be had together in transit

Made by `python -m shaftline.studies.policies.frontier --seeds {seeds}`.

The [speed pilot](../../speed-pilot.md) with fixed settings, {seeds} episodes in each held-out sea, and
the packaged policy among them: paired differences, interquartile means over the seeds with 95 %
intervals. A higher `speed_gain` holds the speed more tightly, a lower `speed_offset` sails slower than
ordered.

![fuel against speed error](frontier.png)

{table}

The frigate's combinator is at full pitch already, and by holding the shaft's speed it lets the ship slow
down where the resistance is high, which is where a mile costs most: it is hard to beat at its own speed
error. A ship that is held to a constant speed spends more fuel; sailing slower wins the fuel back and
costs speed error. Holding the speed also means following the resistance's slow swing with the torque, so
what lowers the speed error raises the torque's fluctuation. So the targets of the transit policy exclude
each other: the CPP optimiser saves its fuel by sailing slower, at more than twice the speed error.

Where the policy lies beside the pilot's points tells what learning adds here: good settings, found
without trying them by hand.
"""

if __name__ == "__main__":
    typer.run(main)
