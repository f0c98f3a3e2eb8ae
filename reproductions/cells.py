"""Printed numbers beside ours: met, different for a calculated reason, or unexplained.

A cell is one printed number. It states its kind (whether our model was given the number, was fitted
to it, or predicts it), the interval in which our number counts as met, and where that interval comes
from. A reason belongs to one cell and is a calculation of what a cause adds to our number. It counts
only where our number plus this shift meets the print. A cell that is off without such a calculation
is unexplained.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.display.tables import write_csv

_FILE_ROUNDING = 1e-9  # relative rounding of numbers in a file of cells


HALF_DIGIT = "half a unit of the last printed digit"  # basis of a cell's interval


class Kind(StrEnum):
    """What our model knew of a printed number."""

    INPUT = "input"  # it was given the number
    CALIBRATED = "calibrated"  # a parameter was fitted to the number or to its table
    FREE = "free"  # it predicts the number
    DERIVED = "derived"  # it follows by arithmetic from other printed numbers, which ours is


class Verdict(StrEnum):
    """How our number compares with the print."""

    MET = "met"
    EXPLAINED = "differs, reason calculated"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class Reason:
    """A calculated cause of the difference between one printed number and ours.

    The cause explains the cell only where ``ours + shift`` meets the print. A shift must come out of a
    calculation that does not use the cell's own difference.

    Raises:
        ValueError: a shift that is not finite or zero, or a distance above half of the shift.
    """

    text: str  # the cause, with the formula and the numbers of the calculation
    shift: float  # what the cause adds to our number [unit of the cell]
    within: float | None = None
    """Distance of ``ours + shift`` from the printed number that still counts; by default the cell's
    interval. At most half of the shift: a cause must explain most of a difference."""

    def __post_init__(self) -> None:
        """Check the fields."""
        if not math.isfinite(self.shift) or self.shift == 0.0:
            raise ValueError(f"a reason needs a finite shift that is not 0; got {self.shift!r}")
        most = 0.5 * abs(self.shift) * (1.0 + _FILE_ROUNDING)
        if self.within is not None and not 0.0 <= self.within <= most:
            raise ValueError(
                f"a reason must explain most of a difference: within is {self.within:g}, "
                f"at most {0.5 * abs(self.shift):g} (half of the shift) is allowed"
            )


@dataclass(frozen=True)
class Cell:
    """One printed number beside ours.

    Raises:
        ValueError: no table, row or basis; a printed number outside of its own interval; no print at
            all; a reason with a distance but no printed number.
    """

    table: str  # the table, figure or section of the source
    row: str  # row of the table, or the quantity with its unit
    column: str  # empty if the table has one
    ours: float
    low: float  # least number that counts as met
    high: float  # largest number that counts as met
    basis: str  # of the interval: printed digits, a stated error, propagated rounding
    kind: Kind = Kind.FREE
    printed: float = math.nan  # NaN where the print has words only
    words: str = ""  # of the print
    reason: Reason | None = None  # ignored where the cell is met

    def __post_init__(self) -> None:
        """Check the fields."""
        where = f"{self.table} / {self.row} / {self.column}"
        if not (self.table.strip() and self.row.strip() and self.basis.strip()):
            raise ValueError(f"cell {where}: table, row and basis of the tolerance must be given")
        if not self.low <= self.high:
            raise ValueError(f"cell {where}: interval {self.low:g} to {self.high:g} is empty")
        if math.isnan(self.printed):
            if not self.words.strip():
                raise ValueError(f"cell {where}: give the printed number or the printed words")
            if self.reason is not None and self.reason.within is not None:
                raise ValueError(f"cell {where}: a distance needs a printed number")
        elif not self.low <= self.printed <= self.high:
            raise ValueError(
                f"cell {where}: printed {self.printed:g} is outside of {self.low:g} to {self.high:g}"
            )

    @property
    def key(self) -> tuple[str, str, str]:
        """Table, row and column."""
        return self.table, self.row, self.column

    @property
    def verdict(self) -> Verdict:
        """How our number compares with the print; NaN is never met."""
        if self.low <= self.ours <= self.high:
            return Verdict.MET
        if self.reason is not None:
            moved, within = self.ours + self.reason.shift, self.reason.within
            near = (
                self.low <= moved <= self.high
                if within is None
                else abs(moved - self.printed) <= within
            )
            if near:
                return Verdict.EXPLAINED
        return Verdict.UNEXPLAINED

    @property
    def print_text(self) -> str:
        """The printed number or words."""
        return self.words or f"{self.printed:.6g}"


def number(
    table: str,
    row: str,
    column: str,
    ours: float,
    printed: float,
    tolerance: float,
    basis: str,
    kind: Kind = Kind.FREE,
    reason: Reason | None = None,
) -> Cell:
    """Return the cell of a printed number with a symmetric tolerance."""
    low, high = printed - tolerance, printed + tolerance
    return Cell(table, row, column, float(ours), low, high, basis, kind, printed, "", reason)


def printed_number(
    table: str,
    row: str,
    column: str,
    ours: float,
    text: str,
    kind: Kind = Kind.FREE,
    more: float = 0.0,
    basis: str = HALF_DIGIT,
    reason: Reason | None = None,
) -> Cell:
    """Return the cell of a number as printed, met within half of its last digit and ``more``."""
    return number(
        table, row, column, ours, float(text), half_digit(text) + more, basis, kind, reason
    )


def half_digit(text: str, decimals: int | None = None) -> float:
    """Return half a unit of the last printed digit.

    Raises:
        ValueError: the text is no number.
    """
    found = re.fullmatch(r"\s*[-+]?\d+(?:\.(\d*))?(?:[eE]([-+]?\d+))?\s*", text)
    if not found:
        raise ValueError(f"{text!r} is no printed number, such as -0.46 or 1.4e13")
    digits = len(found[1] or "") if decimals is None else decimals
    return 0.5 * 10.0 ** (int(found[2] or 0) - digits) * (1.0 + _FILE_ROUNDING)


def explain(cell: Cell, *reasons: Reason | None) -> Cell:
    """Return the cell with the first reason that explains it, or else with the first reason."""
    tried = [replace(cell, reason=reason) for reason in reasons if reason is not None]
    explained = [one for one in tried if one.verdict is Verdict.EXPLAINED]
    return next(iter([*explained, *tried]), cell)


def shift_to(text: str, ours: float, follows: float, within: float | None = None) -> Reason | None:
    """Return the reason that moves our number to ``follows``; None if it does not move it.

    ``within`` is limited to half of the shift.
    """
    shift = float(follows - ours)
    if not shift:
        return None
    return Reason(text, shift, None if within is None else min(within, 0.5 * abs(shift)))


def counts(cells: Iterable[Cell]) -> pd.DataFrame:
    """Return the number of cells by kind (rows) and verdict (columns), kinds without cells left out."""
    found = Counter((cell.kind, cell.verdict) for cell in cells)
    kinds = [kind for kind in Kind if any(found[kind, verdict] for verdict in Verdict)]
    return pd.DataFrame(
        [[found[kind, verdict] for verdict in Verdict] for kind in kinds],
        index=pd.Index(map(str, kinds), name="kind"),
        columns=[str(verdict) for verdict in Verdict],
    )


def _line(cell: Cell) -> dict[str, Any]:
    reason = cell.reason
    return {
        "table": cell.table,
        "row": cell.row,
        "column": cell.column,
        "kind": str(cell.kind),
        "printed": cell.printed,
        "words": cell.words,
        "ours": cell.ours,
        "low": cell.low,
        "high": cell.high,
        "basis": cell.basis,
        "verdict": str(cell.verdict),
        "shift": reason.shift if reason else math.nan,
        "within": reason.within if reason and reason.within is not None else math.nan,
        "reason": reason.text if reason else "",
    }


def write(folder: Path, name: str, cells: Iterable[Cell]) -> None:
    """Write ``cells/NAME.csv`` into a folder, one line a cell, so that :func:`read` returns them."""
    write_csv(folder / "cells", name, pd.DataFrame([_line(cell) for cell in cells]), digits=12)


def read(path: Path) -> list[Cell]:
    """Return the cells of a file that :func:`write` wrote."""
    empty = {name: [""] for name in ("printed", "ours", "low", "high", "shift", "within")}
    found = []
    for line in pd.read_csv(path, keep_default_na=False, na_values=empty).itertuples():
        within = None if math.isnan(line.within) else line.within
        reason = Reason(line.reason, line.shift, within) if line.reason else None
        found.append(
            Cell(
                line.table,
                line.row,
                str(line.column),
                line.ours,
                line.low,
                line.high,
                line.basis,
                Kind(line.kind),
                line.printed,
                line.words,
                reason,
            )
        )
    return found


def repeated_keys(cells: Iterable[Cell]) -> Iterator[tuple[str, str, str]]:
    """Yield the keys that more than one cell has."""
    yield from (key for key, count in Counter(cell.key for cell in cells).items() if count > 1)
