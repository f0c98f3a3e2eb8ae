"""Combinator table of a ship file: shaft speed and pitch by lever position or ordered ship speed.

Controllers follow the table in place of the standard curve (:mod:`shaftline.baselines.combinator`). The
plant does not depend on it.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .keys import Section, quantity

MOST_ROWS = 256


def _column(description: str, unit: str, low: float, high: float) -> Any:
    about = f"{description}, 2 to {MOST_ROWS} values"
    return quantity(f"{about} ({low:g} to {high:g})", unit, default=(), strict=False)


class CombinatorTable(Section):
    """Combinator table: settings by lever position or ordered speed, linear between the rows."""

    # fmt: off
    lever: tuple[Annotated[float, Field(ge=0, le=1)], ...] = _column(
        "lever positions, rising", "-", 0, 1)
    speed_order_m_s: tuple[Annotated[float, Field(ge=0, le=40)], ...] = _column(
        "ordered ship speeds, rising, in place of lever", "m/s", 0, 40)
    shaft_speed_rpm: tuple[Annotated[float, Field(gt=0, le=3000)], ...] = _column(
        "shaft speed in each row", "rpm", 0, 3000)
    pitch_ratio: tuple[Annotated[float, Field(ge=0, le=3)], ...] = _column(
        "P/D in each row; not for a fixed pitch", "-", 0, 3)
    # fmt: on

    @property
    def present(self) -> bool:
        """Whether the ship file has a table."""
        return bool(self.model_fields_set)

    @property
    def key(self) -> str:
        """Key of the column by which the rows are looked up."""
        return "lever" if self.lever else "speed_order_m_s"

    def check(self, shaft_speeds: tuple[float, float], pitch_ratios: tuple[float, float]) -> None:
        """Refuse a table whose columns are missing, of different lengths, not rising or out of range.

        Args:
            shaft_speeds: lowest and highest shaft speed of the engine [rad/s].
            pitch_ratios: lowest and highest P/D of the propeller [-].

        Raises:
            ValueError: names column and row, counted from 1, with unit and range.
        """
        if bool(self.lever) == bool(self.speed_order_m_s):
            raise ValueError("give the column lever or the column speed_order_m_s, one of the two")
        fixed = pitch_ratios[0] == pitch_ratios[1]
        needed = [self.key, "shaft_speed_rpm", *(() if fixed else ("pitch_ratio",))]
        for name in needed:
            if not getattr(self, name):
                raise ValueError(f"the column {name} is missing; needed are {', '.join(needed)}")
        rows = len(getattr(self, self.key))
        for name in type(self).model_fields:
            values = getattr(self, name)
            if values and not 2 <= len(values) == rows <= MOST_ROWS:
                raise ValueError(
                    f"{name} has {len(values)} rows and {self.key} {rows}; all columns need the same "
                    f"number of rows, 2 to {MOST_ROWS}"
                )
        key = np.array(getattr(self, self.key))
        if (level := np.flatnonzero(np.diff(key) <= 0.0)).size:
            row = int(level[0]) + 1
            raise ValueError(
                f"{self.key}, row {row + 1}: {key[row]:g} does not exceed {key[row - 1]:g} of the row "
                "before; sort the rows by rising values"
            )
        rpm = 30.0 / math.pi
        for name, unit, (low, high) in (
            ("shaft_speed_rpm", "rpm", (shaft_speeds[0] * rpm, shaft_speeds[1] * rpm)),
            ("pitch_ratio", "-", pitch_ratios),
        ):
            for row, value in enumerate(getattr(self, name), 1):
                # A table is printed with few digits.
                if not low * (1.0 - 1e-3) <= value <= high * (1.0 + 1e-3):
                    raise ValueError(
                        f"{name}, row {row}: {value:g} lies outside the range of this ship, "
                        f"{low:.4g} to {high:.4g} (unit {unit})"
                    )
