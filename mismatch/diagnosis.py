"""The result of :func:`shaftline.mismatch.diagnose`, with its reports."""

from __future__ import annotations

from typing import Any

from ..plant.ship import Ship
from .outcome import Outcome
from .report.data import diagnosis_as_dict
from .report.index import Result
from .report.text import headline, sentence, summary

SHIP = "corrected_ship.toml"
"""File name of the corrected ship."""


class Diagnosis(Outcome, Result):
    """Diagnosis of recordings: verdict, missing physics, corrected ship, and reports.

    The fields are those of :class:`~shaftline.mismatch.outcome.Outcome`. ``save`` writes
    ``report.json``, ``report.html`` and ``corrected_ship.toml``.
    """

    @property
    def headline(self) -> str:
        """Verdict and cause in at most 15 words."""
        return headline(self)

    @property
    def sentence(self) -> str:
        """Diagnosis in words, with parameters and intervals, one sentence for each finding."""
        return sentence(self)

    def summary(self) -> str:
        """Return headline, findings with intervals, parameters and fit as text for a terminal."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``report.json``: values in the units that their names state."""
        return diagnosis_as_dict(self)

    def _ships(self) -> dict[str, Ship]:
        return {SHIP: self.corrected}

    def _page(self) -> str:
        from .report.html import report_html

        return report_html(self)

    def __repr__(self) -> str:
        """Return ship and verdict, without the arrays."""
        return f"<Diagnosis of {self.ship.name}: {self.verdict}>"
