from __future__ import annotations

import pytest

from shaftline.plant import ShipError, load_ship
from shaftline.plant.tolerances import Tolerances

STATED = {
    "resistance": 0.004,
    "mass": 0.005,
    "wake_fraction": 0.0015,
    "thrust_curve": 0.002,
    "torque_curve": 0.002,
    "inertia": 0.005,
    "torque_per_rack": 0.0015,
    "torque_offset": 0.001,
    "motor_constant": 0.002,
    "armature_resistance": 0.0025,
    "pitch_time_constant": 0.01,
    "hull_derivatives": 0.02,
    "rudder_force": 0.02,
}
"""One standard deviation of each number where a file says nothing."""


def test_a_ship_that_says_nothing_is_known_this_well() -> None:
    assert Tolerances().model_dump(exclude={"default", "numbers", "correlations"}) == STATED
    assert Tolerances().numbers == {}
    assert Tolerances().correlations == {}


def test_errors_that_go_together_are_those_of_numbers_told() -> None:
    known = Tolerances(numbers={"a.b": 1.0, "c.d": 2.0}, correlations={"a.b": {"c.d": 0.9}})
    assert known.correlation("a.b", "c.d") == known.correlation("c.d", "a.b") == 0.9
    assert known.correlation("a.b", "a.b") == 1.0
    assert known.correlation("a.b", "e.f") == 0.0
    assert hash(known) != hash(Tolerances(numbers=known.numbers))
    with pytest.raises(ValueError, match=r"name c\.d, which has no standard deviation"):
        Tolerances(numbers={"a.b": 1.0}, correlations={"a.b": {"c.d": 0.9}})
    with pytest.raises(ValueError, match="less than or equal to 1"):
        Tolerances(numbers=known.numbers, correlations={"a.b": {"c.d": 1.1}})


@pytest.mark.parametrize("key", STATED)
def test_a_tolerance_runs_from_exact_to_half(key: str) -> None:
    for value in (0.0, 0.5):
        assert getattr(Tolerances.model_validate({key: value}), key) == value
    for value in (-1e-9, 0.51):
        with pytest.raises(ValueError, match=key):
            Tolerances.model_validate({key: value})


def test_a_file_that_was_guessed_is_known_less_well() -> None:
    ship = load_ship("frigate").with_values({"tolerances.default": "guessed"})
    known = ship.tolerances
    assert (known.resistance, known.wake_fraction, known.torque_offset) == (0.3, 0.1, 0.05)
    weighed = load_ship("frigate").with_values(
        {"tolerances.default": "guessed", "tolerances.mass": 0.0}
    )
    assert (weighed.tolerances.mass, weighed.tolerances.inertia) == (0.0, 0.3)
    with pytest.raises(ShipError, match=r"tolerances\.default"):
        load_ship("frigate").with_values({"tolerances.default": "measured well"})
