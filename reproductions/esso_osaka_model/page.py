"""Page of a tanker model: missing physics of surge, and the manoeuvring ship.

Run ``python -m reproductions esso_osaka_model --recordings FOLDER --out docs/results``; ten minutes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import write_csv, write_table
from shaftline.mismatch import Diagnosis
from shaftline.plant.columns import TIME
from shaftline.plant.replay import simulate_recording

from ..pages import fill_template, make_parser
from . import turning
from .runs import (
    FREE,
    HELD_OUT,
    SPEED,
    Found,
    Recordings,
    diagnose_surge,
    identify_surge,
    surge_ship,
)

NAME, TITLE = "esso-osaka-model", "Esso Osaka model: missing physics of surge and manoeuvring"
COMMAND = "python -m reproductions esso_osaka_model --out docs/results --recordings FOLDER"

TARGET = 0.025
"""Target of the error on the held-out runs [m/s]."""


def main() -> None:
    """Identify, diagnose, evaluate, and write ``esso-osaka-model.md``, its tables and its figures."""
    parser = make_parser(
        "esso_osaka_model", __doc__, "out/esso-osaka-model", recordings="folder of the CSV files"
    )
    options = parser.parse_args()

    def tick(stage: str, done: int, whole: int) -> None:
        print(f"{stage}: {done} of {whole}", flush=True)

    with Recordings(options.recordings) as runs:
        ships = {"ship file": runs.evaluate(surge_ship()), "identified": identify_surge(runs, tick)}
        said = {}
        for what, free, most in (
            ("diagnosed", (), None),
            ("diagnosed, parameters free", FREE, None),
            ("five effects", (), 5),
            ("five effects, parameters free", FREE, 5),
        ):
            said[what], ships[what] = diagnose_surge(runs, free, tick=tick, most=most)
        with Recordings(options.recordings, across=True) as steered:
            write(options.out, runs, ships, said, (steered, turning.simulate_all(steered, tick)))
    print(f"page: {options.out / f'{NAME}.md'}")


def table_of(ships: dict[str, Found]) -> pd.DataFrame:
    """Return the rms error of each ship's speed by run [m/s]."""
    names = next(iter(ships.values())).errors
    fitted = tuple(name for name in names if name not in HELD_OUT)
    rows = [
        {"run": name, "held out": "yes" if name in HELD_OUT else "",
         **{what: found.errors[name] for what, found in ships.items()}}
        for name in names
    ]  # fmt: skip
    for what, chosen in (("seven fitted", fitted), ("two held out", HELD_OUT)):
        rows.append({"run": what, "held out": "", **{n: f.over(chosen) for n, f in ships.items()}})
    return pd.DataFrame(rows)


def effects_table(diagnoses: dict[str, Diagnosis]) -> pd.DataFrame:
    """Return the identified effects of each diagnosis with their parameters."""
    rows = []
    for what, said in diagnoses.items():
        for finding in said.findings:
            for own in finding.estimates:
                low, high = own.ci95
                rows.append(
                    {"diagnosis": what, "verdict": said.verdict, "effect": finding.effect.label,
                     "parameter": own.name, "value": f"{own.value:.3g}",
                     "95 %": f"{low:.3g} to {high:.3g}", "unit": own.unit}
                )  # fmt: skip
    return pd.DataFrame(rows)


def figure_of(runs: Recordings, ships: dict[str, Found]) -> Figure:
    """Draw measured and simulated speed of the held-out runs."""
    figure, axes = figures.new_figure(len(HELD_OUT), 1, (9.0, 5.6))
    for axis, name in zip(axes[:, 0], HELD_OUT, strict=True):
        for color, (what, found) in zip(figures.PALETTE, ships.items(), strict=False):
            table = runs.tables(found.ship)[name]
            speed = simulate_recording(found.ship, table)[SPEED]
            axis.plot(table[TIME], speed, color=color, linewidth=1.1, label=what)
        axis.plot(table[TIME], table[SPEED], color=figures.TRUTH, linewidth=1.4, label="measured")
        axis.set_title(f"{name}, held out", fontsize=9)
        axis.set_ylabel("speed ahead [m/s]")
    axes[-1, 0].set_xlabel("time [s]")
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=2)
    return figure


def write(
    folder: Path,
    runs: Recordings,
    ships: dict[str, Found],
    diagnoses: dict[str, Diagnosis],
    turned: tuple[Recordings, turning.Turning],
) -> None:
    """Write ``esso-osaka-model.md``, its tables and its figures."""
    table, own = table_of(ships), turned[1]
    after = {what: found.over(HELD_OUT) for what, found in ships.items()}
    inside = {what: found.over(runs.fitted) for what, found in ships.items()}
    body = fill_template(
        Path(__file__).with_name("page.md"), table=table, after=after, inside=inside, target=TARGET,
        chosen=min(inside, key=lambda what: inside[what]),
        least=min(after, key=lambda what: after[what]), effects=effects_table(diagnoses),
        turning=turning, own=own, n=turning.summary(own), neutral=np.degrees(own.response.neutral),
        balances=", ".join(f"{b.name} {b.explained:.0%}" for b in own.said.balance_verdicts),
    )  # fmt: skip
    write_table(folder, NAME, TITLE, COMMAND, table, body)
    write_csv(folder, f"{NAME}-turning", turning.csv_table(own))
    figures.save(figure_of(runs, ships), folder / "figures" / f"{NAME}.png")
    figures.save(turning.figure_of(*turned), folder / "figures" / f"{NAME}-turning.png")
