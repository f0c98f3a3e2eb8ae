"""Names against formulas: the better one is told, and a name that is far behind is refuted."""

from __future__ import annotations

import functools
from types import SimpleNamespace
from typing import Any

import pytest

from shaftline.mismatch import Diagnosis, diagnose
from shaftline.mismatch.judge.correction import refutes_effects
from shaftline.plant.terms import Term

from ..search.test_formulas import recorded, rig


@functools.cache
def found(expression: str, size: float, seed: int) -> Diagnosis:
    term = {"id": "truth", "acts_on": "drive_torque", "expression": expression}
    ship = rig().with_term(Term.model_validate(term | {"parameters": {"c": size}}))
    return diagnose(rig(), recorded(ship, seed))


def test_friction_that_grows_with_a_force_is_not_viscous_friction() -> None:
    told = found("-c * side_force * shaft_speed", 1e-5, 5)
    assert told.verdict == "unexplained"
    assert told.findings == []
    assert told.formula is not None
    assert set(told.formula.signals) == {"side_force", "shaft_speed"}
    assert told.formula.better_than
    assert told.corrected.term[0].expression == told.formula.term.expression


def test_a_name_that_is_near_stays_and_the_formula_stands_beside_it() -> None:
    told = found("-c * shaft_speed ** 3", 2e-7, 6)
    assert told.verdict == "partly-explained"  # the formula says that something else acts
    assert [f.effect.id for f in told.findings] == ["quadratic-drag"]
    assert told.formula is not None
    assert "shaft_speed" in told.formula.signals  # the propeller's torque is its square
    assert told.formula.better_than == ("quadratic-drag (motor)",)
    assert told.formula.ahead > 6.0
    report: dict[str, Any] = told.to_dict()
    assert report["formula"]["better_than"] == ["quadratic-drag (motor)"]
    assert "another form" in told.summary()


def test_a_name_that_is_the_truth_has_no_formula_beside_it() -> None:
    told = found("-c * shaft_speed * abs(shaft_speed)", 8e-6, 7)
    assert told.verdict == "explained"
    assert told.findings[0].effect.id == "quadratic-drag"
    assert told.formula is None


@pytest.mark.parametrize(
    ("gain", "names", "signals", "gone"),
    [
        (59.0, ("motor",), ("drive", "wind"), True),
        (61.0, ("motor",), ("drive", "wind"), False),
        (59.0, ("motor",), ("drive",), False),  # another form of the same
        (61.0, ("motor", "motor"), ("drive",), True),
        (99.0, ("propeller",), ("drive",), True),
        (99.0, ("sensor",), ("drive",), False),  # an instrument's error shows anywhere
    ],
)
def test_far_behind_or_with_more_or_elsewhere_names_are_refuted(
    gain: float, names: tuple[str, ...], signals: tuple[str, ...], gone: bool
) -> None:
    formula: Any = SimpleNamespace(gain=100.0, blocks=(None,), balance="motor", signals=signals)
    effects = tuple(SimpleNamespace(effect=SimpleNamespace(balance=name)) for name in names)
    selection: Any = SimpleNamespace(fit=SimpleNamespace(score=gain + 7.0, effects=effects))
    balances = SimpleNamespace(replay=SimpleNamespace(outside={"wind": None}))
    fitter = SimpleNamespace(null=SimpleNamespace(score=7.0), balances=balances)
    whiteness: Any = SimpleNamespace(fitter=fitter)
    assert refutes_effects(formula, selection, whiteness) is gone
