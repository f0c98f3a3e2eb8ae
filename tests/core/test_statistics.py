"""Covariances and intervals of estimates."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy

from shaftline.core.statistics import covariance_of, half_95, wilson_interval


def test_the_half_width_is_that_of_student_s_t() -> None:
    for freedom, half in ((1.0, 12.706), (8.0, 2.306), (30.0, 2.042), (math.inf, 1.96)):
        assert half_95(freedom) == pytest.approx(half, abs=1e-3)
    assert half_95(0.1) == half_95(1.0)


def test_wilson_s_interval_is_that_of_scipy() -> None:
    for hits, count in ((5, 10), (0, 10), (7, 7), (1, 1), (3, 4000)):
        there = scipy.stats.binomtest(hits, count).proportion_ci(0.95, "wilson")
        assert wilson_interval(hits, count) == pytest.approx((there.low, there.high), abs=1e-5)
    assert wilson_interval(0, 10)[0] == 0.0
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_the_covariance_does_not_depend_on_the_units_of_the_parameters() -> None:
    """A torque in N m, known to 25 kN m, stands beside a clock error known to 1e-5 rows."""
    rng = np.random.default_rng(5)
    factors = rng.normal(size=(9, 4))
    information = factors.T @ factors
    units = np.array([25e3, 0.1, 1e-5, 1.0])
    found = covariance_of(information / np.outer(units, units))
    expected = np.linalg.inv(information) * np.outer(units, units)
    assert found == pytest.approx(expected, rel=1e-9)
