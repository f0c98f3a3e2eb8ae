"""An identification: the numbers, how sure they are, and what they bring."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.ship import Ship
from ..estimate import Estimate
from ..report.data import finite
from ..report.files import write_result
from ..report.text import aligned
from ..search.placed import Window

SHIP = "identified_ship.toml"
"""Name of the file of an identification that holds its ship."""


@dataclass(frozen=True, repr=False)
class Identification:
    """Numbers of a ship as recordings tell them.

    Args:
        method: by which they were found.
        ship: nominal.
        identified: the ship with these numbers, and how well each is known in its tolerances.
        estimates: of each number, n of them.
        correlation: of their errors, shape (n, n).
        left_out: why a number that might have been free is not, by its key.
        tables: what the method shows on the way, by file name.
        time_s: of the recordings' rows, end to end, shape (rows,); empty where states were given.
        held_out: stretches [s] that were set aside before anything was fitted.
        measured: channels by column, each of shape (rows,); likewise the next two.
        before: open-loop simulation of the nominal ship.
        after: of the identified ship.
        fit_before: FitPercent by column on what was set aside, or on all where nothing was.
        fit_after: likewise.
        limits: what the recordings cannot show.
        warnings: what a reader must know.
        line: whether the demands were taken as straight lines between rows instead of held.
    """

    method: str
    ship: Ship
    identified: Ship
    estimates: tuple[Estimate, ...]
    correlation: NDArray[np.float64]
    left_out: dict[str, str] = field(default_factory=dict)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    time_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    held_out: list[Window] = field(default_factory=list)
    measured: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    before: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    after: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    fit_before: dict[str, float] = field(default_factory=dict)
    fit_after: dict[str, float] = field(default_factory=dict)
    limits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    line: bool = False

    @property
    def parameters(self) -> dict[str, float]:
        """Values by dotted key, in the keys' units."""
        return {estimate.key: estimate.value for estimate in self.estimates}

    @property
    def corrected(self) -> Ship:
        """The identified ship, as reports call one that was changed."""
        return self.identified

    @property
    def judged_on(self) -> str:
        """What the fit was judged on, in words."""
        if not self.held_out:
            return "what was fitted itself: nothing was set aside"
        held = ", ".join(f"{a:.4g} to {b:.4g} s" for a, b in self.held_out)
        return f"{held}, which was set aside before anything was fitted"

    def strongest_correlation(self) -> tuple[str, str, float] | None:
        """The two numbers whose errors go together most, and their correlation."""
        if len(self.estimates) < 2:
            return None
        apart = np.abs(np.triu(self.correlation, 1))
        i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
        names = [estimate.key for estimate in self.estimates]
        return names[i], names[j], float(self.correlation[i, j])

    def summary(self) -> str:
        """The numbers with their intervals, and the fit, as text for a terminal."""
        rows = []
        for estimate in self.estimates:
            low, high = estimate.ci95
            rows.append(
                {
                    "key": estimate.key,
                    "file": f"{estimate.neutral:.5g}",
                    "found": f"{estimate.value:.5g}",
                    "95 % from": f"{low:.5g}",
                    "to": f"{high:.5g}",
                    "unit": estimate.unit,
                }
            )
        parts = [
            f"Numbers of {self.ship.name} by {self.method}\n"
            + aligned(rows, ("file", "found", "95 % from", "to"))
        ]
        if (pair := self.strongest_correlation()) is not None:
            parts[0] += f"\nstrongest correlation: {pair[0]} with {pair[1]}, {pair[2]:.2f}"
        if self.left_out:
            parts.append(
                "Left as they are\n"
                + "\n".join(f"{key}: {why}" for key, why in self.left_out.items())
            )
        if self.fit_before:
            fits = [
                {
                    "channel": column,
                    "before": f"{before:.1f}",
                    "after": f"{self.fit_after[column]:.1f}",
                }
                for column, before in self.fit_before.items()
            ]
            parts.append(
                "FitPercent, 100 is perfect\n"
                + aligned(fits, ("before", "after"))
                + f"\njudged on {self.judged_on}"
            )
        notes = [f"note: {note}" for note in (*self.limits, *self.warnings)]
        return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)

    def to_dict(self) -> dict[str, Any]:
        """What stands in ``report.json``: numbers in the units of their keys."""
        keys = [estimate.key for estimate in self.estimates]
        report: dict[str, Any] = {
            "method": self.method,
            "ship": self.ship.name,
            "recording": {
                "rows": len(self.time_s),
                "seconds": float(self.time_s[-1]) if len(self.time_s) else 0.0,
                "held_out": [list(window) for window in self.held_out],
            },
            "parameters": {
                e.key: {
                    "value": e.value, "se": e.standard_error, "ci95": list(e.ci95),
                    "unit": e.unit, "before": e.neutral,
                    "degrees_of_freedom": e.freedom,
                }
                for e in self.estimates
            },
            "correlation": {"keys": keys, "matrix": self.correlation.tolist()},
            "left_out": self.left_out,
            "fit": {
                "held_out" if self.held_out else "fitted": {
                    "before": self.fit_before, "after": self.fit_after,
                }
            },
            "demands_between_rows": "lines" if self.line else "held",
            "limits": self.limits,
            "warnings": self.warnings,
        }  # fmt: skip
        plain: dict[str, Any] = finite(report)
        return plain

    def save(self, folder: str | Path, *, page: bool = True) -> Path:
        """Write ``report.json``, ``report.html``, ``identified_ship.toml`` and the tables as CSV.

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
            from .page import page_of  # draws

            text = page_of(self)
        return write_result(folder, self.to_dict(), text, {SHIP: self.identified}, self.tables)

    def __repr__(self) -> str:
        """Ship and method; the fields hold arrays as long as the recordings."""
        return (
            f"<Identification of {self.ship.name} by {self.method}: {len(self.estimates)} numbers>"
        )
