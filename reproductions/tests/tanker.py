"""The tanker's model with an open-water table of ours, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from reproductions.kvlcc2.runs import ship_of
from shaftline.plant import Ship

OMEGA = 64.2738


def tanker(folder: Path) -> Ship:
    """KT and KQ are straight lines over J."""
    j = np.linspace(0.0, 0.9, 10)
    table = pd.DataFrame({"J": j, "Kt": 0.32 - 0.35 * j, "10Kq": 0.37 - 0.35 * j})
    table.to_csv(folder / "open_water.csv", index=False)
    return ship_of(folder)
