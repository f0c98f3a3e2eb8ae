"""Numbers that are let move widely, and those that cannot be."""

from __future__ import annotations

import pytest

from shaftline.mismatch import Options
from shaftline.mismatch.identification.parameters import (
    WIDE,
    check_free_parameters,
    start_with_free_parameters,
)
from shaftline.plant import Ship

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"


def test_a_free_number_may_be_a_third_off(frigate: Ship) -> None:
    found = start_with_free_parameters(frigate, (RESISTANCE,))
    assert found.file == frigate
    assert found.free == (RESISTANCE,)
    assert found.ship.tolerances.numbers == {RESISTANCE: WIDE * 3306.2}
    assert start_with_free_parameters(frigate, ()).ship is frigate


def test_what_the_file_says_is_taken_where_it_is_more(frigate: Ship) -> None:
    unsure = frigate.with_values({"tolerances.numbers": {RESISTANCE: 2000.0, FRICTION: 100.0}})
    found = start_with_free_parameters(unsure, (RESISTANCE, FRICTION))
    assert found.ship.tolerances.numbers == {RESISTANCE: 2000.0, FRICTION: 100.0}


def test_numbers_that_cannot_move_are_refused_by_name(frigate: Ship) -> None:
    with pytest.raises(ValueError, match=r"hull\.rust is no parameter of this ship"):
        Options(free=("hull.rust",)).check(frigate)
    with pytest.raises(ValueError, match="is given twice"):
        check_free_parameters(frigate, (RESISTANCE, RESISTANCE), calibrated=True)
    with pytest.raises(ValueError, match=rf"{FRICTION} is 0, .* \[N m\] under \[tolerances"):
        check_free_parameters(frigate, (FRICTION,), calibrated=False)
    check_free_parameters(frigate, (FRICTION,), calibrated=True)
    told = frigate.with_values({"tolerances.numbers": {FRICTION: 100.0}})
    check_free_parameters(told, (FRICTION,), calibrated=False)
