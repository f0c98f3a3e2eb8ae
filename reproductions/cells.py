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
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.display.tables import write_csv

_FILE_ROUNDING = 1e-9
"""Relative rounding of numbers in a file of cells."""


class Kind(StrEnum):
    """What our model knew of a printed number."""

    INPUT = "input"
    """The model was given the number."""
    CALIBRATED = "calibrated"
    """A parameter was fitted to the number or to its table."""
    FREE = "free"
    """The model predicts the number."""


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

    Args:
        text: the cause, with the formula and the numbers of the calculation.
        shift: what the cause adds to our number [unit of the cell].
        within: distance of ``ours + shift`` from the printed number that still counts; the cell's own
            interval if not given. At most half of the shift: a cause must explain most of a difference.

    Raises:
        ValueError: a shift that is not finite or zero, or a distance above half of the shift.
    """

    text: str
    shift: float
    within: float | None = None

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

    Args:
        table: the table, figure or section of the source.
        row: row of the table, or the quantity with its unit.
        column: column of the table; empty if the table has one.
        ours: our number.
        low: least number that counts as met.
        high: largest number that counts as met.
        basis: where the interval comes from: the printed digits, a stated error, propagated rounding.
        kind: what our model knew of the number.
        printed: the printed number; NaN where the print has words only.
        words: what the print says where it has no number.
        reason: calculated cause of a difference; ignored where the cell is met.

    Raises:
        ValueError: no table, row or basis; a printed number outside of its own interval; no print at
            all; a reason with a distance but no printed number.
    """

    table: str
    row: str
    column: str
    ours: float
    low: float
    high: float
    basis: str
    kind: Kind = Kind.FREE
    printed: float = math.nan
    words: str = ""
    reason: Reason | None = None

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
            if within is None:
                shown = self.low <= moved <= self.high
            else:
                shown = abs(moved - self.printed) <= within
            if shown:
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


def half_digit(text: str, decimals: int | None = None) -> float:
    r"""Return half a unit of the last printed digit.


    Raises:
        ValueError: the text is no number.
    """
    found = re.fullmatch(r"\s*[-+]?\d+(?:\.(\d*))?(?:[eE]([-+]?\d+))?\s*", text)
    if not found:
        raise ValueError(f"{text!r} is no printed number, such as -0.46 or 1.4e13")
    digits = len(found[1] or "") if decimals is None else decimals
    return 0.5 * 10.0 ** (int(found[2] or 0) - digits) * (1.0 + 1e-9)


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
        "table": cell.table, "row": cell.row, "column": cell.column, "kind": str(cell.kind),
        "printed": cell.printed, "words": cell.words, "ours": cell.ours, "low": cell.low,
        "high": cell.high, "basis": cell.basis, "verdict": str(cell.verdict),
        "shift": reason.shift if reason else math.nan,
        "within": reason.within if reason and reason.within is not None else math.nan,
        "reason": reason.text if reason else "",
    }  # fmt: skip


def write(folder: Path, name: str, cells: Iterable[Cell]) -> None:
    """Write ``cells/NAME.csv`` into a folder, one line a cell, so that :func:`read` returns them."""
    write_csv(folder / "cells", name, pd.DataFrame([_line(cell) for cell in cells]), digits=12)


def read(path: Path) -> list[Cell]:
    """Return the cells of a file that :func:`write` wrote."""
    frame = pd.read_csv(path, keep_default_na=False, na_values={
        name: [""] for name in ("printed", "ours", "low", "high", "shift", "within")
    })  # fmt: skip
    found = []
    for line in frame.itertuples():
        reason = None
        if line.reason:
            within = None if math.isnan(line.within) else line.within
            reason = Reason(line.reason, line.shift, within)
        found.append(
            Cell(line.table, line.row, str(line.column), line.ours, line.low, line.high, line.basis,
                 Kind(line.kind), line.printed, line.words, reason)
        )  # fmt: skip
    return found


def repeated_keys(cells: Iterable[Cell]) -> Iterator[tuple[str, str, str]]:
    """Yield the keys that more than one cell has."""
    yield from (key for key, count in Counter(cell.key for cell in cells).items() if count > 1)
