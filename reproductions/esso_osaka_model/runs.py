"""Diagnose the surge of a free-running tanker model on real recordings."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import tomli_w

from shaftline.mismatch import Diagnosis, Options, diagnose, identify, load_recording
from shaftline.mismatch.estimate import Tick, ignore_progress
from shaftline.plant import Ship, load_ship
from shaftline.plant.columns import HEADING, RUDDER, SHAFT_SPEED, SWAY_SPEED, TIME, YAW_RATE
from shaftline.plant.replay import simulate_recording

from ..writing import rms

HERE = Path(__file__).parent
SPEED = "ship_speed_m_s"
WIND, WIND_ACROSS = "head_wind", "side_wind"

EVERY = 4
"""One row in so many of 10 Hz is kept for the manoeuvring ship, which needs 10 s for a length."""

HELD_OUT = ("random_06-Aug-2020_16_24_25_6", "turn_14-Sep-2020_15_58_08")
"""Held-out runs: one with reversals in the strongest wind, one turn."""

FREE = ("hull.resistance_coefficient_N_s2_m2", "hull.thrust_deduction", "hull.wake_fraction")
"""Assumed parameters of the ship file."""


class Found(NamedTuple):
    """A ship and its errors on the recordings."""

    ship: Ship
    errors: dict[str, float]  # rms of the free-running speed by run [m/s]

    def over(self, names: tuple[str, ...]) -> float:
        """Return the root mean square over some runs, equally weighted [m/s]."""
        return rms([self.errors[name] for name in names])


def surge_ship() -> Ship:
    """Return the surge model of the ship file."""
    return load_ship(HERE / "surge.toml")


def canonical(raw: pd.DataFrame, across: bool = False) -> pd.DataFrame:
    """Return a published recording with canonical columns and the wind from ahead, or also across."""
    wind, comes_from = raw["wind_velo_relative_mid [m/s]"], raw["wind_dir_relative_mid [rad]"]
    aside = {WIND_ACROSS: -wind * np.sin(comes_from)} if across else {}
    return pd.DataFrame(
        {
            TIME: raw["t [s]"] - raw["t [s]"].iloc[0],
            SHAFT_SPEED: 2.0 * math.pi * raw["n_prop [rps]"],
            SPEED: raw["u_velo [m/s]"],
            SWAY_SPEED: raw["vm_velo [m/s]"],
            YAW_RATE: raw["r_angvelo [rad/s]"],
            HEADING: np.unwrap(raw["psi_hat [rad]"]),
            RUDDER: raw["delta_rudder [rad]"],
            WIND: wind * np.cos(comes_from),
            **aside,
        }
    )


class Recordings:
    """Temporary files of the runs of a folder with canonical columns; a context manager.

    With ``across`` they have the cross wind for the manoeuvring ship, and one row in :data:`EVERY`,
    because this ship is slower to simulate.

    Raises:
        FileNotFoundError: a held-out run is missing.
    """

    def __init__(self, folder: Path, across: bool = False) -> None:
        files = sorted(folder.glob("*.csv"))
        if lacking := [name for name in HELD_OUT if folder / f"{name}.csv" not in files]:
            raise FileNotFoundError(f"{folder}: {lacking[0]}.csv is missing")
        self._scratch = tempfile.TemporaryDirectory()
        scratch = Path(self._scratch.name)
        self.paths = {file.stem: scratch / file.name for file in files}
        for file in files:
            table = canonical(pd.read_csv(file), across).iloc[:: EVERY if across else 1]
            table.to_csv(self.paths[file.stem], index=False)
        self.columns = scratch / "columns.toml"
        names = (WIND, WIND_ACROSS) if across else (WIND,)
        signals = {name: {"signal": name, "unit": "m/s"} for name in names}
        self.columns.write_text(tomli_w.dumps({"signals": signals}))

    def __enter__(self) -> Recordings:
        """Return the recordings."""
        return self

    def __exit__(self, *_: object) -> None:
        """Delete the files."""
        self._scratch.cleanup()

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the fitted runs."""
        return tuple(name for name in self.paths if name not in HELD_OUT)

    def tables(self, ship: Ship) -> Mapping[str, pd.DataFrame]:
        """Return the tables that a diagnosis of a ship loads."""
        return {n: load_recording(p, ship, self.columns).table for n, p in self.paths.items()}

    def evaluate(self, ship: Ship) -> Found:
        """Return a ship with its errors."""
        tables = self.tables(ship).items()
        return Found(
            ship, {n: rms(simulate_recording(ship, t)[SPEED] - t[SPEED]) for n, t in tables}
        )


def identify_surge(runs: Recordings, tick: Tick = ignore_progress) -> Found:
    """Identify the assumed parameters on the fitted runs, without new physics."""
    paths = [runs.paths[name] for name in runs.fitted]
    free = FREE[:2]  # the wake is not identifiable while the physics of turns is missing
    found = identify(surge_ship(), *paths, free=free, columns=runs.columns, tick=tick)
    return runs.evaluate(found.identified)


def diagnose_surge(
    runs: Recordings,
    free: tuple[str, ...] = (),
    most: int | None = None,
    tick: Tick = ignore_progress,
) -> tuple[Diagnosis, Found]:
    """Diagnose the ship file on the fitted runs, and evaluate it on all.

    ``free`` parameters get wide tolerances; ``most`` is the largest number of effects.
    """
    options = Options(columns=runs.columns, free=free, most_effects=most, quick=True)
    fitted, held = ([runs.paths[name] for name in some] for some in (runs.fitted, HELD_OUT))
    said = diagnose(surge_ship(), *fitted, hold_out=held, options=options, tick=tick)
    return said, runs.evaluate(said.corrected)
