"""The choice among fitted models."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from shaftline.mismatch.judge.verdict import FORM_SHARE
from shaftline.mismatch.structure.model import Model
from shaftline.mismatch.structure.search import Ranked, choose, parameters_alone, total

BEFORE = np.array([10.0])


def _ranked(
    labels: str, held: float | tuple[float, ...], merit: float = 0.0, place: int = 0
) -> Ranked:
    """Return a model whose effects are letters, of one value each; a capital is a form of two."""
    model = SimpleNamespace(
        labels=frozenset(labels),
        kinds=frozenset(labels.lower()),
        size=sum(1 + letter.isupper() for letter in labels),
    )
    errors = np.atleast_1d(np.array(held, np.float64))
    return Ranked(cast(Model, model), merit, errors, errors, place=place)


def test_the_likeliest_model_is_chosen_on_fitted_and_held_out_data_together() -> None:
    plain, one, other = _ranked("", 3.0, -500.0), _ranked("a", 1.0), _ranked("b", 1.1, -30.0)
    assert choose([one, other, plain], BEFORE) == (one, [])
    held = replace(other, likelihood=45.0)
    assert choose([one, held, plain], BEFORE) == (held, [])


def test_of_equals_the_first_in_the_catalogue_is_reported_and_the_other_beside_it() -> None:
    plain = _ranked("", 3.0, -500.0)
    one, other = _ranked("a", 1.0, 9.0, place=5), _ranked("b", 1.0, 0.0, place=3)
    assert choose([one, other, plain], BEFORE) == (other, [one])
    assert choose([replace(one, merit=11.0), other, plain], BEFORE)[0].place == 5


def test_of_equals_the_one_with_the_fewest_departures_from_the_ship_file_is_reported() -> None:
    """A parameter far from the file counts like an effect, before the order of the catalogue."""
    plain = _ranked("", 3.0, -500.0)
    few = replace(_ranked("a", 1.0, 0.0, place=5), departures=2)
    many = replace(_ranked("b", 1.0, 3.0, place=3), departures=5)
    assert choose([many, few, plain], BEFORE) == (few, [many])
    assert choose([replace(many, merit=11.0), few, plain], BEFORE)[0].departures == 5


def test_what_the_form_of_an_effect_has_wrong_is_no_evidence_of_a_further_one() -> None:
    """The first effect gains 1000, so that its form may leave 22."""
    plain, part = _ranked("", 3.0, -1000.0), _ranked("a", 1.0, 0.0)
    allowed = FORM_SHARE**2 * 1000.0
    for gained, chosen in ((allowed - 1.0, part.model), (allowed + 1.0, None)):
        whole = _ranked("ab", 0.9, gained)
        best, _ = choose([whole, part, plain], BEFORE)
        assert best.model is (chosen or whole.model)


def test_a_form_of_more_values_must_pay_like_a_further_effect() -> None:
    plain, simple = _ranked("", 3.0, -1000.0), _ranked("a", 1.0, 0.0)
    assert choose([_ranked("A", 0.9, 20.0), simple, plain], BEFORE)[0] is simple
    assert choose([_ranked("A", 0.9, 50.0), simple, plain], BEFORE)[0].model.size == 2


def test_an_effect_that_does_not_pay_its_price_is_left_out_however_small_its_error() -> None:
    part, whole, plain = _ranked("a", 1.0, 50.0), _ranked("ab", 0.5, 49.0), _ranked("", 2.0, 45.0)
    assert choose([part, whole, plain], BEFORE)[0] is part
    assert choose([_ranked("a", 0.5, 44.0), plain], BEFORE)[0] is plain


def test_a_model_with_a_far_larger_held_out_error_is_an_alternative_at_most() -> None:
    plain, close = _ranked("", 3.0, -500.0), _ranked("a", 1.0)
    assert choose([_ranked("b", 1.4, 100.0), close, plain], BEFORE)[0].merit == 100.0
    vetoed = _ranked("b", 1.6, 100.0)
    assert choose([vetoed, close, plain], BEFORE) == (close, [vetoed])


def test_a_value_at_the_bound_of_its_search_is_chosen_last() -> None:
    plain, inside = _ranked("", 3.0, -500.0), _ranked("a", 1.0)
    bound = replace(_ranked("b", 1.0, 100.0), at_bound=True)
    assert choose([bound, inside, plain], BEFORE)[0] is inside
    assert choose([bound, plain, _ranked("", 3.0, -501.0)], BEFORE)[0] is plain
    assert choose([bound], BEFORE)[0] is bound


def test_a_model_that_is_worse_than_the_file_in_a_channel_is_left_out() -> None:
    uneven, even = _ranked("a", (0.1, 3.0), 90.0), _ranked("b", (0.9, 0.9), 80.0)
    assert choose([uneven, even], np.array([1.0, 1.0]))[0] is even


def test_the_error_of_several_channels_is_their_geometric_mean() -> None:
    assert total(np.array([2.0, 8.0]), np.array([1.0, 1.0])) == pytest.approx(4.0)
    assert total(np.array([np.inf, 1.0]), np.array([1.0, 1.0])) == np.inf


def test_a_model_that_is_nearly_as_likely_and_as_close_is_an_alternative() -> None:
    """Of a gain of 1000, the alternative has 960 or 940, and a held-out error 1.04 or 1.06 times."""
    plain, best = _ranked("", 3.0, -1000.0), _ranked("a", 1.0, 0.0)
    near, weaker, farther = (
        _ranked("b", 1.04, -40.0),
        _ranked("b", 1.04, -60.0),
        _ranked("b", 1.06, -40.0),
    )
    assert choose([best, near, plain], BEFORE, 0.9) == (best, [near])
    assert choose([best, near, plain], BEFORE, 1.1) == (best, [])  # log L holds: noise is left
    assert choose([best, weaker, plain], BEFORE, 0.9) == (best, [])
    assert choose([best, farther, plain], BEFORE, 0.9) == (best, [])


def test_parameters_alone_are_preferred_unless_more_of_them_leave_the_ship_file() -> None:
    plain = replace(_ranked("", 1.0), departures=2)
    for held, departures, chosen in ((0.96, 2, plain), (0.94, 2, None), (0.96, 1, None)):
        best = replace(_ranked("a", held), departures=departures)
        assert parameters_alone(best, [best, plain], 12.0) is chosen
    assert parameters_alone(plain, [plain], 0.0) is None


@pytest.mark.parametrize(("gain", "kept"), [(11.9, False), (12.1, True)])
def test_effects_that_the_likelihood_of_held_out_data_confirms_are_kept(
    gain: float, kept: bool
) -> None:
    """Effects with a price of 12 whose held-out rms error is no smaller."""
    plain = _ranked("", 1.0)
    best = replace(_ranked("a", 1.1), likelihood=plain.likelihood + gain)
    chosen = None if kept else plain
    assert parameters_alone(best, [best, plain], 12.0) is chosen
