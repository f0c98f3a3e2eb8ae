"""The choice among fitted models."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from shaftline.mismatch.structure.choice import Ranked, chosen, total
from shaftline.mismatch.structure.model import Model


def _ranked(labels: str, *held: float, merit: float = 0.0) -> Ranked:
    """A model whose effects are letters, of one value each."""
    model = SimpleNamespace(labels=frozenset(labels), size=len(labels))
    errors = np.array(held)
    return Ranked(cast(Model, model), merit, errors, errors)


def test_the_simplest_within_five_percent_of_the_best_is_chosen() -> None:
    large, small, poor = _ranked("abc", 1.0, merit=9.0), _ranked("d", 1.04), _ranked("", 1.3)
    best, alike = chosen([large, small, poor], np.array([10.0]))
    assert best is small
    assert alike == []
    twin = _ranked("e", 1.02)
    best, alike = chosen([large, small, twin, poor], np.array([10.0]))
    assert (best, alike) == (small, [twin])


def test_what_the_fitted_data_prefer_and_the_others_do_not_stays_open() -> None:
    other, preferred = _ranked("a", 1.0), _ranked("b", 1.15, merit=20.0)
    best, alike = chosen([preferred, other], np.array([10.0]))
    assert (best, alike) == (preferred, [other])
    worse_in_both = _ranked("b", 1.15, merit=-11.0)
    assert chosen([other, worse_in_both], np.array([10.0])) == (other, [])
    hardly_worse = _ranked("b", 1.15, merit=-9.0)
    assert chosen([other, hardly_worse], np.array([10.0])) == (other, [hardly_worse])
    assert chosen([other, _ranked("b", 1.25, merit=20.0)], np.array([10.0])) == (other, [])


def test_a_model_that_follows_a_channel_worse_than_the_file_is_left_out() -> None:
    better_in_one, honest = _ranked("a", 0.1, 3.0), _ranked("b", 0.9, 0.9)
    assert chosen([better_in_one, honest], np.array([1.0, 1.0]))[0] is honest


def test_every_channel_has_to_come_near_the_best() -> None:
    """In waves three channels are noise whatever the model; the fourth tells."""
    told, plain = _ranked("a", 1.0, 1.0, 1.0, 1.0, merit=9.0), _ranked("", 1.0, 1.0, 1.0, 1.12)
    assert chosen([told, plain], np.full(4, 2.0))[0] is told
    assert chosen([told, _ranked("", 1.04, 1.04, 1.04, 1.04)], np.full(4, 2.0))[0].model.size == 0


def test_the_error_of_several_channels_is_their_geometric_mean() -> None:
    assert total(np.array([2.0, 8.0]), np.array([1.0, 1.0])) == pytest.approx(4.0)
    assert total(np.array([np.inf, 1.0]), np.array([1.0, 1.0])) == np.inf


def test_an_effect_that_does_not_pay_its_price_is_left_out_however_well_it_does() -> None:
    part, whole = _ranked("a", 1.0, merit=50.0), _ranked("ab", 0.5, merit=49.0)
    assert chosen([part, whole], np.array([9.0]))[0] is part
    assert chosen([part, _ranked("ab", 0.5, merit=51.0)], np.array([9.0]))[0].model.size == 2
