"""The result of :func:`shaftline.mismatch.diagnose`, with its reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..core.files import write_atomically
from ..plant.ship import Ship
from .outcome import Outcome
from .report.data import ALTERNATIVES, HIDDEN, diagnosis_as_dict, model_file
from .report.index import CALIBRATED, PDF, SHIP, Result
from .report.text import headline, sentence, summary


class Diagnosis(Outcome, Result):
    """Diagnosis of recordings: verdict, missing physics, corrected ship, and reports.

    The fields are those of :class:`~shaftline.mismatch.outcome.Outcome`. ``save`` writes
    ``report.json``, ``report.html``, ``corrected_ship.toml``, the ships of models that the recordings
    cannot distinguish from it (``alternatives/``) or of effects that they may hide (``hidden/``), with a
    reference period ``calibrated_ship.toml`` and, if wanted, ``report.pdf``.
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

    def save(self, folder: str | Path, *, page: bool = True, pdf: bool = False) -> Path:
        """Write ``report.json``, ``report.html``, the corrected ship, and ``report.pdf`` if wanted.

        Each file is renamed into place when it is complete.

        Args:
            folder: created if it does not exist.
            page: whether to write ``report.html`` with its figures.
            pdf: whether to write ``report.pdf``, the report on A4 pages.

        Returns:
            The folder.

        Raises:
            OSError: the folder cannot be written to.
        """
        content = self._pdf() if pdf else None
        folder = super().save(folder, page=page)
        written = {folder / name for name in self._ships()}
        ships = (folder / name for name in (ALTERNATIVES, HIDDEN))
        for file in (
            *(one for place in ships for one in place.glob("*.toml")),
            folder / CALIBRATED,
        ):
            if file not in written:  # of an earlier diagnosis
                file.unlink(missing_ok=True)
        if content is not None:
            write_atomically(folder / PDF, lambda file: file.write_bytes(content))
        return folder

    def _ships(self) -> dict[str, Ship]:
        ships = {SHIP: self.corrected}
        if self.calibrated is not None:
            ships[CALIBRATED] = self.calibrated
        for place, own in ((ALTERNATIVES, self.alternatives), (HIDDEN, self.hidden)):
            ships |= {model_file(place, name): ship for name, ship in own.items()}
        return ships

    def _page(self) -> str:
        from .report.html import report_html

        return report_html(self)

    def _pdf(self) -> bytes:
        from .report.pdf import report_pdf

        return report_pdf(self)

    def __repr__(self) -> str:
        """Return ship and verdict, without the arrays."""
        return f"<Diagnosis of {self.ship.name}: {self.verdict}>"
