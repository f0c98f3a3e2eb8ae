"""Observers `none` and `oracle`."""

from __future__ import annotations

import math

from shaftline.observers import get_observer

from .screw import DT, SHIP, sampled


def test_none_is_never_valid() -> None:
    record = get_observer("none").discretise(SHIP, DT)
    (last,) = sampled(record, [(10.0, 1.4e5, 1.3, 0.0, 8.0)])
    assert (last["advance_velocity"], last["valid"], last["started"]) == (0.0, 0, 1)


def test_oracle_is_the_truth_and_holds_it_where_there_is_none() -> None:
    record = get_observer("oracle").discretise(SHIP, DT)
    truths = [8.0, -3.0, math.nan, math.inf, 2.0]
    after = sampled(record, [(10.0, 1.4e5, 1.3, 0.0, truth) for truth in truths])
    assert [float(e["advance_velocity"]) for e in after] == [8.0, -3.0, -3.0, -3.0, 2.0]
    assert [int(e["valid"]) for e in after] == [1, 1, 0, 0, 1]
    # The oracle does not depend on the measurements.
    (blind,) = sampled(record, [(math.nan, math.nan, 1.3, math.nan, 8.0)])
    assert (blind["advance_velocity"], blind["valid"]) == (8.0, 1)
