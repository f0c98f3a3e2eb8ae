"""Call the update function of an external observer through its address in this process.

The observers of this package are compiled into one kernel (:mod:`.registry`), which is cached on disk.
An external observer cannot be part of that kernel. Its update function is compiled separately, and its
OBSERVER record holds the address. The kernels for single and batched simulation call it by that address.
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

_SIGNALS = len(Measurement._fields)
types: Any = numba_types
_OBSERVER: Any = numba.from_dtype(OBSERVER)
_ESTIMATE: Any = numba.from_dtype(ESTIMATE)
_SIGNATURE: Any = types.void(
    types.CPointer(_OBSERVER), types.CPointer(_ESTIMATE), *[types.float64] * _SIGNALS
)
_compiled: dict[Callable[..., Any], Any] = {}


def address_of(update: Callable[..., Any]) -> int:
    """Compile an update function, of Python or numba, and return its address in this process.

    Raises:
        numba.core.errors.NumbaError: numba cannot compile the function.
    """
    if update not in _compiled:
        kernel = update if hasattr(update, "py_func") else numba.njit(error_model="numpy")(update)

        def call(
            observer: Any, estimate: Any, a: float, b: float, c: float, d: float, e: float
        ) -> None:
            one, other = carray(observer, 1)[0], carray(estimate, 1)[0]
            velocity, valid = kernel(one, other, Measurement(a, b, c, d, e))
            other.returned[0] = velocity
            other.returned[1] = 1.0 if valid else 0.0

        _compiled[update] = numba.cfunc(_SIGNATURE, error_model="numpy")(call)
    return int(_compiled[update].address)


def _generate_call(context: Any, address: Any, observer: Any, estimate: Any, m: Any) -> Any:
    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        place, one, other, measurement = arguments
        pointer, number = ir.IntType(8).as_pointer(), ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer, *[number] * _SIGNALS])
        function = builder.inttoptr(place, kind.as_pointer())
        values = [builder.extract_value(measurement, i) for i in range(_SIGNALS)]
        records = [builder.bitcast(record, pointer) for record in (one, other)]
        builder.call(function, [*records, *values])
        return _.get_dummy_value()

    return types.void(address, observer, estimate, m), generate


_call_address: Any = intrinsic(_generate_call)


@compiled
def update_through_address(
    observer: Record, estimate: Record, m: Measurement
) -> tuple[float, bool]:
    """Call the update of an external observer."""
    _call_address(observer.address, observer, estimate, m)
    return estimate.returned[0], estimate.returned[1] != 0.0
