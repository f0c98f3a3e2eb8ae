"""Which numbers information tells apart: by hand, on two and three of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.mismatch.identification.free_parameters import (
    distinguishable,
    one_direction,
    refuse_indistinct,
    refuse_unidentifiable,
)

APART = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 1.0]])


def alike(correlation: float) -> NDArray[np.float64]:
    """Information of two numbers that go together, and of a third; of sizes far apart."""
    scale = np.diag([1e3, 1e-2, 1.0])
    told = np.eye(3)
    told[0, 1] = told[1, 0] = correlation
    return np.asarray(scale @ told @ scale)


def test_the_worst_known_combination_is_found_whatever_the_units() -> None:
    value, made_of = one_direction(alike(0.999))
    assert value == pytest.approx(1e-3)
    assert made_of == [0, 1]


def test_numbers_that_go_together_are_refused_by_name() -> None:
    refuse_unidentifiable("abc", APART)
    refuse_unidentifiable("abc", alike(0.999))
    with pytest.raises(ValueError, match=r"^a and b are not identifiable together"):
        refuse_unidentifiable("abc", alike(0.99995))
    with pytest.raises(ValueError, match=r"^b is not identifiable: no measured channel"):
        refuse_unidentifiable("abc", np.diag([1.0, 0.0, 2.0]))


def test_only_the_numbers_themselves_are_looked_at() -> None:
    refuse_unidentifiable("c", alike(0.99999)[::-1, ::-1])


def test_the_worst_told_is_dropped_until_all_are_told_well() -> None:
    errors = np.array([0.02, 0.3, 0.09])  # of numbers of size 1, 1 and 2
    rest, left = distinguishable("abc", (1.0, 1.0, 2.0), np.diag(errors**-2))
    assert rest == [0, 2]
    assert left == {"b": "its standard error would be 30 % of its value"}
    rest, left = distinguishable("abc", (1.0, 1.0, 0.5), np.diag(errors**-2))
    assert rest == [0]
    assert list(left) == ["b", "c"]


def test_of_numbers_that_go_together_the_less_known_is_dropped() -> None:
    rest, left = distinguishable("abc", (1.0, 1e7, 20.0), alike(0.99999))
    assert rest == [1, 2]
    assert left == {"a": "only its combination with b is identifiable"}
    rest, left = distinguishable("abc", (1.0, 1e4, 20.0), alike(0.99999))
    assert rest == [0, 2]
    assert left == {"b": "only its combination with a is identifiable"}


def test_a_number_that_moves_nothing_is_left_out() -> None:
    rest, left = distinguishable("ab", (1.0, 1.0), np.diag([0.0, 1e4]))
    assert rest == [1]
    assert left == {"a": "no measured channel depends on it here"}


def test_numbers_that_act_alike_are_named() -> None:
    one = np.array([1.0, 2.0, 3.0])
    rows = np.column_stack([one, [1.0, 0.0, 1.0], -2.0 * one])
    with pytest.raises(ValueError, match="steady: the recording does not distinguish a, c"):
        refuse_indistinct(("a", "b", "c"), rows, "steady")
    with pytest.raises(ValueError, match="none of the compared values depends on b"):
        refuse_indistinct(("a", "b"), np.column_stack([one, 0.0 * one]), "steady")
    with pytest.raises(ValueError, match="does not distinguish"):
        refuse_indistinct(("a", "b"), np.array([[1.0, 2.0]]), "steady")
    refuse_indistinct(("a", "b"), rows[:, :2], "steady")
