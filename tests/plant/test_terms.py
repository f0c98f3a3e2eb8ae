"""Terms: what an expression means, where it acts, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    linearise,
    load_ship,
    simulate,
    write_ship,
)
from shaftline.plant.term_kernel import MAX_DEPTH, MAX_TERMS, Added, Heard, added
from shaftline.plant.terms import FUNCTIONS, PLACES, TERM_SIGNALS, Term, TermError, add_term, parsed

HEARD = Heard(11.0, 8.0, 1.2, 1.3, 22.0, 6.5, 4.0, 30.0)


def with_term(ship: Ship, expression: str, acts_on: str = "load_torque", **numbers: float) -> Ship:
    term = {"id": "one", "acts_on": acts_on, "expression": expression, "parameters": numbers}
    return ship.with_values({"term": [term]})


def value(ship: Ship, expression: str, heard: Heard = HEARD, **numbers: float) -> Any:
    record = with_term(ship, expression, "drive_torque", **numbers).record()
    return added(record, heard).drive_torque


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("2 - 3 - 4", -5.0),
        ("2 - (3 - 4)", 3.0),
        ("12 / 3 / 2", 2.0),
        ("-2 ** 2", -4.0),
        ("(-2) ** 3", -8.0),
        ("2 ** -2", 0.25),
        ("4 ** 0.5", 2.0),
        ("shaft_speed * ship_speed", 88.0),
        ("pitch_ratio + 10 * pitch_command", 14.2),
        ("drive / advance_velocity", 22.0 / 6.5),
        ("submergence - time", -26.0),
        ("abs(-3) + sign(-3) + sign(0) + sign(2)", 3.0),
        ("step(0.1) + 10 * step(0) + 100 * step(-1)", 1.0),
        ("sqrt(9) + exp(0) + log(1)", 4.0),
        ("tanh(0.5) - sin(0.5) + cos(0.5) - atan(0.5)",
         np.tanh(0.5) - np.sin(0.5) + np.cos(0.5) - np.arctan(0.5)),
        ("min(2, 3) + 10 * max(2, 3)", 32.0),
        ("max(min(shaft_speed, 5), -5)", 5.0),
        ("+a * 2 - b", 5.0),
    ],
)  # fmt: skip
def test_an_expression_means_what_it_says(frigate: Ship, expression: str, expected: float) -> None:
    numbers = {"a": 4.0, "b": 3.0} if "a *" in expression else {}
    assert value(frigate, expression, HEARD, **numbers) == pytest.approx(expected, rel=1e-14)


@given(
    st.recursive(
        st.sampled_from(["shaft_speed", "ship_speed", "drive", "2.5", "0.3"]),
        lambda inner: st.builds(
            "({} {} {})".format, inner, st.sampled_from(["+", "-", "*"]), inner
        ),
        max_leaves=8,
    )
)
def test_arithmetic_is_pythons_own(expression: str) -> None:
    expected = eval(expression, HEARD._asdict())  # of our own making
    assert value(load_ship("frigate"), expression) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_complex_steps_give_the_derivative(frigate: Ship) -> None:
    expression = (
        "3 * abs(ship_speed) * ship_speed ** 2 + tanh(shaft_speed / 9) + sqrt(drive)"
        " + max(shaft_speed, 2) * step(ship_speed) + exp(-time / 50) + sign(shaft_speed)"
    )
    h = 1e-30
    for name in ("shaft_speed", "ship_speed", "drive", "time"):
        base = Heard(*(complex(x) for x in HEARD))
        moved = base._replace(**{name: getattr(base, name) + 1j * h})
        slope = value(frigate, expression, moved).imag / h
        step = 1e-6 * getattr(HEARD, name)
        up, down = (HEARD._replace(**{name: getattr(HEARD, name) + s}) for s in (step, -step))
        numeric = (value(frigate, expression, up) - value(frigate, expression, down)) / (2.0 * step)
        assert slope == pytest.approx(numeric, rel=1e-6), name


def sailed(ship: Ship) -> Any:
    schedule = Schedule(
        lambda t: np.where(t < 20, 20.0, 26.0), lambda t: np.where(t < 35, 1.2, 1.0)
    )
    return simulate(ship, schedule, 60.0, initial=equilibrium(ship, 20.0, 1.2).state)


@pytest.mark.parametrize(
    ("acts_on", "expression", "same"),
    [
        ("load_torque", "60 * shaft_speed * abs(shaft_speed)",
         {"transmission.quadratic_drag_N_m_s2_rad2": 60.0}),
        ("drive_torque", "-500 * shaft_speed",
         {"transmission.viscous_friction_engine_side_N_m_s_rad": 500.0}),
        ("resistance", "0.2 * c1 * ship_speed ** 2", {"hull.fouling_fraction": 0.2}),
        ("inflow_velocity", "-0.05 * ship_speed", {"hull.wake_fraction": 0.05}),
        ("pitch_rate", "0.03 / tau", {"pitch_actuator.offset": 0.03}),
    ],
)  # fmt: skip
def test_a_term_is_the_effect_that_it_spells(
    frigate: Ship, acts_on: str, expression: str, same: dict[str, float]
) -> None:
    """The plant's own effects, once more as terms at the same place."""
    base = (
        frigate.with_values({"hull.wake_fraction": 0.0})
        if "hull.wake_fraction" in same
        else frigate
    )
    numbers = {
        "c1": frigate.hull.resistance_coefficient_N_s2_m2,
        "tau": frigate.pitch_actuator.time_constant_s,
    }
    used = {name: number for name, number in numbers.items() if name in expression}
    found, expected = (
        sailed(with_term(base, expression, acts_on, **used)),
        sailed(base.with_values(same)),
    )
    for name in ("shaft_speed", "ship_speed", "shaft_torque", "pitch_ratio"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
    assert np.abs(found["shaft_speed"] - sailed(base)["shaft_speed"]).max() > 0.01


def test_thrust_and_demand_are_added_to(frigate: Ship) -> None:
    weaker = sailed(with_term(frigate, "-1e4", "thrust"))
    assert weaker["thrust"][0] < sailed(frigate)["thrust"][0]
    more = with_term(frigate, "2.0", "drive")
    point, expected = equilibrium(more, 20.0, 1.2), equilibrium(frigate, 22.0, 1.2)
    assert point.state.shaft_speed == pytest.approx(expected.state.shaft_speed, rel=1e-9)


def test_terms_add_up_and_only_at_their_place(frigate: Ship) -> None:
    both = [
        {"id": name, "acts_on": place, "expression": "100.0"}
        for name, place in (("a", "load_torque"), ("b", "load_torque"), ("c", "resistance"))
    ]
    record = frigate.with_values({"term": both}).record()
    found = list(added(record, HEARD))
    assert found == [
        200.0 if p == "load_torque" else 100.0 if p == "resistance" else 0.0 for p in PLACES
    ]


def test_a_linear_model_knows_the_terms(frigate: Ship) -> None:
    drag = frigate.with_values({"transmission.quadratic_drag_N_m_s2_rad2": 60.0})
    term = with_term(frigate, "60 * shaft_speed * abs(shaft_speed)")
    models = [linearise(ship, equilibrium(ship, 22.0, 1.2)) for ship in (drag, term)]
    np.testing.assert_allclose(models[0].A, models[1].A, rtol=1e-12)


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("", "no expression"),
        ("1 +", "no expression"),
        ("wind * 2", "'wind' is unknown; known: shaft_speed"),
        ("__import__('os')", "function '__import__' is unknown"),
        ("open", "'open' is unknown"),
        ("shaft_speed.real", "cannot stand"),
        ("(lambda: 1)()", "cannot stand"),
        ("[1, 2]", "cannot stand"),
        ("'a'", "cannot stand"),
        ("True", "cannot stand"),
        ("1j", "cannot stand"),
        ("shaft_speed if 1 else 2", "cannot stand"),
        ("1 < 2", "cannot stand"),
        ("min(1)", "min takes 2, not 1"),
        ("tanh(1, 2)", "tanh takes 1, not 2"),
        ("sin(x=1)", "cannot stand"),
        ("+".join(["shaft_speed"] * 40), "79 operations; at most 64"),
        ("+".join(["1"] * 25), "25 numbers; at most 24"),
        ("1+(" * 12 + "drive" + ")" * 12, "13 steps of depth; at most 12"),
        ("max(1, " * 12 + "drive" + ")" * 12, "13 steps of depth; at most 12"),
        ("(" * 3000 + "1" + ")" * 3000, "no expression"),
    ],
)  # fmt: skip
def test_what_is_no_expression_is_refused(expression: str, words: str) -> None:
    with pytest.raises(TermError, match=words.replace("(", r"\(")):
        parsed(expression, {})


def test_the_largest_that_is_allowed_works(frigate: Ship) -> None:
    deep = "1+(" * (MAX_DEPTH - 1) + "drive" + ")" * (MAX_DEPTH - 1)
    assert value(frigate, deep) == HEARD.drive + MAX_DEPTH - 1
    record = frigate.record()
    for i in range(MAX_TERMS):
        assert add_term(record, Term(id=f"t{i}", acts_on="thrust", expression="1")) == i
    with pytest.raises(TermError, match="at most 6 terms"):
        add_term(record, Term(id="more", acts_on="thrust", expression="1"))


@pytest.mark.parametrize(
    ("term", "words"),
    [
        ({"id": "a", "acts_on": "wind", "expression": "1"}, "acts_on"),
        ({"id": "A b", "acts_on": "thrust", "expression": "1"}, "id"),
        ({"id": "a", "acts_on": "thrust", "expression": "1", "parameters": {"drive": 1.0}},
         "a name of its own"),
        ({"id": "a", "acts_on": "thrust", "expression": "k",
          "parameters": {"k": {"value": 3.0, "high": 2.0}}}, "outside"),
        ({"id": "a", "acts_on": "thrust", "expression": "k"}, "'k' is unknown"),
    ],
)  # fmt: skip
def test_a_bad_term_is_named(frigate: Ship, term: dict[str, Any], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        frigate.with_values({"term": [term]})


def test_a_term_stands_once(frigate: Ship) -> None:
    term = {"id": "a", "acts_on": "thrust", "expression": "1"}
    with pytest.raises(ShipError, match="stands twice"):
        frigate.with_values({"term": [term, term]})


def test_a_file_with_terms_reads_back(frigate: Ship, tmp_path: Path) -> None:
    ship = with_term(frigate, "k * shaft_speed", k=3.0)
    again = load_ship(write_ship(ship, tmp_path / "mine.toml"))
    assert again == ship
    assert again.record().tobytes() == ship.record().tobytes()


def test_every_signal_and_function_is_reached(frigate: Ship) -> None:
    assert Heard._fields == tuple(TERM_SIGNALS)
    assert Added._fields == tuple(PLACES)
    for i, name in enumerate(TERM_SIGNALS):
        assert value(frigate, name) == HEARD[i]
    assert len({code for code, _ in FUNCTIONS.values()}) == len(FUNCTIONS)


def test_a_terms_parameter_is_a_number_of_the_ship(frigate: Ship) -> None:
    given = {"a": 2.0, "k": {"value": 3.0, "unit": "N m s/rad", "low": 0.0, "high": 9.0}}
    first = {"id": "first", "acts_on": "thrust", "expression": "5"}
    term = {"id": "more-drag", "acts_on": "load_torque", "expression": "a * k", "parameters": given}
    ship = frigate.with_values({"term": [first, term]})
    number = ship.number("term.more-drag.k")
    assert (number.value, number.info.unit, number.info.low, number.info.high) == (
        3.0, "N m s/rad", 0.0, 9.0,
    )  # fmt: skip
    changed = ship.with_values({"term.more-drag.k": 4.0})
    assert changed.term[1].parameters["k"].unit == "N m s/rad"
    record = ship.record()
    number.write(record, 4.0)
    assert record.tobytes() == changed.record().tobytes()
    assert number.read(record) == 4.0
    assert frigate.with_term(ship.term[0]).with_term(ship.term[1]) == ship
    for key in ("term.more-drag.b", "term.other.k", "term.more-drag", "term"):
        assert not ship.has_key(key)
    with pytest.raises(ShipError, match="outside 0 to 9"):
        ship.with_values({"term.more-drag.k": 10.0})
    with pytest.raises(ShipError, match=r"term.other.k is not a known key"):
        ship.with_values({"term.other.k": 1.0})
