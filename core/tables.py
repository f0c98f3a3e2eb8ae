"""Tables as data loggers write them: separator, decimal comma, encoding, header lines, units.

Properties that a file does not state are guessed from its first lines. The guess is stored with the
table (``table.attrs["layout"]``), so that it can be shown.
"""

from __future__ import annotations

import codecs
import csv
import functools
import importlib.util
import os
import pickle
import re
import subprocess
import sys
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from . import sheet_process

_READ_BYTES = 100_000
_NAMES = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma"}
"""Separators; the comma is last, because with the others it may be the decimal sign."""
_CONSTANT = 0.9  # least share of the lines with the same number of fields
_WIDE = 0.9  # least share of zero bytes at one place of each character in a UTF-16 or UTF-32 text
_HEAD_ROWS = 100  # rows of a spreadsheet in which the header is searched
_LONGEST_S = 120  # time limit of the spreadsheet process [s]
_LARGEST_UNPACKED = 400e6  # largest unpacked spreadsheet [bytes]
_SHORT = 16  # largest number of characters of a unit
_NO_TEXT = {
    b"\x1f\x8b": "it is compressed (gzip); unpack it first",
    b"PK\x03\x04": "it is a zip archive or a spreadsheet; unpack it, or give it its own ending (.xlsx)",
    b"MATLAB 5.0": "it is a MATLAB file; save the table as CSV (writetable)",
    b"\x89HDF": "it is an HDF5 or a MATLAB file; save the table as CSV or Parquet",
    b"PAR1": "it is a Parquet file; give it the ending .parquet",
}
"""First bytes of files that are often mistaken for text, and the remedy."""


class LayoutError(ValueError):
    """A file without a usable table; the message says why."""


@dataclass(frozen=True)
class Layout:
    """Layout of a table in a text file or spreadsheet."""

    encoding: str = "utf-8"  # of the text, as Python names it
    separator: str = ","  # of the fields
    decimal: str = "."  # decimal sign, ``.`` or ``,``
    header_row: int = 1  # line of the column names, from 1
    unit_row: int | None = None  # line of the units, if there is one
    sheet: str | None = None  # of a spreadsheet; None for a text file

    def description(self) -> str:
        """Return the properties that differ from a plain CSV file; empty for a plain file."""
        special = {
            f"sheet {self.sheet!r}": self.sheet is not None,
            f"encoding {self.encoding}": self.encoding != "utf-8",
            f"separator {_NAMES.get(self.separator, self.separator)}": self.separator != ",",
            "decimal comma": self.decimal != ".",
            f"names in line {self.header_row}": self.header_row != 1,
            f"units in line {self.unit_row}": self.unit_row is not None,
        }
        return ", ".join(part for part, applies in special.items() if applies)


def _encoding(head: bytes) -> str:
    for marks, name in (
        ((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE), "utf-32"),
        ((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE), "utf-16"),
        ((codecs.BOM_UTF8,), "utf-8-sig"),
    ):
        if head.startswith(marks):
            return name
    if b"\x00" in head:
        return _wide_encoding(head)
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:  # The error is not just a character cut at the end.
            return "cp1252"
    return "utf-8"


def _wide_encoding(head: bytes) -> str:
    """Return the encoding of a text with two or four bytes per character and no byte order mark.

    In a text of mostly Latin letters the zero bytes are at the same places of every character.
    """
    zero = [1.0 - sum(map(bool, head[k::4])) / max(len(head[k::4]), 1) for k in range(4)]
    for name, places in (
        ("utf-32-be", (0, 1, 2)), ("utf-32-le", (1, 2, 3)), ("utf-16-be", (0, 2)), ("utf-16-le", (1, 3))
    ):  # fmt: skip
        letters = [zero[k] for k in range(4) if k not in places]
        if min(zero[k] for k in places) > _WIDE and max(letters) == 0.0:
            return name
    raise LayoutError("it contains bytes that are no text; save the table as CSV")


def _is_number(cell: str, decimal: str) -> bool:
    text = cell.strip()
    if decimal == ",":
        text = text.replace(".", "").replace(",", ".")
    try:
        float(text)
    except ValueError:
        return False
    return True


def guess_layout(path: Path, encoding: str | None = None) -> Layout:
    """Return the layout of a text file, guessed from its first lines and its encoding, if it is known.

    A file that contains nothing like a table with column names raises a LayoutError.
    """
    with path.open("rb") as file:
        head = file.read(_READ_BYTES)
    whole = len(head) < _READ_BYTES
    for mark, what in _NO_TEXT.items():
        if head.startswith(mark):
            raise LayoutError(what)
    encoding = encoding or _encoding(head)
    lines = head.decode(encoding, errors="ignore").splitlines()[: None if whole else -1]
    if not any(line.strip() for line in lines):
        long = f"its first line is longer than {_READ_BYTES / 1e6:g} MB"
        raise LayoutError("it is empty" if whole else long)
    last = [line for line in lines[len(lines) // 2 :] if line.strip()]
    for separator in _NAMES:
        widths = Counter(len(_cells(line, separator)) for line in last)
        width, count = widths.most_common(1)[0]
        if width > 1 and count >= _CONSTANT * len(last):
            break
    else:
        separator, width = ",", 1
    body = [cell for line in last for cell in _cells(line, separator)]
    number = r"\s*[-+]?\d*[{}]\d+(e[-+]?\d+)?\s*"
    comma, point = (
        sum(bool(re.fullmatch(number.format(sign), c, re.I)) for c in body) for sign in ",."
    )
    decimal = "," if separator != "," and comma > point else "."
    rows = [_cells(line, separator) if line.strip() else [] for line in lines]
    return Layout(encoding, separator, decimal, *_names_and_units(rows, width, decimal))


def _names_and_units(rows: list[list[str]], width: int, decimal: str) -> tuple[int, int | None]:
    """Return the row of the column names, from 1, and of the units, if there is one.

    They are the rows of text directly above the numbers, of the same width.
    """
    headers: list[int] = []
    for number, cells in enumerate(rows, start=1):
        if len(cells) != width or not any(cell.strip() for cell in cells):
            headers = []
        elif 2 * sum(_is_number(cell, decimal) for cell in cells) >= width:
            break
        else:
            headers.append(number)
    else:
        return (headers or [1])[0], None  # The caller reports that there are no numbers.
    if not headers:
        return 1, None
    if len(headers) > 1 and _are_units(rows[headers[-1] - 1]):
        return headers[-2], headers[-1]
    return headers[-1], None


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator))


def _are_units(cells: list[str]) -> bool:
    """Return whether all cells are short and none is a date or a time."""
    return all(len(c.strip()) <= _SHORT and not re.search(r"\d:\d", c) for c in cells)


def read_text_table(path: Path, given: dict[str, Any] | None = None) -> pd.DataFrame:
    """Return the table of a text file; ``attrs`` has its ``layout`` and, if present, ``units`` by name.

    ``given`` holds the known fields of :class:`Layout`; the others are guessed.

    Raises:
        LayoutError: no table, or a repeated column name.
        ValueError: from pandas, which cannot read the file.
    """
    given = given or {}
    layout = replace(guess_layout(path, given.get("encoding")), **given)

    style = {"sep": layout.separator, "decimal": layout.decimal, "encoding": layout.encoding}
    read = functools.partial(pd.read_csv, path, **style)
    above = list(range(layout.header_row - 1))
    try:
        names = _unique(read(header=None, skiprows=above, nrows=1, dtype=str).iloc[0])
    except pd.errors.EmptyDataError:
        empty = f"line {layout.header_row} is empty, but should contain the column names"
        raise LayoutError(empty) from None
    skipped = above if layout.unit_row is None else [*above, layout.unit_row - 1]
    table = read(skiprows=skipped)
    units = None
    if layout.unit_row is not None:
        units = read(header=None, skiprows=layout.unit_row - 1, nrows=1, dtype=str).iloc[0]
    if len(names) == len(table.columns):  # There are fewer names if rows end with a separator.
        table.columns = pd.Index(names)
    return _labelled(table, layout, units)


def read_sheet(path: Path, given: dict[str, Any] | None = None) -> pd.DataFrame:
    """Return the table of a spreadsheet (xlsx, xls, xlsb or ods), as in :func:`read_text_table`.

    Macros and formulas are not executed; their last stored results are read. ``given`` may hold
    ``sheet`` (by default the first), ``header_row`` and ``unit_row``.

    Raises:
        LayoutError: no table, no such sheet, or a repeated column name.
        ImportError: the reader is not installed.
    """
    known = dict(given or {})
    if path.suffix.lower() != ".xls":
        _check_unpacked(path)
    names, raw = _read_in_process(path, known.get("sheet", ""))
    sheet = known.get("sheet", names[0])
    if raw is None:
        raise LayoutError(f"no sheet {sheet!r}; it has: {', '.join(names)}")
    if raw.empty:
        raise LayoutError(f"sheet {sheet!r} is empty")
    head = [["" if pd.isna(c) else str(c) for c in row] for row in raw.head(_HEAD_ROWS).to_numpy()]
    header, unit = _names_and_units(head, len(raw.columns), ".")
    given_rows = known.get("header_row", header), known.get("unit_row", unit)
    layout = Layout("utf-8", ",", ".", *given_rows, sheet)
    if layout.header_row > len(raw):
        few = f"{len(raw)} rows, but header_row is {layout.header_row}"
        raise LayoutError(f"sheet {sheet!r} has {few}")
    below = max(layout.header_row, layout.unit_row or 0)
    table = raw.iloc[below:].reset_index(drop=True)
    table.columns = pd.Index(_unique(raw.iloc[layout.header_row - 1]))
    units = None if layout.unit_row is None else raw.iloc[layout.unit_row - 1]
    return _labelled(table.infer_objects(), layout, units)


def _read_in_process(path: Path, sheet: str) -> tuple[list[str], pd.DataFrame | None]:
    """Return the names of a spreadsheet's sheets, and one sheet as a table, None if absent."""
    if importlib.util.find_spec("python_calamine") is None:
        raise ModuleNotFoundError("No module named 'python_calamine'", name="python_calamine")
    line = [sys.executable, "-P", sheet_process.__file__, str(path.absolute()), sheet]
    # Use one thread, because each thread reserves address space.
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(line, capture_output=True, timeout=_LONGEST_S, env=alone, check=False)
    except subprocess.TimeoutExpired:
        late = f"the spreadsheet took over {_LONGEST_S} s to open; save the sheet as CSV"
        raise LayoutError(late) from None
    if done.returncode == 0:
        names, table = pickle.loads(done.stdout)
        return names, table
    message = done.stderr.decode(errors="replace")
    if any(sign in message for sign in ("memory allocation", "MemoryError", "capacity overflow")):
        raise LayoutError(
            f"the spreadsheet needs more than {sheet_process.LARGEST_BYTES / 1e9:g} GB of memory: "
            "perhaps a stray cell far from the table; delete it, or save the sheet as CSV"
        )
    raise LayoutError("it is no spreadsheet, or a damaged one; open it and save it as CSV")


def _check_unpacked(path: Path) -> None:
    declares = False
    try:
        with zipfile.ZipFile(path) as members:
            size = sum(member.file_size for member in members.infolist())
            for member in members.infolist():
                if member.filename.endswith(".xml") and size <= _LARGEST_UNPACKED:
                    with members.open(member) as file:
                        declares |= b"<!DOCTYPE" in file.read(_READ_BYTES)
    except (zipfile.BadZipFile, zlib.error, OSError, ValueError, RuntimeError, EOFError):
        raise LayoutError("it is no spreadsheet, or a damaged one; save the sheet as CSV") from None
    if size > _LARGEST_UNPACKED:
        raise LayoutError(
            f"the spreadsheet unpacks to {size / 1e6:.0f} MB; at most {_LARGEST_UNPACKED / 1e6:.0f} "
            "MB are read. Save the sheet as CSV"
        )
    if declares:  # No spreadsheet program writes entities, which can exhaust memory.
        raise LayoutError(
            "the spreadsheet declares a document type, which no spreadsheet program writes: it is "
            "damaged or harmful; save the sheet as CSV"
        )


def _unique(row: pd.Series) -> list[str]:
    """Return the column names of a row; missing ones are named as in pandas."""
    names = [f"Unnamed: {i}" if pd.isna(name) else str(name).strip() for i, name in enumerate(row)]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise LayoutError(f"column {twice[0]!r} occurs twice; give each column a name of its own")
    return names


def _labelled(table: pd.DataFrame, layout: Layout, units: pd.Series | None) -> pd.DataFrame:
    table.attrs["layout"] = layout
    if units is not None:
        table.attrs["units"] = {
            name: unit.strip().strip("[]()").strip()
            for name, unit in zip(table.columns, units, strict=False)
            if isinstance(unit, str)
        }
    return table
