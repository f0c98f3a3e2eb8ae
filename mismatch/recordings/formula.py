"""Formulas of a column map: a column that is worked out from others, row by row.

The expressions are those of terms (:mod:`shaftline.plant.expressions`): parsed, never run.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import COLUMNS
from ...plant.expressions import FUNCTIONS, names_in, parsed
from ...plant.term_kernel import rows_of

LONGEST = 1000
"""Letters of a formula at most."""


def check_formula(formula: str, names: Mapping[str, str]) -> None:
    """Refuse a formula that is no expression, or names that it does not use.

    Args:
        formula: see the module.
        names: names in it, and the columns of the file for which they stand.

    Raises:
        ValueError: says what is wrong and what is allowed.
    """
    if len(formula) > LONGEST:
        raise ValueError(f"a formula has at most {LONGEST} letters, not {len(formula)}")
    used = list(dict.fromkeys(names_in(formula)))
    parsed(formula, (), {name: k for k, name in enumerate(used)}, [])
    if not used:
        raise ValueError(f"{formula!r} uses no column; a formula needs the name of one at least")
    for name in names:
        if name not in used or name in FUNCTIONS:
            raise ValueError(
                f"names.{name} does not stand in {formula!r} (it uses {', '.join(used)})"
            )


def columns_in(formula: str, names: Mapping[str, str]) -> dict[str, str]:
    """Columns that a formula uses, by their names in it."""
    return {name: names.get(name, name) for name in names_in(formula)}


def worked_out(
    formula: str, names: Mapping[str, str], raw: pd.DataFrame, mapped: pd.DataFrame
) -> pd.Series:
    """Values of a formula, a row each; missing where one of its columns has no number.

    Args:
        formula: checked by :func:`check_formula`.
        names: as there.
        raw: the file's columns, in the file's units.
        mapped: columns that the map has given so far. Canonical ones and signals are taken from here,
            in the canonical unit.

    Raises:
        ValueError: a column that is in neither, or a row in which the formula has no finite value.
    """
    used = columns_in(formula, names)
    found = {}
    for name, column in used.items():
        canonical = name not in names and column in mapped
        if not canonical and column not in raw:
            known = dict.fromkeys([*map(str, raw), *(c for c in mapped if c in COLUMNS)])
            raise ValueError(
                f"{formula!r} uses {column!r}, which is no column (found: {', '.join(known)}); for a "
                f'column whose name has blanks or signs say names = {{ {name} = "..." }}'
            )
        values = (mapped if canonical else raw)[column]
        found[name] = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    signals = np.column_stack(list(found.values()))
    literals: list[float] = []
    program = np.array(parsed(formula, (), {name: k for k, name in enumerate(found)}, literals))
    result: NDArray[np.float64] = np.empty(len(signals))
    rows_of(program, np.array([*literals, 0.0]), signals, result)
    bad = ~np.isfinite(result) & np.isfinite(signals).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        there = ", ".join(f"{name} = {values[row]:g}" for name, values in found.items())
        raise ValueError(
            f"row {row + 1}: {formula!r} has no finite value with {there} ({bad.sum()} of {len(bad)} "
            "rows): it divides by 0, has the root or logarithm of a number below 0, or is too large; "
            "keep a divisor away from 0 by max(..., 0.1), or cut these rows"
        )
    return pd.Series(result, raw.index)
