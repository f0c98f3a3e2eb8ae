"""A number with its unit, bounds and errors."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shaftline.mismatch import Estimate
from shaftline.plant import Ship, ShipError

FRICTION = "transmission.coulomb_friction_engine_side_N_m"


def test_the_ship_says_unit_bounds_and_what_changes_nothing(frigate: Ship) -> None:
    found = Estimate.of(frigate.with_values({FRICTION: 500.0}), FRICTION, 8000.0, 100.0)
    assert found == Estimate(FRICTION, 8000.0, "N m", (0.0, 1e7), 500.0, 100.0, 0.0)
    assert found.name == "coulomb_friction_engine_side_N_m"
    other = Estimate.of(frigate, FRICTION, 8000.0, 100.0, neutral=1.0, form_error=3.0)
    assert (other.neutral, other.form_error) == (1.0, 3.0)
    with pytest.raises(ShipError, match=r"hull\.colour is not a known key"):
        Estimate.of(frigate, "hull.colour", 1.0, 0.1)


def test_the_interval_is_1_96_standard_errors_and_the_form_s(frigate: Ship) -> None:
    assert Estimate.of(frigate, FRICTION, 8000.0, 100.0).ci95 == pytest.approx((7804.0, 8196.0))
    both = Estimate.of(frigate, FRICTION, 8000.0, 100.0 * 3.0 / 1.96, form_error=400.0)
    assert both.ci95 == pytest.approx((7500.0, 8500.0))  # in quadrature


def test_the_interval_ends_at_the_bounds() -> None:
    share = Estimate("prime_mover.braking_loss_fraction", 0.97, "-", (0.0, 1.0), 0.0, 0.1)
    assert share.ci95 == pytest.approx((0.774, 1.0))
    assert replace(share, value=0.1).ci95 == pytest.approx((0.0, 0.296))
    assert replace(share, value=1.2).ci95 == pytest.approx((1.004, 1.2))  # beyond them already


def test_as_data_it_is_value_and_interval(frigate: Ship) -> None:
    found = Estimate.of(frigate, FRICTION, 8000.0, 100.0).to_dict()
    ends = [8000.0 - 196.0, 8000.0 + 196.0]
    assert found == {"value": 8000.0, "ci95": ends, "key": FRICTION, "se": 100.0}


def test_an_error_known_from_little_has_a_wider_interval() -> None:
    sure = Estimate("hull.mass_kg", 10.0, "kg", (-1e3, 1e9), 9.0, 1.0)
    assert sure.ci95 == pytest.approx((8.04, 11.96))
    for freedom, half in ((1.0, 12.706), (8.0, 2.306), (30.0, 2.042), (1e9, 1.96)):
        ends = replace(sure, freedom=freedom).ci95
        assert ends == pytest.approx((10.0 - half, 10.0 + half), abs=2e-3)
