from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant.cavitation import burrill_limit, burrill_ratio


@pytest.mark.parametrize(
    ("sigma", "limit"), [(0.1, 0.0615), (0.2, 0.1020), (0.5, 0.1821), (1.0, 0.2752), (2.0, 0.4121)]
)
def test_limit_is_the_line_of_five_percent(sigma: float, limit: float) -> None:
    """0.28 (sigma - 0.03)^0.57, by hand."""
    assert burrill_limit(sigma) == pytest.approx(limit, abs=6e-5)
    assert burrill_limit(sigma) == pytest.approx(0.28 * (sigma - 0.03) ** 0.57, rel=1e-14)


def test_limit_is_held_outside_the_chart() -> None:
    assert burrill_limit(0.05) == burrill_limit(0.1) < burrill_limit(0.11)
    assert burrill_limit(9.0) == burrill_limit(2.0) > burrill_limit(1.99)


def test_ratio_by_hand(plant: Any) -> None:
    square = 8.0**2 + (0.7 * math.pi * 2.0 * 4.2) ** 2
    dynamic = 0.5 * 1025 * square
    area = 0.9 * math.pi / 4 * 4.2**2 * (1.067 - 0.229 * 1.2)
    sigma = (101325 - 1671 + 1025 * 9.81 * 4.0) / dynamic
    expected = 2e5 / (dynamic * area) / (0.28 * (sigma - 0.03) ** 0.57)
    found = burrill_ratio(plant, 2e5, 8.0, 4.0 * math.pi, 1.2, 4.0)
    assert found == pytest.approx(expected, rel=1e-12)


def test_more_thrust_or_less_depth_cavitates_more(plant: Any) -> None:
    shallow, deep = (burrill_ratio(plant, 2e5, 8.0, 12.0, 1.2, h) for h in (1.0, 8.0))
    assert shallow > deep > 0.0
    assert burrill_ratio(plant, 4e5, 8.0, 12.0, 1.2, 8.0) == pytest.approx(2.0 * deep)
    assert np.isfinite(burrill_ratio(plant, 1e7, 0.0, 0.5, 1.4, -30.0))


def test_no_thrust_or_no_motion_does_not_cavitate(plant: Any) -> None:
    assert burrill_ratio(plant, 0.0, 8.0, 12.0, 1.0, 4.0) == 0.0
    assert burrill_ratio(plant, -1e5, 5.0, 10.0, 1.0, 4.0) == 0.0
    assert burrill_ratio(plant, 1.0, 5.0, 10.0, 1.0, 4.0) > 0.0
    assert burrill_ratio(plant, 1e5, 0.0, 0.0, 1.0, 4.0) == 0.0
    assert burrill_ratio(plant, 1e5, 0.01, 0.0, 1.0, 4.0) > 0.0
    assert burrill_ratio(plant, 1e5, 0.0, 0.01, 1.0, 4.0) > 0.0
