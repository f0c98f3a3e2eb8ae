"""Expressions of terms: parsed into operations on a stack, and evaluated inside the equations.

An expression is never executed as Python. :func:`parse_expression` translates it into a program, a list
of operations with indices of constants and signals. The kernels run the programs that :mod:`.terms`
writes into the ship record.
"""

from __future__ import annotations

import ast
import functools
import itertools
import math
import threading
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn, TypeAlias

import numpy as np

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.lanes import one_by_one
from ..core.numeric import piecewise_linear

MAX_TERMS, MAX_PROGRAMS, MAX_OPERATIONS, MAX_CONSTANTS, MAX_DEPTH = 6, 12, 64, 24, 24
MAX_STATES = 3
MAX_SIGNALS = 6
"""Largest number of external signals of a ship."""

(CONSTANT, SIGNAL, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE, ABS, SIGN, STEP, SQRT, EXP, LOG,
 TANH, SIN, COS, ARCTAN, MIN, MAX, TABLE) = range(21)  # fmt: skip
"""Codes of the operations."""

NO_SIGNALS = (0.0,) * MAX_SIGNALS
"""Values of the external signals if there are none."""


class InputSignals(NamedTuple):
    """Signals at one instant that are known before the models of the plant are evaluated."""

    shaft_speed: Real
    ship_speed: Real
    pitch_ratio: Real
    pitch_command: Real
    drive: Real
    advance_velocity: Real
    submergence: Real
    time: Real
    sway_speed: Real
    yaw_rate: Real
    heading: Real
    rudder_angle: Real
    shaft_angle: Real


class LoadSignals(NamedTuple):
    """Signals at one instant that the models of the plant give, from drive command and inflow."""

    thrust: Real
    propeller_torque: Real
    brake_torque: Real
    resistance: Real
    pitch_rate: Real


BEFORE = 2
"""Number of locations whose terms act on the inputs of the models, first in ``terms.PLACES``."""

FIRST_STATE = len(InputSignals._fields) + len(LoadSignals._fields)
FIRST_SIGNAL = FIRST_STATE + MAX_STATES
"""Indices at which the terms' states, and the external signals, begin among the signals."""


class InputTermSums(NamedTuple):
    """Sums of a ship's terms that act on inputs of the models."""

    drive: Real  # [mm | V | N m]
    inflow_velocity: Real  # [m/s]


class LoadTermSums(NamedTuple):
    """Sums of a ship's terms that act on results of the models, and the rates of the terms' states."""

    thrust: Real  # of one propeller [N]
    drive_torque: Real  # [N m]
    load_torque: Real  # [N m]
    resistance: Real  # [N]
    pitch_rate: Real  # [1/s]
    side_force: Real  # [N]
    yaw_moment: Real  # [N m]
    rate_1: Real
    rate_2: Real
    rate_3: Real


@compiled
def external_at(signals: Any, row: int) -> tuple[float, ...]:
    """Return the external signals at a row of an array, shape (rows, MAX_SIGNALS) or a single row."""
    k = min(row, len(signals) - 1)
    return (
        signals[k, 0],
        signals[k, 1],
        signals[k, 2],
        signals[k, 3],
        signals[k, 4],
        signals[k, 5],
    )


@one_by_one
@compiled_apart
def sum_input_terms(
    plant: Record, inputs: InputSignals, states: tuple[Real, ...], outside: tuple[float, ...]
) -> InputTermSums:
    """Return the sums of a ship's terms that act on inputs of the models."""
    none = LoadSignals(0.0, 0.0, 0.0, 0.0, 0.0)
    signals = _signals(inputs, none, states, outside)
    drive = inflow_velocity = signals[0] * 0.0
    for slot in range(plant.term_programs):
        if plant.term_place[slot] == 0:
            drive += _value(plant, signals, slot)
        elif plant.term_place[slot] == 1:
            inflow_velocity += _value(plant, signals, slot)
    return InputTermSums(drive, inflow_velocity)


@one_by_one
@compiled_apart
def sum_load_terms(
    plant: Record,
    inputs: InputSignals,
    loads: LoadSignals,
    states: tuple[Real, ...],
    outside: tuple[float, ...],
) -> LoadTermSums:
    """Return the sums of a ship's terms that act on results of the models, by location."""
    signals = _signals(inputs, loads, states, outside)
    t = q = m = r = p = y = n = rate_1 = rate_2 = rate_3 = signals[0] * 0.0
    for slot in range(plant.term_programs):
        place = plant.term_place[slot]
        if place < BEFORE:
            continue
        value = _value(plant, signals, slot)
        if place == 2:
            t += value
        elif place == 3:
            q += value
        elif place == 4:
            m += value
        elif place == 5:
            r += value
        elif place == 6:
            p += value
        elif place == 7:
            y += value
        elif place == 8:
            n += value
        elif place == 9:
            rate_1 += value
        elif place == 10:
            rate_2 += value
        else:
            rate_3 += value
    return LoadTermSums(t, q, m, r, p, y, n, rate_1, rate_2, rate_3)


@compiled
def _signals(
    heard: InputSignals, loaded: LoadSignals, states: tuple[Real, ...], outside: tuple[float, ...]
) -> tuple[Real, ...]:
    """Return all signals in their order and of one type: complex if any of them is complex."""
    of_type = 0.0 * (
        heard.shaft_speed + heard.ship_speed + heard.pitch_ratio + heard.pitch_command + heard.drive
        + heard.advance_velocity + heard.submergence + heard.time + heard.sway_speed
        + heard.yaw_rate + heard.heading + heard.rudder_angle + heard.shaft_angle + loaded.thrust
        + states[0] + states[1] + states[2] + outside[0]
    )  # fmt: skip
    return (
        of_type + heard.shaft_speed, of_type + heard.ship_speed, of_type + heard.pitch_ratio,
        of_type + heard.pitch_command, of_type + heard.drive, of_type + heard.advance_velocity,
        of_type + heard.submergence, of_type + heard.time, of_type + heard.sway_speed,
        of_type + heard.yaw_rate, of_type + heard.heading, of_type + heard.rudder_angle,
        of_type + heard.shaft_angle,
        of_type + loaded.thrust,
        of_type + loaded.propeller_torque, of_type + loaded.brake_torque,
        of_type + loaded.resistance, of_type + loaded.pitch_rate,
        of_type + states[0], of_type + states[1], of_type + states[2],
        of_type + outside[0], of_type + outside[1], of_type + outside[2],
        of_type + outside[3], of_type + outside[4], of_type + outside[5],
    )  # fmt: skip


@compiled
def _value(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Return the value of a program."""
    if plant.term_depth[slot] <= REGISTERS:
        return _in_registers(plant, signals, slot)
    return _on_a_stack(plant, signals, slot)


REGISTERS = 4
"""Stack depth up to which a program needs no stack in memory. A table has a depth of at least five, and
is not computed in registers."""


@compiled
def _in_registers(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Return the value of a program of small depth; ``a`` is the top of its stack."""
    term = plant.term_owner[slot]
    a = b = c = d = zero = signals[0] * 0.0
    for k in range(plant.term_length[slot]):
        code, index = plant.term_code[slot, k], plant.term_index[slot, k]
        if code == CONSTANT:
            a, b, c, d = zero + plant.term_constants[term, index], a, b, c
        elif code == SIGNAL:
            a, b, c, d = signals[index], a, b, c
        elif code <= POWER or code >= MIN:
            a, b, c = _of_two(code, b, a), c, d
        else:
            a = _of_one(code, a)
    return a


@compiled_apart
def _on_a_stack(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Return the value of a program of any depth."""
    stack = np.zeros(MAX_DEPTH, np.array(signals[:1]).dtype)
    constants = plant.term_constants[plant.term_owner[slot]]
    length = plant.term_length[slot]
    return _run(stack, plant.term_code[slot], plant.term_index[slot], length, constants, signals)


@compiled
def _run(stack: Any, codes: Any, indices: Any, length: int, constants: Any, signals: Any) -> Real:
    """Return the value of a program, computed on a stack."""
    top = -1
    for k in range(length):
        code, index = codes[k], indices[k]
        if code == CONSTANT:
            top += 1
            stack[top] = constants[index]
        elif code == SIGNAL:
            top += 1
            stack[top] = signals[index]
        elif code == TABLE:
            top -= index
            points = stack[top + 1 : top + 1 + index]
            stack[top] = piecewise_linear(points[::2], points[1::2], index // 2, stack[top])
        elif code <= POWER or code >= MIN:
            top -= 1
            stack[top] = _of_two(code, stack[top], stack[top + 1])
        else:
            stack[top] = _of_one(code, stack[top])
    return stack[0]


@compiled_apart
def evaluate_rows(program: Any, constants: Any, signals: Any, values: Any) -> None:
    """Evaluate a program that belongs to no term at each row of its signals, shape (rows, k).

    ``program`` holds operations, each with its index, shape (n, 2). ``values``, shape (rows,), are not
    finite where the program has no value.
    """
    stack = np.zeros(MAX_DEPTH)
    codes, indices = program[:, 0], program[:, 1]
    for row in range(len(signals)):
        values[row] = _run(stack, codes, indices, len(program), constants, signals[row])


@compiled
def _of_two(code: int, left: Real, right: Real) -> Real:
    if code == ADD:
        return left + right
    if code == SUBTRACT:
        return left - right
    if code == MULTIPLY:
        return left * right
    if code == DIVIDE:
        return left / right
    if code == MIN:
        return left if left.real <= right.real else right
    if code == MAX:
        return left if left.real >= right.real else right
    # Whole powers use multiplication, so that a negative base gives no complex number.
    if right.real != math.floor(right.real) or abs(right.real) > 8.0:
        return left**right
    product = left * 0.0 + 1.0
    for _ in range(int(abs(right.real))):
        product = product * left
    return product if right.real >= 0.0 else 1.0 / product


@compiled
def _of_one(code: int, x: Real) -> Real:
    if code == NEGATE:
        return -x
    if code == ABS:
        return x if x.real >= 0.0 else -x
    if code == SIGN:
        return x * 0.0 + (1.0 if x.real > 0.0 else (-1.0 if x.real < 0.0 else 0.0))
    if code == STEP:
        return x * 0.0 + (1.0 if x.real > 0.0 else 0.0)
    if code == SQRT:
        return np.sqrt(x)
    if code == EXP:
        return np.exp(x)
    if code == LOG:
        return np.log(x)
    if code == TANH:
        return np.tanh(x)
    if code == SIN:
        return np.sin(x)
    if code == COS:
        return np.cos(x)
    return np.arctan(x)


FUNCTIONS = {
    "abs": (ABS, 1),
    "sign": (SIGN, 1),
    "step": (STEP, 1),
    "sqrt": (SQRT, 1),
    "exp": (EXP, 1),
    "log": (LOG, 1),
    "tanh": (TANH, 1),
    "sin": (SIN, 1),
    "cos": (COS, 1),
    "atan": (ARCTAN, 1),
    "min": (MIN, 2),
    "max": (MAX, 2),
    "table": (TABLE, 0),
}
"""Code and number of arguments of each function.

``step`` is 1 above 0 and 0 elsewhere; ``sign`` is 0 at 0. ``table(x, x1, y1, x2, y2, ...)``
interpolates linearly between two or more points and is constant outside them. The x of the points are
plain numbers in rising order; the y may be any expressions.
"""

_LARGEST = 1e300  # absolute value of a literal

_BINARY = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER}


Program: TypeAlias = tuple[tuple[int, int], ...]
"""A translated expression: operation codes, each with the index of a constant or a signal."""


class TermError(ValueError):
    """An invalid expression; the message says where and why."""


_PARSER = threading.Lock()


@functools.lru_cache(maxsize=1024)
def _syntax_tree(expression: str) -> ast.Expression:
    """Return the syntax tree of an expression; it must not be changed.

    Before Python 3.11.8 the parser fails at random where threads use it together (CPython issue 106905).
    """
    with _PARSER:
        return ast.parse(expression, mode="eval")


def parse_expression(
    expression: str, parameters: Sequence[str], names: Mapping[str, int], literals: list[float]
) -> Program:
    """Return the program of an expression, which :mod:`.terms` describes.

    ``names`` are the signals that it may use, with their indices among the kernels' signals. Its numbers
    are appended to ``literals``, those of the term's expressions so far. A TermError says why it is
    invalid: an unknown name or function, or an expression that is too long or too deep.

    >>> from shaftline.plant.expressions import parse_expression
    >>> parse_expression("k * speed", ["k"], {"speed": 1}, [])
    ((0, 0), (1, 1), (4, 0))
    >>> parse_expression("k * sped", ["k"], {"speed": 1}, [])
    Traceback (most recent call last):
    ...
    shaftline.plant.expressions.TermError: 'k * sped': 'sped' is unknown; known: k, speed
    """
    try:
        tree = _syntax_tree(expression.strip()).body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise TermError(
            f"{expression!r} is not a valid expression ({type(error).__name__}); write it like "
            "'-c * shaft_speed'"
        ) from None
    operations: list[tuple[int, int]] = []
    known = {name: (CONSTANT, i) for i, name in enumerate(parameters)}
    known |= {name: (SIGNAL, i) for name, i in names.items() if name not in known}

    def refuse(reason: str) -> NoReturn:
        raise TermError(f"{expression!r}: {reason}")

    def walk(node: ast.AST) -> int:
        """Append the operations of a node and return the stack depth that it needs."""
        # Python counts True and False as whole numbers; here they are an error.
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            assert isinstance(node.value, int | float)  # for the type checker
            if not -_LARGEST <= node.value <= _LARGEST:
                refuse(f"a number exceeds {_LARGEST:g}; write smaller numbers")
            operations.append((CONSTANT, len(parameters) + len(literals)))
            literals.append(float(node.value))
            return 1
        if isinstance(node, ast.Name):
            if node.id not in known:
                refuse(f"{node.id!r} is unknown; known: {', '.join(known)}")
            operations.append(known[node.id])
            return 1
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            depth = walk(node.operand)
            if isinstance(node.op, ast.USub):
                operations.append((NEGATE, 0))
            return depth
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            left, right = walk(node.left), walk(node.right)
            operations.append((_BINARY[type(node.op)], 0))
            return max(left, right + 1)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            name, given = node.func.id, len(node.args)
            code, count = FUNCTIONS.get(name, (-1, 0))
            if code < 0:
                refuse(f"function {name!r} is unknown; known: {', '.join(FUNCTIONS)}")
            if code == TABLE:
                count = given
                if count < 5 or count % 2 == 0:
                    refuse(f"table takes a signal and two or more pairs x, y; not {count} values")
                _check_rising(node.args[1::2], expression)
            if given != count:
                refuse(f"{name} takes {count} argument(s), not {given}")
            depths = [walk(a) + i for i, a in enumerate(node.args)]
            operations.append((code, count - 1 if code == TABLE else 0))
            return max(depths)
        refuse(
            f"{ast.unparse(node)!r} is not allowed in an expression; use numbers, names, + - * / ** "
            "and functions"
        )

    deepest = walk(tree)
    for what, count, most in (
        ("operations", len(operations), MAX_OPERATIONS),
        ("numbers", len(parameters) + len(literals), MAX_CONSTANTS),
        ("levels of nesting", deepest, MAX_DEPTH),
    ):
        if count > most:
            raise TermError(f"{expression!r} has {count} {what}; at most {most} are allowed")
    return tuple(operations)


def _check_rising(knots: Sequence[ast.expr], source: str) -> None:
    """Refuse points of a table whose x are not plain numbers in rising order."""
    values: list[float] = []
    for knot in knots:
        sign, digits = 1.0, knot
        while isinstance(digits, ast.UnaryOp) and isinstance(digits.op, ast.USub | ast.UAdd):
            sign = -sign if isinstance(digits.op, ast.USub) else sign
            digits = digits.operand
        if not isinstance(digits, ast.Constant) or type(digits.value) not in (int, float):
            raise TermError(
                f"{source!r}: {ast.unparse(knot)!r} is the x of a table's point; it must be a plain "
                "number, so that the points are in order for all values of the parameters"
            )
        assert isinstance(digits.value, int | float)  # for the type checker
        values.append(sign * digits.value)
    for before, after in itertools.pairwise(values):
        if not before < after:
            raise TermError(
                f"{source!r}: the x of a table's points must rise, but {after:g} follows {before:g}"
            )


def stack_depth(program: Program) -> int:
    """Return the largest number of values on the stack while a program runs."""
    depth = most = 0
    for code, index in program:
        if code in (CONSTANT, SIGNAL):
            depth += 1
        elif code == TABLE:
            depth -= index
        elif code <= POWER or code >= MIN:
            depth -= 1
        most = max(most, depth)
    return most


def names_in(expression: str) -> list[str]:
    """Return the names of values in an expression; none if the text is no valid expression."""
    try:
        tree = _syntax_tree(expression.strip())
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return []
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    names = [n for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called]
    names.sort(key=lambda node: (node.lineno, node.col_offset))
    return [node.id for node in names]
