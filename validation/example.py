"""Write the example of the package: a case of the validation in the file format of a ship's logger.

The recording comes from the independent simulator, which shares no equations with the package, at two
rows per second. ``python -m shaftline.validation.example`` writes identical files again.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd

from ..core.files import write_json, write_text
from ..mismatch.example import COLUMN_MAP, CONCEALED, FOLDER, RECORDING, SHIP_FILE
from ..plant import load_ship
from ..plant.ship_files import write_ship
from ..plant.surroundings import KNOT
from .cases import draw_case
from .recording import SimulatedCase, simulate_case

SEED, INDEX = 7, 2
EFFECTS = "pitch-actuator-offset/pitch-actuator", "hull-fouling/hull"
"""Seed, index and concealed effects of the case: a harbour programme in a small sea."""

EVERY = 5  # rows; 0.5 s
BEGINS = "2026-05-03 23:54:12.5"  # so that midnight falls into it
_RPM = 30.0 / math.pi
_HEAD = "Propulsion data log;;;;;;\nShip: example frigate;;;;;;\n"
_NAMES = {
    "Time": ("hh:mm:ss", 1, "time_s"),
    "Fuel rack": ("%", 1, "fuel_rack_mm"),
    "Pitch order": ("%", 1, "pitch_ratio_command"),
    "Pitch": ("%", 1, "pitch_ratio"),
    "Shaft speed": ("rpm", 2, "shaft_speed_rad_s"),
    "Shaft torque": ("kN m", 2, "shaft_torque_N_m"),
    "Log": ("kn", 2, "ship_speed_m_s"),
}
"""Name in the file: unit, decimals, canonical column."""


def logger_file(simulated: SimulatedCase) -> str:
    """Return the text of the recording's file."""
    table = simulated.recording.iloc[::EVERY]
    ship = load_ship("frigate").record()
    rack, pitch = float(ship["drive_max"]), float(ship["pitch_ratio_max"])
    stamps = pd.Timestamp(BEGINS) + pd.to_timedelta(table["time_s"], unit="s")
    values = {
        "fuel_rack_mm": 100.0 / rack * table["fuel_rack_mm"],
        "pitch_ratio_command": 100.0 / pitch * table["pitch_ratio_command"],
        "pitch_ratio": 100.0 / pitch * table["pitch_ratio"],
        "shaft_speed_rad_s": _RPM * table["shaft_speed_rad_s"],
        "shaft_torque_N_m": 1e-3 * table["shaft_torque_N_m"],
        "ship_speed_m_s": table["ship_speed_m_s"] / KNOT,
    }
    columns = {"Time": [f"{t:%H:%M:%S}.{t.microsecond // 100000}" for t in stamps]} | {
        name: [f"{v:.{digits}f}" for v in values[column]]
        for name, (_, digits, column) in list(_NAMES.items())[1:]
    }
    columns["Log"][100:102] = ["", ""]  # two values lost, as loggers lose some
    rows = np.array(list(columns.values())).T
    lines = [";".join(_NAMES), ";".join(unit for unit, _, _ in _NAMES.values())]
    lines += [";".join(row).replace(".", ",") for row in rows]
    return _HEAD + "\n".join(lines) + "\n"


def column_map() -> str:
    """Return the text of the column map."""
    units = {"hh:mm:ss": "datetime", "%": "percent of range"}
    lines = [
        "# how the logger's names and units are to be read; see docs/recordings.md",
        "[columns]",
    ]
    for name, (unit, _, column) in _NAMES.items():
        said = f', unit = "{units[unit]}"' if unit in units else ""
        what = f'{{ column = "{column}"{said} }}' if said else f'"{column}"'
        lines.append(f'"{name}" = {what}')
    return "\n".join(lines) + "\n"


def concealed_sizes(simulated: SimulatedCase) -> dict[str, float]:
    """Return the size of each concealed effect in the catalogue's form, by its id."""
    sizes = simulated.truth["equivalents"]
    return {key.split("/")[0]: round(sizes[key]["value"], 5) for key in sorted(sizes)}


def main(folder: Path = FOLDER) -> None:
    """Write the example's files."""
    simulated = simulate_case(draw_case(SEED, INDEX, keys=EFFECTS))
    write_text(folder / RECORDING, logger_file(simulated))
    write_json(folder / CONCEALED, concealed_sizes(simulated))
    write_text(folder / COLUMN_MAP, column_map())
    write_ship(load_ship("frigate"), folder / SHIP_FILE)


if __name__ == "__main__":
    main()
