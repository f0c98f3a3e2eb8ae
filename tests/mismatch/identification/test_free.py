"""The numbers that may move, the ship at other values of them, and keys that are none."""

from __future__ import annotations

import pytest

from shaftline.mismatch.identification.drive_train import CONSTANT, INDUCTANCE, LOAD
from shaftline.mismatch.identification.free_parameters import (
    RATIO,
    Free,
    doubtful,
    keys_at_bounds,
    number_of,
    parse_free,
    usual_keys,
)
from shaftline.plant import Ship, load_ship, ship_names
from shaftline.plant.terms import Term

from .benches import tug

MASS, WAKE = "hull.mass_kg", "hull.wake_fraction"
KQ = RATIO[0]


def test_the_record_is_that_of_the_file_with_other_values(frigate: Ship) -> None:
    free = Free(frigate, (MASS, WAKE))
    assert free.values == (3.3e6, 0.05)
    assert free.record((3.0e6, 0.04)) == free.at((3.0e6, 0.04)).record()
    assert free.at((3.0e6, 0.04)).hull.mass_kg == 3.0e6


def test_a_number_that_the_record_holds_in_another_form_moves_too() -> None:
    tug = load_ship("tito-neri-sine")
    free = Free(tug, (KQ,))
    assert free.record((0.2,)) == tug.with_values({KQ: 0.2}).record()
    assert free.record((0.2,)) != tug.record()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ((), "no parameter is free"),
        ((MASS, WAKE, MASS), r"hull\.mass_kg is given twice"),
        (("hull.mas",), r"frigate: hull\.mas is no parameter .* of \[hull\] are hull\.mass_kg"),
        (("nothing.x",), r"nothing\.x is no parameter of this ship that can be free$"),
        (("propeller.blades",), r"propeller\.blades is no parameter"),
        (("propeller.model",), r"propeller\.model is no parameter"),
    ],
)
def test_what_cannot_be_free_is_named(frigate: Ship, keys: tuple[str, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Free(frigate, keys)


def test_a_step_stops_short_of_a_bound(frigate: Ship) -> None:
    free = Free(frigate, (MASS, "transmission.efficiency"))
    low = free.numbers[0].search_range[0]
    assert low == free.numbers[0].info.low == 0.01
    found = free.towards((3e6, 0.95), (-1e6, 0.97))
    assert found == [pytest.approx(0.1 * 3e6 + 0.9 * low), 0.97]
    assert free.towards((3e6, 0.95), (2e6, 1.2))[1] == pytest.approx(0.995)


def test_a_search_stays_off_a_bound_that_the_file_excludes(frigate: Ship) -> None:
    diameter = Free(frigate, ("propeller.diameter_m",)).numbers[0]
    assert diameter.info.low == 0.0 < diameter.search_range[0] < 0.01 * diameter.value


def test_a_file_may_be_wrong_about_what_it_states_and_has_a_tolerance_or_an_effect() -> None:
    keys = doubtful(load_ship("frigate"))
    assert {MASS, WAKE, "prime_mover.torque_per_rack_N_m_mm"} <= set(keys)
    assert "hull.thrust_deduction" in keys  # no tolerance speaks of it
    assert "transmission.gear_ratio" not in keys
    assert "hull.fouling_fraction" not in keys  # absent
    fouled = load_ship("frigate").with_values({"hull.fouling_fraction": 0.1})
    assert "hull.fouling_fraction" in doubtful(fouled)
    assert KQ in doubtful(load_ship("tito-neri-sine"))


# -- as a method on a shaft takes them ---------------------------------------------------------


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((), "tito-neri-sine: no parameter is free"),
        ((CONSTANT, CONSTANT), f"{CONSTANT} is given twice"),
        (RATIO, "only the ratio of propeller.torque_coefficient and propeller.relative_rotative"),
        (("prime_mover.colour",), r"prime_mover\.colour is no parameter of this ship"),
        (("propeller.model",), "propeller.model is no parameter"),
        (("engine.x",), r"engine\.x is no parameter of this ship"),
    ],
)
def test_what_a_method_cannot_find_is_named(free: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_free(tug(), free, ())


def test_defaults_ranges_and_values() -> None:
    chosen = parse_free(tug(), None, (CONSTANT, LOAD))
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
    zero = parse_free(tug(), ("sensors.speed_delay_s",), ())
    assert zero.scale == pytest.approx([1e-3])
    assert (zero.bounds[0][0], zero.bounds[1][0]) == (0.0, 6.0)


def test_a_search_may_pass_where_the_time_step_does_not_fit() -> None:
    assert parse_free(tug(), (INDUCTANCE,), ()).on([1e-6]).parameter(INDUCTANCE).value == 1e-6


def test_a_term_s_numbers_may_be_found() -> None:
    own = {"c": {"value": 1e-5, "unit": "N m s/rad", "low": 0.0, "high": 1.0}}
    said = {"id": "drag", "acts_on": "load_torque", "expression": "c * shaft_speed"}
    term = Term.model_validate({**said, "parameters": own})
    ship = tug().with_term(term)
    assert number_of(ship, "term.drag.c").value == 1e-5
    assert parse_free(ship, ("term.drag.c",), ()).on([2e-5]).parameter("term.drag.c").value == 2e-5


def test_a_diesel_s_numbers_too() -> None:
    number = number_of(load_ship("frigate"), WAKE)
    assert (number.value, number.info.unit) == (0.05, "-")


@pytest.mark.parametrize("name", ship_names())
def test_every_ship_has_parameters_that_a_method_usually_frees(name: str) -> None:
    ship = load_ship(name)
    for response in (False, True):
        keys = usual_keys(ship, response=response)
        assert all(number_of(ship, key).value != 0.0 for key in keys)
        assert bool(keys) == (ship.turns_freely or ship.moves)


def test_values_at_the_end_of_their_range_are_found(frigate: Ship) -> None:
    values = [
        (WAKE, 0.5999),  # its range ends at 0.6
        ("hull.resistance_exponent", 1.0),
        ("propeller.relative_rotative_efficiency", 1.2),
        (MASS, 4e6),
        ("transmission.arctangent_friction_engine_side_N_m", 0.0),  # absent, not at an end
        ("prime_mover.no_such_key", 1.0),
    ]
    assert keys_at_bounds(frigate, values) == [WAKE, "hull.resistance_exponent"]
