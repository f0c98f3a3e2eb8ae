"""The result of :func:`shaftline.mismatch.diagnose`, with its reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .outcome import Outcome
from .report.data import diagnosis_as_dict
from .report.index import write_result
from .report.text import headline, sentence, summary

SHIP = "corrected_ship.toml"
"""File name of the corrected ship."""


class Diagnosis(Outcome):
    """Diagnosis of recordings: verdict, missing physics, corrected ship, and reports.

    The fields are those of :class:`~shaftline.mismatch.outcome.Outcome`.
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

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html`` and ``corrected_ship.toml``.

        Each file is renamed into place when it is complete.

        Args:
            folder: created if it does not exist.
            page: whether to write ``report.html`` with its figures.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        text = None
        if page:
            from .report.html import report_html

            text = report_html(self)
        return write_result(folder, self.to_dict(), text, {SHIP: self.corrected})

    def __repr__(self) -> str:
        """Return ship and verdict, without the arrays."""
        return f"<Diagnosis of {self.ship.name}: {self.verdict}>"
