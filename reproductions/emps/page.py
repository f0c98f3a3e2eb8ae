"""Page of the positioning system EMPS: identification and diagnosis of a real drive.

Run ``python -m reproductions emps --recordings FOLDER --out docs/results``; takes about four minutes.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from shaftline.plant.replay import simulate_recording

from ..pages import make_parser
from ..writing import Line, Panel, against_measured, draw, write_results
from . import runs as emps
from .runs import KEYS, NAMES, POSITION, PUBLISHED, STICTION, Recordings, rig

TITLE = "EMPS: friction and mass of a real positioning system"


def main() -> None:
    """Identify, diagnose, evaluate, and write ``emps.md``, its table and its figure."""
    parser = make_parser(
        "emps", __doc__, "out/emps", recordings="folder of estimation.csv and validation.csv"
    )
    options = parser.parse_args()
    runs = emps.load_runs(options.recordings)
    found, named = emps.identify_all(runs), emps.diagnose_all(runs)
    write(options.out, found, emps.references(runs), named, runs)


def write(
    folder: Path, found: pd.DataFrame, known: pd.DataFrame, named: pd.DataFrame, runs: Recordings
) -> None:
    """Write ``emps.md``, ``emps.csv`` and ``figures/emps.png``."""
    shown = found[[c for c in found.columns if not c.startswith("se_")]]
    shown = shown.assign(stiction_m_s=[f"{v:g}" for v in found["stiction_m_s"]])
    numbers = known.set_index("numbers")
    refit = numbers.loc["least position error on estimation"]
    write_results(
        __file__,
        folder,
        TITLE,
        found,
        {"": figure_of(found, runs)},
        "--recordings FOLDER",
        keys=",\\\n".join(KEYS),
        known=known,
        shown=shown,
        named=named,
        found=found,
        refit=refit,
        published=numbers.loc["published"],
    )


def figure_of(found: pd.DataFrame, runs: Recordings) -> Figure:
    """Draw the position on validation, and its error with published and identified parameters."""
    recording = runs.validation
    time, measured = recording["time_s"], recording[POSITION]
    ships = {"published": rig().with_values(PUBLISHED)}
    for rate, some in found.groupby("rate_Hz", sort=False):
        row = some.iloc[0]
        values = {key: row[column] for key, column in NAMES.items()}
        values[STICTION] = row["stiction_m_s"]
        ships[f"identified at {rate} Hz"] = rig().with_values(values)
    positions = {what: simulate_recording(one, recording)[POSITION] for what, one in ships.items()}
    lines = against_measured(time, measured, positions)
    errors = [Line(time, 1e3 * (line.y - measured), line.label, line.color) for line in lines[1:]]
    panels = [
        Panel(lines, {"ylabel": "position [m]"}, 1),
        Panel(errors, {"ylabel": "position error [mm]"}, 1),
    ]
    return draw(panels, (9.5, 5.2), xlabel="time [s]")
