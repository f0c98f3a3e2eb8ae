"""Page of the positioning system EMPS: identification and diagnosis of a real drive.

Run ``python -m reproductions emps --recordings FOLDER --out docs/results``; takes about four minutes.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import write_table
from shaftline.plant.replay import simulate_recording

from ..pages import fill_template, make_parser
from . import runs as emps
from .runs import KEYS, POSITION, PUBLISHED, STICTION, Recordings, rig

NAME, TITLE = "emps", "EMPS: friction and mass of a real positioning system"
COMMAND = "python -m reproductions emps --out docs/results --recordings FOLDER"


def main() -> None:
    """Identify, diagnose, evaluate, and write ``emps.md``, its table and its figure."""
    parser = make_parser(
        "emps", __doc__, "out/emps", recordings="folder of estimation.csv and validation.csv"
    )
    options = parser.parse_args()
    runs = emps.load_runs(options.recordings)

    def tick(stage: str, done: int, whole: int) -> None:
        print(f"{stage}: {done} of {whole}", flush=True)

    found, named = emps.identify_all(runs, tick), emps.diagnose_all(runs, tick)
    write(options.out, found, emps.references(runs), named, runs)
    print(f"page: {options.out / f'{NAME}.md'}")


def write(
    folder: Path, found: pd.DataFrame, known: pd.DataFrame, named: pd.DataFrame, runs: Recordings
) -> None:
    """Write ``emps.md``, ``emps.csv`` and ``figures/emps.png``."""
    body = fill_template(
        Path(__file__).with_name("page.md"), keys=",\\\n".join(KEYS), known=_rounded(known),
        found=_rounded(found), named=named, n=summary(found, known),
    )  # fmt: skip
    write_table(folder, NAME, TITLE, COMMAND, found, body)
    figures.save(figure_of(found, runs), folder / "figures" / f"{NAME}.png")


def _rounded(table: pd.DataFrame) -> pd.DataFrame:
    shown = table[[c for c in table.columns if not c.startswith("se_")]].copy()
    if "stiction_m_s" in shown:
        shown["stiction_m_s"] = [f"{v:g}" for v in shown["stiction_m_s"]]
    return shown


def summary(found: pd.DataFrame, known: pd.DataFrame) -> dict[str, float]:
    """Return the numbers of the page's conclusions by name."""
    off = found[[c for c in found.columns if c.endswith("off_percent")]].abs().max()
    published = known[known["numbers"] == "published"].iloc[0]
    refit = known[known["numbers"] == "least position error on estimation"].iloc[0]
    summed = {
        "count": len(found),
        "mass": off["mass_kg_off_percent"],
        "viscous": off["viscous_N_s_m_off_percent"],
        "coulomb": off["coulomb_N_off_percent"],
        "velocity_published": published["validation_velocity_percent"],
        "position_published": published["validation_mm"],
        "offset_error": found["se_offset_N"].median(),
        "refit": refit["validation_mm"],
        "refit_mass": abs(refit["mass_kg_off_percent"]),
        "refit_coulomb": abs(refit["coulomb_N_off_percent"]),
    }
    for name, column in (
        ("offset", "offset_N"),
        ("velocity", "validation_velocity_percent"),
        ("position", "validation_mm"),
        ("estimation", "estimation_mm"),
    ):
        summed |= {f"{name}_low": found[column].min(), f"{name}_high": found[column].max()}
    return summed


def figure_of(found: pd.DataFrame, runs: Recordings) -> Figure:
    """Draw the position on validation, and its error with published and identified parameters."""
    figure, axes = figures.new_figure(2, 1, (9.5, 5.2))
    above, below = axes[0][0], axes[1][0]
    recording = runs.validation
    time = recording["time_s"]
    above.plot(time, recording[POSITION], color=figures.TRUTH, label="measured")
    ships = {"published": rig().with_values(PUBLISHED)}
    for rate, some in found.groupby("rate_Hz", sort=False):
        row = some.iloc[0]
        columns = ("mass_kg", "viscous_N_s_m", "coulomb_N", "offset_N")
        values = {key: row[c] for key, c in zip(KEYS, columns, strict=True)}
        ships[f"identified at {rate} Hz"] = rig().with_values(
            {**values, STICTION: row["stiction_m_s"]}
        )
    for label, ship in ships.items():
        position = simulate_recording(ship, recording)[POSITION]
        above.plot(time, position, linewidth=0.8, label=label)
        below.plot(time, 1e3 * (position - recording[POSITION]), linewidth=0.9, label=label)
    above.set_ylabel("position [m]")
    below.set_ylabel("position error [mm]")
    below.set_xlabel("time [s]")
    above.legend(fontsize=8)
    below.legend(fontsize=8)
    return figure
