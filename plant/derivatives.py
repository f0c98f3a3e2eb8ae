"""Exact derivatives of the plant's rates and outputs: to its states and to the numbers of its file.

By complex steps (Squire & Trapp 1998): f(x + i h) = f(x) + i h f'(x) for a tiny h, with no subtraction,
hence no cancellation. A state is moved as it is; a number stands in the ship's record, so a derivative
to it asks for a record whose numbers are complex. That is :data:`COMPLEX_PLANT`, the same record with
room for the step: the kernels take it as they take the other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled, spelled_out
from .dynamics import evaluate
from .keys import KeyInfo, Section, info_of
from .record import PLANT
from .ship import Ship, ShipError
from .state import Inputs, Outputs, State, moved

STEP = 1e-30
"""Of the complex step."""

_TABLES = ("kt", "kq", "term_constants")  # arrays that numbers of a file stand in


def _complex_dtype() -> np.dtype[Any]:
    def wider(name: str) -> tuple[Any, ...]:
        field = PLANT[name]
        if field == np.float64 or name in _TABLES:
            return name, np.complex128, field.shape
        return name, field.base, field.shape

    return np.dtype([wider(name) for name in PLANT.names or ()], align=True)


COMPLEX_PLANT = _complex_dtype()
"""dtype of a ship whose numbers are complex; codes, counts and what is tabulated are as in ``PLANT``."""


def words(record: Any) -> NDArray[np.float64]:
    """A record, or one made complex, as a row of float64 in the same memory."""
    return np.asarray(record).reshape(1).view(np.float64)


def _complex_words() -> NDArray[np.int64]:
    assert PLANT.fields is not None
    assert COMPLEX_PLANT.fields is not None
    found = np.full(len(words(np.zeros((), PLANT))), -1)
    for name, (field, offset, *_) in PLANT.fields.items():
        own, place, *_ = COMPLEX_PLANT.fields[name]
        if own.base == np.complex128:
            count = int(np.prod(field.shape, dtype=int))
            found[offset // 8 : offset // 8 + count] = place // 8 + 2 * np.arange(count)
    return found


COMPLEX_WORD = _complex_words()
"""For each word of a record the one of its real part in a complex record, the imaginary part being the
next; -1 for what is not complex there."""


class Acting(NamedTuple):
    """How a number of a ship's file acts in its record: it moves some words in proportion."""

    key: str  # dotted
    value: float
    info: KeyInfo
    words: NDArray[np.int64]
    slopes: NDArray[np.float64]  # change of each word per unit of the number


def acting(ship: Ship, key: str) -> Acting:
    """A number of a ship and what it moves in the record.

    Args:
        ship: the ship.
        key: dotted; a number with a field of its own, or one of which tables in the record are a
            multiple, as a bollard propeller's coefficients.

    Raises:
        ShipError: no such number, or one that the record holds in no such form.
    """
    section, _, name = key.partition(".")
    if ship.has_key(key):
        number = ship.number(key)
        dtype, offset = PLANT.fields[number.field][:2]  # type: ignore[index]
        within = int(np.ravel_multi_index(number.place, dtype.shape)) if number.place else 0
        at = np.array([offset // 8 + within])
        found = Acting(key, number.value, number.info, at, np.ones(1))
    else:
        table = getattr(ship, section, None)
        value: Any = getattr(table, name, None)
        if not isinstance(table, Section) or not isinstance(value, float):
            return ship.number(key)  # type: ignore[return-value]  # raises, and says why
        info = info_of(type(table).model_fields[name])
        step = 1e-3 * (abs(value) or 1.0) * (1.0 if value < 0.5 * (info.low + info.high) else -1.0)
        base, once, twice = (
            words(ship.with_values({key: value + k * step}).record()).copy() for k in range(3)
        )
        at = np.flatnonzero(once != base)
        if not np.allclose(twice[at] - base[at], 2.0 * (once[at] - base[at]), rtol=1e-6):
            raise ShipError(f"{ship.name}: {key} acts on the equations through tables made from it")
        found = Acting(key, value, info, at, (once[at] - base[at]) / step)
    if not len(found.words) or np.any(COMPLEX_WORD[found.words] < 0):
        raise ShipError(f"{ship.name}: {key} is no number that the equations have a derivative to")
    return found


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
    direction: State,
) -> tuple[State, Outputs]:
    """Derivatives of :func:`shaftline.plant.dynamics.evaluate` along one direction.

    Args:
        twin: :data:`COMPLEX_PLANT` record; what has an imaginary part of :data:`STEP` is moved along.
        state: real.
        inputs: what acts; real.
        blade_before: as of ``evaluate``.
        direction: how fast each state moves along; all 0 for a number alone.

    Returns:
        Of the states' rates and of the outputs, each per unit of the direction. Inside a dead band or
        backlash, or at an end stop, what does not answer has the derivative 0.
    """
    rate, outputs = evaluate(twin, moved(state, direction, STEP * 1j), inputs, blade_before)
    return _imaginary_rate(rate, 1.0 / STEP), _imaginary_outputs(outputs, 1.0 / STEP)
