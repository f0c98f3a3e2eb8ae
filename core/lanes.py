"""Several ships at once: a number of a kernel that holds the values of :data:`LANES` ships.

A kernel that is called with such numbers computes all ships with one instruction where it would need one
for each. The equations are those of a single ship, in the same order and with the same roundings, so the
results are equal to the bit.

A branch must be the same for all ships. Where they disagree, the kernel raises a
:class:`DisagreementError` and
the caller computes the ships one after the other. So :func:`where` replaces branches in which ships
often differ. A kernel under :func:`one_by_one` computes each ship by itself.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import math
import operator
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import PrimitiveModel, register_default
from numba.core.imputils import lower_builtin, lower_cast, lower_getattr_generic
from numba.core.typeconv import Conversion
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import intrinsic, lower_getattr, overload
from numba.np.numpy_support import as_dtype

P = ParamSpec("P")
R = TypeVar("R")

LANES = 4
"""Number of ships that are computed at once."""

_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_INDEX = ir.IntType(32)


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


class ShipsType(types.Type):  # type: ignore[misc]
    """Type of the ship records of all lanes; see :func:`fill_block`."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(name="ships")

    @property
    def key(self) -> Any:
        """Return what distinguishes the type from others of its class."""
        return self.record


class LanesArrayType(types.Type):  # type: ignore[misc]
    """Type of an array field of the ship records of all lanes."""

    def __init__(self, rows: list[int], shape: tuple[int, ...]) -> None:
        self.rows, self.shape = tuple(rows), shape
        super().__init__(name=f"lanes_array{shape, self.rows}")


LANES_TYPE, PARAMETER_TYPE, MASK_TYPE = LanesType(), ParameterType(), MaskType()


@register_default(LanesType)
@register_default(ParameterType)
class _LanesModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


@register_default(MaskType)
class _MaskModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(ir.IntType(1), LANES))


@register_default(ShipsType)
@register_default(LanesArrayType)
class _PointerModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _DOUBLE.as_pointer())


# Conversions, and numbers of single ships inside vectors.


def _spread(builder: Any, value: Any) -> Any:
    """Return a vector with the same value for all ships."""
    vector = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    vector = builder.insert_element(vector, value, ir.Constant(_INDEX, 0))
    order = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(vector, vector, order)


def _to_lanes(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    if isinstance(kind, LanesType):
        return value
    return _spread(builder, context.cast(builder, value, kind, types.float64))


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
@lower_cast(ParameterType, LanesType)
def _cast(context: Any, builder: Any, kind: Any, to: Any, value: Any) -> Any:
    return _to_lanes(context, builder, value, kind)


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
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(values))
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
        found = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(LANES):
            place = ir.Constant(_INDEX, lane)
            own = [builder.extract_element(value, place) for value in values]
            found = builder.insert_element(found, call(builder, own), place)
        return found

    return generate


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
    found = one = _spread(builder, ir.Constant(_DOUBLE, 1.0))
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
            first = builder.extract_element(parameter, ir.Constant(_INDEX, 0))
            return getattr(builder, comparison)(relation, first, number)
        mask = getattr(builder, comparison)(relation, parameter, _spread(builder, number))
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


@overload(everywhere, jit_options={"forceinline": True}, strict=False)
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


@overload(where, jit_options={"forceinline": True}, strict=False)
def _where(condition: Any, a: Any, b: Any) -> Any:
    if condition == MASK_TYPE:
        return lambda condition, a, b: _select(condition, a, b)
    return lambda condition, a, b: a if condition else b


@intrinsic
def _widened(typingctx: Any, number: Any, example: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return _to_lanes(context, builder, values[0], number)

    return signature(LANES_TYPE, number, example), generate


def of_kind(number: Any, example: Any) -> Any:
    """Return a number as one of all ships if ``example`` is, so that both have the same type."""
    return number


@overload(of_kind, jit_options={"forceinline": True}, strict=False)
def _of_kind(number: Any, example: Any) -> Any:
    if isinstance(example, LanesType):
        return lambda number, example: _widened(number, example)
    return lambda number, example: number


# Ship records of all lanes.

LARGEST = 32
"""Number of elements up to which an array field of a record is held for all ships at once."""


class _Layout:
    """Rows of a block of ship records.

    A row has the same word of all records. Rows are made in groups of :data:`LANES` words that follow
    each other in a record. Large tables are left out.
    """

    def __init__(self, record: np.dtype[Any]) -> None:
        fields: dict[str, tuple[int, int, tuple[int, ...], bool]] = {}
        for name, (kind, offset, *_) in (record.fields or {}).items():
            number, shape = kind.subdtype or (kind, ())
            size = math.prod(shape)
            if size <= LARGEST and (number == np.float64 or (number == np.int64 and not shape)):
                fields[name] = (offset // 8, size, shape, number == np.float64)
        words = sorted(first + k for first, size, *_ in fields.values() for k in range(size))
        self.groups: list[int] = []  # offset in the record of the first word of each group [bytes]
        row_of: dict[int, int] = {}
        for word in words:
            if word not in row_of:
                first = min(word, record.itemsize // 8 - LANES)
                row_of |= {first + k: len(self.groups) * LANES + k for k in range(LANES)}
                self.groups.append(8 * first)
        self.switches: dict[str, int] = {}  # rows of the integers
        self.parameters: dict[str, int] = {}  # rows of the single floats
        self.arrays: dict[str, tuple[list[int], tuple[int, ...]]] = {}  # rows and shapes
        for name, (first, size, shape, is_float) in fields.items():
            if shape:
                self.arrays[name] = ([row_of[first + k] for k in range(size)], shape)
            else:
                (self.parameters if is_float else self.switches)[name] = row_of[first]

    @property
    def address(self) -> int:
        """Return the row of the addresses of the records."""
        return len(self.groups) * LANES


@functools.cache
def _layout(record: np.dtype[Any]) -> _Layout:
    return _Layout(record)


def _layout_of(record: Any) -> _Layout:
    return _layout(as_dtype(record))


def block_shape(record: np.dtype[Any]) -> tuple[int, int]:
    """Return the shape of the block of numbers that holds :data:`LANES` ship records."""
    return _layout(record).address + 1, LANES


def _table(builder: Any, values: list[int]) -> Any:
    """Return the address of a constant table."""
    table = ir.Constant(ir.ArrayType(_INDEX, len(values)), values)
    constant = cgutils.global_constant(builder.module, ".table", table)
    return builder.bitcast(constant, _INDEX.as_pointer())


def _in_record(builder: Any, record: Any, offset: Any, kind: Any) -> Any:
    """Return a pointer to a field of a record at an offset [bytes]."""
    start = builder.bitcast(record, ir.IntType(8).as_pointer())
    return builder.bitcast(builder.gep(start, [offset]), kind.as_pointer())


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Return a pointer to the first number of an array."""
    return context.make_array(kind)(context, builder, array).data


def _is_block(kind: Any) -> bool:
    """Return whether a type is that of a block: numbers in memory, row after row."""
    return bool(
        isinstance(kind, types.Array)
        and kind.dtype == types.float64
        and kind.ndim == 2
        and kind.layout == "C"
    )


def _is_records(kind: Any) -> bool:
    """Return whether a type is that of an array of ship records."""
    is_array = isinstance(kind, types.Array) and kind.ndim == 1
    return is_array and isinstance(kind.dtype, types.Record)


def _row(builder: Any, data: Any, row: Any) -> Any:
    """Return a pointer to a row of a block."""
    place = builder.gep(data, [builder.mul(row, ir.Constant(row.type, LANES))])
    return builder.bitcast(place, _VECTOR.as_pointer())


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
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
                    places = ir.Constant(ir.VectorType(_INDEX, LANES), order)
                    rows[row] = builder.shuffle_vector(a, b, places)
        distance *= 2
    return rows


@intrinsic
def fill_block(typingctx: Any, block: Any, records: Any, first: Any) -> Any:
    """Copy :data:`LANES` ship records, from an index on, into a block of :func:`block_shape`."""
    if not (_is_block(block) and _is_records(records) and isinstance(first, types.Integer)):
        return None
    layout = _layout_of(records.dtype)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        data = _data(context, builder, block, values[0])
        groups = _table(builder, layout.groups)
        wide = ir.IntType(64)
        array = context.make_array(records)(context, builder, values[1])
        begin = context.cast(builder, values[2], first, types.int64)
        (stride,) = cgutils.unpack_tuple(builder, array.strides, 1)
        places = (builder.add(begin, ir.Constant(wide, lane)) for lane in range(LANES))
        ships = [
            _in_record(builder, array.data, builder.mul(p, stride), ir.IntType(8)) for p in places
        ]
        with cgutils.for_range(builder, ir.Constant(wide, len(layout.groups))) as loop:
            offset = builder.load(builder.gep(groups, [loop.index]))
            places = (_in_record(builder, ship, offset, _VECTOR) for ship in ships)
            words = [builder.load(place, align=8) for place in places]
            top = builder.mul(loop.index, ir.Constant(wide, LANES))
            for k, vector in enumerate(_transposed(builder, words)):
                row = builder.add(top, ir.Constant(wide, k))
                builder.store(vector, _row(builder, data, row), align=8)
        addresses = builder.bitcast(data, wide.as_pointer())
        for lane, ship in enumerate(ships):
            place = ir.Constant(_INDEX, layout.address * LANES + lane)
            builder.store(builder.ptrtoint(ship, wide), builder.gep(addresses, [place]))
        return context.get_dummy_value()

    return signature(types.none, block, records, first), generate


@intrinsic
def are_alike(typingctx: Any, block: Any, records: Any) -> Any:
    """Return whether the ships of a block can be computed at once; ``records`` are of their type.

    Their switches, which choose between equations, are equal, and their parameters have equal signs, so
    all have the same effects.
    """
    if not (_is_block(block) and _is_records(records)):
        return None
    layout = _layout_of(records.dtype)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        wide, truths = ir.IntType(64), ir.VectorType(ir.IntType(1), LANES)
        data = _data(context, builder, block, values[0])
        differ = cgutils.alloca_once_value(builder, ir.Constant(truths, None))

        def compare(rows: list[int], properties: Callable[[Any], list[Any]]) -> None:
            table = _table(builder, rows)
            with cgutils.for_range(builder, ir.Constant(wide, len(rows))) as loop:
                row = builder.load(builder.gep(table, [loop.index]))
                vector = builder.load(_row(builder, data, row), align=8)
                for own in properties(vector):
                    first = _spread(builder, builder.extract_element(own, ir.Constant(_INDEX, 0)))
                    other = builder.xor(own, first)
                    if other.type != truths:
                        other = builder.icmp_unsigned("!=", other, ir.Constant(other.type, None))
                    builder.store(builder.or_(builder.load(differ), other), differ)

        def signs(vector: Any) -> list[Any]:
            zero = ir.Constant(_VECTOR, None)
            return [builder.fcmp_ordered(sign, vector, zero) for sign in (">", "<")]

        whole = ir.VectorType(wide, LANES)
        compare(list(layout.switches.values()), lambda v: [builder.bitcast(v, whole)])
        compare(list(layout.parameters.values()), signs)
        bits = builder.bitcast(builder.load(differ), ir.IntType(LANES))
        return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, 0))

    return signature(types.boolean, block, records), generate


@intrinsic
def ships_of(typingctx: Any, block: Any, records: Any) -> Any:
    """Return the ships of a filled block, as kernels use them; ``records`` are of their type."""
    if not (_is_block(block) and _is_records(records)):
        return None

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return _data(context, builder, block, values[0])

    return signature(ShipsType(records.dtype), block, records), generate


def _vector_at(builder: Any, data: Any, row: Any) -> Any:
    return builder.load(_row(builder, data, row), align=8)


def _record_of(context: Any, builder: Any, kind: Any, ships: Any, lane: int) -> Any:
    """Return the record of one of the ships."""
    wide = ir.IntType(64)
    place = ir.Constant(_INDEX, _layout_of(kind.record).address * LANES + lane)
    address = builder.load(builder.gep(builder.bitcast(ships, wide.as_pointer()), [place]))
    return builder.inttoptr(address, context.get_value_type(kind.record))


@infer_getattr
class _ShipsAttributes(AttributeTemplate):  # type: ignore[misc]
    key = ShipsType

    def generic_resolve(self, ships: Any, field: str) -> Any:
        layout = _layout_of(ships.record)
        if field in layout.switches:
            return types.int64
        if field in layout.parameters:
            return PARAMETER_TYPE
        return LanesArrayType(*layout.arrays[field]) if field in layout.arrays else None


@lower_getattr_generic(ShipsType)
def _field(context: Any, builder: Any, kind: Any, ships: Any, field: str) -> Any:
    layout = _layout_of(kind.record)
    if field in layout.switches:
        switches = builder.bitcast(ships, ir.IntType(64).as_pointer())
        return builder.load(
            builder.gep(switches, [ir.Constant(_INDEX, layout.switches[field] * LANES)])
        )
    if field in layout.parameters:
        return _vector_at(builder, ships, ir.Constant(_INDEX, layout.parameters[field]))
    return ships


@infer_global(operator.getitem)
class _LanesItem(AbstractTemplate):  # type: ignore[misc]
    key = operator.getitem

    def generic(self, args: Any, kws: Any) -> Any:
        array, index = args
        fits = (
            isinstance(array, LanesArrayType)
            and isinstance(index, types.UniTuple)
            and len(index) == len(array.shape)
            and isinstance(index.dtype, types.Integer)
        )
        return signature(LANES_TYPE, array, index) if fits else None


@lower_builtin(operator.getitem, LanesArrayType, types.UniTuple)
def _item(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    array, index = sig.args
    element = ir.Constant(ir.IntType(64), 0)
    for size, place in zip(array.shape, cgutils.unpack_tuple(builder, values[1]), strict=True):
        place = context.cast(builder, place, index.dtype, types.int64)
        element = builder.add(builder.mul(element, ir.Constant(element.type, size)), place)
    row = builder.load(builder.gep(_table(builder, list(array.rows)), [element]))
    return _vector_at(builder, values[0], row)


# Tuples of numbers of all lanes, and boxes that hold them for each ship.


def _change(kind: Any, change: Callable[[Any], Any]) -> Any:
    """Return the type of a tuple with its numbers changed to others."""
    if not isinstance(kind, types.BaseTuple):
        return change(kind)
    inner = [_change(part, change) for part in kind]
    if isinstance(kind, types.BaseNamedTuple):
        return types.BaseTuple.from_types(inner, kind.instance_class)
    return types.BaseTuple.from_types(inner)


def _numbers(context: Any, builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Return type and value of each number in a nested tuple."""
    if not isinstance(kind, types.BaseTuple):
        return [(kind, value)]
    parts = cgutils.unpack_tuple(builder, value, len(kind))
    pairs = (_numbers(context, builder, k, v) for k, v in zip(kind, parts, strict=True))
    return [pair for group in pairs for pair in group]


def _rebuild(context: Any, builder: Any, kind: Any, numbers: Any) -> Any:
    """Return the value of a nested tuple of a type from an iterator over its numbers."""
    if not isinstance(kind, types.BaseTuple):
        return next(numbers)
    parts = [_rebuild(context, builder, part, numbers) for part in kind]
    return context.make_tuple(builder, kind, parts)


def _single(kind: Any) -> Any:
    return types.float64 if isinstance(kind, LanesType) else kind


def _several(kind: Any) -> Any:
    return LANES_TYPE if isinstance(kind, types.Float | LanesType) else kind


def box_shape(values: Any) -> tuple[int, int]:
    """Return the shape of a box for a nested tuple of numbers of :data:`LANES` ships.

    It has a row for each ship. A processor passes a number that was just written only to a read of the
    same place that is no longer, so the numbers of all ships are read one by one.
    """

    def count(value: Any) -> int:
        return sum(map(count, value)) if isinstance(value, tuple) else 1

    return LANES, -(-count(values) // LANES) * LANES


class _Box:
    """A box in a kernel."""

    def __init__(self, context: Any, builder: Any, kind: Any, array: Any) -> None:
        box = context.make_array(kind)(context, builder, array)
        self._builder, self._data = builder, box.data
        self._columns = cgutils.unpack_tuple(builder, box.shape, 2)[1]

    def place(self, lane: Any, number: int) -> Any:
        """Return a pointer to a number of a ship."""
        builder, wide = self._builder, self._columns.type
        lane = ir.Constant(wide, lane) if isinstance(lane, int) else lane
        row = builder.mul(lane, self._columns)
        return builder.gep(self._data, [builder.add(row, ir.Constant(wide, number))])


@intrinsic
def put_lane(typingctx: Any, box: Any, lane: Any, values: Any) -> Any:
    """Write the numbers of a tuple of one ship into its row of a box of :func:`box_shape`."""
    if not _is_block(box):
        return None

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        to = _Box(context, builder, box, given[0])
        own = context.cast(builder, given[1], lane, types.int64)
        for k, (kind, number) in enumerate(_numbers(context, builder, values, given[2])):
            number = context.cast(builder, number, kind, types.float64)
            builder.store(number, to.place(own, k))
        return context.get_dummy_value()

    return signature(types.none, box, lane, values), generate


@intrinsic
def take_lane(typingctx: Any, box: Any, lane: Any, like: Any) -> Any:
    """Return the tuple of one ship from a box; ``like`` is a tuple of the same type."""
    if not _is_block(box):
        return None
    found = _change(like, _single)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        of = _Box(context, builder, box, given[0])
        own = context.cast(builder, given[1], lane, types.int64)
        numbers = (builder.load(of.place(own, k)) for k in itertools.count())
        return _rebuild(context, builder, found, numbers)

    return signature(found, box, lane, like), generate


@intrinsic
def take_lanes(typingctx: Any, box: Any, like: Any) -> Any:
    """Return the tuple of all ships from a box; ``like`` is such a tuple of a single ship."""
    if not _is_block(box):
        return None
    found = _change(like, _several)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        of = _Box(context, builder, box, given[0])
        numbers = (
            _joined_vector(builder, [builder.load(of.place(lane, k)) for lane in range(LANES)])
            for k in itertools.count()
        )
        return _rebuild(context, builder, found, numbers)

    return signature(found, box, like), generate


def _joined_vector(builder: Any, numbers: list[Any]) -> Any:
    """Return the vector of a number of each ship."""
    vector = ir.Constant(_VECTOR, ir.Undefined)
    for lane, number in enumerate(numbers):
        vector = builder.insert_element(vector, number, ir.Constant(_INDEX, lane))
    return vector


@intrinsic
def put_lanes(typingctx: Any, box: Any, values: Any) -> Any:
    """Write the numbers of a tuple of all ships into a box."""
    if not _is_block(box):
        return None

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        to = _Box(context, builder, box, given[0])
        vectors = [
            _to_lanes(context, builder, number, kind)
            for kind, number in _numbers(context, builder, values, given[1])
        ]
        for first in range(0, len(vectors), LANES):
            group = vectors[first : first + LANES]
            group += [ir.Constant(_VECTOR, None)] * (LANES - len(group))
            for lane, row in enumerate(_transposed(builder, group)):
                place = builder.bitcast(to.place(lane, first), _VECTOR.as_pointer())
                builder.store(row, place, align=8)
        return context.get_dummy_value()

    return signature(types.none, box, values), generate


# Kernels that compute each ship by itself.


@intrinsic(prefer_literal=True)
def _of_lane(typingctx: Any, value: Any, lane: Any) -> Any:
    """Return the part of one ship in a number, tuple or ship record."""
    if not isinstance(lane, types.IntegerLiteral):
        return None
    found = value.record if isinstance(value, ShipsType) else _change(value, _single)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        own = ir.Constant(_INDEX, lane.literal_value)
        if isinstance(value, ShipsType):
            return _record_of(context, builder, value, given[0], lane.literal_value)
        numbers = _numbers(context, builder, value, given[0])
        parts = (
            builder.extract_element(n, own) if isinstance(k, LanesType) else n for k, n in numbers
        )
        return _rebuild(context, builder, found, parts)

    return signature(found, value, lane), generate


@intrinsic
def _joined(typingctx: Any, singles: Any) -> Any:
    """Return one tuple or number of all ships from those of single ships."""
    if not (isinstance(singles, types.UniTuple) and len(singles) == LANES):
        return None
    found = _change(singles.dtype, _several)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        ships = [
            _numbers(context, builder, singles.dtype, value)
            for value in cgutils.unpack_tuple(builder, given[0], LANES)
        ]
        numbers = (
            _joined_vector(builder, [number for _, number in same])
            for same in zip(*ships, strict=True)
        )
        return _rebuild(context, builder, found, numbers)

    return signature(found, singles), generate


def _holds_lanes(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return any(map(_holds_lanes, kind))
    return isinstance(kind, LanesType | ShipsType)


def one_by_one(kernel: Callable[P, R]) -> Callable[P, R]:
    """Let a kernel of one ship compute several, one after the other.

    For kernels whose way through the code depends on the ship: searches, tables, programs of terms.
    """
    names = list(inspect.signature(cast("Any", kernel).py_func).parameters)
    calls = (
        f"kernel({', '.join(f'_of_lane({name}, {lane})' for name in names)})"
        for lane in range(LANES)
    )
    scope = {"kernel": kernel, "_of_lane": _of_lane, "_joined": _joined}
    return _with_choice(kernel, f"_joined(({', '.join(calls)}))", scope)


def several_by(other: Callable[P, R]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let another kernel with the same arguments compute several ships at once."""

    def decorate(kernel: Callable[P, R]) -> Callable[P, R]:
        names = ", ".join(inspect.signature(cast("Any", kernel).py_func).parameters)
        return _with_choice(kernel, f"other({names})", {"kernel": kernel, "other": other})

    return decorate


def _with_choice(kernel: Callable[P, R], of_several: str, scope: dict[str, Any]) -> Callable[P, R]:
    """Return a function that calls a kernel for one ship and an expression for several."""
    function = cast("Any", kernel).py_func
    names = ", ".join(inspect.signature(function).parameters)

    @functools.wraps(function)
    def single(*values: P.args, **more: P.kwargs) -> R:
        return kernel(*values, **more)

    several = eval(f"lambda {names}: {of_several}", scope)
    one = eval(f"lambda {names}: kernel({names})", scope)

    def choose(*kinds: Any) -> Any:
        return several if any(map(_holds_lanes, kinds)) else one

    overload(single, jit_options={"forceinline": True}, strict=False)(choose)
    return single
