"""Expressions of terms: parsed, never run, into a list of operations on a stack for the kernels."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from .term_kernel import (
    ABS,
    ADD,
    ARCTAN,
    CONSTANT,
    COS,
    DIVIDE,
    EXP,
    LOG,
    MAX,
    MAX_CONSTANTS,
    MAX_DEPTH,
    MAX_OPERATIONS,
    MIN,
    MULTIPLY,
    NEGATE,
    POWER,
    SIGN,
    SIGNAL,
    SIN,
    SQRT,
    STEP,
    SUBTRACT,
    TABLE,
    TANH,
)  # fmt: skip

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
