"""Fixtures that many tests share."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import settings

from shaftline.plant import Equilibrium, Ship, equilibrium, get_sea, load_ship, realise

# the same examples at every run, and no time limit on a noisy machine
settings.register_profile("shaftline", deadline=None, derandomize=True, max_examples=25)
settings.load_profile("shaftline")


@pytest.fixture(scope="session")
def frigate() -> Ship:
    return load_ship("frigate")


@pytest.fixture(scope="session")
def design_point(frigate: Ship) -> Equilibrium:
    """The thesis's base case: X = 22 mm, P/D = 1.4."""
    return equilibrium(frigate, 22.0, 1.4)


@pytest.fixture(scope="session")
def thesis_sea() -> Any:
    """One realisation of the thesis's sea; `simulate` works on a copy of it."""
    sea = get_sea("thesis")
    assert sea is not None
    return realise(sea, depth_m=4.0, seed=7)
