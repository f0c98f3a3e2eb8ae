"""The page on the positioning system: every number from :mod:`.runs`."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import markdown, write_table
from shaftline.plant.replay import simulate_recording

from .runs import KEYS, POSITION, PUBLISHED, STICTION, Recordings, rig

NAME, TITLE = "emps", "Electro-mechanical positioning system: a real drive's numbers found"
COMMAND = "python -m reproductions emps --out docs/results --recordings FOLDER"

INTRODUCTION = """\
A motor and a screw push a carriage: mass, viscous and Coulomb friction, an offset of the force. Two
recordings of 24.84 s at 1 kHz, force and raw encoder, taken in closed loop (Janot, Gautier & Brunot,
nonlinearbenchmark.org); they are not kept here. `estimation` is fitted, `validation` never shown.

```
shaftline identify estimation.csv --ship emps.toml --columns columns.toml --hold-out validation.csv \\
    --free {keys} \\
    --out out/emps
```

[The ship's file and the column map](../../studies/emps/emps.toml) hold rough numbers on purpose; *far
off* begins still farther away (mass 60, friction 300 and 30). Rows are dropped without a filter for 200
and 50 Hz. Nobody gives the speed below which friction sticks, so three are tried. All errors are of
the 1 kHz recordings simulated open loop from the force alone, without any feedback of the position."""

COMES_TO = """\
- **Numbers.** All {count} runs lie within {mass:.1f} % (mass), {viscous:.1f} % (viscous friction) and
  {coulomb:.1f} % (Coulomb friction) of the published ones; the target is 4 %. Offset {offset_low:.2f} to
  {offset_high:.2f} N; published 3.2.
- **Velocity** on validation {velocity_low:.1f} to {velocity_high:.1f} %; target 8 %, published numbers
  {velocity_published:.1f}.
- **Position** on validation {position_low:.1f} to {position_high:.1f} mm, and {estimation_low:.1f} to
  {estimation_high:.1f} on estimation: **the target, 5.0, is missed**, and the published numbers, with
  {position_published:.1f}, carry farther. Errors of the position add up the force's over 25 s: of one
  standard error of the offset, {offset_error:.2f} N, they move by several millimetres, so the recording
  does not tell them better than that. The least position error itself is no way out: refitted to it, the
  four numbers leave {refit:.1f} mm on validation and lie {refit_mass:.0f} to {refit_coulomb:.0f} % off,
  for mass and friction then make up for what the law of friction lacks.
- **What made the difference.** The force is drawn as a line between rows where that fits better (at
  200 and 50 Hz; held, it would be late by half an interval, which looks like friction). Frequencies
  that tell next to nothing of the numbers are left out (here above 3 to 4 Hz, whatever the rate):
  there, what the law of friction lacks draws Coulomb friction down. And Coulomb friction is not in the
  coordinates in which both are compared: a noisy speed about 0 would make a force of it."""


NAMED = """\
The ship's file has the published numbers, but no Coulomb friction and no offset, or no friction at all:
`shaftline diagnose estimation.csv --ship … --columns columns.toml --hold-out validation.csv`. Rows are
dropped as they are (*raw*), or behind a zero-phase low-pass at 0.4 times the rate that is kept, at most
40 Hz (*filtered*). On validation the corrected ship's velocity is {low:.1f} to {high:.1f} % off."""


def write(
    folder: Path, found: pd.DataFrame, known: pd.DataFrame, named: pd.DataFrame, runs: Recordings
) -> None:
    """Write ``emps.md``, ``emps.csv`` and ``figures/emps.png``.

    Args:
        folder: to write into.
        found: from :func:`.runs.identified`.
        known: from :func:`.runs.yardsticks`.
        named: from :func:`.diagnosed.diagnosed`.
        runs: both recordings.
    """
    write_table(folder, NAME, TITLE, COMMAND, found, body(found, known, named))
    figures.save(drawn(found, runs), folder / "figures" / f"{NAME}.png")


def body(found: pd.DataFrame, known: pd.DataFrame, named: pd.DataFrame) -> str:
    """The page below its title."""
    return "\n\n".join(
        [
            INTRODUCTION.format(keys=",\\\n".join(KEYS)),
            f"![Positions and their errors](figures/{NAME}.png)",
            "## What others reach\n\nIn this simulator, friction sticking below 0.001 m/s.",
            markdown(_rounded(known)),
            "## What identify finds",
            markdown(_rounded(found)),
            "## What it comes to",
            COMES_TO.format(**_summed(found, known)),
            "## What diagnose names",
            NAMED.format(
                low=named["validation_velocity_percent"].min(),
                high=named["validation_velocity_percent"].max(),
            ),
            markdown(_rounded(named)),
        ]
    )


def _rounded(table: pd.DataFrame) -> pd.DataFrame:
    shown = table[[c for c in table.columns if not c.startswith("se_")]].copy()
    if "stiction_m_s" in shown:
        shown["stiction_m_s"] = [f"{v:g}" for v in shown["stiction_m_s"]]
    return shown


def _summed(found: pd.DataFrame, known: pd.DataFrame) -> dict[str, float]:
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


def drawn(found: pd.DataFrame, runs: Recordings) -> Figure:
    """Position on validation, and its error with the published and with the identified numbers."""
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
    below.set_ylabel("its error [mm]")
    below.set_xlabel("time [s]")
    above.legend(fontsize=8)
    below.legend(fontsize=8)
    return figure
