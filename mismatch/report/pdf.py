"""``report.pdf``: the report of a diagnosis on A4 pages.

The pages are drawn by matplotlib, which draws the figures anyway. A converter from HTML would need a
browser or system libraries that ``pip`` does not install. A page is a matplotlib figure; panels keep
their curves and letters as vectors.
"""

from __future__ import annotations

import io
import itertools
import logging
import re
from collections.abc import Iterator, Sequence
from html import unescape
from importlib.metadata import version
from typing import Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from matplotlib.transforms import Bbox

from ..outcome import Outcome
from .figures import (
    AFTER,
    BEFORE,
    HEIGHT,
    MEASURED,
    TITLE_OF_PANEL,
    equation_figure,
    is_corrected,
    text_width,
)
from .first_page import FirstPage, Tile
from .html import report_fields, report_panels
from .index import SHIP
from .wording import unbroken

PAGE_WIDTH, PAGE_HEIGHT = 8.27, 11.69  # A4 [inch]
MARGIN, FOOT = 0.75, 0.7  # left, right and top margin, and height of the footer [inch]
COLUMN = PAGE_WIDTH - 2.0 * MARGIN  # width of the text [inch]
GAP = 0.3  # between two columns [inch]
BODY, SMALL, HEADING, TITLE = 9.5, 8.0, 12.5, 17.0  # sizes of letters [pt]
LEADING = 1.38  # distance of lines, in sizes of letters
SOFT, LINE, PALE = "#55617a", "#d9dee7", "#f5f7fa"
_POINT = 1.0 / 72.0  # [inch]


def report_pdf(diagnosis: Outcome) -> bytes:
    """Return the report of a diagnosis as a PDF file: the first page, then the technical part."""
    fields = report_fields(diagnosis)
    first: FirstPage = fields["first"]
    panels = report_panels(diagnosis, first)
    document = Document(f"{diagnosis.ship.name}: {first.headline}")
    _write_first_page(document, first, fields, panels["speed-power"])
    _write_technical_part(document, diagnosis, fields, panels)
    return document.to_bytes()


def wrap(words: str, width: float, size: float, bold: bool = False) -> list[str]:
    """Return a text as lines of at most a width [inch]; long names break after a dot or underscore.

    >>> wrap("one two three", text_width("one two", 9.0) + 0.01, 9.0)
    ['one two', 'three']
    """
    lines = [""]
    for word in unbroken(words).split(" "):
        space = " " if lines[-1] else ""
        if text_width(lines[-1] + space + word, size, bold) <= width:
            lines[-1] += space + word
            continue
        if lines[-1]:
            lines.append("")
        for piece in _pieces(word):
            if lines[-1] and text_width(lines[-1] + piece, size, bold) > width:
                lines.append("")
            lines[-1] += piece
    return lines


def _pieces(word: str) -> list[str]:
    return re.split(r"(?<=[._/])(?=[A-Za-z])", word)


class _Placed(Artist):
    """A figure drawn as a part of a page."""

    def __init__(self, inner: Figure) -> None:
        super().__init__()
        self._inner = inner

    def draw(self, renderer: Any) -> None:
        self._inner.draw(renderer)


class Document:
    """Pages that are filled from the top with text, tables and panels.

    Args:
        title: title in the file's properties.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.pages: list[Figure] = []
        self.y = 0.0
        self.new_page()

    def new_page(self) -> None:
        """Begin a page."""
        self.pages.append(Figure(figsize=(PAGE_WIDTH, PAGE_HEIGHT), dpi=72))
        self.y = MARGIN

    def need(self, height: float) -> None:
        """Begin a page unless a height [inch] is left on this one."""
        if self.y + height > PAGE_HEIGHT - FOOT and self.y > MARGIN:
            self.new_page()

    def skip(self, height: float) -> None:
        """Leave a height [inch] free."""
        self.y += height

    def line_of_text(self, x: float, words: str, size: float, **style: Any) -> None:
        """Write words at a distance from the left edge [inch] and at the height reached."""
        y = self.y + size * _POINT
        self.pages[-1].text(
            x / PAGE_WIDTH,
            1.0 - y / PAGE_HEIGHT,
            words,
            fontsize=size,
            parse_math=False,
            **{"color": MEASURED, "va": "baseline", **style},
        )

    def rule(self, colour: str = LINE, width: float = 0.7) -> None:
        """Draw a line across the text at the height reached."""
        self._box(MARGIN, self.y, COLUMN, width * _POINT, colour, 0.0)

    def _box(
        self, x: float, y: float, width: float, height: float, colour: str, rounded: float
    ) -> None:
        page = self.pages[-1]
        box = FancyBboxPatch(
            (72.0 * x, 72.0 * (PAGE_HEIGHT - y - height)),
            72.0 * width,
            72.0 * height,
            boxstyle=f"round,pad=0,rounding_size={72.0 * rounded}" if rounded else "square,pad=0",
            facecolor=colour,
            edgecolor="none",
            transform=None,
        )
        page.add_artist(box)

    def paragraph(
        self,
        words: str,
        size: float = BODY,
        *,
        x: float = MARGIN,
        width: float = COLUMN,
        bullet: bool = False,
        after: float = 0.07,
        **style: Any,
    ) -> None:
        """Write a paragraph; a bullet indents it."""
        indent = 0.16 if bullet else 0.0
        bold = style.get("fontweight") == "bold"
        for number, line in enumerate(wrap(words, width - indent, size, bold)):
            height = LEADING * size * _POINT
            self.need(height)
            if bullet and number == 0:
                self.line_of_text(x + 0.02, "•", size, **style)
            self.line_of_text(x + indent, line, size, **style)
            self.y += height
        self.y += after

    def heading(self, words: str, size: float = HEADING, least: float = 1.2) -> None:
        """Write a heading with a line above, on a new page if less than ``least`` [inch] remain."""
        self.need(least)
        if self.y > MARGIN:
            self.y += 0.14
        self.rule()
        self.y += 0.09
        self.paragraph(words, size, fontweight="bold", after=0.06)

    def table(
        self,
        heads: Sequence[str],
        rows: Sequence[Sequence[str]],
        right: Sequence[int] = (),
        size: float = SMALL,
    ) -> None:
        """Write a table; long cells are wrapped, and the heads are repeated on each page.

        Args:
            heads: heads of the columns.
            rows: cells.
            right: indices of the columns that are aligned to the right.
            size: of the letters [pt].
        """
        widths = column_widths(heads, rows, size)
        self._row(heads, widths, right, size, True)
        for row in rows:
            if self._row(row, widths, right, size, False, only_if_it_fits=True):
                continue
            self.new_page()
            self._row(heads, widths, right, size, True)
            self._row(row, widths, right, size, False)
        self.y += 0.1

    def _row(
        self,
        cells: Sequence[str],
        widths: Sequence[float],
        right: Sequence[int],
        size: float,
        bold: bool,
        only_if_it_fits: bool = False,
    ) -> bool:
        lines = [
            wrap(cell, width - CELL_GAP, size, bold)
            for cell, width in zip(cells, widths, strict=True)
        ]
        leading = LEADING * size * _POINT
        height = leading * max(map(len, lines)) + 0.07
        if self.y + height > PAGE_HEIGHT - FOOT:
            if only_if_it_fits:
                return False
            self.need(height)
        top, x = self.y + 0.02, MARGIN
        for k, (cell, width) in enumerate(zip(lines, widths, strict=True)):
            for place, line in enumerate(cell):
                self.y = top + place * leading
                at, side = (x + width - CELL_GAP, "right") if k in right else (x, "left")
                self.line_of_text(at, line, size, ha=side, fontweight="bold" if bold else "normal")
            x += width
        self.y = top + height - 0.02
        self.rule(MEASURED if bold else LINE, 0.9 if bold else 0.5)
        return True

    def panels(self, panels: Sequence[Figure], columns: int = 2) -> None:
        """Place panels in rows, each at the width of its column."""
        width = (COLUMN - (columns - 1) * GAP) / columns
        for begin in range(0, len(panels), columns):
            row = panels[begin : begin + columns]
            heights = [resize(figure, width) for figure in row]
            self.need(max(heights))
            for k, (figure, height) in enumerate(zip(row, heights, strict=True)):
                self.place(figure, MARGIN + k * (width + GAP), self.y, width, height)
            self.y += max(heights) + 0.08

    def place(self, figure: Figure, x: float, y: float, width: float, height: float) -> None:
        """Draw a figure of a size at a distance from the left and the top edge [inch]."""
        figure.set_dpi(72.0)
        figure.patch.set_visible(False)
        bottom = PAGE_HEIGHT - y - height
        figure.bbox_inches.set(Bbox.from_bounds(x, bottom, width, height))
        self.pages[-1].add_artist(_Placed(figure))

    def to_bytes(self) -> bytes:
        """Return the file, with page numbers; equal content gives an equal file."""
        buffer = io.BytesIO()
        properties = {
            "Title": self.title,
            "Creator": f"shaftline {version('shaftline')}",
            "CreationDate": None,
        }
        # TrueType letters can be searched and copied.
        # fontTools warns of the date of matplotlib's own font.
        logging.getLogger("fontTools.ttLib.tables._h_e_a_d").setLevel(logging.ERROR)
        with (
            matplotlib.rc_context({"pdf.fonttype": 42}),
            PdfPages(buffer, metadata=properties) as file,
        ):
            for count, page in enumerate(self.pages, 1):
                self._foot(page, f"page {count} of {len(self.pages)}")
                file.savefig(page)
        return buffer.getvalue()

    def _foot(self, page: Figure, count: str) -> None:
        y = 0.42 / PAGE_HEIGHT
        style: dict[str, Any] = {"fontsize": SMALL, "color": SOFT, "parse_math": False}
        room = COLUMN - text_width(count, SMALL) - GAP
        page.text(MARGIN / PAGE_WIDTH, y, wrap(self.title, room, SMALL)[0], **style)
        page.text(1.0 - MARGIN / PAGE_WIDTH, y, count, ha="right", **style)


CELL_GAP = 0.12
"""Distance between the columns of a table [inch]."""


def column_widths(heads: Sequence[str], rows: Sequence[Sequence[str]], size: float) -> list[float]:
    """Return the widths [inch] of the columns of a table that is as wide as the text.

    Columns with long cells are narrowed first, down to their longest word.
    """
    columns = list(zip(heads, *rows, strict=True))

    def widest(cells: Iterator[str], bold: bool) -> float:
        return max((text_width(cell, size, bold) for cell in cells), default=0.0)

    whole, least = [], []
    for head, *cells in columns:
        words = itertools.chain.from_iterable(
            _pieces(w) for cell in cells for w in unbroken(cell).split(" ")
        )
        whole.append(max(text_width(head, size, True), widest(iter(cells), False)) + CELL_GAP)
        least.append(max(widest(iter(head.split()), True), widest(words, False)) + CELL_GAP)
    spare = COLUMN - sum(whole)
    if spare >= 0.0:
        return [width + spare / len(whole) for width in whole]
    slack = sum(whole) - sum(least)
    share = min(1.0, max(0.0, (COLUMN - sum(least)) / slack)) if slack > 0.0 else 0.0
    widths = [low + share * (high - low) for low, high in zip(least, whole, strict=True)]
    return [width * min(1.0, COLUMN / sum(widths)) for width in widths]


def resize(figure: Figure, width: float) -> float:
    """Give a panel another width [inch], with letters and margins unchanged; return its height."""
    (old_width, height), (axes,) = figure.get_size_inches(), figure.axes
    box = axes.get_position()
    left, right = box.x0 * old_width, (1.0 - box.x1) * old_width
    figure.set_size_inches(width, height)
    axes.set_position((left / width, box.y0, (width - left - right) / width, box.height))
    title = axes.get_title("left")
    if (wide := text_width(title, TITLE_OF_PANEL, True)) > width - left:
        axes.set_title(
            title,
            loc="left",
            fontsize=TITLE_OF_PANEL * (width - left) / wide,
            fontweight="bold",
            color=MEASURED,
            pad=5,
        )
    return float(height)


def _write_first_page(
    document: Document, first: FirstPage, fields: dict[str, Any], panels: list[Figure]
) -> None:
    """Write the page for a superintendent."""
    name, verdict = fields["d"].ship.name, fields["verdict"]
    document.paragraph(
        f"{name} · {verdict}", SMALL + 1.0, color=SOFT, fontweight="bold", after=0.03
    )
    document.paragraph(first.headline, TITLE, fontweight="bold", after=0.12)
    if first.tiles:
        _write_tiles(document, first.tiles)
    else:
        document.paragraph(first.lead, BODY + 1.5, after=0.12)
    top, width = document.y, (COLUMN - GAP) * (0.5 if panels else 1.0) + (0 if panels else GAP)
    sections = [("Where", [first.place + "."]), ("What to do next", first.next_steps)]
    if first.doubts:
        sections.append(("How sure this is", first.doubts))
    for head, texts in sections:
        document.paragraph(head, BODY + 1.0, width=width, fontweight="bold", after=0.02)
        for words in texts:
            document.paragraph(words, width=width, bullet=len(texts) > 1, after=0.04)
        document.skip(0.08)
    document.paragraph(
        "A diagnosis is evidence, not an instruction: check before work begins.",
        SMALL,
        width=width,
        color=SOFT,
    )
    if panels:
        height = resize(panels[0], width)
        document.place(panels[0], MARGIN + width + GAP, top, width, height)
        document.y = max(document.y, top + height)
    if first.rows:
        document.skip(0.1)
        heads = ["At service speed" if first.service.speed_m_s else "At the median command"]
        heads += ["Ship file", "As diagnosed", "Change"]
        rows = [
            [
                f"{r.name} [{r.unit}]",
                r.before,
                r.after,
                f"{r.change} ({r.interval})" if r.interval else r.change,
            ]
            for r in first.rows
        ]
        if not first.service.changes:
            heads, rows = heads[:2], [row[:2] for row in rows]
        document.table(heads, rows, right=range(1, len(heads)), size=SMALL + 0.5)
        document.paragraph(first.method, SMALL, color=SOFT)


def _write_tiles(document: Document, tiles: list[Tile]) -> None:
    """Draw the large numbers side by side."""
    gap = 0.15
    width = (COLUMN - (len(tiles) - 1) * gap) / len(tiles)
    inside = width - 0.24
    texts = [
        [line for t in (tile.interval, tile.detail) if t for line in wrap(t, inside, SMALL)]
        for tile in tiles
    ]
    height = 0.72 + LEADING * SMALL * _POINT * max(map(len, texts))
    top = document.y
    for k, (tile, lines) in enumerate(zip(tiles, texts, strict=True)):
        x = MARGIN + k * (width + gap)
        document._box(x, top, width, height, PALE, 0.06)
        document.y = top + 0.09
        document.line_of_text(x + 0.12, tile.label, BODY, fontweight="bold")
        document.y += 0.2
        document.line_of_text(x + 0.12, tile.value, TITLE, fontweight="bold")
        document.y += 0.36
        for line in lines:
            document.line_of_text(x + 0.12, line, SMALL, color=SOFT)
            document.y += LEADING * SMALL * _POINT
    document.y = top + height + 0.16


def _plain(cell: Any) -> str:
    """Return a cell of the page without marks for a browser."""
    return unescape(re.sub(r"<[^>]*>", "", str(cell)))


def _write_technical_part(
    document: Document, diagnosis: Outcome, fields: dict[str, Any], panels: dict[str, list[Figure]]
) -> None:
    """Write the sections of the page behind the first one."""
    document.new_page()
    document.paragraph("Technical part", TITLE, fontweight="bold", after=0.1)
    document.paragraph(fields["headline"], BODY + 1.0, fontweight="bold")
    document.paragraph(fields["sentence"])
    for name, words in fields["facts"]:
        document.paragraph(f"{name}: {words}", bullet=True, after=0.02)
    _write_fits(document, fields)
    warnings = [f"The recording is limited: {text}." for text in diagnosis.limits]
    if warnings := warnings + fields["remarks"] + diagnosis.warnings:
        document.heading("Warnings")
        for words in warnings:
            document.paragraph(words, bullet=True, after=0.03)
    if fields["balances"]:
        document.heading("Verdict by balance")
        rows = [
            [b[key] for key in ("name", "verdict", "share", "residual")] for b in fields["balances"]
        ]
        document.table(["Balance", "Verdict", "Explained", "Residual"], rows, right=(2,))
    for finding, card in zip(diagnosis.findings, fields["findings"], strict=True):
        _write_finding(document, finding.effect, card)
    _write_residual(document, fields, panels["shape"])
    _write_parameters(document, fields)
    _write_panels(document, diagnosis, fields, panels)
    _write_detectable(document, fields)
    document.heading("Corrected ship")
    if not fields["keys"]:
        document.paragraph(f"No key was changed: {SHIP} is the nominal ship.")
        return
    document.paragraph(f"These keys of the ship file differ in {SHIP}.")
    rows = [list(map(_plain, row)) for row in fields["keys"]]
    document.table(["Key", "Nominal", "Corrected"], rows)


def _write_fits(document: Document, fields: dict[str, Any]) -> None:
    document.heading("Fit on the held-out data")
    rows = [
        [
            fit["name"],
            fit["none"] or f"{fit['before']} %",
            "" if fit["none"] else f"{fit['after']} %",
        ]
        for fit in fields["fits"]
    ]
    document.table(["FitPercent", "Nominal ship", "Corrected ship"], rows, right=(1, 2))
    document.paragraph(
        "FitPercent = 100 (1 − ‖measured − simulated‖ / ‖measured − mean‖), open loop: 100 is perfect, "
        "0 is no better than the mean.",
        SMALL,
        color=SOFT,
    )


def _write_finding(document: Document, effect: Any, card: dict[str, Any]) -> None:
    form = f", form: {effect.form.replace('-', ' ')}" if effect.form else ""
    document.heading(f"{card['index']}. {card['name']} ({effect.balance}{form})", least=2.2)
    figure = equation_figure(effect.latex)
    if figure is None:
        document.paragraph(effect.equation)
    else:
        width, height = map(float, figure.get_size_inches())
        document.place(figure, MARGIN, document.y, width, height)
        document.skip(height + 0.08)
    subject = "instrument" if effect.balance == "sensor" else f"{effect.balance} balance"
    document.paragraph(f"The {subject} {card['lacks']}.")
    rows = [
        [p["name"], _plain(p["key"]), p["value"], p["interval"], p["unit"]]
        for p in card["parameters"]
    ]
    document.table(["Parameter", "Key", "Value", "95 % interval", "Unit"], rows, right=(2, 3))
    regime = f"; mostly with {card['regime']}" if card["regime"] else ""
    rivals = "; ".join(card["rivals"])
    texts = [
        f"Time and regime: {card['when']}{regime}.",
        f"Evidence: 2 Δ log L = {card['score']}, threshold {card['threshold']}; {card['p_value']}.",
        f"This recording cannot distinguish it from {rivals}."
        if rivals
        else "No other effect fits this recording as well.",
        card["biased"],
        f"Easily confused: {', '.join(card['mistaken_for'])}." if card["mistaken_for"] else "",
        f"Data that distinguish them: {effect.split_by}." if effect.split_by else "",
    ]
    for words in filter(None, texts):
        document.paragraph(words, bullet=True, after=0.03)


def _write_residual(document: Document, fields: dict[str, Any], panels: list[Figure]) -> None:
    """Write the shape and the formula of a residual."""
    if shape := fields["shape"]:
        undecided = fields["status"] == "undecided"
        document.heading(f"Residual of {'undecided' if undecided else 'unknown'} cause", least=3.5)
        document.paragraph(
            f"The curve over {shape['signal']} describes the residual best; it does not explain it. "
            f"Evidence: 2 Δ log L = {shape['gain']}, threshold {shape['threshold']}."
        )
        document.panels(panels)
    if formula := fields["formula"]:
        document.heading("Formula")
        better = f" In these recordings {formula['better']}." if formula["better"] else ""
        document.paragraph(formula["sentence"] + better)
        rows = [[c["name"], c["value"], c["interval"], c["unit"]] for c in formula["coefficients"]]
        document.table(["Coefficient", "Value", "95 % interval", "Unit"], rows, right=(1, 2))
        document.paragraph(f"Term for the ship file: {formula['term']}")


def _write_parameters(document: Document, fields: dict[str, Any]) -> None:
    if not fields["parameters"]:
        return
    document.heading("Parameters of the ship")
    heads = {
        "key": "Key",
        "file": "Ship file",
        "value": "Estimate",
        "error": "Standard error",
        "unit": "Unit",
        "change": "Change in tolerances",
        "source": "Source",
        "corrected": "Corrected",
    }
    rows = [[_plain(p[key]) for key in heads] for p in fields["parameters"]]
    document.table(list(heads.values()), rows, right=(1, 2, 3, 5, 7))


def _write_panels(
    document: Document, diagnosis: Outcome, fields: dict[str, Any], panels: dict[str, list[Figure]]
) -> None:
    located = " and ".join(fields["located"])
    titles = {
        "traces": (
            "Measured and simulated",
            "Simulated open loop. Shaded: held-out data, never fitted.",
        ),
        "residuals": (
            "Residual of each balance over time",
            "Yellow: times at which the effect acts. Positive: the simulation has too little.",
        ),
        "regimes": (
            f"Residual of {located} over the operating regime",
            "Means with 95 % intervals.",
        ),
        "spectra": ("Spectrum of the residual of each balance", ""),
        "ranking": (
            f"Evidence for the best {fields['shown']} of {len(diagnosis.ranking)} effects",
            "Each added alone to the nominal ship; the red mark is the threshold.",
        ),
    }
    for key, (title, note) in titles.items():
        if not panels[key]:
            continue
        document.heading(title, least=HEIGHT + 0.9)
        if key != "ranking":
            _write_legend(document, is_corrected(diagnosis), measured=key == "traces")
        if note:
            document.paragraph(note, SMALL, color=SOFT)
        document.panels(panels[key], 1 if key == "ranking" else 2)


def _write_legend(document: Document, corrected: bool, measured: bool) -> None:
    """Write the colours of the lines."""
    entries = [("nominal ship (dashed)" if corrected else "nominal ship", BEFORE)]
    entries += [("corrected ship", AFTER)] if corrected else []
    entries = [("measured (thin)", MEASURED), *entries] if measured else entries
    x = MARGIN
    for words, colour in entries:
        document._box(x, document.y + 0.07, 0.22, 0.03, colour, 0.0)
        document.line_of_text(x + 0.28, words, SMALL, color=SOFT)
        x += 0.55 + text_width(words, SMALL)
    document.skip(0.2)


def _write_detectable(document: Document, fields: dict[str, Any]) -> None:
    document.heading("Smallest detectable effects")
    document.paragraph("A smaller effect may be present; this recording could not show it.")
    if fields["detectable"]:
        rows = [
            [row[key] for key in ("effect", "balance", "parameter", "size", "needs")]
            for row in fields["detectable"]
        ]
        heads = ["Effect", "Balance", "Parameter", "Smallest size", "Excitation needed"]
        document.table(heads, rows, right=(3,), size=7.5)
