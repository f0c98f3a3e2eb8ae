"""The report's page: whole, self-contained, and the same at every run."""

from __future__ import annotations

import re
from html import unescape
from html.parser import HTMLParser
from importlib import resources
from importlib.metadata import version
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import Diagnosis, catalogue
from shaftline.mismatch.report import figures
from shaftline.mismatch.report.first_page import first_page
from shaftline.mismatch.report.html import (
    _detectable_rows,
    _facts,
    _fits,
    _shape,
    _without_size,
    report_html,
)
from shaftline.mismatch.report.text import CONSTANT, VERDICT_WORDS, status
from shaftline.plant import load_ship

from ..diagnoses import FRICTION, channels, diagnosis_of


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
        "limits": ["insufficient excitation: the rack stands still"],
        "undecidable": True,
        "warnings": ["two rows were <b>lost</b>"],
        "ship": load_ship("frigate").model_copy(update={"name": "a<b ship"}),
    },
}


@pytest.fixture(scope="module")
def pages() -> dict[str, tuple[Diagnosis, str]]:
    made = {}
    for name, changes in CASES.items():
        diagnosis = diagnosis_of("unexplained" if name == "undecided" else name, **changes)
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
    text = unescape(page).replace("\xa0", " ")
    assert f"<h1>{first_page(diagnosis).headline}</h1>" in text
    assert f"<p><b>{diagnosis.headline}</b></p>" in text
    assert text.index("<h1>") < text.index("Technical part") < text.index("Key facts")
    assert len(page) < 3_000_000


@pytest.mark.parametrize("name", VERDICT_WORDS)
def test_every_verdict_has_a_tone(name: str) -> None:
    """Without one, the mark beside the headline is invisible."""
    style = resources.files("shaftline.mismatch.report").joinpath("style.css").read_text()
    assert re.search(rf"\.{name} {{ --tone: #\w+ }}", style)


@pytest.mark.parametrize("case", CASES)
def test_every_figure_is_there(case: str, pages: dict[str, tuple[Diagnosis, str]]) -> None:
    expected = {"traces": 4, "residuals": 2, "regimes": 2, "spectra": 2, "ranking": 1}
    if case in ("unexplained", "undecided"):
        expected["shape"] = 1
    if case != "undecided":
        expected["speed-power"] = 1
    assert outline(pages[case][1]).figures == expected


def test_the_verdict_is_said(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    words = {
        "explained": "explained",
        "unexplained": "unexplained",
        "nothing-missing": "nothing missing",
        "undecided": "cannot be decided",
    }
    for case, (diagnosis, page) in pages.items():
        name = diagnosis.ship.name
        assert f'<p class="verdict">{name} · {words[case]}</p>' in unescape(page)
        assert f'<body class="{case}">' in page


def test_a_finding_is_told_in_full(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    diagnosis, page = pages["explained"]
    text = unescape(re.sub(r"<wbr>", "", page))
    effect = diagnosis.findings[0].effect
    for told in (
        "Coulomb friction",
        "8.00",
        "6.95 … 9.05",
        "kN m",
        FRICTION,
        effect.split_by,
        "viscous-friction (engine)",
        "60 to 120 s",
        "shaft speed above 11 rad/s",
        f"shaftline {version('shaftline')}",
        "98 % of the mean square of the difference",
        "324 N m",
    ):
        assert told in text, told


def test_texts_are_escaped(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    _, page = pages["undecided"]
    assert page.count("<b>") == 1  # the headline of the technical part
    assert "two rows were &lt;b&gt;lost&lt;/b&gt;" in page
    assert "a&lt;b ship" in page


def test_unexplained_without_a_shape_gives_a_page() -> None:
    ship = load_ship("frigate")
    worse = dict.fromkeys(channels(0.0), -20.0)
    page = report_html(
        diagnosis_of(
            "unexplained",
            shape=None,
            shape_windows=[],
            corrected=ship,
            fit_after=worse,
            fit_before={"pitch_ratio": 84.5},
        )
    )
    assert page.count("<small>constant: no FitPercent</small>") == 1
    assert "Residual of unknown cause" not in page
    assert "−20.0" not in page  # nothing was corrected


def test_the_same_diagnosis_gives_the_same_drawing(
    pages: dict[str, tuple[Diagnosis, str]],
) -> None:
    (drawn,) = figures.ranking_panels(pages["explained"][0])
    assert figures.svg(drawn, "ranking0") in pages["explained"][1]


def test_facts_are_those_of_the_recording(pages: dict[str, tuple[Diagnosis, str]]) -> None:
    _, page = pages["explained"]
    text = " ".join(unescape(re.sub(r"<[^>]*>", " ", page)).split())
    for told in (
        "Ship frigate",
        "Recording 240 s (4 min), 1200 rows, one every 0.2 s",
        "Held-out data, never fitted 180 to 240 s",
        "Balances checked hull, engine",
        f"Effects tried 3 of {len(catalogue())} in the catalogue",
        "Explained 98 % of the mean square of the difference beyond noise",
        "2 Δ log L on held-out data 285",
        "pitch ratio 84.5 → 99.4 %",
        "2 Δ log L = 347, threshold 10.5",
        "cannot distinguish it from viscous-friction (engine) with viscous friction engine side 700 N m "
        "s/rad",
        "The best 3 of 3 effects",
    ):
        assert told in text, told
    assert "width:84.5%" in page
    assert "width:99.4%" in page


def test_short_recordings_are_told_in_seconds_alone() -> None:
    short = {
        name: getattr(diagnosis_of("nothing-missing"), name)[..., :595]
        for name in ("time_s", "drive", "residual_before", "residual_after")
    }
    facts = dict(_facts(diagnosis_of("nothing-missing", held_out=[(100.0, 118.0)], **short)))
    assert facts["Recording"] == "119 s, 595 rows, one every 0.2 s"
    assert facts["Held-out data, never fitted"] == "100.0 to 118.0 s"
    longer = dict(_facts(diagnosis_of("nothing-missing", time_s=np.linspace(0.0, 120.0, 1200))))
    assert longer["Recording"] == "120 s (2 min), 1200 rows, one every 0.1 s"


@pytest.mark.parametrize(
    ("value", "percent", "width"),
    [
        (-0.01, "0.0", "0.0"),
        (-12.34, "−12.3", "0.0"),
        (199.94, "199.9", "100.0"),
        (-3000.4, "−3000", "0.0"),
        (float("-inf"), "−inf", "0"),
    ],
)
def test_fits_are_drawn_between_0_and_100(value: float, percent: str, width: str) -> None:
    diagnosis = diagnosis_of(
        "nothing-missing", fit_before={"pitch_ratio": value}, fit_after={"pitch_ratio": 50.0}
    )
    fit, constant = _fits(diagnosis)
    assert (fit["before"], fit["wide_before"]) == (percent, width)
    assert (fit["after"], fit["wide_after"], fit["name"]) == ("50.0", "50.0", "pitch ratio")
    assert constant == {"name": "shaft speed", "none": CONSTANT}


@pytest.mark.parametrize(
    ("verdict", "changes", "told"),
    [
        ("explained", {"limits": ["insufficient excitation"], "excited": False}, "explained"),
        ("nothing-missing", {"limits": ["insufficient excitation"]}, "nothing-missing"),
        ("unexplained", {"limits": ["too short"], "undecidable": True}, "undecided"),
        (
            "partly-explained",
            {"limits": ["insufficient excitation"], "excited": False},
            "partly-explained",
        ),
        ("nothing-missing", {"limits": [], "excited": False}, "nothing-missing"),
        ("unexplained", {"limits": ["insufficient excitation"], "excited": False}, "undecided"),
        ("unexplained", {"limits": ["insufficient excitation"]}, "unexplained"),
    ],
)
def test_what_limits_the_recording_may_leave_it_undecided(
    verdict: str, changes: dict[str, Any], told: str
) -> None:
    assert status(diagnosis_of(verdict, **changes)) == told


def test_a_shape_is_told_by_its_knots() -> None:
    diagnosis = diagnosis_of("unexplained", shape_regime="shaft_speed above 11 rad/s")
    assert _shape(diagnosis) == {
        "signal": "shaft speed",
        "unit": "kN m",
        "rows": [("9.00", "0"), ("10.0", "−12.0"), ("11.0", "0.500")],
        "gain": "300",
        "threshold": "40.0",
        "windows": "20 to 50 s",
        "regime": "shaft speed above 11 rad/s",
    }
    assert _shape(diagnosis_of("explained")) is None


def test_what_has_no_smallest_size_is_listed_with_the_reason() -> None:
    diagnosis = diagnosis_of("explained")
    told = _without_size(diagnosis)
    assert told["unsized"] == ["viscous-friction (engine)", "hull-fouling (hull)"]
    tried = {c.effect.label for c, _ in diagnosis.ranking}
    assert sorted([*told["untried"], *tried]) == sorted(e.label for e in catalogue())
    assert _detectable_rows(diagnosis) == [
        {
            "effect": "Coulomb friction",
            "balance": "engine",
            "parameter": "coulomb friction engine side",
            "size": "324 N m",
            "needs": diagnosis.findings[0].effect.excitation,
        }
    ]
