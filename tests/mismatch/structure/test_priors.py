"""Priors of a ship's parameters: near the file, or far from it at the price of a wrong file."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.structure.model import WIDE, WRONG, Prior, parameter_priors
from shaftline.plant import load_ship

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


def test_every_parameter_with_a_tolerance_has_a_prior_and_those_of_the_ship_s_own_terms() -> None:
    term = {"id": "weight", "acts_on": "load_torque", "expression": "m", "parameters": {"m": 0.01}}
    ship = motor().with_values({"tolerances.inertia": 0.2, "term": [term]})
    found = {d.key: d for d in parameter_priors(JointReplay(ship, run()))}
    assert set(found) == {
        INERTIA, "prime_mover.motor_constant_V_s_rad", "prime_mover.armature_resistance_ohm",
        "term.weight.m",
    }  # fmt: skip
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
