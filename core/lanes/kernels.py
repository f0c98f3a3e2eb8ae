"""Kernels that compute several ships in another way than one."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from .boxes import changed, numbers_in, of_several, of_single, rebuilt
from .compiler import cgutils, inlined_overload, intrinsic, ir, literal_intrinsic, signature, types
from .numbers import INDEX, LANES, LanesType, joined_vector
from .records import ShipsType, record_of_lane

P = ParamSpec("P")
R = TypeVar("R")


@literal_intrinsic
def _of_lane(typingctx: Any, value: Any, lane: Any) -> Any:
    """Return the part of one ship in a number, tuple or ship record."""
    if not isinstance(lane, types.IntegerLiteral):
        return None
    found = value.record if isinstance(value, ShipsType) else changed(value, of_single)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        own = ir.Constant(INDEX, lane.literal_value)
        if isinstance(value, ShipsType):
            return record_of_lane(context, builder, value, given[0], lane.literal_value)
        numbers = numbers_in(context, builder, value, given[0])
        parts = (
            builder.extract_element(n, own) if isinstance(k, LanesType) else n for k, n in numbers
        )
        return rebuilt(context, builder, found, parts)

    return signature(found, value, lane), generate


@intrinsic
def _joined(typingctx: Any, singles: Any) -> Any:
    """Return one tuple or number of all ships from those of single ships."""
    if not (isinstance(singles, types.UniTuple) and len(singles) == LANES):
        return None
    found = changed(singles.dtype, of_several)

    def generate(context: Any, builder: Any, sig: Any, given: Any) -> Any:
        ships = [
            numbers_in(context, builder, singles.dtype, value)
            for value in cgutils.unpack_tuple(builder, given[0], LANES)
        ]
        numbers = (
            joined_vector(builder, [number for _, number in same])
            for same in zip(*ships, strict=True)
        )
        return rebuilt(context, builder, found, numbers)

    return signature(found, singles), generate


def _holds_lanes(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return any(map(_holds_lanes, kind))
    return isinstance(kind, LanesType | ShipsType)


def one_by_one(kernel: Callable[P, R]) -> Callable[P, R]:
    """Let a kernel of one ship compute several, one after the other.

    For kernels whose way through the code depends on the ship: searches, tables, programs of terms.
    """
    function = cast("Any", kernel).py_func
    names = list(inspect.signature(function).parameters)

    @functools.wraps(function)
    def single(*values: P.args, **more: P.kwargs) -> R:
        return kernel(*values, **more)

    calls = (
        f"kernel({', '.join(f'_of_lane({name}, {lane})' for name in names)})"
        for lane in range(LANES)
    )
    scope = {"kernel": kernel, "_of_lane": _of_lane, "_joined": _joined}
    several = eval(f"lambda {', '.join(names)}: _joined(({', '.join(calls)}))", scope)

    def choose(*kinds: Any) -> Any:
        return several if any(map(_holds_lanes, kinds)) else one

    one = eval(f"lambda {', '.join(names)}: kernel({', '.join(names)})", scope)
    inlined_overload(single, choose)
    return single
