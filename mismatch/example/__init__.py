"""A recording with its column map and its ship, as a ship's logger would have written it.

It was sailed by equations that the tool does not share (:mod:`shaftline.validation.example`).
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

FOLDER = Path(__file__).parent
RECORDING, COLUMN_MAP, SHIP_FILE = "voyage.csv", "columns.toml", "ship.toml"
CONCEALED = "concealed.json"
"""Size of each effect that the file's ship does not have; never read by the diagnosis."""


def copy_example(folder: str | Path) -> tuple[Path, Path, Path]:
    """The example's files in a folder of the user's: recording, column map, ship.

    Args:
        folder: made where it is missing.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / name for name in (RECORDING, COLUMN_MAP, SHIP_FILE)]
    for path in paths:
        shutil.copyfile(FOLDER / path.name, path)
    return paths[0], paths[1], paths[2]


def concealed() -> str:
    """What is concealed in the recording, in words."""
    sizes = json.loads((FOLDER / CONCEALED).read_text(encoding="utf-8"))
    return ", ".join(f"{name} of {size:.4g}" for name, size in sizes.items())
