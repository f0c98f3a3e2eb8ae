"""What no recording could mend is refused before any is read."""

from __future__ import annotations

import math

import pytest

from shaftline.mismatch import Options
from shaftline.plant import Ship


@pytest.mark.parametrize("tolerance", [0.0, 1.0, 8.0])
def test_a_tolerance_is_a_factor(frigate: Ship, tolerance: float) -> None:
    Options(tolerance=tolerance).check(frigate)
    Options(exclude=("hull-fouling",)).check(frigate)
    assert Options() == Options(None, (), 1.0)


@pytest.mark.parametrize("tolerance", [-0.1, math.nan, math.inf])
def test_another_is_refused(frigate: Ship, tolerance: float) -> None:
    with pytest.raises(ValueError, match=f"tolerance = {tolerance:g}: the factor on"):
        Options(tolerance=tolerance).check(frigate)


def test_an_unknown_id_is_refused(frigate: Ship) -> None:
    with pytest.raises(ValueError, match=r"unknown effect 'rust'; known: .*hull-fouling"):
        Options(exclude=("hull-fouling", "rust")).check(frigate)
