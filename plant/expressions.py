"""Evaluating terms inside the equations: operations on a stack, as :mod:`.terms` writes them.

Expressions of terms: parsed, never run, into a list of operations on a stack for the kernels.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.numeric import piecewise_linear

MAX_TERMS, MAX_PROGRAMS, MAX_OPERATIONS, MAX_CONSTANTS, MAX_DEPTH = 6, 12, 64, 24, 24
MAX_STATES = 3
MAX_SIGNALS = 6
"""From outside the ship that its terms may hear."""

(CONSTANT, SIGNAL, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE, ABS, SIGN, STEP, SQRT, EXP, LOG,
 TANH, SIN, COS, ARCTAN, MIN, MAX, TABLE) = range(21)  # fmt: skip
"""Operations."""

NO_SIGNALS = (0.0,) * MAX_SIGNALS
"""Where nothing from outside is heard."""


class Heard(NamedTuple):
    """Signals at one instant that are known before any term acts."""

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


class Loaded(NamedTuple):
    """Signals that are known once demand and inflow are: what the plant's own parts give."""

    thrust: Real
    propeller_torque: Real
    brake_torque: Real
    resistance: Real
    pitch_rate: Real


BEFORE = 2
"""Places whose terms act before the parts do: the first of :data:`shaftline.plant.terms.PLACES`."""

FIRST_STATE = len(Heard._fields) + len(Loaded._fields)
FIRST_SIGNAL = FIRST_STATE + MAX_STATES
"""Where the states of terms, and what is heard from outside, begin among the signals."""


class AddedBefore(NamedTuple):
    """What a ship's terms add to what its parts are given."""

    drive: Real  # [mm | V | N m]
    inflow_velocity: Real  # [m/s]


class Added(NamedTuple):
    """What a ship's terms add to what its parts give, and the rates of the terms' own states."""

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
def outside_at(signals: Any, row: int) -> tuple[float, ...]:
    """What is heard from outside at a row of an array of shape (rows, MAX_SIGNALS), or its only one."""
    k = min(row, len(signals) - 1)
    return (
        signals[k, 0], signals[k, 1], signals[k, 2], signals[k, 3], signals[k, 4], signals[k, 5],
    )  # fmt: skip


@compiled_apart
def added_before(
    plant: Record, heard: Heard, states: tuple[Real, ...], outside: tuple[float, ...]
) -> AddedBefore:
    """Sums of a ship's terms on what its parts are given.

    Args:
        plant: ship record.
        heard: the signals.
        states: of its terms.
        outside: signals from outside the ship.
    """
    none = Loaded(0.0, 0.0, 0.0, 0.0, 0.0)
    signals = _signals(heard, none, states, outside)
    drive = inflow_velocity = signals[0] * 0.0
    for slot in range(plant.term_programs):
        if plant.term_place[slot] == 0:
            drive += _value(plant, signals, slot)
        elif plant.term_place[slot] == 1:
            inflow_velocity += _value(plant, signals, slot)
    return AddedBefore(drive, inflow_velocity)


@compiled_apart
def added(
    plant: Record, heard: Heard, loaded: Loaded, states: tuple[Real, ...],
    outside: tuple[float, ...],
) -> Added:  # fmt: skip
    """Sums of a ship's terms on what its parts give, place by place; 0 where it has none.

    Args:
        plant: ship record.
        heard: the signals.
        loaded: the signals that the parts give.
        states: of its terms.
        outside: signals from outside the ship.
    """
    signals = _signals(heard, loaded, states, outside)
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
    return Added(t, q, m, r, p, y, n, rate_1, rate_2, rate_3)


@compiled
def _signals(
    heard: Heard, loaded: Loaded, states: tuple[Real, ...], outside: tuple[float, ...]
) -> tuple[Real, ...]:
    """All signals in their order, of one type: complex where any of them is."""
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
    """Value of a program."""
    if plant.term_depth[slot] <= REGISTERS:
        return _in_registers(plant, signals, slot)
    return _on_a_stack(plant, signals, slot)


REGISTERS = 4
"""Depth up to which a program needs no stack in memory."""


@compiled
def _in_registers(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Value of a program that is not deep; ``a`` is the top of its stack."""
    term = plant.term_owner[slot]
    a = b = c = d = signals[0] * 0.0
    for k in range(plant.term_length[slot]):
        code, index = plant.term_code[slot, k], plant.term_index[slot, k]
        if code == CONSTANT:
            a, b, c, d = a * 0.0 + plant.term_constants[term, index], a, b, c
        elif code == SIGNAL:
            a, b, c, d = signals[index], a, b, c
        elif code <= POWER or code >= MIN:
            a, b, c = _of_two(code, b, a), c, d
        else:
            a = _of_one(code, a)
    return a


@compiled_apart
def _on_a_stack(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """The same of any program."""
    term = plant.term_owner[slot]
    stack = np.zeros(MAX_DEPTH, np.array(signals[:1]).dtype)
    top = -1
    for k in range(plant.term_length[slot]):
        code, index = plant.term_code[slot, k], plant.term_index[slot, k]
        if code == CONSTANT:
            top += 1
            stack[top] = plant.term_constants[term, index]
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
def rows_of(program: Any, constants: Any, signals: Any, found: Any) -> None:
    """Values of a program that belongs to no term, a row each.

    Args:
        program: operations, each with its index, shape (n, 2).
        constants: that it uses, shape (m,).
        signals: that it uses, shape (rows, k).
        found: shape (rows,), filled; not finite where the program has no value.
    """
    stack = np.zeros(MAX_DEPTH)
    for row in range(len(signals)):
        top = -1
        for k in range(len(program)):
            code, index = program[k, 0], program[k, 1]
            if code == CONSTANT:
                top += 1
                stack[top] = constants[index]
            elif code == SIGNAL:
                top += 1
                stack[top] = signals[row, index]
            elif code == TABLE:
                top -= index
                points = stack[top + 1 : top + 1 + index]
                stack[top] = piecewise_linear(points[::2], points[1::2], index // 2, stack[top])
            elif code <= POWER or code >= MIN:
                top -= 1
                stack[top] = _of_two(code, stack[top], stack[top + 1])
            else:
                stack[top] = _of_one(code, stack[top])
        found[row] = stack[0]


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
    # whole powers by multiplication, so that a negative base is no complex number
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
    "abs": (ABS, 1), "sign": (SIGN, 1), "step": (STEP, 1), "sqrt": (SQRT, 1), "exp": (EXP, 1),
    "log": (LOG, 1), "tanh": (TANH, 1), "sin": (SIN, 1), "cos": (COS, 1), "atan": (ARCTAN, 1),
    "min": (MIN, 2), "max": (MAX, 2), "table": (TABLE, 0),
}  # fmt: skip
"""Code and number of arguments; ``step`` is 1 above 0 and 0 elsewhere, ``sign`` 0 at 0.

``table(x, x1, y1, x2, y2, ...)`` draws straight lines between two or more points and holds the outermost
values outside them. Their x are plain numbers that rise; their y may be any expressions.
"""

_LARGEST = 1e300  # of a literal

_BINARY = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER}


Program: TypeAlias = tuple[tuple[int, int], ...]
"""An expression as the kernels take it: codes, each with the index of a constant or signal."""


class TermError(ValueError):
    """An expression that cannot be used; the message says where and why."""


def parsed(
    expression: str, numbers: Sequence[str], names: Mapping[str, int], literals: list[float]
) -> Program:
    """A term's program.

    Args:
        expression: see the module.
        numbers: names of the term's parameters.
        names: signals that it may use, and their places among the kernels' signals.
        literals: numbers that stand in the term's expressions so far; its own are appended.

    Raises:
        TermError: no expression, a name or function that is unknown, or one that is too long or too
            deep.
    """
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise TermError(f"{expression!r}: no expression ({type(error).__name__})") from None
    operations: list[tuple[int, int]] = []
    known = {name: (CONSTANT, i) for i, name in enumerate(numbers)}
    known |= {name: (SIGNAL, i) for name, i in names.items() if name not in known}
    deepest = _walk(tree, known, operations, literals, len(numbers), expression)
    for what, found, most in (
        ("operations", len(operations), MAX_OPERATIONS),
        ("numbers", len(numbers) + len(literals), MAX_CONSTANTS),
        ("steps of depth", deepest, MAX_DEPTH),
    ):
        if found > most:
            raise TermError(f"{expression!r}: {found} {what}; at most {most} are allowed")
    return tuple(operations)


def _walk(
    node: ast.AST,
    names: Mapping[str, tuple[int, int]],
    operations: list[tuple[int, int]],
    literals: list[float],
    first: int,
    source: str,
) -> int:
    """Append a node's operations; gives the depth of stack that it needs."""
    # a truth value is a whole number to Python, but nobody means one
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        assert isinstance(node.value, int | float)  # for the type checker
        if not -_LARGEST <= node.value <= _LARGEST:
            raise TermError(f"{source!r}: a number in it is larger than {_LARGEST:g}")
        operations.append((CONSTANT, first + len(literals)))
        literals.append(float(node.value))
        return 1
    if isinstance(node, ast.Name):
        if node.id not in names:
            raise TermError(f"{source!r}: {node.id!r} is unknown; known: {', '.join(names)}")
        operations.append(names[node.id])
        return 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        depth = _walk(node.operand, names, operations, literals, first, source)
        if isinstance(node.op, ast.USub):
            operations.append((NEGATE, 0))
        return depth
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left = _walk(node.left, names, operations, literals, first, source)
        right = _walk(node.right, names, operations, literals, first, source)
        operations.append((_BINARY[type(node.op)], 0))
        return max(left, right + 1)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        code, count = FUNCTIONS.get(node.func.id, (-1, 0))
        if code < 0:
            raise TermError(
                f"{source!r}: function {node.func.id!r} is unknown; known: {', '.join(FUNCTIONS)}"
            )
        if code == TABLE:
            count = len(node.args)
            if count < 5 or count % 2 == 0:
                raise TermError(
                    f"{source!r}: table takes a signal and two or more pairs x, y; not {count} values"
                )
            _check_rising(node.args[1::2], source)
        if len(node.args) != count:
            raise TermError(f"{source!r}: {node.func.id} takes {count}, not {len(node.args)}")
        depths = [
            _walk(a, names, operations, literals, first, source) + i
            for i, a in enumerate(node.args)
        ]
        operations.append((code, count - 1 if code == TABLE else 0))
        return max(depths)
    raise TermError(f"{source!r}: {ast.unparse(node)!r} cannot stand in an expression")


def _check_rising(knots: Sequence[ast.expr], source: str) -> None:
    """Refuse the x of a table's points that are no plain numbers or do not rise."""
    values: list[float] = []
    for knot in knots:
        sign, digits = 1.0, knot
        while isinstance(digits, ast.UnaryOp) and isinstance(digits.op, ast.USub | ast.UAdd):
            sign = -sign if isinstance(digits.op, ast.USub) else sign
            digits = digits.operand
        if not isinstance(digits, ast.Constant) or type(digits.value) not in (int, float):
            raise TermError(
                f"{source!r}: {ast.unparse(knot)!r} is the x of a table's point; it must be a plain "
                "number, so that the points stand in order whatever the parameters are"
            )
        assert isinstance(digits.value, int | float)  # for the type checker
        values.append(sign * digits.value)
    for before, after in itertools.pairwise(values):
        if not before < after:
            raise TermError(
                f"{source!r}: the x of a table's points must rise, but {after:g} follows {before:g}"
            )


def deepest(program: Program) -> int:
    """Most values that stand on the stack at once while a program runs."""
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
    """Names in an expression that stand for values, not functions; none in what is no expression."""
    try:
        tree = ast.parse(expression.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return []
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    names = [n for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called]
    names.sort(key=lambda node: (node.lineno, node.col_offset))
    return [node.id for node in names]
