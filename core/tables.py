"""Tables as loggers write them: separator, decimal comma, encoding, lines above the names, units.

What a file does not say is guessed from its first lines, and the guess goes with the table
(``table.attrs["layout"]``), so that it can be shown.
"""

from __future__ import annotations

import csv
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
_SEPARATORS = ("\t", ";", "|", ",")  # a comma last: it may be the decimal sign of the others
_CONSTANT = 0.9  # share of the lines that must have as many fields
_WIDE = 0.9  # share of zero bytes at a place of each letter, from which a text is of wide letters
_HEAD_ROWS = 100  # of a spreadsheet, in which its names are looked for
_LONGEST_S = 120  # for reading a spreadsheet
_LARGEST_UNPACKED = 400e6  # of a spreadsheet [bytes]
_SHORT = 16  # letters of a unit at most
_NO_TEXT = {
    b"\x1f\x8b": "it is compressed (gzip); unpack it first",
    b"PK\x03\x04": "it is a zip archive or a spreadsheet; unpack it, or give it its own ending (.xlsx)",
    b"MATLAB 5.0": "it is a MATLAB file; save the table as CSV (writetable)",
    b"\x89HDF": "it is an HDF5 or a MATLAB file; save the table as CSV or Parquet",
    b"PAR1": "it is a Parquet file; give it the ending .parquet",
}
"""First bytes of files that are often taken for a text, and what to do."""
_NAMES = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma"}


class LayoutError(ValueError):
    """A file that is no table; the message says why."""


@dataclass(frozen=True)
class Layout:
    """How a text file is a table.

    Args:
        encoding: of the text, as Python names it.
        separator: between fields.
        decimal: sign, ``.`` or ``,``.
        header_row: line of the names, from 1.
        unit_row: line of the units, if there is one.
        sheet: of a spreadsheet; None for a text.
    """

    encoding: str = "utf-8"
    separator: str = ","
    decimal: str = "."
    header_row: int = 1
    unit_row: int | None = None
    sheet: str | None = None

    def words(self) -> str:
        """What is not plain about it; empty for a plain file."""
        said = [] if self.sheet is None else [f"sheet {self.sheet!r}"]
        if self.encoding != "utf-8":
            said.append(f"encoding {self.encoding}")
        if self.separator != ",":
            said.append(f"separator {_NAMES.get(self.separator, self.separator)}")
        if self.decimal != ".":
            said.append("decimal comma")
        if self.header_row != 1:
            said.append(f"names in line {self.header_row}")
        if self.unit_row is not None:
            said.append(f"units in line {self.unit_row}")
        return ", ".join(said)


def _encoding(head: bytes) -> str:
    for mark, name in (
        (b"\xff\xfe\x00\x00", "utf-32"),
        (b"\x00\x00\xfe\xff", "utf-32"),
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
        (b"\xef\xbb\xbf", "utf-8-sig"),
    ):
        if head.startswith(mark):
            return name
    if b"\x00" in head:
        return _wide_encoding(head)
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:  # not merely cut off within a letter
            return "cp1252"
    return "utf-8"


def _wide_encoding(head: bytes) -> str:
    """Encoding of a text with two or four bytes a letter and no mark at its begin.

    In such a text of mostly Latin letters the zero bytes stand at the same places of every letter.

    Raises:
        LayoutError: it is none.
    """
    zero = [1.0 - sum(map(bool, head[k::4])) / max(len(head[k::4]), 1) for k in range(4)]
    for name, places in (
        ("utf-32-be", (0, 1, 2)), ("utf-32-le", (1, 2, 3)), ("utf-16-be", (0, 2)), ("utf-16-le", (1, 3))
    ):  # fmt: skip
        letters = [zero[k] for k in range(4) if k not in places]
        if min(zero[k] for k in places) > _WIDE and max(letters) == 0.0:
            return name
    raise LayoutError("it holds bytes that are no text")


def _is_number(cell: str, decimal: str) -> bool:
    text = cell.strip()
    if decimal == ",":
        text = text.replace(".", "").replace(",", ".")
    try:
        float(text)
    except ValueError:
        return False
    return True


def guessed(path: Path, encoding: str | None = None) -> Layout:
    """The layout of a text file, from its first lines.

    Args:
        path: of the file.
        encoding: of its text, where that is known.

    Raises:
        LayoutError: nothing in it looks like a table with names.
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
        raise LayoutError(
            "it is empty" if whole else f"its first line is longer than {_READ_BYTES / 1e6:g} MB"
        )
    last = [line for line in lines[len(lines) // 2 :] if line.strip()]
    for separator in _SEPARATORS:
        widths = Counter(len(_cells(line, separator)) for line in last)
        width, count = widths.most_common(1)[0]
        if width > 1 and count >= _CONSTANT * len(last):
            break
    else:
        separator, width = ",", 1
    body = [cell for line in last for cell in _cells(line, separator)]
    comma = sum(bool(re.fullmatch(r"\s*[-+]?\d*,\d+(e[-+]?\d+)?\s*", c, re.I)) for c in body)
    point = sum(bool(re.fullmatch(r"\s*[-+]?\d*\.\d+(e[-+]?\d+)?\s*", c, re.I)) for c in body)
    decimal = "," if separator != "," and comma > point else "."
    rows = [_cells(line, separator) if line.strip() else [] for line in lines]
    return Layout(encoding, separator, decimal, *_names_and_units(rows, width, decimal))


def _names_and_units(rows: list[list[str]], width: int, decimal: str) -> tuple[int, int | None]:
    """Row of the names, from 1, and of the units, if there is one.

    They are the rows of text right above the numbers, as wide as they are.
    """
    found: list[int] = []
    for number, cells in enumerate(rows, start=1):
        if len(cells) != width or not any(cell.strip() for cell in cells):
            found = []
        elif 2 * sum(_is_number(cell, decimal) for cell in cells) >= width:
            break
        else:
            found.append(number)
    else:
        return (found or [1])[0], None  # no numbers: its reader says what is wrong with it
    if not found:
        return 1, None
    if len(found) > 1 and _are_units(rows[found[-1] - 1]):
        return found[-2], found[-1]
    return found[-1], None


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator))


def _are_units(cells: list[str]) -> bool:
    """Whether cells are short and none of them a date or a time."""
    return all(len(c.strip()) <= _SHORT and not re.search(r"\d:\d", c) for c in cells)


def read_text_table(path: Path, given: dict[str, Any] | None = None) -> pd.DataFrame:
    """The table of a text file; ``attrs`` has its ``layout``, and ``units`` by name where it has them.

    Args:
        path: of the file.
        given: fields of :class:`Layout` that are known; the others are guessed.

    Raises:
        LayoutError: no table, or a name that stands twice.
        ValueError: of pandas, which cannot read it.
    """
    given = given or {}
    layout = replace(guessed(path, given.get("encoding")), **given)

    def read(**options: Any) -> pd.DataFrame:
        table: pd.DataFrame = pd.read_csv(
            path, sep=layout.separator, decimal=layout.decimal, encoding=layout.encoding, **options
        )
        return table

    above = list(range(layout.header_row - 1))
    try:
        names = _unique(read(header=None, skiprows=above, nrows=1, dtype=str).iloc[0])
    except pd.errors.EmptyDataError:
        raise LayoutError(
            f"nothing stands in line {layout.header_row}, that of the names"
        ) from None
    skipped = above if layout.unit_row is None else [*above, layout.unit_row - 1]
    table = read(skiprows=skipped)
    units = None
    if layout.unit_row is not None:
        units = read(header=None, skiprows=layout.unit_row - 1, nrows=1, dtype=str).iloc[0]
    if len(names) == len(table.columns):  # fewer where rows end with a separator
        table.columns = pd.Index(names)
    return _labelled(table, layout, units)


def read_sheet(path: Path, given: dict[str, Any] | None = None) -> pd.DataFrame:
    """The table of a spreadsheet (xlsx, xls, xlsb or ods), as of :func:`read_text_table`.

    Its macros and formulas are not run; what they gave last is read.

    Args:
        path: of the file.
        given: ``sheet`` (the first by default), ``header_row`` and ``unit_row`` where they are known.

    Raises:
        LayoutError: no table, no such sheet, or a name that stands twice.
        ImportError: its reader is not installed.
    """
    said = dict(given or {})
    if path.suffix.lower() != ".xls":
        _check_unpacked(path)
    names, raw = _read_apart(path, said.get("sheet", ""))
    sheet = said.get("sheet", names[0])
    if raw is None:
        raise LayoutError(f"no sheet {sheet!r}; it has: {', '.join(names)}")
    if raw.empty:
        raise LayoutError(f"sheet {sheet!r} is empty")
    head = [["" if pd.isna(c) else str(c) for c in row] for row in raw.head(_HEAD_ROWS).to_numpy()]
    header, unit = _names_and_units(head, len(raw.columns), ".")
    layout = Layout(
        "utf-8", ",", ".", said.get("header_row", header), said.get("unit_row", unit), sheet
    )
    if layout.header_row > len(raw):
        raise LayoutError(f"sheet {sheet!r} has {len(raw)} rows; the names' is {layout.header_row}")
    below = max(layout.header_row, layout.unit_row or 0)
    table = raw.iloc[below:].reset_index(drop=True)
    table.columns = pd.Index(_unique(raw.iloc[layout.header_row - 1]))
    units = None if layout.unit_row is None else raw.iloc[layout.unit_row - 1]
    return _labelled(table.infer_objects(), layout, units)


def _read_apart(path: Path, sheet: str) -> tuple[list[str], pd.DataFrame | None]:
    """Return the names of a spreadsheet's sheets, and one of them as a table: None if it is not there.

    Raises:
        LayoutError: damaged, too large, or no spreadsheet.
        ImportError: its reader is not installed.
    """
    if importlib.util.find_spec("python_calamine") is None:
        raise ModuleNotFoundError("No module named 'python_calamine'", name="python_calamine")
    script = Path(sheet_process.__file__)
    line = [sys.executable, "-P", str(script), str(path.absolute()), sheet]
    # one thread, for each asks for address space
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(line, capture_output=True, timeout=_LONGEST_S, env=alone, check=False)
    except subprocess.TimeoutExpired:
        raise LayoutError(f"reading the spreadsheet took over {_LONGEST_S} s") from None
    if done.returncode == 0:
        names, table = pickle.loads(done.stdout)
        return names, table
    said = done.stderr.decode(errors="replace")
    if "memory allocation" in said or "MemoryError" in said or "capacity overflow" in said:
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
        raise LayoutError("it is no spreadsheet, or a damaged one") from None
    if size > _LARGEST_UNPACKED:
        raise LayoutError(
            f"the spreadsheet unpacks to {size / 1e6:.0f} MB; at most {_LARGEST_UNPACKED / 1e6:.0f} "
            "MB are read. Save the sheet as CSV"
        )
    if declares:  # entities, which no spreadsheet program writes
        raise LayoutError(
            "the spreadsheet declares a document type: it is a damaged or a harmful one"
        )


def _unique(row: pd.Series) -> list[str]:
    """Names of a row; those without one are called as pandas does."""
    names = [f"Unnamed: {i}" if pd.isna(name) else str(name).strip() for i, name in enumerate(row)]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise LayoutError(f"column {twice[0]!r} stands twice")
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
