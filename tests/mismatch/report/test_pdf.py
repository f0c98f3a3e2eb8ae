"""The report on A4 pages: everything on the pages, nothing outside, equal files from equal content."""

from __future__ import annotations

import functools
import re
from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from shaftline.mismatch import Diagnosis
from shaftline.mismatch.report import pdf
from shaftline.mismatch.report.figures import HEIGHT, panel, text_width
from shaftline.mismatch.report.first_page import first_page
from shaftline.mismatch.report.pdf import (
    COLUMN,
    FOOT,
    MARGIN,
    PAGE_HEIGHT,
    PAGE_WIDTH,
    Document,
    column_widths,
    report_pdf,
    resize,
    wrap,
)

from ..diagnoses import diagnosis_of
from .test_service import fouled

LONG = "hull.resistance_coefficient_N_s2_m2"


def made(diagnosis: Diagnosis) -> tuple[bytes, Document]:
    """Return the file of a report and its document."""
    documents: list[Document] = []

    class Kept(Document):
        def __init__(self, title: str) -> None:
            super().__init__(title)
            documents.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pdf, "Document", Kept)
        content = report_pdf(diagnosis)
    (document,) = documents
    return content, document


@functools.cache
def long_report(verdict: str) -> tuple[bytes, Document]:
    """Return the report of a diagnosis with long texts."""
    long = [f"{LONG} {'and a long remark that needs several lines ' * 8}"] * 12
    return made(diagnosis_of(verdict, warnings=long))


def words_of(page: Any) -> str:
    return " ".join(text.get_text() for text in page.texts).replace("\xa0", " ")


def boxes(page: Any) -> list[tuple[str, float, float, float, float]]:
    """Each text of a page with its left, top, right and bottom edge [inch]."""
    page.set_dpi(600.0)  # without the rounding of letters to pixels
    renderer = FigureCanvasAgg(page).get_renderer()  # type: ignore[no-untyped-call]
    found = []
    for text in page.texts:
        box = text.get_window_extent(renderer).transformed(page.dpi_scale_trans.inverted())
        found.append((text.get_text(), box.x0, PAGE_HEIGHT - box.y1, box.x1, PAGE_HEIGHT - box.y0))
    return found


def test_the_first_page_and_the_technical_part() -> None:
    diagnosis = fouled()
    content, document = made(diagnosis)
    assert content.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type /Page\b", content)) == len(document.pages)
    first, second, *_ = map(words_of, document.pages)
    page = first_page(diagnosis)
    for words in (page.headline, page.tiles[1].value, "What to do next", "Engine power"):
        assert words in first, words
    assert "Technical part" not in first
    assert "Technical part" in second
    for words in (diagnosis.headline, "Fit on the held-out data", "1. Hull fouling (hull)"):
        assert words in second, words
    for number, text in enumerate(map(words_of, document.pages), 1):
        assert f"page {number} of {len(document.pages)}" in text
    panels = sum(isinstance(a, pdf._Placed) for p in document.pages for a in p.artists)
    assert panels == 1 + 6 + 2 + 3 + 2 + 1 + 1  # with the equation


@pytest.mark.parametrize("verdict", ["explained", "unexplained", "nothing-missing"])
def test_every_text_is_inside_its_page(verdict: str) -> None:
    for page in long_report(verdict)[1].pages:
        for words, left, top, right, bottom in boxes(page):
            assert left >= MARGIN - 0.02, words
            assert right <= PAGE_WIDTH - MARGIN + 0.05, words
            assert top >= MARGIN - 0.1, words
            assert bottom <= PAGE_HEIGHT - 0.3, words
            if bottom > PAGE_HEIGHT - FOOT + 0.05:
                assert words.startswith(("page ", "frigate: ")), words


def test_equal_diagnoses_give_equal_files() -> None:
    content, _ = long_report("nothing-missing")
    long_report.cache_clear()
    assert long_report("nothing-missing")[0] == content


def test_text_is_wrapped_at_spaces_and_long_names_at_underscores() -> None:
    width = text_width("one two", 9.0) + 0.01
    assert wrap("one two three", width, 9.0) == ["one two", "three"]
    lines = wrap(LONG, 1.0, 9.0)
    assert "".join(lines) == LONG
    assert all(text_width(line, 9.0) <= 1.0 for line in lines)
    assert all(line[-1] in "._" for line in lines[:-1])
    assert wrap("at 15.9 kn", text_width("at 15.9", 9.0) + 0.02, 9.0) == ["at", "15.9\xa0kn"]


def test_columns_fill_the_page_and_long_cells_give_way() -> None:
    plain = column_widths(["a", "b"], [["x", "y"]], 8.0)
    assert sum(plain) == pytest.approx(COLUMN)
    heads, rows = ["Effect", "Excitation"], [["offset", "a long text " * 20], [LONG, "short"]]
    narrow = column_widths(heads, rows, 8.0)
    assert sum(narrow) == pytest.approx(COLUMN)
    assert narrow[0] >= text_width("resistance_", 8.0)
    assert narrow[1] > narrow[0]


def test_a_table_repeats_its_heads_on_each_page() -> None:
    document = Document("t")
    document.table(["Effect", "Size"], [[f"row {k}", "1"] for k in range(120)], right=(1,))
    assert len(document.pages) > 1
    texts = [[text.get_text() for text in page.texts] for page in document.pages]
    assert all(text[:2] == ["Effect", "Size"] for text in texts)
    assert [t for text in texts for t in text if t.startswith("row")] == [
        f"row {k}" for k in range(120)
    ]


def test_a_panel_keeps_its_margins_at_another_width() -> None:
    figure, axes = panel("a title that is longer than a narrow panel is wide", "x", "y", left=0.9)
    assert resize(figure, 3.0) == HEIGHT
    box = axes.get_position()
    assert box.x0 * 3.0 == pytest.approx(0.9)
    assert (1.0 - box.x1) * 3.0 == pytest.approx(0.2)
    title = axes.title if axes.title.get_text() else axes._left_title  # type: ignore[attr-defined]
    assert text_width(title.get_text(), title.get_fontsize(), True) <= 3.0 - 0.9 + 1e-6
    assert title.get_fontweight() == "bold"


def test_a_panel_is_drawn_where_it_is_placed() -> None:
    document = Document("t")
    figure, axes = panel("", "x", "y")
    resize(figure, 3.0)
    document.place(figure, 4.0, 2.0, 3.0, HEIGHT)
    box = axes.get_window_extent().transformed(document.pages[0].dpi_scale_trans.inverted())
    assert box.x0 == pytest.approx(4.0 + 0.7)
    assert box.x1 == pytest.approx(4.0 + 3.0 - 0.2)
    assert PAGE_HEIGHT - box.y1 == pytest.approx(2.0 + 0.3)
