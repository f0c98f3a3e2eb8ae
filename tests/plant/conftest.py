from __future__ import annotations

from typing import Any

import pytest

from shaftline.plant import Ship


@pytest.fixture
def plant(frigate: Ship) -> Any:
    """The frigate's record, a fresh one to change."""
    return frigate.record()
