"""Errors and correlation from a covariance."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.identification.parameters import MethodResult


def test_errors_and_correlation_are_the_covariances() -> None:
    found = MethodResult(("a", "b"), (1.0, 2.0), np.array([[4.0, -3.0], [-3.0, 9.0]]))
    assert found.standard_errors.tolist() == [2.0, 3.0]
    assert found.correlation == pytest.approx(np.array([[1.0, -0.5], [-0.5, 1.0]]))


def test_a_number_without_error_is_correlated_with_none() -> None:
    found = MethodResult(("a", "b"), (1.0, 2.0), np.array([[0.0, 0.0], [0.0, 9.0]]))
    assert np.isfinite(found.correlation).all()
    assert found.correlation[0, 1] == 0.0


def test_another_model_that_may_be_true_widens_the_errors_by_its_share() -> None:
    one = MethodResult(("a", "b"), (1.0, 2.0), np.diag([1.0, 4.0]))
    two = MethodResult(("a", "b"), (4.0, 2.0), np.diag([9.0, 4.0]))
    assert one.mix_with(two, 0.0) is one
    both = one.mix_with(two, 0.25)
    assert both.values == one.values
    np.testing.assert_allclose(both.covariance, [[0.75 + 0.25 * (9.0 + 9.0), 0.0], [0.0, 4.0]])
    assert np.isinf(one.degrees).all()
