"""Boxes: numbers of a tuple of each ship in memory, from which those of all ships are read at once."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from .compiler import cgutils, intrinsic, ir, signature, types
from .numbers import LANES, LANES_TYPE, VECTOR, LanesType, joined_vector, to_lanes, transposed
from .records import is_block


def changed(kind: Any, change: Callable[[Any], Any]) -> Any:
    """Return the type of a tuple with its numbers changed to others."""
    if not isinstance(kind, types.BaseTuple):
        return change(kind)
    inner = [changed(part, change) for part in kind]
    if isinstance(kind, types.BaseNamedTuple):
        return types.BaseTuple.from_types(inner, kind.instance_class)
    return types.BaseTuple.from_types(inner)


def numbers_in(context: Any, builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Return type and value of each number in a nested tuple."""
    if not isinstance(kind, types.BaseTuple):
        return [(kind, value)]
    parts = cgutils.unpack_tuple(builder, value, len(kind))
    pairs = (numbers_in(context, builder, k, v) for k, v in zip(kind, parts, strict=True))
    return [pair for group in pairs for pair in group]


def rebuilt(context: Any, builder: Any, kind: Any, numbers: Any) -> Any:
    """Return the value of a nested tuple of a type from an iterator over its numbers."""
    if not isinstance(kind, types.BaseTuple):
        return next(numbers)
    parts = [rebuilt(context, builder, part, numbers) for part in kind]
    return context.make_tuple(builder, kind, parts)


def of_single(kind: Any) -> Any:
    """Return the type of one ship's part of a number."""
    return types.float64 if isinstance(kind, LanesType) else kind


def of_several(kind: Any) -> Any:
    """Return the type of a number that holds those of all ships."""
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
        """Return a pointer to a value of a ship."""
        builder, wide = self._builder, self._columns.type
        lane = ir.Constant(wide, lane) if isinstance(lane, int) else lane
        row = builder.mul(lane, self._columns)
        return builder.gep(self._data, [builder.add(row, ir.Constant(wide, number))])


@intrinsic
def put_lane(typingctx: Any, box: Any, lane: Any, values: Any) -> Any:
    """Write the numbers of a tuple of one ship into its row of a box of :func:`box_shape`."""
    if not is_block(box):
        return None

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        to = _Box(context, builder, box, given[0])
        own = context.cast(builder, given[1], lane, types.int64)
        for k, (kind, number) in enumerate(numbers_in(context, builder, values, given[2])):
            number = context.cast(builder, number, kind, types.float64)
            builder.store(number, to.place(own, k))
        return context.get_dummy_value()

    return signature(types.none, box, lane, values), generate


@intrinsic
def take_lane(typingctx: Any, box: Any, lane: Any, like: Any) -> Any:
    """Return the tuple of one ship from a box; ``like`` is a tuple of the same type."""
    if not is_block(box):
        return None
    found = changed(like, of_single)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        of = _Box(context, builder, box, given[0])
        own = context.cast(builder, given[1], lane, types.int64)
        numbers = (builder.load(of.place(own, k)) for k in itertools.count())
        return rebuilt(context, builder, found, numbers)

    return signature(found, box, lane, like), generate


@intrinsic
def take_lanes(typingctx: Any, box: Any, like: Any) -> Any:
    """Return the tuple of all ships from a box; ``like`` is such a tuple of a single ship."""
    if not is_block(box):
        return None
    found = changed(like, of_several)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        of = _Box(context, builder, box, given[0])
        numbers = (
            joined_vector(builder, [builder.load(of.place(lane, k)) for lane in range(LANES)])
            for k in itertools.count()
        )
        return rebuilt(context, builder, found, numbers)

    return signature(found, box, like), generate


@intrinsic
def put_lanes(typingctx: Any, box: Any, values: Any) -> Any:
    """Write the numbers of a tuple of all ships into a box."""
    if not is_block(box):
        return None

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        to = _Box(context, builder, box, given[0])
        vectors = [
            to_lanes(context, builder, number, kind)
            for kind, number in numbers_in(context, builder, values, given[1])
        ]
        for first in range(0, len(vectors), LANES):
            group = vectors[first : first + LANES]
            group += [ir.Constant(VECTOR, None)] * (LANES - len(group))
            for lane, row in enumerate(transposed(builder, group)):
                place = builder.bitcast(to.place(lane, first), VECTOR.as_pointer())
                builder.store(row, place, align=8)
        return context.get_dummy_value()

    return signature(types.none, box, values), generate
