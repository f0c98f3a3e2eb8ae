"""The recordings of the model, and what her surge comes to before and after a diagnosis."""

from __future__ import annotations

import importlib.resources
import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import tomli_w

from shaftline.mismatch import Diagnosis, Options, diagnose, identify, load_recording
from shaftline.mismatch.estimate import Tick, silent
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import RUDDER, SHAFT_SPEED, TIME
from shaftline.plant.replay import simulate_recording

SPEED = "ship_speed_m_s"
WIND, WIND_ACROSS = "head_wind", "side_wind"

EVERY = 4
"""Rows of 10 Hz of which one is kept for a ship that turns: she takes 10 s for a length."""

HELD_OUT = ("random_06-Aug-2020_16_24_25_6", "turn_14-Sep-2020_15_58_08")
"""Runs that nothing is fitted to: one that reverses in the strongest wind, one that turns."""

FREE = ("hull.resistance_coefficient_N_s2_m2", "hull.thrust_deduction", "hull.wake_fraction")
"""Numbers of the file that are assumed."""


class Found(NamedTuple):
    """A ship's surge on the recordings."""

    ship: Ship
    errors: dict[str, float]  # rms of the speed, free-running, by run [m/s]

    def over(self, names: tuple[str, ...]) -> float:
        """Root of the mean of the squares over some runs, all counted alike [m/s]."""
        return float(np.sqrt(np.mean([self.errors[name] ** 2 for name in names])))


def surge_ship() -> Ship:
    """The model's file."""
    return load_ship(str(importlib.resources.files(__package__).joinpath("surge.toml")))


def canonical(raw: pd.DataFrame, across: bool = False) -> pd.DataFrame:
    """A recording of the data set with canonical columns, and the wind from ahead.

    Args:
        raw: as published: positions, velocities, revolutions, rudder, wind as felt on board and where
            it comes from.
        across: whether the wind to starboard is wanted too.
    """
    wind, comes_from = raw["wind_velo_relative_mid [m/s]"], raw["wind_dir_relative_mid [rad]"]
    aside = {WIND_ACROSS: -wind * np.sin(comes_from)} if across else {}
    return pd.DataFrame(
        {
            TIME: raw["t [s]"] - raw["t [s]"].iloc[0],
            SHAFT_SPEED: 2.0 * math.pi * raw["n_prop [rps]"],
            SPEED: raw["u_velo [m/s]"],
            "sway_speed_m_s": raw["vm_velo [m/s]"],
            "yaw_rate_rad_s": raw["r_angvelo [rad/s]"],
            "heading_rad": np.unwrap(raw["psi_hat [rad]"]),
            RUDDER: raw["delta_rudder [rad]"],
            WIND: wind * np.cos(comes_from),
            **aside,
        }
    )


class Recordings:
    """The runs of a folder as files with canonical columns, for as long as it is open.

    Args:
        folder: of the data set's CSV files.
        across: whether they hold the wind across the ship, which only one that turns can use. She is
            slower to sail, so these have one row of :data:`EVERY`.

    Raises:
        FileNotFoundError: no run, or not those that are held out.
    """

    def __init__(self, folder: Path, across: bool = False) -> None:
        files = sorted(folder.glob("*.csv"))
        if lacking := [name for name in HELD_OUT if folder / f"{name}.csv" not in files]:
            raise FileNotFoundError(f"{folder}: no {lacking[0]}.csv")
        self._room = tempfile.TemporaryDirectory()
        room = Path(self._room.name)
        self.paths = {file.stem: room / file.name for file in files}
        for file in files:
            table = canonical(pd.read_csv(file), across).iloc[:: EVERY if across else 1]
            table.to_csv(self.paths[file.stem], index=False)
        self.columns = room / "columns.toml"
        heard = (WIND, WIND_ACROSS) if across else (WIND,)
        signals = {name: {"signal": name, "unit": "m/s"} for name in heard}
        self.columns.write_text(tomli_w.dumps({"signals": signals}))

    def __enter__(self) -> Recordings:
        """The files are there."""
        return self

    def __exit__(self, *_: object) -> None:
        """They are gone."""
        self._room.cleanup()

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the runs that are not held out."""
        return tuple(name for name in self.paths if name not in HELD_OUT)

    def tables(self, ship: Ship) -> Mapping[str, pd.DataFrame]:
        """The runs as a diagnosis of a ship sees them."""
        return {n: load_recording(p, ship, self.columns).table for n, p in self.paths.items()}

    def errors(self, ship: Ship) -> dict[str, float]:
        """Rms error of the ship's speed, free-running from each run's start [m/s]."""
        found = {}
        for name, table in self.tables(ship).items():
            error = simulate_recording(ship, table)[SPEED] - table[SPEED]
            found[name] = float(np.sqrt(np.mean(np.square(error))))
        return found

    def found(self, ship: Ship) -> Found:
        """A ship with her errors."""
        return Found(ship, self.errors(ship))


def nominal(runs: Recordings, tick: Tick = silent) -> Found:
    """The file with its assumed numbers found on the fitted runs: the best of surge alone."""
    paths = [runs.paths[name] for name in runs.fitted]
    free = FREE[:2]  # of the wake they do not tell while the turns are left out
    found = identify(surge_ship(), *paths, free=free, columns=runs.columns, tick=tick)
    return runs.found(found.identified)


def diagnosed(
    runs: Recordings,
    free: tuple[str, ...] = (),
    exclude: tuple[str, ...] = (),
    tick: Tick = silent,
    most: int | None = None,
) -> tuple[Diagnosis, Found]:
    """The file diagnosed on the fitted runs, judged on those held out.

    Args:
        runs: the recordings.
        free: numbers of the file that may move widely.
        exclude: ids that are not tried.
        tick: progress.
        most: effects that are named at most; the search's own number by default.
    """
    options = Options(
        columns=runs.columns, free=free, exclude=exclude, most_effects=most, quick=True
    )
    said = diagnose(
        surge_ship(), *(runs.paths[name] for name in runs.fitted),
        hold_out=[runs.paths[name] for name in HELD_OUT], options=options, tick=tick,
    )  # fmt: skip
    return said, runs.found(said.corrected)
