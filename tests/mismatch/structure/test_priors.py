"""Priors of a ship's parameters: near the file, or far from it at the price of a wrong file."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.model import (
    WIDE,
    WRONG,
    JointPrior,
    Prior,
    parameter_priors,
)
from shaftline.plant import load_ship
from shaftline.plant.tolerances import Tolerances

from .rigs import INERTIA, motor, run

PRIOR = Prior("some.key", 4.0, 0.01, 0.7, 0.1, True, lambda record, value: None)


def test_near_the_file_a_parameter_costs_what_a_normal_variable_does() -> None:
    assert PRIOR.penalty(0.0) == 0.0
    assert PRIOR.penalty(0.02) == pytest.approx(4.0, abs=0.05)
    assert PRIOR.precision(0.005) == pytest.approx(1e4, rel=0.01)


def test_far_from_it_no_more_than_that_the_file_is_wrong() -> None:
    """The chance of that, and the density's width: 2 ln(0.9 / 0.01 x 0.7 / 0.1) and (0.7 / 0.7)^2."""
    wrong = 2.0 * math.log(0.9 / 0.01 * 0.7 / 0.1)
    assert PRIOR.penalty(0.7) == pytest.approx(wrong + 1.0, abs=0.01)
    assert PRIOR.precision(0.3) == pytest.approx(1.0 / 0.7**2, rel=1e-6)
    assert PRIOR.penalty(0.7) - PRIOR.penalty(0.0) < 15.0


def test_a_guessed_parameter_costs_its_distance_alone() -> None:
    assert PRIOR.penalty(0.35, guessed=True) == pytest.approx(0.25)
    assert PRIOR.precision(0.0, guessed=True) == pytest.approx(1.0 / 0.49)


def test_a_share_moves_by_a_factor_and_a_shift_by_itself() -> None:
    assert PRIOR.value_at(math.log(2.0)) == pytest.approx(8.0)
    assert Prior("k", 4.0, 0.1, 1.0, 0.1, False, PRIOR.write).value_at(-0.5) == 3.5


def _joint(correlation: float, wrong: float = 0.01) -> JointPrior:
    """Return the joint prior of two parameters with errors of 10 %, and of a third without links."""
    first, second, third = (
        Prior(key, 1.0, 0.1, 0.7, wrong, True, PRIOR.write) for key in ("a", "b", "c")
    )
    known = Tolerances(numbers={"a": 0.1, "b": 0.1}, correlations={"b": {"a": correlation}})
    return JointPrior([first, second, third], known)


def test_correlated_parameters_move_together_cheaply_and_apart_at_the_price_of_a_wrong_one() -> (
    None
):
    """At rho = 0.999, steps of s apart cost 2 s^2 / (1 - rho), steps together 2 s^2 / (1 + rho)."""
    joint = _joint(0.999, wrong=0.0)
    assert joint.penalty(np.array([0.1, 0.1, 0.0])) == pytest.approx(2.0 / 1.999)
    assert joint.penalty(np.array([0.1, -0.1, 0.0])) == pytest.approx(2.0 / 0.001)
    assert joint.penalty(np.array([0.1, -0.1, 0.0]), guessed=True) == pytest.approx(
        2 * (1 / 7) ** 2
    )
    apart = _joint(0.999).penalty(np.array([0.2, -0.1, 0.0]))
    assert 10.0 < apart < 25.0  # one of both is wrong: 2 ln(1 / 0.01) and the density's width


def test_the_parameter_that_is_wrong_is_far_although_it_is_inside_its_own_tolerance() -> None:
    joint = _joint(0.9999)
    assert joint.distances(np.array([0.1, 0.1, 0.1])) == pytest.approx([1.0, 1.0, 1.0], rel=1e-3)
    far = joint.distances(np.array([0.15, 0.0, 0.0]))
    assert far[0] > 50.0
    assert far[2] == 0.0


def test_the_precision_of_a_joint_prior_is_the_slope_of_its_penalty() -> None:
    joint, at = _joint(0.9), np.array([0.12, 0.02, -0.05])
    slope = joint.precision(at) @ at
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6
        change = joint.penalty(at + step) - joint.penalty(at - step)
        assert change / 4e-6 == pytest.approx(slope[k], rel=1e-6)


def test_without_correlations_a_joint_prior_is_the_sum_of_its_parts() -> None:
    joint, at = _joint(0.0), np.array([0.12, 0.5, -0.05])
    own = [Prior("a", 1.0, 0.1, 0.7, 0.01, True, PRIOR.write)] * 3
    assert joint.penalty(at) == sum(p.penalty(float(x)) for p, x in zip(own, at, strict=True))
    assert np.array_equal(
        joint.precision(at), np.diag([p.precision(float(x)) for p, x in zip(own, at, strict=True)])
    )


def test_every_parameter_with_a_tolerance_has_a_prior_and_those_of_the_ship_s_own_terms() -> None:
    term = {"id": "weight", "acts_on": "load_torque", "expression": "m", "parameters": {"m": 0.01}}
    ship = motor().with_values({"tolerances.inertia": 0.2, "term": [term]})
    found = {d.key: d for d in parameter_priors(JointReplay(ship, run()))}
    assert set(found) == {
        INERTIA,
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "term.weight.m",
    }
    assert found[INERTIA].near == pytest.approx(0.2)
    assert found[INERTIA].far == WIDE
    assert found[INERTIA].wrong == WRONG
    assert found["term.weight.m"].wrong == 1.0
    assert parameter_priors(JointReplay(ship, run()), 0.0) == []


def test_no_parameter_moves_out_of_the_range_of_its_key() -> None:
    ship = load_ship("tito-neri-sine")
    table = pd.DataFrame({"time_s": 0.01 * np.arange(200), "motor_voltage_V": 6.0})
    table["shaft_speed_rad_s"] = 100.0
    found = {d.key: d for d in parameter_priors(JointReplay(ship, table))}
    own = found["propeller.torque_coefficient"]
    high = ship.parameter(own.key).search_range[1]
    assert own.value_at(own.range[1]) <= high
    resistance = found["prime_mover.armature_resistance_ohm"]
    assert resistance.range[0] == -5.0
    highest = ship.parameter(resistance.key).search_range[
        1
    ]  # beyond it the step does not resolve L / R
    assert resistance.value_at(resistance.range[1]) == pytest.approx(highest)


def test_a_prior_writes_its_parameter_into_a_record() -> None:
    ship = load_ship("tito-neri-sine")
    record = ship.record()
    for prior in parameter_priors(JointReplay(motor(), run())):
        prior.write(record, 0.123)
        assert record[motor().parameter(prior.key).field] == 0.123
