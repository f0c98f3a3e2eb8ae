"""How the coverage of the intervals is measured, and what it has shown once."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.identification.free_parameters import number_of
from shaftline.validation.coverage import (
    KEYS,
    MOST_BIAS,
    TOLERANCE_OF_KEY,
    WATERS,
    by_choice,
    cases,
    coverage,
    coverage_row,
    evaluate_case,
    free_parameters,
    ship_of,
    truth_of,
    water_of,
)
from shaftline.validation.simulator.effects import BENCH

SEED = 31


def test_every_water_has_its_cases_and_every_parameter_is_wrong_by_what_the_file_says() -> None:
    found = cases(5, SEED)
    assert [water_of(case) for case in found] == [w for w in WATERS for _ in range(5)]
    for case in found:
        tolerances, own = ship_of(case).tolerances, TOLERANCE_OF_KEY[case.ship]
        for name, factor in case.factors.items():
            most = (
                MOST_BIAS if name in free_parameters(case) else 4.0 * getattr(tolerances, own[name])
            )
            assert 0.0 < abs(factor - 1.0) <= most, name
    assert found == cases(5, SEED)


def test_the_truth_is_that_of_the_key() -> None:
    for case in cases(3, SEED):
        ship = ship_of(case)
        for name in free_parameters(case):
            wrong = truth_of(case, name) / number_of(ship, KEYS[name]).value
            close = 0.03 if name == "inertia" else 1e-9  # the bench's two are one in its simulator
            assert wrong == pytest.approx(case.factors[name], rel=close)


def test_what_intervals_are_worth() -> None:
    rng = np.random.default_rng(0)
    error = rng.standard_normal(4000)
    exact = np.column_stack(
        [10.0 + error, np.ones(4000), 8.04 + error, 11.96 + error, np.full(4000, 10.0)]
    )
    row = coverage_row(exact)
    assert row["covered %"] == pytest.approx(95.0, abs=1.0)
    assert row["from %"] < 95.0 < row["to %"]
    for ratio in ("width / calibrated", "width / oracle"):
        assert row[ratio] == pytest.approx(1.0, abs=0.05)
    wide = exact + np.array([0.0, 0.0, -1.96, 1.96, 0.0])
    assert coverage_row(wide)["width / calibrated"] == pytest.approx(2.0, abs=0.1)
    found = [
        {"water": "calm", "free": "resistance", "numbers": {"resistance": one.tolist()}}
        for one in exact[:50]
    ]
    assert list(coverage(found)["intervals"]) == [50, 50]
    assert list(by_choice(found)["intervals"]) == [50]


@pytest.mark.parametrize("index", [59, 623, 778])
def test_other_parameters_are_felt_at_what_was_found(index: int) -> None:
    """The motor's constant is off by two tolerances here, and what is free by a tenth.

    Felt about the file, the constant moves the estimates by up to eight standard errors.
    """
    case = next(c for c in cases(34, SEED) if c.ship == BENCH and c.index == index)
    for name, (value, error, _, _, truth) in evaluate_case(case)["numbers"].items():
        assert abs(value - truth) < 3.0 * error, name
