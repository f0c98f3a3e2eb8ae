"""Small drawings for the report: SVG that stands inside the page, and what they have in common.

A report is read on wide and on narrow screens, so a figure is a row of small panels that the page wraps,
each drawn at the size at which it is read.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from html import escape
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER, QUIET, HELD_OUT, WINDOW = (
    "#1f2a44", "#d1495b", "#00798c", "#8d99ae", "#e9ecf1", "#f6e3b4",
)  # fmt: skip
"""Colours of recording, nominal ship, corrected ship, what is in the background, and two shadings."""

BEFORE_LINE: dict[str, Any] = {"color": BEFORE, "linewidth": 1.25, "linestyle": (0, (3.5, 1.6))}
AFTER_LINE: dict[str, Any] = {"color": AFTER, "linewidth": 1.5}
"""Lines of the nominal and of the corrected ship; the dashed is drawn last, so both are seen."""

WIDTH, HEIGHT = 5.4, 2.35
"""Of a panel [inch]; the page shows it about 550 pixels wide."""

_SMALL, _NORMAL = 8.0, 8.8
_POINTS = 420

_UNKNOWN_TO_MATHTEXT = {
    r"\le ": r"\leq ",
    r"\ge ": r"\geq ",
    r"\bigl(": "(",
    r"\bigr)": ")",
    r"\bigl|": "|",
    r"\bigr|": "|",
}


def panel(
    title: str, x: str, y: str, height: float = HEIGHT, left: float = 0.7
) -> tuple[Figure, Axes]:
    """An empty panel.

    Args:
        title: above it.
        x: label of the horizontal axis.
        y: label of the vertical axis.
        height: [inch].
        left: margin for the labels of the vertical axis [inch].
    """
    figure = Figure(figsize=(WIDTH, height))
    above, below = 0.3, 0.46
    axes = figure.add_axes(
        (
            left / WIDTH,
            below / height,
            (WIDTH - left - 0.2) / WIDTH,
            (height - above - below) / height,
        )
    )
    axes.set_title(title, fontsize=_NORMAL, loc="left", color=MEASURED, fontweight="bold", pad=5)
    axes.set_xlabel(x, fontsize=_NORMAL, labelpad=2)
    axes.set_ylabel(y, fontsize=_NORMAL, labelpad=3)
    axes.tick_params(labelsize=_SMALL, length=3)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)
    return figure, axes


def svg(figure: Figure, label: str, prefix: str) -> str:
    """A figure as an SVG element.

    Args:
        figure: to draw.
        label: read out where the drawing is not seen.
        prefix: of its ids, which must differ from every other drawing's on the page.
    """
    buffer = io.StringIO()
    nothing: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    # the salt makes the ids, and so the page, the same at every run
    with matplotlib.rc_context({"svg.hashsalt": "shaftline", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{prefix}-", text)
    # a hundredth of a point is enough in what is drawn; letters are scaled and keep theirs
    text = re.sub(r'(?<= d=")[^"]*', lambda d: re.sub(r"(\.\d\d)\d+", r"\1", d[0]), text)
    text = text.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "", 1)
    text = text.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1).replace("xlink:href", "href")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)


def equation(latex: str, plain: str, prefix: str) -> str:
    """An equation as an SVG element, set by matplotlib; its plain text where it cannot be set.

    Args:
        latex: without the dollar signs.
        plain: the same in words and signs.
        prefix: of the drawing's ids.
    """
    spaced = latex + " "
    for unknown, known in _UNKNOWN_TO_MATHTEXT.items():
        spaced = spaced.replace(unknown, known)
    figure = Figure(figsize=(0.01, 0.01))
    figure.text(0.0, 0.0, f"${spaced.strip()}$", fontsize=13, color=MEASURED, math_fontfamily="cm")
    buffer = io.BytesIO()
    try:
        figure.savefig(buffer, format="svg")  # tells whether it can be set
    except ValueError:
        return f"<code>{escape(plain)}</code>"
    box = figure.get_tightbbox().padded(0.03)  # type: ignore[no-untyped-call]
    figure.set_size_inches(box.width, box.height)
    figure.texts[0].set_position((-box.x0 / box.width, -box.y0 / box.height))
    return svg(figure, plain, prefix)


def outline(time: Array, values: Array) -> tuple[Array, Array]:
    """A long trace as the lowest and highest value of each of some hundred stretches, in turn."""
    size = len(values) // _POINTS
    if size < 3:
        return time, values
    count = len(values) // size
    cut = values[: count * size].reshape(count, size)
    at = time[: count * size].reshape(count, size)
    pairs = np.column_stack([cut.min(axis=1), cut.max(axis=1)]).ravel()
    return np.column_stack([at[:, 0], at[:, size // 2]]).ravel(), pairs


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Some hundred evenly spaced points of a smooth trace."""
    step = max(1, len(values) // (3 * _POINTS))
    return time[::step], values[::step]


def block_rows(seconds: float, interval_s: float) -> int:
    """Rows of the blocks over which residuals are averaged: 5 s, less in a short recording."""
    return max(1, round(min(5.0, seconds / 60.0) / interval_s))


def blocks(values: Array, size: int, take: Callable[..., Any] = np.mean) -> Array:
    """A statistic of each block of ``size`` rows."""
    count = len(values) // size
    return np.asarray(take(values[: count * size].reshape(count, size), axis=1))
