"""The choice among fitted models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shaftline.mismatch.structure.choice import Ranked, chosen, total


def _ranked(size: int, *held: float) -> Ranked:
    class Sized:
        def __init__(self) -> None:
            self.size = size

    errors = np.array(held)
    return Ranked(Sized(), -float(size), errors, errors)  # type: ignore[arg-type]


def test_the_simplest_within_five_percent_of_the_best_is_chosen() -> None:
    large, small, poor = _ranked(3, 1.0), _ranked(1, 1.04), _ranked(0, 1.2)
    best, alike = chosen([large, small, poor], np.array([10.0]))
    assert best is small
    assert alike == []
    twin = _ranked(1, 1.02)
    best, alike = chosen([large, small, twin, poor], np.array([10.0]))
    assert (best, alike) == (small, [twin])


def test_what_the_fitted_data_prefer_and_the_others_do_not_stays_open() -> None:
    other, preferred = _ranked(1, 1.0), replace(_ranked(1, 1.15), merit=20.0)
    best, alike = chosen([preferred, other], np.array([10.0]))
    assert (best, alike) == (preferred, [other])
    worse_in_both = _ranked(1, 1.15)
    assert chosen([other, worse_in_both], np.array([10.0])) == (other, [])


def test_a_model_that_follows_a_channel_worse_than_the_file_is_left_out() -> None:
    better_in_one, honest = _ranked(1, 0.1, 3.0), _ranked(1, 0.9, 0.9)
    assert chosen([better_in_one, honest], np.array([1.0, 1.0]))[0] is honest


def test_the_error_of_several_channels_is_their_geometric_mean() -> None:
    assert total(np.array([2.0, 8.0]), np.array([1.0, 1.0])) == pytest.approx(4.0)
    assert total(np.array([np.inf, 1.0]), np.array([1.0, 1.0])) == np.inf
