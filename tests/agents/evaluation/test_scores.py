"""Scores: 0 is the combinator, 1 the clairvoyant bound."""

from __future__ import annotations

import pytest

from shaftline.agents.evaluation.scores import Bound, bounds
from shaftline.envs import tasks

BOUND = Bound(combinator=0.5, tuned=0.6, best=0.9, spread=0.05)


def test_a_score_is_the_share_of_the_way_from_the_combinator_to_the_bound() -> None:
    assert BOUND.score(0.5) == 0.0
    assert BOUND.score(0.9) == pytest.approx(1.0)
    assert BOUND.score(0.4) == pytest.approx(-0.25)


@pytest.mark.parametrize("task", sorted(bounds()))
def test_a_bound_is_above_the_controllers_of_its_task(task: str) -> None:
    bound = bounds()[task]
    assert task in tasks()
    assert 0.0 < bound.combinator < bound.best <= 1.0
    assert bound.tuned < bound.best
    assert 0.0 <= bound.spread < bound.best - bound.combinator
