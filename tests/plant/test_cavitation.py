from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Ship
from shaftline.plant.cavitation import (
    burrill_limit,
    burrill_ratio,
    effective_attack,
    outside_bucket,
)


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


def test_angle_of_attack_by_hand(frigate: Ship) -> None:
    """P/D 1.2 at J = 0.8: arctan(1.2 / 2.1991) - arctan(0.8 / 2.1991)."""
    plant = frigate.record()
    shaft_speed = 2.0 * math.pi * 1.5
    found = effective_attack(plant, 0.8 * 1.5 * 4.2, shaft_speed, 1.2)
    assert found == pytest.approx(28.62021 - 19.99055, abs=2e-4)
    plant["attack_pitch_factor"], plant["attack_inflow_factor"] = 1.1, 1.2
    found = effective_attack(plant, 0.8 * 1.5 * 4.2, shaft_speed, 1.2)
    assert found == pytest.approx(1.1 * 28.62021 - 23.58321, abs=2e-4)
    assert effective_attack(plant, 5.0, 0.0, 1.2) == 0.0


@pytest.mark.parametrize(
    ("attack", "outside"), [(3.0, 0.0), (6.9, 0.0), (7.5, 0.5), (1.1, 0.0), (0.5, 0.5)]
)
def test_the_bucket_widens_with_the_cavitation_number(
    frigate: Ship, attack: float, outside: float
) -> None:
    """At 1.5 rev/s and 4 m deep sigma_n is 6.8647; the widths make 4 deg and 2 deg of it."""
    sigma = (101325.0 - 1671.0 + 1025.0 * 9.81 * 4.0) / (0.5 * 1025.0 * (1.5 * 4.2) ** 2)
    plant = frigate.with_values(
        {
            "cavitation_bucket.centre_deg": 3.0,
            "cavitation_bucket.suction_deg": 4.0 / sigma,
            "cavitation_bucket.pressure_deg": 2.0 / sigma,
        }
    ).record()
    turning = 2.0 * math.pi * 1.5
    assert outside_bucket(plant, attack, turning, 4.0) == pytest.approx(outside, abs=1e-9)
    assert outside_bucket(frigate.record(), attack, turning, 4.0) == 0.0
    if outside:  # a faster shaft narrows it
        assert outside_bucket(plant, attack, 1.5 * turning, 4.0) > outside
