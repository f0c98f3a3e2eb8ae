"""K_e and R_a of column I by other least squares on Table 4: how near the printed pair one can come."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..side_by_side import published

Floats = NDArray[np.float64]


def _points() -> tuple[Floats, Floats, Floats]:
    """Return voltage [V], motor speed [rad/s] and current [A] of Table 4, shape (5,) each."""
    table = published("tito_neri_operating_points")
    names = ("motor_voltage_V", "motor_speed_rad_s", "motor_current_A")
    voltage, speed, current = (table[name].to_numpy(dtype=np.float64) for name in names)
    return voltage, speed, current


def _solved(columns: Floats, target: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0])


def _pairs() -> Iterator[tuple[str, float, float]]:
    """Yield a name, K_e [V s/rad] and R_a [ohm] of each way to solve U = K_e w + R_a i."""
    voltage, speed, current = _points()
    both, letters = np.column_stack([speed, current]), np.array(list("ABCDE"))
    for count in range(2, 6):
        for kept in map(list, itertools.combinations(range(5), count)):
            constant, ohm = _solved(both[kept], voltage[kept])
            yield f"points {''.join(letters[kept])}", constant, ohm
    for name, weight in (
        ("1/U", 1 / voltage),
        ("1/i", 1 / current),
        ("1/w", 1 / speed),
        ("U", voltage),
    ):
        constant, ohm = _solved(both * weight[:, None], voltage * weight)
        yield f"weights {name}", constant, ohm
    a, b = _solved(np.column_stack([voltage, current]), speed)
    yield "speed as the dependent variable", 1.0 / a, -b / a
    a, b = _solved(np.column_stack([voltage, speed]), current)
    yield "current as the dependent variable", -b / a, 1.0 / a
    last = np.linalg.svd(np.column_stack([speed, current, voltage]))[2][-1]
    yield "total least squares", -last[0] / last[2], -last[1] / last[2]
    constant, ohm, _ = _solved(np.column_stack([speed, current, np.ones(5)]), voltage)
    yield "with a constant drop of the brushes", constant, ohm


def tried() -> pd.DataFrame:
    """Return every pair, the nearest to the printed one first.

    Returns:
        Columns way, K_e, R_a and off [%], the larger of the two differences from the printed pair.
    """
    printed = published("tito_neri_identified_parameters")["staircase_method_1"]
    rows = [
        (way, constant, ohm,
         100.0 * max(abs(constant / printed["K_e"] - 1.0), abs(ohm / printed["R_a"] - 1.0)))
        for way, constant, ohm in _pairs()
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["way", "K_e", "R_a", "off [%]"])
    return table.sort_values("off [%]", ignore_index=True)
