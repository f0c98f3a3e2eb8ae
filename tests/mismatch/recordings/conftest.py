from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch import Recording, load_recording
from shaftline.plant import Ship

from .trials import voyage

Load = Callable[..., Recording]


@pytest.fixture(scope="session")
def calm(frigate: Ship) -> pd.DataFrame:
    return voyage(frigate)


@pytest.fixture
def load(frigate: Ship, tmp_path: Path) -> Load:
    """Write a table, and a column map, and load them."""

    def through_files(table: pd.DataFrame, columns: str = "", ship: Ship = frigate) -> Recording:
        table.to_csv(tmp_path / "r.csv", index=False)
        (tmp_path / "map.toml").write_text(columns)
        return load_recording(tmp_path / "r.csv", ship, tmp_path / "map.toml" if columns else None)

    return through_files
