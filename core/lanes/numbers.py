"""Numbers of several ships at once: their types, arithmetic and conditions."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from .compiler import (
    AbstractTemplate,
    AttributeTemplate,
    Conversion,
    PrimitiveModel,
    cgutils,
    infer_getattr,
    infer_global,
    inlined_overload,
    intrinsic,
    ir,
    lower_builtin,
    lower_cast,
    lower_getattr,
    register_default,
    signature,
    types,
)

LANES = 4
"""Number of ships that are computed at once."""

DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, LANES)
INDEX = ir.IntType(32)


class DisagreementError(Exception):
    """A branch that is not the same for all ships."""


class LanesType(types.Type):  # type: ignore[misc]
    """Type of one number for each ship."""

    def __init__(self) -> None:
        super().__init__(name=f"lanes({LANES})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Return that a number of a single ship becomes the number of all."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Return the type of a variable that holds either kind of number."""
        return self if isinstance(other, LanesType | types.Float | types.Integer) else None


class ParameterType(LanesType):  # type: ignore[misc]
    """Type of a field of the ship records.

    Whether it is above, below or equal to 0 is the same for all ships (:func:`are_alike`).
    """

    def __init__(self) -> None:
        types.Type.__init__(self, name=f"parameter({LANES})")

    def can_convert_to(self, typingctx: Any, other: Any) -> Any:
        """Return that it is a number of all ships."""
        return Conversion.safe if other == LANES_TYPE else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Return the type of a variable that holds this or another number."""
        is_number = isinstance(other, LanesType | types.Float | types.Integer)
        return LANES_TYPE if is_number else None


class MaskType(types.Type):  # type: ignore[misc]
    """Type of the truth of a condition for each ship."""

    def __init__(self) -> None:
        super().__init__(name=f"mask({LANES})")


LANES_TYPE, PARAMETER_TYPE, MASK_TYPE = LanesType(), ParameterType(), MaskType()


@register_default(LanesType)
@register_default(ParameterType)
class _LanesModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, VECTOR)


@register_default(MaskType)
class _MaskModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(ir.IntType(1), LANES))


# Conversions, and numbers of single ships inside vectors.


def spread(builder: Any, value: Any) -> Any:
    """Return a vector with the same value for all ships."""
    vector = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    vector = builder.insert_element(vector, value, ir.Constant(INDEX, 0))
    order = ir.Constant(ir.VectorType(INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(vector, vector, order)


def to_lanes(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    """Return a number of any type as one of all ships."""
    if isinstance(kind, LanesType):
        return value
    return spread(builder, context.cast(builder, value, kind, types.float64))


def joined_vector(builder: Any, numbers: list[Any]) -> Any:
    """Return the vector of a number of each ship."""
    vector = ir.Constant(VECTOR, ir.Undefined)
    for lane, number in enumerate(numbers):
        vector = builder.insert_element(vector, number, ir.Constant(INDEX, lane))
    return vector


def transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Return the transpose of :data:`LANES` vectors, by exchanges in halves, quarters and so on."""
    rows = list(rows)
    distance = 1
    while distance < LANES:
        for i in range(LANES):
            if not i & distance:
                a, b = rows[i], rows[i | distance]
                first = [LANES + (j ^ distance) if j & distance else j for j in range(LANES)]
                second = [LANES + j if j & distance else j ^ distance for j in range(LANES)]
                for row, order in ((i, first), (i | distance, second)):
                    places = ir.Constant(ir.VectorType(INDEX, LANES), order)
                    rows[row] = builder.shuffle_vector(a, b, places)
        distance *= 2
    return rows


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
@lower_cast(ParameterType, LanesType)
def _cast(context: Any, builder: Any, kind: Any, to: Any, value: Any) -> Any:
    return to_lanes(context, builder, value, kind)


@infer_getattr
class _LanesAttributes(AttributeTemplate):  # type: ignore[misc]
    key = LanesType

    def resolve_real(self, lanes: Any) -> Any:
        return lanes


@lower_getattr(LanesType, "real")
def _real(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return value


# Arithmetic.

_Generator = Callable[..., Any]
"""Function that writes machine code: context, builder, numba signature and values to a value."""


def _is_number(kind: Any) -> bool:
    return isinstance(kind, LanesType | types.Float | types.Integer)


def _some_lanes(kinds: Any) -> bool:
    """Return whether all arguments are numbers, and one of them is of all ships."""
    return any(isinstance(k, LanesType) for k in kinds) and all(map(_is_number, kinds))


def _declare(function: Any, result: Any, arguments: int, generator: _Generator) -> None:
    """Define a function of numbers of which at least one is of all ships."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            fits = len(args) == arguments and _some_lanes(args) and not kws
            return signature(result, *(LANES_TYPE for _ in args)) if fits else None

    infer_global(function, types.Function(Template))
    lower_builtin(function, *(LanesType,) * arguments)(generator)


def _instruction(name: str, *more: Any) -> _Generator:
    """Return the generator of one instruction of the processor for all ships."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return getattr(builder, name)(*more, *values)

    return generate


def _extreme(relation: str) -> _Generator:
    """Return the generator of the smaller or larger of two numbers; the first one, if equal."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        first, second = values
        return builder.select(builder.fcmp_ordered(relation, second, first), second, first)

    return generate


def _vector_function(name: str) -> _Generator:
    """Return the generator of a function of LLVM that is exact or correctly rounded."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR] * len(values))
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(function, values)

    return generate


def _lane_by_lane(function: Any) -> _Generator:
    """Return the generator of a library function, which is called for each ship."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        numbers = [types.float64] * len(sig.args)
        kind = context.typing_context.resolve_value_type(function)
        scalar = kind.get_call_type(context.typing_context, numbers, {})
        call = context.get_function(kind, scalar)
        found = ir.Constant(VECTOR, ir.Undefined)
        for lane in range(LANES):
            place = ir.Constant(INDEX, lane)
            own = [builder.extract_element(value, place) for value in values]
            found = builder.insert_element(found, call(builder, own), place)
        return found

    return generate


_function: Any
_choice: Any
for _function, _name in (
    (operator.add, "fadd"),
    (operator.iadd, "fadd"),
    (operator.sub, "fsub"),
    (operator.isub, "fsub"),
    (operator.mul, "fmul"),
    (operator.imul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.itruediv, "fdiv"),
):
    _declare(_function, LANES_TYPE, 2, _instruction(_name))

_declare(operator.neg, LANES_TYPE, 1, _instruction("fneg"))
_declare(min, LANES_TYPE, 2, _extreme("<"))
_declare(max, LANES_TYPE, 2, _extreme(">"))

for _function, _name, _count in (
    (abs, "fabs", 1),
    (np.sqrt, "sqrt", 1),
    (math.sqrt, "sqrt", 1),
    (np.floor, "floor", 1),
    (math.copysign, "copysign", 2),
):
    _declare(_function, LANES_TYPE, _count, _vector_function(_name))

for _function, _count in (
    (np.tanh, 1),
    (np.arctan, 1),
    (np.exp, 1),
):
    _declare(_function, LANES_TYPE, _count, _lane_by_lane(_function))


@infer_global(operator.pow)
class _Power(AbstractTemplate):  # type: ignore[misc]
    """A power; a whole exponent is the same for all ships and multiplies, as for a single one."""

    key = operator.pow
    prefer_literal = True

    def generic(self, args: Any, kws: Any) -> Any:
        if not _some_lanes(args):
            return None
        exponent = args[1]
        if isinstance(exponent, types.IntegerLiteral):
            return signature(LANES_TYPE, LANES_TYPE, exponent)
        if isinstance(exponent, types.Integer):
            return None
        return signature(LANES_TYPE, LANES_TYPE, LANES_TYPE)


@lower_builtin(operator.pow, LanesType, types.IntegerLiteral)
def _whole_power(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    """Generate the products that Numba generates for a single number."""
    exponent, factor = sig.args[1].literal_value, values[0]
    found = one = spread(builder, ir.Constant(DOUBLE, 1.0))
    left = abs(exponent)
    while left:
        if left & 1:
            found = builder.fmul(found, factor)
        factor = builder.fmul(factor, factor)
        left >>= 1
    return builder.fdiv(one, found) if exponent < 0 else found


lower_builtin(operator.pow, LanesType, LanesType)(_lane_by_lane(operator.pow))


# Conditions.


def _declare_condition(function: Any, generator: _Generator) -> None:
    class Template(AbstractTemplate):  # type: ignore[misc]
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            return signature(types.boolean, *args) if args == (MASK_TYPE,) else None

    infer_global(function, types.Function(Template))
    lower_builtin(function, MaskType)(generator)


def _agreement(context: Any, builder: Any, mask: Any) -> Any:
    """Generate the truth of a condition on which all ships agree; raise an error if they do not."""
    bits = builder.bitcast(mask, ir.IntType(LANES))
    differ, yes, no = (builder.append_basic_block(name) for name in ("differ", "yes", "no"))
    done = builder.append_basic_block("agreed")
    cases = builder.switch(bits, differ)
    cases.add_case(ir.Constant(bits.type, -1), yes)
    cases.add_case(ir.Constant(bits.type, 0), no)
    builder.position_at_end(differ)
    context.call_conv.return_user_exc(builder, DisagreementError, ())
    for block in (yes, no):
        builder.position_at_end(block)
        builder.branch(done)
    builder.position_at_end(done)
    truth = builder.phi(ir.IntType(1))
    truth.add_incoming(ir.Constant(truth.type, 1), yes)
    truth.add_incoming(ir.Constant(truth.type, 0), no)
    return truth


def _agreed(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return _agreement(context, builder, values[0])


def _not_agreed(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return builder.not_(_agreed(context, builder, sig, values))


_declare_condition(bool, _agreed)
_declare_condition(operator.not_, _not_agreed)


def _compare(function: Any, relation: str) -> None:
    """Define a comparison; one of a parameter with zero has the same truth for all ships."""
    comparison = "fcmp_unordered" if relation == "!=" else "fcmp_ordered"

    class OfParameter(AbstractTemplate):  # type: ignore[misc]
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            fits = args[0] == PARAMETER_TYPE and isinstance(args[1], types.Float | types.Integer)
            return signature(types.boolean, args[0], types.float64) if fits else None

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        parameter, number = values
        if isinstance(number, ir.Constant) and number.constant == 0.0:
            first = builder.extract_element(parameter, ir.Constant(INDEX, 0))
            return getattr(builder, comparison)(relation, first, number)
        mask = getattr(builder, comparison)(relation, parameter, spread(builder, number))
        return _agreement(context, builder, mask)

    infer_global(function, types.Function(OfParameter))
    lower_builtin(function, ParameterType, types.Float)(generate)
    _declare(function, MASK_TYPE, 2, _instruction(comparison, relation))


for _function, _name in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    _compare(_function, _name)


@intrinsic
def _all_of(typingctx: Any, mask: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        bits = builder.bitcast(values[0], ir.IntType(LANES))
        return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))

    return signature(types.boolean, mask), generate


def everywhere(condition: Any) -> bool:
    """Return whether a condition holds for all ships."""
    return bool(condition)


def _everywhere(condition: Any) -> Any:
    if condition == MASK_TYPE:
        return lambda condition: _all_of(condition)
    return lambda condition: condition


@intrinsic
def _select(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return builder.select(*values)

    return signature(LANES_TYPE, mask, LANES_TYPE, LANES_TYPE), generate


def where(condition: Any, a: Any, b: Any) -> Any:
    """Return ``a`` if a condition holds and ``b`` if not, for each ship by itself.

    Both are computed, so neither may raise an error, and a seldom needed one costs time at each call.
    """
    return a if condition else b


def _where(condition: Any, a: Any, b: Any) -> Any:
    if condition == MASK_TYPE:
        return lambda condition, a, b: _select(condition, a, b)
    return lambda condition, a, b: a if condition else b


@intrinsic
def _widened(typingctx: Any, number: Any, example: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return to_lanes(context, builder, values[0], number)

    return signature(LANES_TYPE, number, example), generate


def of_kind(number: Any, example: Any) -> Any:
    """Return a number as one of all ships if ``example`` is, so that both have the same type."""
    return number


def _of_kind(number: Any, example: Any) -> Any:
    if isinstance(example, LanesType):
        return lambda number, example: _widened(number, example)
    return lambda number, example: number


for _function, _choice in ((everywhere, _everywhere), (where, _where), (of_kind, _of_kind)):
    inlined_overload(_function, _choice)
