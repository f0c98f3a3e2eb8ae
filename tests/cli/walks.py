"""Recordings that our own commands write of every ship, and what the walk over all commands expects."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from typer.testing import CliRunner, Result

from reproductions.anti_spin_ships import PARTICULARS
from shaftline.cli.main import app
from shaftline.plant import Ship, equilibrium, linearise, load_ship, ship_names
from shaftline.plant.columns import RUDDER_COMMAND, TIME, drive_column
from shaftline.plant.particulars import Particulars, ship_from_particulars
from shaftline.plant.ship_files import format_value, template, template_names

FOREIGN: dict[str, dict[str, Any]] = {
    "trawler": PARTICULARS["trawler"],
    "harbour-tug": PARTICULARS["harbour-tug"] | {"prime_mover": "electric"},
}
"""Particulars of ships that the package does not contain."""

SHIPS = (*ship_names(), *template_names(), *FOREIGN)
"""Every packaged ship, every template from which ``new-ship`` writes a file, and foreign ships."""

LEVELS = (1.0, 1.15, 0.9, 1.05)
"""Of a staircase, as shares of its mean."""

ROWS_A_LEVEL = 150
TIME_CONSTANTS_A_LEVEL = 10.0
LONGEST_INTERVAL_S = 4.5
"""A recording has at least a row every 5 s."""


def packaged(name: str) -> Ship:
    """Return a ship by the name of a preset, of a template or of a foreign ship."""
    if name in FOREIGN:
        return ship_from_particulars(Particulars(name=name, **FOREIGN[name]))
    return template(name) if name in template_names() else load_ship(name)


def name_of(ship: str, folder: Path) -> str:
    """Return a ship as ``--ship`` takes it; files of other ships are written by ``new-ship``."""
    if ship not in template_names() and ship not in FOREIGN:
        return ship
    file = folder / f"{ship}.toml"
    if not file.exists():
        source: tuple[object, ...] = ("--template", ship)
        if ship in FOREIGN:
            particulars = folder / f"{ship}-particulars.toml"
            keys = {"name": ship} | FOREIGN[ship]
            particulars.write_text("".join(f"{k} = {format_value(v)}\n" for k, v in keys.items()))
            source = ("--from-particulars", particulars)
        done(run("new-ship", *source, "--out", file))
    return str(file)


def run(*arguments: object) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(result: Result, *reasons: str) -> bool:
    """Return whether a command refused, and check that it says one of the reasons.

    Any other exception than the command's own exit is an error of ours.
    """
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    if result.exit_code == 0:
        return False
    assert result.exit_code == 2, result.output
    said = " ".join(result.output.split())
    assert any(re.search(reason, said) for reason in reasons), said
    return True


def done(result: Result) -> None:
    """Check that a command gave a result."""
    assert not refused(result, "^$"), result.output


def programme(ship: Ship, kind: str) -> pd.DataFrame:
    """Return demands that move a ship: a staircase, a sine or noise, in her own time and size."""
    drive, pitch = 0.55 * float(ship.record()["drive_max"]), ship.propeller.pitch_ratio_max
    model = linearise(ship, equilibrium(ship, drive, pitch), ("ship_speed",))
    rates = -np.real(model.poles())
    slowest_s = 1.0 / np.min(rates[rates > 1e-9])
    level_s = TIME_CONSTANTS_A_LEVEL * slowest_s
    level = max(ROWS_A_LEVEL, math.ceil(level_s / LONGEST_INTERVAL_S))
    rows = {"staircase": len(LEVELS) * level, "sine": 4 * level, "noise": 10 * level}[kind]
    row = np.arange(rows)
    shares = {
        "staircase": np.array(LEVELS)[row // level % len(LEVELS)],
        "sine": 1.0 + 0.05 * np.sin(2.0 * np.pi * row / (level // 6)),
        "noise": 1.0 + 0.02 * np.random.default_rng(1).standard_normal(rows),
    }[kind]
    interval_s = float(f"{level_s / level:.3g}")
    table = pd.DataFrame({TIME: row * interval_s, drive_column(ship): drive * shares})
    if ship.has_variable_pitch:
        low = np.where(row // (2 * level) % 2, 0.9, 1.0)
        table["pitch_ratio_command"] = pitch * (low if kind == "staircase" else 1.0)
    if ship.turns:
        table[RUDDER_COMMAND] = 0.0
    return table


class Files:
    """Recordings of every ship as ``simulate`` writes them, each made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def ship(self, name: str) -> str:
        """Return a ship as ``--ship`` takes it."""
        return name_of(name, self.folder)

    def recording(self, name: str, kind: str) -> Path:
        """Return the recording of a ship under a programme."""
        file = self.folder / f"{name}-{kind}.csv"
        if not file.exists():
            demands = self.folder / f"{name}-{kind}-demands.csv"
            programme(load_ship(self.ship(name)), kind).to_csv(
                demands, index=False, float_format="%.10g"
            )
            done(run("simulate", "--ship", self.ship(name), "--inputs", demands, "--out", file))
        return file


def one_key(ship: Ship) -> str:
    """Return the key of a parameter that is identifiable from every recording of a ship."""
    if ship.moves:
        return "hull.resistance_coefficient_N_s2_m2"
    return "transmission.inertia_engine_side_kg_m2"


def numbers_of(report: Any) -> list[float]:
    """Return every number of a report's parameters."""
    return [v for one in report["parameters"].values() for v in (one["value"], one["se"])]
