"""What a diagnosis has found, as the reports read it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .identification.parameters import MovedNumber, WrongNumber
from .judge.findings import Detectable, Finding
from .judge.shapes import Shape
from .judge.verdict import BalanceVerdict
from .search.catalogue import Window
from .search.formulas import Formula
from .search.selection import Candidate
from .search.whiteness import Colour


@dataclass(frozen=True, repr=False)
class Outcome:
    """Where recordings and the simulation differ, what physics is missing, and the proof.

    Args:
        verdict: ``explained``, ``partly-explained``, ``nothing-missing`` or ``unexplained``.
        ship: nominal.
        corrected: with the effects, or the shape, that were found.
        time_s: shape (rows,).
        held_out: windows set aside [s].
        drive: demand on the prime mover [mm | V | N m], shape (rows,).
        measured: channels by column, each of shape (rows,); likewise the next two.
        before: nominal open-loop simulation.
        after: corrected open-loop simulation.
        balances: names of the balances, and their units.
        residual_before: what each balance lacks, shape (balances, rows).
        residual_after: likewise with the corrected ship.
        findings: effects, in the order of discovery.
        shape: the missing quantity without a name, where more than noise is left; then the
            windows and the regime in which it acts.
        shape_windows: in which it acts [s].
        shape_regime: in words.
        explained: share of the residual's power beyond the instruments' noise that the effects explain.
        left_over: where what they leave is more than noise; None where it is noise.
        ranking: the catalogue, best first, and each entry's threshold.
        detectable: smallest effects that the recording would have shown.
        fit_before: FitPercent by column on the held-out part, without those that are constant there.
        fit_after: likewise, of the corrected ship.
        held_out_gain: of the corrected ship in 2 log L, on the held-out part alone.
        excited: whether the demands move enough to tell effects apart.
        line: whether the demands are taken as straight lines between rows instead of held.
        highest_Hz: up to which the recording was judged [Hz].
        rows_averaged: of the recording, in each row of the arrays.
        limits: why the recording may not decide.
        warnings: what was noticed about the recording.
        undecidable: whether the recording is too short or too dull to tell that nothing is missing.
        numbers: of the ship that were calibrated or free, or that the recording moved far.
        balance_verdicts: each balance for itself.
        wrong: of each finding: the number of the ship's file that would explain it as well, or None.
        formula: of what has no name, where one holds on the data set aside; None where none does.
    """

    verdict: str
    ship: Ship
    corrected: Ship
    time_s: NDArray[np.float64]
    held_out: list[Window]
    drive: NDArray[np.float64]
    measured: dict[str, NDArray[np.float64]]
    before: dict[str, NDArray[np.float64]]
    after: dict[str, NDArray[np.float64]]
    balances: list[tuple[str, str]]
    residual_before: NDArray[np.float64]
    residual_after: NDArray[np.float64]
    findings: list[Finding]
    shape: Shape | None
    shape_windows: list[Window]
    shape_regime: str
    explained: float
    left_over: Colour | None
    ranking: list[tuple[Candidate, float]]
    detectable: list[Detectable]
    fit_before: dict[str, float]
    fit_after: dict[str, float]
    held_out_gain: float
    excited: bool
    line: bool = False
    highest_Hz: float = math.inf
    rows_averaged: int = 1
    limits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    undecidable: bool = False
    numbers: list[MovedNumber] = field(default_factory=list)
    wrong: list[WrongNumber | None] = field(default_factory=list)
    balance_verdicts: tuple[BalanceVerdict, ...] = ()
    formula: Formula | None = None

    @property
    def held_rows(self) -> NDArray[np.bool_]:
        """Whether each row is held out, shape (rows,)."""
        half = 0.5 * float(self.time_s[1] - self.time_s[0])
        inside = [(self.time_s > a - half) & (self.time_s < b - half) for a, b in self.held_out]
        return np.asarray(np.any(inside, axis=0))
