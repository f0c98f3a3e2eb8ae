"""Page of a tanker model: missing physics of surge, and the manoeuvring ship.

Run ``python -m reproductions esso_osaka_model --recordings FOLDER --out docs/results``; ten minutes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.tables import write_csv
from shaftline.mismatch import Diagnosis
from shaftline.plant.columns import TIME
from shaftline.plant.replay import simulate_recording

from ..pages import make_parser
from ..writing import Panel, against_measured, draw, write_results
from . import runs as surge
from . import turning
from .runs import FREE, HELD_OUT, SPEED, Found, Recordings

TITLE = "Esso Osaka model: missing physics of surge and manoeuvring"
TARGET = 0.025  # target of the error on the held-out runs [m/s]


def main() -> None:
    """Identify, diagnose, evaluate, and write ``esso-osaka-model.md``, its tables and its figures."""
    parser = make_parser(
        "esso_osaka_model", __doc__, "out/esso-osaka-model", recordings="folder of the CSV files"
    )
    options = parser.parse_args()

    def tick(stage: str, done: int, whole: int) -> None:
        print(f"{stage}: {done} of {whole}", flush=True)

    with Recordings(options.recordings) as runs:
        ships = {"ship file": runs.evaluate(surge.surge_ship())}
        ships["identified"] = surge.identify_surge(runs, tick)
        said = {}
        for what, free, most in (
            ("diagnosed", (), None),
            ("diagnosed, parameters free", FREE, None),
            ("five effects", (), 5),
            ("five effects, parameters free", FREE, 5),
        ):
            said[what], ships[what] = surge.diagnose_surge(runs, free, most, tick)
        with Recordings(options.recordings, across=True) as steered:
            write(options.out, runs, ships, said, (steered, turning.simulate_all(steered, tick)))


def table_of(ships: dict[str, Found]) -> pd.DataFrame:
    """Return the rms error of each ship's speed by run [m/s]."""
    names = list(next(iter(ships.values())).errors)
    groups: dict[str, tuple[str, ...]] = {name: (name,) for name in names}
    groups["seven fitted"] = tuple(name for name in names if name not in HELD_OUT)
    groups["two held out"] = HELD_OUT
    return pd.DataFrame(
        {
            "run": what,
            "held out": "yes" if what in HELD_OUT else "",
            **{ship: found.over(group) for ship, found in ships.items()},
        }
        for what, group in groups.items()
    )


def effects_table(diagnoses: dict[str, Diagnosis]) -> pd.DataFrame:
    """Return the identified effects of each diagnosis with their parameters."""
    return pd.DataFrame(
        {
            "diagnosis": what,
            "verdict": said.verdict,
            "effect": finding.effect.label,
            "parameter": own.name,
            "value": f"{own.value:.3g}",
            "95 %": f"{own.ci95[0]:.3g} to {own.ci95[1]:.3g}",
            "unit": own.unit,
        }
        for what, said in diagnoses.items()
        for finding in said.findings
        for own in finding.estimates
    )


def figure_of(runs: Recordings, ships: dict[str, Found]) -> Figure:
    """Draw measured and simulated speed of the held-out runs."""
    panels: list[Panel] = []
    for name in HELD_OUT:
        tables = {what: runs.tables(found.ship)[name] for what, found in ships.items()}
        speeds = {
            what: simulate_recording(ships[what].ship, own)[SPEED] for what, own in tables.items()
        }
        table = tables[next(iter(ships))]
        lines = against_measured(table[TIME], table[SPEED], speeds)
        settings = {"title": f"{name}, held out", "ylabel": "speed ahead [m/s]"}
        panels.append(Panel(lines, settings, 0 if panels else 2))
    return draw(panels, (9.0, 5.6), xlabel="time [s]")


def write(
    folder: Path,
    runs: Recordings,
    ships: dict[str, Found],
    diagnoses: dict[str, Diagnosis],
    turned: tuple[Recordings, turning.Turning],
) -> None:
    """Write ``esso-osaka-model.md``, its tables and its figures."""
    own = turned[1]
    after = pd.Series({what: found.over(HELD_OUT) for what, found in ships.items()})
    inside = pd.Series({what: found.over(runs.fitted) for what, found in ships.items()})
    write_csv(folder, "esso-osaka-model-turning", turning.csv_table(own))
    write_results(
        __file__,
        folder,
        TITLE,
        table_of(ships),
        {"": figure_of(runs, ships), "-turning": turning.figure_of(*turned)},
        "--recordings FOLDER",
        table=table_of(ships),
        after=after,
        inside=inside,
        target=TARGET,
        chosen=inside.idxmin(),
        least=after.idxmin(),
        effects=effects_table(diagnoses),
        turning=turning,
        own=own,
        n=turning.summary(own),
        neutral=np.degrees(own.response.neutral),
        balances=", ".join(f"{b.name} {b.explained:.0%}" for b in own.said.balance_verdicts),
    )
