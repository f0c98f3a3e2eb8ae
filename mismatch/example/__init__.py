"""Provide an example recording with its column map and its ship file.

The recording has the format of a ship logger. The independent simulator, which shares no equations with
the ship model, computed it (:mod:`shaftline.validation.example`).
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

FOLDER = Path(__file__).parent
RECORDING, COLUMN_MAP, SHIP_FILE = "voyage.csv", "columns.toml", "ship.toml"
CONCEALED = "concealed.json"
"""File with the size of each effect that the ship file does not have; a diagnosis never reads it."""


def copy_example(folder: str | Path) -> tuple[Path, Path, Path]:
    """Copy the example files to a folder; return the paths of recording, column map and ship file.

    Args:
        folder: target folder, which is created if it does not exist.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / name for name in (RECORDING, COLUMN_MAP, SHIP_FILE)]
    for path in paths:
        shutil.copyfile(FOLDER / path.name, path)
    return paths[0], paths[1], paths[2]


def concealed() -> str:
    """Return the effects that are concealed in the recording and their sizes, as text.

    Example:
        >>> concealed()
        'hull-fouling of 0.1343, pitch-actuator-offset of 0.00595'
    """
    sizes = json.loads((FOLDER / CONCEALED).read_text(encoding="utf-8"))
    return ", ".join(f"{name} of {size:.4g}" for name, size in sizes.items())
