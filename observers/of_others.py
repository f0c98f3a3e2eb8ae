"""Observers that are not ours: their updates are called where they stand in this process's memory.

Our own are compiled into one kernel (:mod:`.registry`), which is kept on disk. Another's cannot be in
it. So its update is compiled for itself, and its OBSERVER record holds the address: the same kernels as
ours then run it, single or batched, at the cost of one call through a pointer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import carray  # type: ignore[attr-defined]
from numba.core import types as numba_types
from numba.extending import intrinsic

from ..core.compiled import Record, compiled
from .records import ESTIMATE, OBSERVER, Measurement

_READINGS = len(Measurement._fields)
types: Any = numba_types
_OBSERVER: Any = numba.from_dtype(OBSERVER)
_ESTIMATE: Any = numba.from_dtype(ESTIMATE)
_SIGNATURE: Any = types.void(
    types.CPointer(_OBSERVER), types.CPointer(_ESTIMATE), *[types.float64] * _READINGS
)
_kept: dict[Callable[..., Any], Any] = {}


def address_of(update: Callable[..., Any]) -> int:
    """Where a compiled update stands in this process.

    Args:
        update: as :meth:`.base.Observer.update`, of Python or a kernel.

    Raises:
        numba.core.errors.NumbaError: it cannot be compiled.
    """
    if update not in _kept:
        kernel = update if hasattr(update, "py_func") else numba.njit(error_model="numpy")(update)

        def call(
            observer: Any, estimate: Any, a: float, b: float, c: float, d: float, e: float
        ) -> None:
            one, other = carray(observer, 1)[0], carray(estimate, 1)[0]
            velocity, valid = kernel(one, other, Measurement(a, b, c, d, e))
            other.answer[0] = velocity
            other.answer[1] = 1.0 if valid else 0.0

        _kept[update] = numba.cfunc(_SIGNATURE, error_model="numpy")(call)
    return int(_kept[update].address)


def _generated(context: Any, address: Any, observer: Any, estimate: Any, m: Any) -> Any:
    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        place, one, other, readings = arguments
        pointer, number = ir.IntType(8).as_pointer(), ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer, *[number] * _READINGS])
        function = builder.inttoptr(place, kind.as_pointer())
        told = [builder.extract_value(readings, i) for i in range(_READINGS)]
        records = [builder.bitcast(record, pointer) for record in (one, other)]
        builder.call(function, [*records, *told])
        return _.get_dummy_value()

    return types.void(address, observer, estimate, m), generate


_through: Any = intrinsic(_generated)


@compiled
def update_through_address(
    observer: Record, estimate: Record, m: Measurement
) -> tuple[float, bool]:
    """The update of an observer that is not ours."""
    _through(observer.address, observer, estimate, m)
    return estimate.answer[0], estimate.answer[1] != 0.0
