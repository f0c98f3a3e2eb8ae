"""Expressions: what they mean, and what is refused."""

from __future__ import annotations

import gc
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.expressions import (
    FUNCTIONS,
    MAX_DEPTH,
    MAX_TERMS,
    InputSignals,
    InputTermSums,
    LoadSignals,
    LoadTermSums,
    TermError,
    names_in,
    parse_expression,
)
from shaftline.plant.terms import PLACES, TERM_SIGNALS, TURNING_SIGNALS, Term, add_term

from .terms import HEARD, LOADED, value


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
        ("1 / 9 ** 9 ** 9 ** 9", 0.0),  # of an infinite power
        ("shaft_speed * ship_speed", 88.0),
        ("pitch_ratio + 10 * pitch_command", 14.2),
        ("drive / advance_velocity", 22.0 / 6.5),
        ("submergence - time", -26.0),
        ("abs(-3) + sign(-3) + sign(0) + sign(2)", 3.0),
        ("step(0.1) + 10 * step(0) + 100 * step(-1)", 1.0),
        ("sqrt(9) + exp(0) + log(1)", 4.0),
        (
            "tanh(0.5) - sin(0.5) + cos(0.5) - atan(0.5)",
            np.tanh(0.5) - np.sin(0.5) + np.cos(0.5) - np.arctan(0.5),
        ),
        ("min(2, 3) + 10 * max(2, 3)", 32.0),
        ("max(min(shaft_speed, 5), -5)", 5.0),
        ("thrust / propeller_torque", 2e5 / 6e4),
        ("brake_torque - resistance + pitch_rate", 6.5e4 - 1.8e5 + 0.02),
        ("table(shaft_speed, 0, 5, 10, 25, 12, 21)", 23.0),
        ("table(9 - shaft_speed, 0, 5, 10, 25)", 5.0),
        ("1 + table(2 * shaft_speed, 0, 5, 10, 25) * 2", 51.0),
        ("+a * 2 - b", 5.0),
        ("min(exp(1000 * ship_speed), 3)", 3.0),  # above the largest number
        ("max(log(0 * ship_speed), 3)", 3.0),
    ],
)
def test_an_expression_means_what_it_says(frigate: Ship, expression: str, expected: float) -> None:
    numbers = {"a": 4.0, "b": 3.0} if "a *" in expression else {}
    assert value(frigate, expression, HEARD, **numbers) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("table(ship_speed, 20, 4e4, 0, 0)", "must rise, but 0 follows 20"),
        ("table(ship_speed, 0, 1, 0, 2)", "must rise, but 0 follows 0"),
        ("table(ship_speed, 1, 1, -2, 2, 3, 3)", "must rise, but -2 follows 1"),
        ("1 + 2 * table(ship_speed, 0, 1, 5, table(drive, 2, 0, 1, 0))", "but 1 follows 2"),
        ("table(ship_speed, 0, 1, drive, 2)", "'drive' is the x of a table's point"),
        ("table(ship_speed, 0, 1, 2 + 3, 2)", "'2 + 3' is the x of a table's point"),
    ],
)
def test_points_of_a_table_stand_in_order(expression: str, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        Term(id="a", acts_on="thrust", expression=expression)


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
        base = InputSignals(*(complex(x) for x in HEARD))
        moved = base._replace(**{name: getattr(base, name) + 1j * h})
        slope = value(frigate, expression, moved).imag / h
        step = 1e-6 * getattr(HEARD, name)
        up, down = (HEARD._replace(**{name: getattr(HEARD, name) + s}) for s in (step, -step))
        numeric = (value(frigate, expression, up) - value(frigate, expression, down)) / (2.0 * step)
        assert slope == pytest.approx(numeric, rel=1e-6), name


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("", "not a valid expression"),
        ("1 +", "not a valid expression"),
        ("wind * 2", "'wind' is unknown; known: k, shaft_speed"),
        ("__import__('os')", "function '__import__' is unknown"),
        ("open", "'open' is unknown"),
        ("shaft_speed.real", "is not allowed in an expression"),
        ("(lambda: 1)()", "is not allowed in an expression"),
        ("[1, 2]", "is not allowed in an expression"),
        ("'a'", "is not allowed in an expression"),
        ("True", "is not allowed in an expression"),
        ("1j", "is not allowed in an expression"),
        ("shaft_speed if 1 else 2", "is not allowed in an expression"),
        ("1 < 2", "is not allowed in an expression"),
        ("min(1)", "min takes 2 argument"),
        ("table(drive, 1, 2)", "table takes a signal and two or more pairs x, y; not 3"),
        ("table(drive, 1, 2, 3, 4, 5)", "table takes a signal and two or more pairs x, y; not 6"),
        ("tanh(1, 2)", "tanh takes 1 argument"),
        ("sin(x=1)", "is not allowed in an expression"),
        ("+".join(["shaft_speed"] * 40), "79 operations; at most 64"),
        ("+".join(["1"] * 24), "25 numbers; at most 24"),
        ("drive+(" * 24 + "drive" + ")" * 24, "25 levels of nesting; at most 24"),
        ("max(drive, " * 24 + "drive" + ")" * 24, "25 levels of nesting; at most 24"),
        ("(" * 3000 + "1" + ")" * 3000, "not a valid expression"),
    ],
)
def test_what_is_no_expression_is_refused(expression: str, words: str) -> None:
    with pytest.raises(TermError, match=words.replace("(", r"\(")):
        parse_expression(expression, ["k"], {name: i for i, name in enumerate(TERM_SIGNALS)}, [])


def test_the_largest_that_is_allowed_works(frigate: Ship) -> None:
    deep = "drive+(" * (MAX_DEPTH - 1) + "drive" + ")" * (MAX_DEPTH - 1)
    assert value(frigate, deep) == HEARD.drive * MAX_DEPTH
    record = frigate.record()
    for i in range(MAX_TERMS):
        assert add_term(record, Term(id=f"t{i}", acts_on="thrust", expression="1")) == i
    with pytest.raises(TermError, match="at most 6 terms"):
        add_term(record, Term(id="more", acts_on="thrust", expression="1"))


def test_every_signal_and_function_is_reached(frigate: Ship) -> None:
    assert InputSignals._fields + LoadSignals._fields == tuple(TERM_SIGNALS)
    assert (InputTermSums._fields + LoadTermSums._fields)[: len(PLACES)] == tuple(PLACES)
    assert LoadTermSums._fields[len(PLACES) - 2 :] == ("rate_1", "rate_2", "rate_3")
    turning = load_ship("ddg-51-surrogate")  # any other has four of them from outside
    for name, expected in zip(TERM_SIGNALS, (*HEARD, *LOADED), strict=True):
        assert value(turning, name) == expected
        if name in TURNING_SIGNALS:
            with pytest.raises(ShipError, match=f"'{name}' is unknown"):
                value(frigate, name)
    assert len({code for code, _ in FUNCTIONS.values()}) == len(FUNCTIONS)


def test_threads_parse_expressions_together() -> None:
    """The parser of Python 3.11.7 fails in some of them (CPython issue 106905)."""

    class Cycle:
        def __del__(self) -> None:
            """Let another thread run while the parser collects garbage."""

    def parse(thread: int) -> int:
        for k in range(1000):
            own: Any = Cycle()
            own.own = own
            assert names_in(f"-(a * step(b) + c * (d + e * (f + {thread} + {k})))") == list(
                "abcdef"
            )
        return thread

    before = gc.get_threshold(), sys.getswitchinterval()
    gc.set_threshold(5)
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(parse, range(4))) == [0, 1, 2, 3]
    finally:
        gc.set_threshold(*before[0])
        sys.setswitchinterval(before[1])
