"""Weights of the tasks between fuel and load, and the load at equal fuel."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from reproductions.frontier import FUEL, LOADS, TORQUE, load_at_equal_fuel, task_of


@pytest.mark.parametrize("load", LOADS)
def test_the_weights_are_the_share_of_the_load_and_the_rest(load: float) -> None:
    goals = task_of(load).goals.used
    weights = {name: goal.weight for name, goal in goals.items() if goal.weight is not None}
    assert sum(weights.values()) == pytest.approx(1.0)
    assert weights.get("fuel_excess", 0.0) == pytest.approx(1.0 - load)
    assert weights.get("torque_fluctuation", 0.0) == pytest.approx(load / 2)
    assert {"speed_error_m_s", "overload", "overspeed"} <= set(goals)


def test_the_load_at_equal_fuel_is_that_between_two_tuned_controllers() -> None:
    """Fuel 42 lies in the middle of 40 and 44; a dominated controller at 45 does not count."""
    front = pd.DataFrame({FUEL: [44.0, 40.0, 45.0], TORQUE: [6.0, 10.0, 9.0]})
    at = [load_at_equal_fuel(pd.Series({FUEL: x, TORQUE: 4.0}), front) for x in (42.0, 45.0, 50.0)]
    assert at == pytest.approx([0.5, 4.0 / 6.0, 4.0 / 6.0])
    assert math.isnan(load_at_equal_fuel(pd.Series({FUEL: 39.0, TORQUE: 4.0}), front))
