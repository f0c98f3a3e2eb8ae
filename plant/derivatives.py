"""Exact derivatives of the plant's rates and outputs: to its states and to the numbers of its file.

By complex steps (Squire & Trapp 1998): f(x + i h) = f(x) + i h f'(x) for a tiny h, with no subtraction,
hence no cancellation. A state is moved as it is; a number stands in the ship's record, so a derivative
to it asks for a record whose numbers are complex. That is :data:`COMPLEX_PLANT`, the same record with
room for the step: the kernels take it as they take the other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled, spelled_out
from .dynamics import evaluate
from .keys import Number
from .record import PLANT
from .state import Inputs, Outputs, State, moved

STEP = 1e-30
"""Of the complex step."""

WORD = np.dtype(np.float64).itemsize


def _complex_dtype() -> np.dtype[Any]:
    def wider(name: str) -> tuple[Any, ...]:
        field = PLANT[name]
        if field == np.float64:
            return name, np.complex128
        if name == "term_constants":
            return name, np.complex128, field.shape
        return (name, field.base, field.shape) if field.shape else (name, field)

    return np.dtype([wider(name) for name in PLANT.names or ()], align=True)


COMPLEX_PLANT = _complex_dtype()
"""dtype of a ship whose numbers are complex; tables, codes and counts are as in ``PLANT``."""


def complex_record(record: Any) -> Any:
    """A ship's record with complex numbers, all real at first.

    Args:
        record: of dtype ``PLANT``.

    Returns:
        One element of dtype :data:`COMPLEX_PLANT`.
    """
    twin = np.zeros(1, COMPLEX_PLANT)[0]
    for name in PLANT.names or ():
        twin[name] = record[name]
    return twin


def word_of(number: Number, dtype: np.dtype[Any]) -> int:
    """Place of a ship's number in its record seen as a row of float64; of a complex one its real part.

    Args:
        number: from :meth:`shaftline.plant.Ship.number`.
        dtype: ``PLANT`` or :data:`COMPLEX_PLANT`.
    """
    assert dtype.fields is not None
    field, offset = dtype.fields[number.field][:2]
    within = int(np.ravel_multi_index(number.place, field.shape)) if number.place else 0
    return int(offset + within * field.base.itemsize) // WORD


_imaginary_rate: Callable[[State, float], State] = spelled_out(
    """
def _imaginary_rate(value, scale):
    return State(
        value.{field}.imag * scale,
    )
""",
    State._fields,
    globals(),
)

_imaginary_outputs: Callable[[Outputs, float], Outputs] = spelled_out(
    """
def _imaginary_outputs(value, scale):
    return Outputs(
        value.{field}.imag * scale,
    )
""",
    Outputs._fields,
    globals(),
)


@compiled
def derivatives(
    twin: Record,
    state: State,
    inputs: Inputs,
    blade_before: float,
    ventilated: bool,
    direction: State,
) -> tuple[State, Outputs]:
    """Derivatives of :func:`shaftline.plant.dynamics.evaluate` along one direction.

    Args:
        twin: :data:`COMPLEX_PLANT` record; what has an imaginary part of :data:`STEP` is moved along.
        state: real.
        inputs: what acts; real.
        blade_before: as of ``evaluate``.
        ventilated: likewise.
        direction: how fast each state moves along; all 0 for a number alone.

    Returns:
        Of the states' rates and of the outputs, each per unit of the direction. Inside a dead band or
        backlash, or at an end stop, what does not answer has the derivative 0.
    """
    rate, outputs = evaluate(
        twin, moved(state, direction, STEP * 1j), inputs, blade_before, ventilated
    )
    return _imaginary_rate(rate, 1.0 / STEP), _imaginary_outputs(outputs, 1.0 / STEP)
