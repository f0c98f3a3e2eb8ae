"""A diagnosis: everything that was found, and what can be done with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .outcome import Outcome
from .report.data import as_dict
from .report.index import write_result
from .report.text import headline, sentence, summary

SHIP = "corrected_ship.toml"
"""Name of the file of a diagnosis that holds its ship."""


class Diagnosis(Outcome):
    """Where recordings and the simulation differ, what physics is missing, and the proof.

    Its fields are those of an :class:`~shaftline.mismatch.outcome.Outcome`.
    """

    @property
    def headline(self) -> str:
        """The answer in at most 15 words."""
        return headline(self)

    @property
    def sentence(self) -> str:
        """The answer with sizes and intervals, a sentence for each finding."""
        return sentence(self)

    def summary(self) -> str:
        """The answer, what was found with its intervals, and the fit, as text for a terminal."""
        return summary(self)

    def to_dict(self) -> dict[str, Any]:
        """What stands in ``report.json``: numbers in the units that their names carry."""
        return as_dict(self)

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html`` and ``corrected_ship.toml``.

        All is made before anything is written, and each file is renamed into place.

        Args:
            folder: made where needed.
            page: whether ``report.html`` with its figures is wanted.

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
        """Verdict and ship; the fields hold arrays as long as the recording."""
        return f"<Diagnosis of {self.ship.name}: {self.verdict}>"
