"""Spreadsheets that are damaged, or made to take all memory: refused with a reason."""

from __future__ import annotations

import contextlib
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from shaftline.core.tables import LayoutError, read_sheet

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("python_calamine")

SHEET, BOOK = "xl/worksheets/sheet1.xml", "xl/workbook.xml"
CELL = b'<row r="1048576"><c r="XFD1048576" t="n"><v>1</v></c></row></sheetData>'
ENTITIES = b'<!DOCTYPE w [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]><worksheet'


def _book(folder: Path) -> Path:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["time_s", "shaft_speed_rad_s"])
    for row in range(20):
        sheet.append([0.1 * row, 10.0])
    path = folder / "book.xlsx"
    book.save(path)
    return path


def _changed(path: Path, member: str, change: Callable[[bytes], bytes | None]) -> Path:
    after = path.with_name("changed.xlsx")
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(after, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = change(old.read(name)) if name == member else old.read(name)
            if content is not None:
                new.writestr(name, content)
    return after


def test_a_sound_one_is_read(tmp_path: Path) -> None:
    table = read_sheet(_book(tmp_path))
    assert list(table.columns) == ["time_s", "shaft_speed_rad_s"]
    assert len(table) == 20
    with pytest.raises(LayoutError, match="no sheet 'other'; it has: Sheet"):
        read_sheet(_book(tmp_path), {"sheet": "other"})


@pytest.mark.parametrize(
    ("member", "change", "reason"),
    [
        (
            SHEET,
            lambda x: x.replace(b"</sheetData>", CELL),
            "more than 2 GB of memory: perhaps a stray",
        ),
        (SHEET, lambda x: x.replace(b"<worksheet", ENTITIES, 1), "declares a document type"),
        (SHEET, lambda x: x[: len(x) // 2], "damaged"),
        (SHEET, lambda x: None, "damaged"),
        (SHEET, lambda x: b"\x00\xff" * 500, "damaged"),
        (SHEET, lambda x: re.sub(b'r="A1"', b'r="1A"', x), "damaged"),
        (BOOK, lambda x: None, "damaged"),
        (SHEET, lambda x: b" " * 500_000_000, "unpacks to 500 MB"),
    ],
    ids=["stray-cell", "entities", "cut", "gone", "junk", "address", "no-book", "bomb"],
)
def test_one_that_is_not_is_refused_for_its_reason(
    member: str, change: Callable[[bytes], bytes | None], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(LayoutError, match=reason):
        read_sheet(_changed(_book(tmp_path), member, change))


def test_flipped_bits_give_a_table_or_a_refusal(tmp_path: Path) -> None:
    good = _book(tmp_path).read_bytes()
    for seed in range(6):
        random = np.random.default_rng(seed)
        bad = np.frombuffer(good, np.uint8).copy()
        places = random.integers(len(bad), size=8)
        bad[places] ^= np.uint8(1) << random.integers(8, size=8).astype(np.uint8)
        path = tmp_path / "flipped.xlsx"
        path.write_bytes(bad.tobytes())
        with contextlib.suppress(LayoutError):
            assert len(read_sheet(path).columns) == 2
