"""Physics as data: what an expression in a ship's file adds to the equations.

    [[term]]
    id = "friction-by-direction"
    acts_on = "drive_torque"
    expression = "-c_ahead * step(shaft_speed) + c_astern * step(-shaft_speed)"
    parameters = { c_ahead = 1200.0, c_astern = 900.0 }

An expression is numbers, the term's parameters and :data:`TERM_SIGNALS`, joined by ``+ - * / **``
and the functions of :data:`FUNCTIONS`. It is parsed, never run: what the kernels see is a list of
operations on a stack, carried in the ship's record. Complex numbers pass, so linear models know the
terms too.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from .keys import Section
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
    MAX_TERMS,
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
    TANH,
)

PLACES = {
    "drive": "demand that reaches the prime mover [mm | V | N m]",
    "inflow_velocity": "advance velocity of the propeller [m/s]",
    "thrust": "thrust of one propeller [N]",
    "drive_torque": "torque that drives the shaft, before the gauge [N m]",
    "load_torque": "torque that the shaft bears, behind the gauge [N m]",
    "resistance": "resistance of the hull [N]",
    "pitch_rate": "rate of the pitch actuator [1/s]",
}
"""Where a term may act, and what it adds to."""

TERM_SIGNALS = {
    "shaft_speed": "omega [rad/s]",
    "ship_speed": "v_s over ground [m/s]",
    "pitch_ratio": "P/D of the blades [-]",
    "pitch_command": "P/D commanded [-]",
    "drive": "fuel rack [mm], voltage [V] or torque [N m]",
    "advance_velocity": "v_a before terms act on it [m/s]",
    "submergence": "of the propeller's centre [m]",
    "time": "since the start [s]",
}
"""What an expression may use."""

FUNCTIONS = {
    "abs": (ABS, 1), "sign": (SIGN, 1), "step": (STEP, 1), "sqrt": (SQRT, 1), "exp": (EXP, 1),
    "log": (LOG, 1), "tanh": (TANH, 1), "sin": (SIN, 1), "cos": (COS, 1), "atan": (ARCTAN, 1),
    "min": (MIN, 2), "max": (MAX, 2),
}  # fmt: skip
"""Code and number of arguments; ``step`` is 1 above 0 and 0 elsewhere, ``sign`` 0 at 0."""

_BINARY = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE, ast.Pow: POWER}


class Program(NamedTuple):
    """An expression as the kernels take it."""

    operations: tuple[tuple[int, int], ...]  # code, and index of a constant or signal
    constants: tuple[float, ...]  # the parameters first, in their order, then the numbers


class TermError(ValueError):
    """An expression that cannot be used; the message says where and why."""


def parsed(expression: str, parameters: Mapping[str, float]) -> Program:
    """A term's program.

    Args:
        expression: see the module.
        parameters: values by name.

    Raises:
        TermError: no expression, a name or function that is unknown, or one that is too long or too
            deep.
    """
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise TermError(f"{expression!r}: no expression ({type(error).__name__})") from None
    operations: list[tuple[int, int]] = []
    constants = [float(value) for value in parameters.values()]
    names = {name: (CONSTANT, i) for i, name in enumerate(parameters)}
    names |= {name: (SIGNAL, i) for i, name in enumerate(TERM_SIGNALS) if name not in names}
    deepest = _walk(tree, names, operations, constants, expression)
    for what, found, most in (
        ("operations", len(operations), MAX_OPERATIONS),
        ("numbers", len(constants), MAX_CONSTANTS),
        ("steps of depth", deepest, MAX_DEPTH),
    ):
        if found > most:
            raise TermError(f"{expression!r}: {found} {what}; at most {most} are allowed")
    return Program(tuple(operations), tuple(constants))


def _walk(
    node: ast.AST,
    names: Mapping[str, tuple[int, int]],
    operations: list[tuple[int, int]],
    constants: list[float],
    source: str,
) -> int:
    """Append a node's operations; gives the depth of stack that it needs."""
    # a truth value is a whole number to Python, but nobody means one
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        assert isinstance(node.value, int | float)  # for the type checker
        operations.append((CONSTANT, len(constants)))
        constants.append(float(node.value))
        return 1
    if isinstance(node, ast.Name):
        if node.id not in names:
            raise TermError(f"{source!r}: {node.id!r} is unknown; known: {', '.join(names)}")
        operations.append(names[node.id])
        return 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        depth = _walk(node.operand, names, operations, constants, source)
        if isinstance(node.op, ast.USub):
            operations.append((NEGATE, 0))
        return depth
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        left = _walk(node.left, names, operations, constants, source)
        right = _walk(node.right, names, operations, constants, source)
        operations.append((_BINARY[type(node.op)], 0))
        return max(left, right + 1)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        code, count = FUNCTIONS.get(node.func.id, (-1, 0))
        if code < 0:
            raise TermError(
                f"{source!r}: function {node.func.id!r} is unknown; known: {', '.join(FUNCTIONS)}"
            )
        if len(node.args) != count:
            raise TermError(f"{source!r}: {node.func.id} takes {count}, not {len(node.args)}")
        depths = [
            _walk(a, names, operations, constants, source) + i for i, a in enumerate(node.args)
        ]
        operations.append((code, 0))
        return max(depths)
    raise TermError(f"{source!r}: {ast.unparse(node)!r} cannot stand in an expression")


class TermParameter(BaseModel):
    """A number of a term, with its unit and range."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    value: float
    unit: str = "-"
    low: float = Field(-1e12, ge=-1e12)
    high: float = Field(1e12, le=1e12)

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, given: Any) -> Any:
        return {"value": given} if isinstance(given, int | float) else given

    @model_validator(mode="after")
    def _inside(self) -> TermParameter:
        if not self.low <= self.value <= self.high:
            raise ValueError(f"{self.value:g} lies outside {self.low:g} to {self.high:g}")
        return self


class Term(Section):
    """One term; see the module."""

    id: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60)]
    acts_on: Literal[
        "drive", "inflow_velocity", "thrust", "drive_torque", "load_torque", "resistance",
        "pitch_rate",
    ]  # fmt: skip
    expression: Annotated[str, Field(max_length=1000)]
    parameters: dict[str, TermParameter] = Field(default_factory=dict, strict=False)

    @model_validator(mode="after")
    def _usable(self) -> Term:
        for name in self.parameters:
            if not name.isidentifier() or name in TERM_SIGNALS or name in FUNCTIONS:
                raise ValueError(f"parameter {name!r}: a name of its own is needed")
        _ = self.program  # raises what is wrong with it
        return self

    def __hash__(self) -> int:
        """Of its content, for ships are kept by theirs."""
        return hash((self.id, self.acts_on, self.expression, tuple(self.parameters.items())))

    @property
    def program(self) -> Program:
        """The expression as the kernels take it."""
        return parsed(self.expression, {name: p.value for name, p in self.parameters.items()})


RECORD_FIELDS = (
    ("term_count", np.int64),
    ("term_place", np.int64, (MAX_TERMS,)),
    ("term_length", np.int64, (MAX_TERMS,)),
    ("term_code", np.int64, (MAX_TERMS, MAX_OPERATIONS)),
    ("term_index", np.int64, (MAX_TERMS, MAX_OPERATIONS)),
    ("term_constants", np.float64, (MAX_TERMS, MAX_CONSTANTS)),
)
"""What a ship's record holds of its terms."""


def add_term(record: Any, term: Term) -> int:
    """Put a term into a ship's record, in the next free place; gives the place's number.

    Raises:
        TermError: the record is full.
    """
    slot = int(record["term_count"])
    if slot >= MAX_TERMS:
        raise TermError(f"{term.id}: a ship carries at most {MAX_TERMS} terms")
    program = term.program
    record["term_count"] = slot + 1
    record["term_place"][slot] = list(PLACES).index(term.acts_on)
    record["term_length"][slot] = len(program.operations)
    codes, indices = zip(*program.operations, strict=True)
    record["term_code"][slot, : len(codes)] = codes
    record["term_index"][slot, : len(indices)] = indices
    record["term_constants"][slot, : len(program.constants)] = program.constants
    return slot
