"""Ship records of several ships at once, as kernels use them."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from .compiler import (
    AbstractTemplate,
    AttributeTemplate,
    PrimitiveModel,
    as_dtype,
    cgutils,
    infer_getattr,
    infer_global,
    intrinsic,
    ir,
    lower_builtin,
    lower_getattr_generic,
    register_default,
    signature,
    types,
)
from .numbers import DOUBLE, INDEX, LANES, LANES_TYPE, PARAMETER_TYPE, VECTOR, spread, transposed


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


@register_default(ShipsType)
@register_default(LanesArrayType)
class _PointerModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, DOUBLE.as_pointer())


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
    table = ir.Constant(ir.ArrayType(INDEX, len(values)), values)
    constant = cgutils.global_constant(builder.module, ".table", table)
    return builder.bitcast(constant, INDEX.as_pointer())


def _in_record(builder: Any, record: Any, offset: Any, kind: Any) -> Any:
    """Return a pointer to a field of a record at an offset [bytes]."""
    start = builder.bitcast(record, ir.IntType(8).as_pointer())
    return builder.bitcast(builder.gep(start, [offset]), kind.as_pointer())


def data_of(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Return a pointer to the first number of an array."""
    return context.make_array(kind)(context, builder, array).data


def is_block(kind: Any) -> bool:
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
    return builder.bitcast(place, VECTOR.as_pointer())


@intrinsic
def fill_block(typingctx: Any, block: Any, records: Any, first: Any) -> Any:
    """Copy :data:`LANES` ship records, from an index on, into a block of :func:`block_shape`."""
    if not (is_block(block) and _is_records(records) and isinstance(first, types.Integer)):
        return None
    layout = _layout_of(records.dtype)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        data = data_of(context, builder, block, values[0])
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
            places = (_in_record(builder, ship, offset, VECTOR) for ship in ships)
            words = [builder.load(place, align=8) for place in places]
            top = builder.mul(loop.index, ir.Constant(wide, LANES))
            for k, vector in enumerate(transposed(builder, words)):
                row = builder.add(top, ir.Constant(wide, k))
                builder.store(vector, _row(builder, data, row), align=8)
        addresses = builder.bitcast(data, wide.as_pointer())
        for lane, ship in enumerate(ships):
            place = ir.Constant(INDEX, layout.address * LANES + lane)
            builder.store(builder.ptrtoint(ship, wide), builder.gep(addresses, [place]))
        return context.get_dummy_value()

    return signature(types.none, block, records, first), generate


@intrinsic
def are_alike(typingctx: Any, block: Any, records: Any) -> Any:
    """Return whether the ships of a block can be computed at once; ``records`` are of their type.

    Their switches, which choose between equations, are equal, and their parameters have equal signs, so
    all have the same effects.
    """
    if not (is_block(block) and _is_records(records)):
        return None
    layout = _layout_of(records.dtype)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        wide, truths = ir.IntType(64), ir.VectorType(ir.IntType(1), LANES)
        data = data_of(context, builder, block, values[0])
        differ = cgutils.alloca_once_value(builder, ir.Constant(truths, None))

        def compare(rows: list[int], properties: Callable[[Any], list[Any]]) -> None:
            table = _table(builder, rows)
            with cgutils.for_range(builder, ir.Constant(wide, len(rows))) as loop:
                row = builder.load(builder.gep(table, [loop.index]))
                vector = builder.load(_row(builder, data, row), align=8)
                for own in properties(vector):
                    first = spread(builder, builder.extract_element(own, ir.Constant(INDEX, 0)))
                    other = builder.xor(own, first)
                    if other.type != truths:
                        other = builder.icmp_unsigned("!=", other, ir.Constant(other.type, None))
                    builder.store(builder.or_(builder.load(differ), other), differ)

        def signs(vector: Any) -> list[Any]:
            zero = ir.Constant(VECTOR, None)
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
    if not (is_block(block) and _is_records(records)):
        return None

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return data_of(context, builder, block, values[0])

    return signature(ShipsType(records.dtype), block, records), generate


def _vector_at(builder: Any, data: Any, row: Any) -> Any:
    return builder.load(_row(builder, data, row), align=8)


def record_of_lane(context: Any, builder: Any, kind: Any, ships: Any, lane: int) -> Any:
    """Return the record of one of the ships."""
    wide = ir.IntType(64)
    place = ir.Constant(INDEX, _layout_of(kind.record).address * LANES + lane)
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
            builder.gep(switches, [ir.Constant(INDEX, layout.switches[field] * LANES)])
        )
    if field in layout.parameters:
        return _vector_at(builder, ships, ir.Constant(INDEX, layout.parameters[field]))
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
