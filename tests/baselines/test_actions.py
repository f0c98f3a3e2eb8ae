"""Conversion of commands to actions and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.baselines.controller import actions, decode, encode
from shaftline.plant import Ship

number = st.floats(-1e4, 1e4)


@given(action=st.floats(-1.0, 1.0), low=number, width=st.floats(1e-3, 1e4))
def test_conversion_and_inverse(action: float, low: float, width: float) -> None:
    there = decode(action, low, low + width)
    scale = max(abs(low), width) / width  # rounding error from the offset of the range
    assert encode(there, low, low + width) == pytest.approx(action, abs=1e-14 * (1.0 + scale))
    assert low - 1e-9 <= there <= low + width + 1e-9


def test_ends_and_middle_by_hand() -> None:
    assert [decode(a, 0.6, 1.4) for a in (-1.0, 0.0, 0.5, 1.0)] == pytest.approx([0.6, 1, 1.2, 1.4])
    assert [encode(c, 0.6, 1.4) for c in (0.6, 1.0, 1.2, 1.4)] == pytest.approx([-1.0, 0, 0.5, 1])
    assert decode(-1.0, 0.3, 0.7) == 0.3  # exact: a closed rack stays closed


def test_beyond_the_range_is_clipped() -> None:
    assert encode(0.5999, 0.6, 1.4) == -1.0
    assert encode(1e9, 0.6, 1.4) == 1.0
    assert encode(-math.inf, 0.0, 40.0) == -1.0
    assert math.isnan(encode(math.nan, 0.0, 40.0))


def test_a_range_of_one_value_has_the_action_zero() -> None:
    assert encode(1.2, 1.2, 1.2) == encode(5.0, 1.2, 1.2) == 0.0
    assert decode(0.7, 1.2, 1.2) == 1.2


def test_actions_are_pitch_and_rack_over_the_ships_ranges(frigate: Ship) -> None:
    found = actions(frigate.record(), [0.6, 1.2, 2.0], np.array([0.0, 10.0, 40.0]))
    assert found.dtype == np.float32
    assert found == pytest.approx(np.array([[-1.0, -1.0], [0.5, -0.5], [1.0, 1.0]]))
