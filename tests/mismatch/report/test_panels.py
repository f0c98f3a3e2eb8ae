"""What the small drawings have in common."""

from __future__ import annotations

import re

import numpy as np
import pytest

from shaftline.mismatch import Effect, catalogue
from shaftline.mismatch.outcome import block_statistics
from shaftline.mismatch.report.figures import (
    HEIGHT,
    WIDTH,
    equation,
    outline,
    panel,
    svg,
    thin,
    with_label,
)

from ..diagnoses import diagnosis_of


@pytest.mark.parametrize("effect", catalogue(), ids=lambda effect: effect.label)
def test_every_equation_can_be_set(effect: Effect) -> None:
    assert equation(effect.latex, effect.equation, "e").startswith("<svg")


def test_an_equation_that_cannot_be_set_is_told_in_plain_text() -> None:
    assert equation(r"\nonsense{", "a < b", "e") == "<code>a &lt; b</code>"


@pytest.mark.parametrize(
    ("duration_s", "interval_s", "rows"),
    [
        (1200.0, 0.1, 50),
        (240.0, 0.2, 20),  # a sixtieth of the recording
        (1200.0, 30.0, 1),
        (14400.0, 0.1, 50),
        (86400.0, 0.1, 289),  # 3000 blocks for 864001 rows
    ],
)
def test_blocks_are_five_seconds_less_in_a_short_recording_and_more_in_a_long_one(
    duration_s: float, interval_s: float, rows: int
) -> None:
    time = interval_s * np.arange(round(duration_s / interval_s) + 1)
    assert diagnosis_of("explained", time_s=time).rows_of_a_block == rows


def test_statistics_of_blocks_leave_the_incomplete_block_out() -> None:
    rows = np.arange(11.0)
    assert block_statistics(rows, 3) == pytest.approx([1.0, 4.0, 7.0])
    assert block_statistics(rows, 3, np.max) == pytest.approx([2.0, 5.0, 8.0])


def test_a_long_trace_keeps_its_extremes() -> None:
    time = np.arange(4200.0)
    values = np.where(time == 1234.0, 9.0, np.where(time == 1235.0, -9.0, 0.0))
    at, ends = outline(time, values)
    assert len(at) == len(ends) == 2 * 420
    assert (ends.max(), ends.min()) == (9.0, -9.0)
    assert (at[:4] == [0.0, 5.0, 10.0, 15.0]).all()
    assert (ends[:2] == [0.0, 0.0]).all()
    lowest_first = outline(time, np.sin(time))[1]
    assert (lowest_first[::2] <= lowest_first[1::2]).all()
    short = np.arange(1259.0)
    assert outline(short, short)[1] is short
    assert len(outline(np.arange(1260.0), np.arange(1260.0))[1]) == 840


def test_a_smooth_trace_is_thinned() -> None:
    time = np.arange(12600.0)
    assert (thin(time, -time)[0] == time[::10]).all()
    assert (thin(time, -time)[1] == -time[::10]).all()
    assert len(thin(time[:500], time[:500])[0]) == 500


def test_a_panel_has_its_size_and_labels() -> None:
    figure, axes = panel("title", "x [s]", "y [N]", 3.0, left=1.0)
    assert figure.get_size_inches() == pytest.approx([WIDTH, 3.0])
    assert (axes.get_title("left"), axes.get_xlabel(), axes.get_ylabel()) == (
        "title",
        "x [s]",
        "y [N]",
    )
    x, y, width, height = axes.get_position().bounds
    assert (x * WIDTH, (x + width) * WIDTH) == pytest.approx((1.0, WIDTH - 0.2))
    assert (y * 3.0, (y + height) * 3.0) == pytest.approx((0.46, 2.7))
    assert panel("", "", "")[0].get_size_inches() == pytest.approx([WIDTH, HEIGHT])


def test_a_drawing_is_one_element_with_ids_of_its_own() -> None:
    def drawn(prefix: str) -> str:
        return svg(with_label(panel("a", "x", "y")[0], 'rate "a" < b'), prefix)

    first, second = drawn("p"), drawn("q")
    assert first.startswith('<svg role="img" aria-label="rate &quot;a&quot; &lt; b" ')
    assert first.rstrip().endswith("</svg>")
    assert second == first.replace("p-", "q-") or set(
        re.findall(r'id="([^"]+)"', first)
    ).isdisjoint(re.findall(r'id="([^"]+)"', second))
    ids = re.findall(r'\bid="([^"]+)"', first)
    assert ids
    assert all(one.startswith("p-") for one in ids)
    assert all(one in ids for one in re.findall(r'href="#([^"]+)"', first))
    assert not re.search(r"xmlns|<!--|<metadata", first)
    assert drawn("p") == first
