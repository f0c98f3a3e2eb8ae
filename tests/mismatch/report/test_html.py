"""The report's page: whole, self-contained, and the same at every run."""

from __future__ import annotations

import re
from html import unescape
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import Diagnosis, Effect, catalogue
from shaftline.mismatch.judge.whiteness import Colour
from shaftline.mismatch.report import figures
from shaftline.mismatch.report.figures import sea_band, smooth_spectrum
from shaftline.mismatch.report.html import report_html
from shaftline.mismatch.report.panels import equation
from shaftline.mismatch.report.remarks import remarks
from shaftline.mismatch.report.wording import measure, number, parameter_words, scaled, spans
from shaftline.plant import load_ship

from ..diagnoses import FRICTION, TIME, channels, diagnosis_of


class Outline(HTMLParser):
    """Addresses that a page fetches, ids, figures and elements left open."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.figures: dict[str, int] = {}
        self.open: list[str] = []
        self.within: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attrs}
        self.addresses += [v for k, v in given.items() if k in ("src", "href", "xlink:href")]
        self.ids += [given["id"]] if "id" in given else []
        figure = given.get("data-figure", self.within[-1] if self.within else "")
        if tag == "svg" and figure:
            self.figures[figure] = self.figures.get(figure, 0) + 1
        if tag not in ("meta", "br", "wbr"):
            self.open.append(tag)
            self.within.append(figure)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in ("meta", "br", "wbr"):
            self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        self.within.pop()
        assert self.open.pop() == tag


def outline(page: str) -> Outline:
    found = Outline()
    found.feed(page)
    assert found.open == []
    return found


CASES: dict[str, dict[str, Any]] = {
    "explained": {},
    "unexplained": {},
    "nothing-missing": {},
    "undecided": {
        "limits": ["dull: the rack stands still"],
        "warnings": ["two rows were <b>lost</b>"],
        "ship": load_ship("frigate").model_copy(update={"name": "a<b ship"}),
    },
}


@pytest.fixture(scope="module")
def pages() -> dict[str, tuple[Diagnosis, str]]:
    made = {}
    for name, changes in CASES.items():
        diagnosis = diagnosis_of("nothing-missing" if name == "undecided" else name, **changes)
        made[name] = diagnosis, report_html(diagnosis)
    return made


@pytest.mark.parametrize("case", CASES)
def test_every_verdict_gives_a_page_that_needs_nothing_else(
    case: str, pages: dict[str, tuple[Diagnosis, str]]
) -> None:
    diagnosis, page = pages[case]
    found = outline(page)
    assert all(address.startswith("#") for address in found.addresses)
    assert not re.search(r"@import|url\((?!#)|<script|<link|<img|https?://", page)
    assert len(found.ids) == len(set(found.ids))
    used = {a[1:] for a in found.addresses} | set(re.findall(r"url\(#([^)]+)\)", page))
    assert used <= set(found.ids)
    assert diagnosis.sentence in unescape(page)
    assert len(page) < 3_000_000


@pytest.mark.parametrize("case", CASES)
def test_every_figure_is_there(case: str, pages: dict[str, tuple[Diagnosis, str]]) -> None:
    expected = {"traces": 4, "residuals": 2, "regimes": 2, "spectra": 2, "ranking": 1}
    if case == "unexplained":
        expected["shape"] = 1
    assert outline(pages[case][1]).figures == expected


def test_the_verdict_is_said(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    words = {
        "explained": "explained", "unexplained": "unexplained",
        "nothing-missing": "nothing missing", "undecided": "cannot be decided",
    }  # fmt: skip
    for case, (_, page) in pages.items():
        assert f'<p class="verdict">{words[case]}</p>' in page
        assert f'<body class="{case}">' in page


def test_a_finding_is_told_in_full(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    diagnosis, page = pages["explained"]
    text = unescape(re.sub(r"<wbr>", "", page))
    effect = diagnosis.findings[0].effect
    for told in (
        "Coulomb friction", "8.00", "6.95 … 9.05", "kN m", FRICTION, effect.split_by,
        "viscous-friction (engine)", "60 to 120 s", "shaft speed above 11 rad/s", "0.1.0",
        "98 % of the slow difference", "324 N m",
    ):  # fmt: skip
        assert told in text, told


def test_texts_are_escaped(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    _, page = pages["undecided"]
    assert "<b>" not in page
    assert "two rows were &lt;b&gt;lost&lt;/b&gt;" in page
    assert "a&lt;b ship" in page


def test_the_same_diagnosis_gives_the_same_drawing(
    pages: dict[str, tuple[Diagnosis, str]],
) -> None:
    (drawn,) = figures.ranking(pages["explained"][0])
    assert drawn in pages["explained"][1]


def test_unexplained_without_a_shape_gives_a_page() -> None:
    ship = load_ship("frigate")
    worse = dict.fromkeys(channels(0.0), -20.0)
    page = report_html(
        diagnosis_of("unexplained", shape=None, shape_windows=[], corrected=ship, fit_after=worse)
    )
    assert "has no name</h2>" not in page
    assert "−20.0" not in page  # nothing was corrected


def test_a_correction_that_does_harm_is_said_to() -> None:
    worse = dict.fromkeys(channels(0.0), -20.0)
    (said,) = remarks(diagnosis_of("unexplained", fit_after=worse))
    assert "worse than the nominal one" in said


def test_what_acts_only_on_the_part_set_aside_is_said() -> None:
    residual = diagnosis_of("nothing-missing").residual_before.copy()
    residual[1] = 300.0 * np.sin(TIME) - 9000.0 * (TIME > 200.0)
    (said,) = remarks(diagnosis_of("nothing-missing", residual_after=residual))
    assert said.startswith("In the engine balance,")
    assert "times as much is missing on the part set aside" in said


def test_what_a_finding_leaves_is_said() -> None:
    (said,) = remarks(diagnosis_of("explained", left_over=Colour(0, 1, 0.005, 0.02, 14.0)))
    assert "in the engine balance, 14 times its power between 0.0050 and 0.020 Hz" in said


@pytest.mark.parametrize("effect", catalogue(), ids=lambda effect: effect.label)
def test_every_equation_can_be_set(effect: Effect) -> None:
    assert equation(effect.latex, effect.equation, "e").startswith("<svg")


def test_an_equation_that_cannot_be_set_is_told_in_plain_text() -> None:
    assert equation(r"\nonsense{", "a < b", "e") == "<code>a &lt; b</code>"


def test_numbers_are_readable() -> None:
    assert number(0.0) == "0"
    assert number(8.0) == "8.00"
    assert number(-1541.28) == "−1540"
    assert number(23956.0) == "24 000"
    assert number(5.34e-5) == "5.34·10⁻⁵"
    assert number(float("inf")) == "∞"
    assert number(0.09996) == "0.100"
    assert measure(13900.0, "N m") == "13.9 kN m"
    assert measure(571.0, "kg m2") == "571 kg m²"
    assert measure(0.03, "-") == "0.0300"
    assert scaled(3.4e6, "N") == (1e6, "MN")
    assert (
        parameter_words("coulomb_friction_engine_side_N_m", "N m") == "coulomb friction engine side"
    )
    assert parameter_words("dead_band", "-") == "dead band"
    assert spans([(0.0, 1200.0)], 1200.0).startswith("the whole recording")


def test_waves_are_seen_in_a_spectrum_and_white_noise_has_none() -> None:
    rng = np.random.default_rng(4)
    white = rng.standard_normal(12000)
    time = np.arange(12000) * 0.1
    swell = sum(
        0.5 * np.sin(2 * np.pi * f * time + k) for k, f in enumerate((0.13, 0.14, 0.15, 0.16))
    )
    assert sea_band(*smooth_spectrum(white, 10.0, 1200)) is None
    band = sea_band(*smooth_spectrum(white + swell, 10.0, 1200))
    assert band is not None
    assert band[0] < 0.15 < band[1]
