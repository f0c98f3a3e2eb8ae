"""Tables as data loggers write them: separator, decimal comma, encoding, header lines, units.

Properties that a file does not state are guessed from its first lines. The guess is stored with the
table (``table.attrs["layout"]``), so that it can be shown.
"""

from __future__ import annotations

import codecs
import csv
import functools
import importlib.util
import math
import os
import pickle
import re
import subprocess
import sys
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from . import sheet_process

_READ_BYTES = 100_000
_NAMES = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma"}
"""Separators; the comma is last, because with the others it may be the decimal sign."""
_CONSTANT = 0.9  # least share of the lines with the same number of fields
_WIDE = 0.9  # least share of zero bytes at one place of each character in a UTF-16 or UTF-32 text
_HEAD_ROWS = 100  # rows of a spreadsheet in which the header is searched
_MOSTLY = 0.8  # least share of the cells of a row of units that look like units
_LONGEST_S = 120  # time limit of the spreadsheet process [s]
_LARGEST_UNPACKED = 400e6  # largest unpacked spreadsheet [bytes]
_SHORT = 24  # largest number of characters of a unit
_UNITS = frozenset((
    "ms", "us", "µs", "μs", "ns", "sec", "min", "hr", "day", "days", "hz", "khz", "rpm", "rps", "rev",
    "mm", "cm", "km", "kn", "kt", "kts", "knot", "knots", "nm", "nmi", "deg", "degrees", "rad", "pct",
    "percent", "mn", "knm", "nmm", "kw", "mw", "hp", "ps", "mv", "kv", "ma", "bar", "mbar", "pa",
    "kpa", "mpa", "°c", "ºc", "degc", "°f", "kg", "mt", "ton", "tons", "ltr", "m3", "m³", "m²", "kwh",
    "kvar", "p/d", "-", "1",
))  # fmt: skip
"""Units of loggers in small letters; quotients and products of them are units as well."""
_LETTERS = frozenset("shmgtdlrLNWVAKCFU%°º")
"""Units of a single letter; other letters, such as n and P, are names."""
DATE_FORMAT = re.compile(
    r"(?=.*[./:-])[dmyjhstfza\s.,:/_-]{5,}|%[a-z].*|date\s*time|datetime|utc", re.I
)
"""Date format in a row of units, such as ``dd.mm.yyyy hh:mm:ss``."""
_STAMP = re.compile(r"\s*(\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|\d{1,2}:\d{2})[\d\s:.,/TZ+-]*")
MISSING = ("-", "--", "---", "----", "-----", "-.-", "--.-", "*", "**", "***", "****", "*****", "n.a.",
           "n.v.", "no data", "No data", "No Data", "bad", "Bad", "invalid", "Invalid")  # fmt: skip
"""Texts that loggers write for a missing value, besides those that pandas knows."""
_PLACEHOLDERS = (-999.0, -9999.0, -99999.0, -999.9, -999.99)
"""Numbers that loggers write for a missing value."""
_FAR_OFF = 2.0  # multiple of the range of a column by which a placeholder lies outside
_DECIMAL = re.compile(r"^[-+]?\d*(?P<sign>[.,])\d+(?:e[-+]?\d+)?$", re.I)
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
"""Number whose sign may separate thousands as well as decimals."""
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


class TextCells(NamedTuple):
    """Cells of a column of numbers that hold text."""

    cells: int
    """Number of these cells."""
    line: int
    """Line of the first one, from 1."""
    text: str
    """Text of the first one."""
    file: str = ""
    """Name of the file of the first one; empty for a table of one file."""

    def description(self, name: str) -> str:
        """Return place and text of the first cell, and the number of further ones.

        Example:
            >>> TextCells(3, 57, "defekt").description("Power")
            "column 'Power', line 57: 'defekt' is not a number (nor are 2 further cells)"
        """
        place = f"{self.file} line {self.line}" if self.file else f"line {self.line}"
        further = f" (nor {_cells_of(self.cells - 1)})" if self.cells > 1 else ""
        return f"column {name!r}, {place}: {self.text!r} is not a number{further}"

    def remark(self, name: str) -> str:
        """Return the sentence on a column whose text is read as missing values."""
        return (
            f"{self.description(name)}; text counts as missing, correct the cell if it is a value"
        )


def _cells_of(count: int) -> str:
    return "is 1 further cell" if count == 1 else f"are {count} further cells"


@dataclass(frozen=True)
class Layout:
    """Layout of a table in a text file or spreadsheet."""

    encoding: str = "utf-8"  # of the text, as Python names it
    separator: str = ","  # of the fields
    decimal: str = "."  # decimal sign, ``.`` or ``,``
    header_row: int = 1  # line of the column names, from 1
    unit_row: int | None = None  # line of the units, if there is one
    data_row: int = 2  # line of the first values
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
        ("utf-32-be", (0, 1, 2)),
        ("utf-32-le", (1, 2, 3)),
        ("utf-16-be", (0, 2)),
        ("utf-16-le", (1, 3)),
    ):
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
    return Layout(encoding, separator, decimal, *_header_rows(rows, width, decimal))


def _header_rows(rows: list[list[str]], width: int, decimal: str) -> tuple[int, int | None, int]:
    """Return the row of the names, from 1, of the units, if there is one, and of the first values.

    They are among the rows of text directly above the values, of the same width. The row of units is the
    lowest one whose cells are units; the names are above it, in the nearest row without an empty cell.
    """
    headers: list[int] = []
    for number, cells in enumerate(rows, start=1):
        if len(cells) != width or not any(cell.strip() for cell in cells):
            headers = []
        elif 2 * sum(_is_value(cell, decimal) for cell in cells) >= width:
            break
        else:
            headers.append(number)
    else:
        first = (headers or [1])[0]
        return first, None, first + 1  # The caller reports that there are no numbers.
    if not headers:
        return number, None, number + 1
    unit = next((row for row in headers[:0:-1] if _are_units(rows[row - 1])), None)
    above = [row for row in headers if unit is None or row < unit]
    full = [row for row in above if len({*map(str.strip, rows[row - 1])} - {""}) == width]
    return (full or above)[-1], unit, number


def _is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell holds a number, a date or time, or the sign of a missing value."""
    stripped = cell.strip()
    other = "." if decimal == "," else ","  # of the other half of a file with both decimal signs
    return bool(
        _is_number(cell, decimal)
        or _is_number(cell, other)
        or _STAMP.fullmatch(stripped)
        or (stripped in MISSING and stripped != "-")
    )


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator))


def _are_units(cells: list[str]) -> bool:
    """Return whether the cells of a row are short and nearly all of them are units or date formats."""
    given = [cell.strip().strip("[]()").strip() for cell in cells if cell.strip()]
    known = sum(_is_unit(cell) for cell in given)
    return all(len(cell) <= _SHORT for cell in given) and known >= _MOSTLY * max(len(given), 1)


def _is_unit(cell: str) -> bool:
    """Return whether a cell is a unit, such as ``kN m`` or ``U/min``, or the format of a date."""
    if DATE_FORMAT.fullmatch(cell):
        return True
    parts = [re.sub(r"(\^|\*\*)?[-+]?[\d⁻¹²³]+$", "", p) for p in re.split(r"[\s/*·.⋅]+", cell)]
    known = [
        part in _LETTERS if len(part) == 1 else part.lower() in _UNITS for part in parts if part
    ]
    return cell.lower() in _UNITS or all(known)


def read_text_table(
    path: Path, given: dict[str, Any] | None = None, as_logged: bool = False
) -> pd.DataFrame:
    """Return the table of a text file; ``attrs`` has its ``layout`` and, if present, ``units`` by name.

    Columns of numbers with a text or with both decimal signs are read cell by cell; the texts stand in
    ``attrs["text_cells"]`` as :class:`TextCells` by column.

    ``given`` holds the known fields of :class:`Layout`; the others are guessed. Of a table ``as_logged``
    texts and numbers that stand for a missing value are missing, and repeated names are numbered: the
    second ``SOG`` becomes ``SOG (2)``; ``attrs["remarks"]`` says so. Else repeated names are refused.

    Raises:
        LayoutError: no table, or a repeated column name.
        ValueError: from pandas, which cannot read the file.
    """
    given = given or {}
    layout = _with_given(guess_layout(path, given.get("encoding")), given)

    style = {"sep": layout.separator, "decimal": layout.decimal, "encoding": layout.encoding}
    read = functools.partial(pd.read_csv, path, **style, skipinitialspace=True)
    above = list(range(layout.header_row - 1))
    try:
        names = _unique(read(header=None, skiprows=above, nrows=1, dtype=str).iloc[0], as_logged)
    except pd.errors.EmptyDataError:
        empty = f"line {layout.header_row} is empty, but should contain the column names"
        raise LayoutError(empty) from None
    skipped = [*above, *range(layout.header_row, layout.data_row - 1)]
    table = read(skiprows=skipped, na_values=MISSING if as_logged else None)
    units = None
    if layout.unit_row is not None:
        units = read(header=None, skiprows=layout.unit_row - 1, nrows=1, dtype=str).iloc[0]
    if len(names) == len(table.columns):  # There are fewer names if rows end with a separator.
        table.columns = pd.Index(names)
    lines = functools.partial(_lines_of_rows, path, layout)
    return _labelled(_read_cell_by_cell(table, layout, lines), layout, units, as_logged)


def _lines_of_rows(path: Path, layout: Layout) -> list[int]:
    """Return the line of each row of a text file, from 1; pandas skips empty lines."""
    with path.open(encoding=layout.encoding, errors="replace") as file:
        return [n for n, line in enumerate(file, 1) if n >= layout.data_row and line.strip()]


def _read_cell_by_cell(
    table: pd.DataFrame, layout: Layout, lines: Callable[[], Sequence[int]]
) -> pd.DataFrame:
    """Convert the numbers of columns that stay text because of single cells.

    ``attrs["text_cells"]`` gets the texts of these columns, ``attrs["remarks"]`` a sentence on columns
    with both decimal signs.

    Args:
        table: table with the names of its columns.
        layout: layout of the file.
        lines: returns the line of each row.
    """
    texts: dict[Any, TextCells] = {}
    mixed: dict[Any, int] = {}
    for name in table.columns[[not pd.api.types.is_numeric_dtype(t) for t in table.dtypes]]:
        cells = table[name].reset_index(drop=True)
        is_text = cells.map(lambda cell: isinstance(cell, str))
        if not is_text.any():
            continue
        written = cells[is_text].astype(str).str.strip()
        numbers, others = _numbers_of_text(written, layout.decimal)
        text = written[numbers.isna() & ~written.isin(["", *MISSING])]
        if 2 * len(text) > cells.notna().sum():
            continue  # a column of dates, names or states
        if others:
            mixed[name] = others
        if len(text):
            row = int(text.index[0])
            texts[name] = TextCells(len(text), lines()[row], str(text.iloc[0])[:100])
        given = cells.astype(object)
        given.loc[numbers.index] = numbers.where(numbers.notna(), written)
        table[name] = given.infer_objects().to_numpy()
    table.attrs["text_cells"] = texts
    table.attrs["remarks"] = []
    if mixed:
        name, count = next(iter(mixed.items()))
        sign = "comma" if layout.decimal == "." else "point"
        table.attrs["remarks"] = [
            f"{sum(mixed.values())} numbers have a decimal {sign}, unlike the others of their columns "
            f"(in column {name!r} {count} of {len(table)}); both signs are read as decimal signs"
        ]
    return table


def _numbers_of_text(cells: pd.Series, decimal: str) -> tuple[pd.Series, int]:
    """Return the numbers of texts, nan without one, and how many have the other decimal sign.

    The other sign is no decimal sign where it may separate thousands in each number of the column.
    """
    numbers = pd.to_numeric(cells, errors="coerce").astype(float)  # also of a column of points
    signs = cells.str.extract(_DECIMAL)["sign"]
    commas, points = cells[signs == ","], cells[signs == "."]
    others = commas if decimal == "." else points
    if others.str.fullmatch(_GROUPED).all() and (decimal == "." or len(commas)):
        others = others.iloc[:0]
        numbers[points.index[:0] if decimal == "." else points.index] = math.nan
    read = commas if decimal == "," else others
    numbers[read.index] = pd.to_numeric(read.str.replace(",", "."), errors="coerce")
    return numbers, len(others) if len(commas) and len(points) else 0


def read_sheet(
    path: Path, given: dict[str, Any] | None = None, as_logged: bool = False
) -> pd.DataFrame:
    """Return the table of a spreadsheet (xlsx, xls, xlsb or ods), as in :func:`read_text_table`.

    Macros and formulas are not executed; their last stored results are read. ``given`` may hold
    ``sheet`` (by default the one with the most numbers), ``header_row`` and ``unit_row``.

    Raises:
        LayoutError: no table, no such sheet, or a repeated column name.
        ImportError: the reader is not installed.
    """
    known = dict(given or {})
    if path.suffix.lower() != ".xls":
        _check_unpacked(path)
    names, sheet, raw = _read_in_process(path, known.get("sheet", ""))
    if raw is None:
        raise LayoutError(f"no sheet {sheet!r}; it has: {', '.join(names)}")
    if raw.empty:
        raise LayoutError(f"sheet {sheet!r} is empty")
    head = [["" if pd.isna(c) else str(c) for c in row] for row in raw.head(_HEAD_ROWS).to_numpy()]
    found = Layout("utf-8", ",", ".", *_header_rows(head, len(raw.columns), "."), sheet)
    layout = _with_given(found, {k: v for k, v in known.items() if k in ("header_row", "unit_row")})
    if layout.header_row > len(raw):
        few = f"{len(raw)} rows, but header_row is {layout.header_row}"
        raise LayoutError(f"sheet {sheet!r} has {few}")
    table = raw.iloc[layout.data_row - 1 :].replace([*MISSING], None).reset_index(drop=True)
    table.columns = pd.Index(_unique(raw.iloc[layout.header_row - 1], as_logged))
    units = None if layout.unit_row is None else raw.iloc[layout.unit_row - 1]
    lines = range(layout.data_row, layout.data_row + len(table))
    return _labelled(
        _read_cell_by_cell(table.infer_objects(), layout, lambda: lines), layout, units, as_logged
    )


def _with_given(found: Layout, given: dict[str, Any]) -> Layout:
    """Return a layout with its known fields; values begin below the given rows of names and units."""
    layout = replace(found, **given)
    if "header_row" in given and "unit_row" not in given and found.unit_row is not None:
        layout = replace(
            layout, unit_row=found.unit_row if found.unit_row > layout.header_row else None
        )
    below = max(layout.header_row, layout.unit_row or 0) + 1
    return replace(layout, data_row=max(below, found.data_row))


def _read_in_process(path: Path, sheet: str) -> tuple[list[str], str, pd.DataFrame | None]:
    """Return the names of a spreadsheet's sheets, and name and table of one sheet, None if absent."""
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
        names, chosen, table = pickle.loads(done.stdout)
        return names, chosen, table
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


def _unique(row: pd.Series, as_logged: bool) -> list[str]:
    """Return the column names of a row; missing ones are named as in pandas, repeated ones numbered."""
    names = [f"Unnamed: {i}" if pd.isna(name) else str(name).strip() for i, name in enumerate(row)]
    if (twice := sorted({name for name in names if names.count(name) > 1})) and not as_logged:
        raise LayoutError(f"column {twice[0]!r} occurs twice; give each column a name of its own")
    numbers = [names[: i + 1].count(name) for i, name in enumerate(names)]
    numeric = [name for name in names if _is_number(name, ".")]
    if 2 * len(numeric) >= max(len(names), 1):
        raise LayoutError(
            f"numbers ({', '.join(numeric[:3])}) where column names are expected; add a line of names "
            "above the values, or set header_row, the line of the names, under [file] in a column map"
        )
    return [
        name if number == 1 else f"{name} ({number})"
        for name, number in zip(names, numbers, strict=True)
    ]


def _blank_placeholders(table: pd.DataFrame) -> Iterator[str]:
    """Make numbers that stand for a missing value, such as -999, missing; yield a remark on each column.

    The other values of the column are positive, or far from this number.
    """
    for name in table.select_dtypes("number"):
        values = table[name]
        hit = values.isin(_PLACEHOLDERS)
        rest = values[~hit].dropna()
        if not hit.any() or rest.empty:
            continue
        low, high = float(rest.min()), float(rest.max())
        if low >= 0.0 or low - float(values[hit].max()) > _FAR_OFF * (high - low):
            table[name] = values.mask(hit)
            yield f"{name!r}: {hit.sum()} values are {values[hit].iloc[0]:g} and count as missing"


def _labelled(
    table: pd.DataFrame, layout: Layout, units: pd.Series | None, as_logged: bool
) -> pd.DataFrame:
    table.attrs["layout"] = layout
    repeated = [name for name in table if re.fullmatch(r".+ \(\d+\)", str(name))]
    table.attrs["remarks"] = [
        *table.attrs["remarks"],
        *(
            f"column {name.rpartition(' (')[0]!r} occurs again; this one is called {name!r}"
            for name in repeated
            if name.rpartition(" (")[0] in table
        ),
        *(_blank_placeholders(table) if as_logged else ()),
    ]
    if units is not None:
        table.attrs["units"] = {
            name: unit.strip().strip("[]()").strip()
            for name, unit in zip(table.columns, units, strict=False)
            if isinstance(unit, str)
        }
    return table
