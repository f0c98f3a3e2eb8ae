"""Numbers that are to be found: named, checked, varied."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.identify.drive_train import CONSTANT, INDUCTANCE, LOAD
from shaftline.mismatch.identify.freed import RATIO, freed, number_of, refuse_indistinct
from shaftline.plant import load_ship
from shaftline.plant.terms import Term

from .benches import tug


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((), "tito-neri-sine: name the keys"),
        ((CONSTANT, CONSTANT), f"{CONSTANT} is named twice"),
        (RATIO, "only the ratio of propeller.torque_coefficient and propeller.relative_rotative"),
        (("prime_mover.colour",), "prime_mover.colour is not a known key"),
        (("propeller.model",), "propeller.model is no number"),
        (("engine.x",), "engine.x is not a known key"),
    ],
)
def test_what_cannot_be_found_is_named(free: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        freed(tug(), free, ())


def test_defaults_ranges_and_values() -> None:
    chosen = freed(tug(), None, (CONSTANT, LOAD))
    assert chosen.keys == (CONSTANT, LOAD)
    assert chosen.start == pytest.approx([0.0183, 0.136])
    assert CONSTANT in chosen
    assert INDUCTANCE not in chosen
    low, high = chosen.bounds
    assert low == pytest.approx([0.0183 / 50, 0.136 / 50])
    assert high == pytest.approx([0.0183 * 50, 1.0])  # KQ ends at 1 in a ship's file
    ship = chosen.on([0.02, 0.1])
    assert ship == tug().with_values({CONSTANT: 0.02, LOAD: 0.1})
    assert ship.record()["motor_constant"] == 0.02
    zero = freed(tug(), ("sensors.speed_delay_s",), ())
    assert zero.scale == pytest.approx([1e-3])
    assert (zero.bounds[0][0], zero.bounds[1][0]) == (0.0, 6.0)


def test_a_search_may_pass_where_the_time_step_does_not_fit() -> None:
    assert freed(tug(), (INDUCTANCE,), ()).on([1e-6]).number(INDUCTANCE).value == 1e-6


def test_a_term_s_numbers_may_be_found() -> None:
    own = {"c": {"value": 1e-5, "unit": "N m s/rad", "low": 0.0, "high": 1.0}}
    said = {"id": "drag", "acts_on": "load_torque", "expression": "c * shaft_speed"}
    term = Term.model_validate({**said, "parameters": own})
    ship = tug().with_term(term)
    assert number_of(ship, "term.drag.c")[0] == 1e-5
    assert freed(ship, ("term.drag.c",), ()).on([2e-5]).number("term.drag.c").value == 2e-5


def test_numbers_that_act_alike_are_named() -> None:
    one = np.array([1.0, 2.0, 3.0])
    rows = np.column_stack([one, [1.0, 0.0, 1.0], -2.0 * one])
    with pytest.raises(ValueError, match="steady: the recording does not tell a, c apart"):
        refuse_indistinct(("a", "b", "c"), rows, "steady")
    with pytest.raises(ValueError, match="nothing that it compares depends on b"):
        refuse_indistinct(("a", "b"), np.column_stack([one, 0.0 * one]), "steady")
    with pytest.raises(ValueError, match="does not tell"):
        refuse_indistinct(("a", "b"), np.array([[1.0, 2.0]]), "steady")
    refuse_indistinct(("a", "b"), rows[:, :2], "steady")


def test_a_diesel_s_numbers_too() -> None:
    value, info = number_of(load_ship("frigate"), "hull.wake_fraction")
    assert (value, info.unit) == (0.05, "-")
