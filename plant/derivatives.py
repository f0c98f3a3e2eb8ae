"""Exact derivatives of the plant's rates and outputs with respect to states and ship parameters.

The derivatives use complex steps (Squire & Trapp 1998): f(x + i h) = f(x) + i h f'(x) for a tiny h.
There is no subtraction and so no cancellation. A state takes the step directly. A parameter is part of
the ship record, so its derivative needs a record with complex fields, :data:`COMPLEX_PLANT`, which the
kernels accept like the real one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled, generate_tuple_kernel
from .dynamics import evaluate
from .keys import KeyInfo, Section, info_of
from .record import PLANT
from .ship import Ship, ShipError
from .state import Inputs, Outputs, State, shift_state

STEP = 1e-30
"""Size of the complex step."""

_TABLES = ("kt", "kq", "term_constants")  # array fields that hold parameters of a ship file


def _complex_dtype() -> np.dtype[Any]:
    def wider(name: str) -> tuple[Any, ...]:
        field = PLANT[name]
        if field == np.float64 or name in _TABLES:
            return name, np.complex128, field.shape
        return name, field.base, field.shape

    return np.dtype([wider(name) for name in PLANT.names or ()], align=True)


COMPLEX_PLANT = _complex_dtype()
"""Complex counterpart of ``PLANT``: parameters are complex; codes, counts and tables stay real."""


def as_words(record: Any) -> NDArray[np.float64]:
    """Return a real or complex record as a row of float64 that shares its memory."""
    return np.asarray(record).reshape(1).view(np.float64)


def _complex_words() -> NDArray[np.int64]:
    assert PLANT.fields is not None
    assert COMPLEX_PLANT.fields is not None
    location = np.full(len(as_words(np.zeros((), PLANT))), -1)
    for name, (field, offset, *_) in PLANT.fields.items():
        own, place, *_ = COMPLEX_PLANT.fields[name]
        if own.base == np.complex128:
            count = int(np.prod(field.shape, dtype=int))
            location[offset // 8 : offset // 8 + count] = place // 8 + 2 * np.arange(count)
    return location


COMPLEX_WORD = _complex_words()
"""Index of the real part in a complex record, for each word of a real record; the imaginary part follows
it. -1 for a word that is not complex."""


class ParameterSlope(NamedTuple):
    """The effect of a ship parameter on the ship record: it changes some words in proportion."""

    key: str  # dotted
    value: float
    info: KeyInfo
    words: NDArray[np.int64]
    slopes: NDArray[np.float64]  # change of each word per unit of the parameter


def parameter_slope(ship: Ship, key: str) -> ParameterSlope:
    """Return a ship parameter and the words of the ship record that it changes.

    The dotted key names a parameter with its own field, or one to which tables in the record are
    proportional, such as the coefficients of a bollard propeller.

    Raises:
        ShipError: unknown key, or a parameter that does not act on the record in proportion.
    """
    section, _, name = key.partition(".")
    if ship.has_key(key):
        number = ship.parameter(key)
        dtype, offset = PLANT.fields[number.field][:2]  # type: ignore[index]
        within = int(np.ravel_multi_index(number.place, dtype.shape)) if number.place else 0
        at = np.array([offset // 8 + within])
        slope = ParameterSlope(key, number.value, number.info, at, np.ones(1))
    else:
        table = getattr(ship, section, None)
        value: Any = getattr(table, name, None)
        if not isinstance(table, Section) or not isinstance(value, float):
            return ship.parameter(key)  # type: ignore[return-value]  # raises, and says why
        info = info_of(type(table).model_fields[name])
        step = 1e-3 * (abs(value) or 1.0) * (1.0 if value < 0.5 * (info.low + info.high) else -1.0)
        base, once, twice = (
            as_words(ship.with_values({key: value + k * step}).record()).copy() for k in range(3)
        )
        at = np.flatnonzero(once != base)
        if not np.allclose(twice[at] - base[at], 2.0 * (once[at] - base[at]), rtol=1e-6):
            raise ShipError(
                f"{ship.name}: {key} has no derivative: the equations use tables computed from it"
            )
        slope = ParameterSlope(key, value, info, at, (once[at] - base[at]) / step)
    if not len(slope.words) or np.any(COMPLEX_WORD[slope.words] < 0):
        raise ShipError(f"{ship.name}: {key} has no derivative: the equations do not depend on it")
    return slope


def complex_record(record: Any) -> Any:
    """Return a ship record as an element of :data:`COMPLEX_PLANT`, with all imaginary parts 0."""
    twin = np.zeros(1, COMPLEX_PLANT)[0]
    for name in PLANT.names or ():
        twin[name] = record[name]
    return twin


_imaginary_rate, _imaginary_outputs = (
    generate_tuple_kernel(
        f"imaginary_{kind.__name__}(value, scale)",
        kind.__name__,
        "value.{field}.imag * scale",
        kind._fields,
        globals(),
    )
    for kind in (State, Outputs)
)


@compiled
def derivatives(
    twin: Record, state: State, inputs: Inputs, blade_before: float, direction: State
) -> tuple[State, Outputs]:
    """Return the derivatives of :func:`shaftline.plant.dynamics.evaluate` per unit of one direction.

    The direction is a component in each state (all 0 for a parameter alone), and each parameter of the
    :data:`COMPLEX_PLANT` record ``twin`` whose imaginary part is :data:`STEP`. State, inputs and pitch
    ratio are real. Inside a dead band or backlash, or at an end stop, the derivative is 0.
    """
    rate, outputs = evaluate(twin, shift_state(state, direction, STEP * 1j), inputs, blade_before)
    return _imaginary_rate(rate, 1.0 / STEP), _imaginary_outputs(outputs, 1.0 / STEP)
