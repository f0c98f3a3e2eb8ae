"""Results of a diagnosis, as the reports use them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .identification.parameters import BiasedParameter, ParameterChange
from .judge.shapes import Shape
from .judge.verdict import BalanceVerdict, Detectable, Finding
from .search.catalogue import Window
from .search.fitting import Colour
from .search.formulas import Formula
from .search.selection import Candidate


@dataclass(frozen=True, repr=False)
class Outcome:
    """Results of a diagnosis: verdict, findings, residuals, simulations and the corrected ship.

    Args:
        verdict: ``explained``, ``partly-explained``, ``nothing-missing`` or ``unexplained``.
        ship: nominal ship.
        corrected: corrected ship, with the reported effects, shape or formula.
        time_s: time of each row [s], shape (rows,).
        held_out: windows of the held-out data [s].
        drive: command of the prime mover [mm | V | N m], shape (rows,).
        measured: measured channels by column, each of shape (rows,).
        before: open-loop simulation of the nominal ship, likewise.
        after: open-loop simulation of the corrected ship, likewise.
        balances: name and unit of each balance.
        residual_before: residual of each balance with the nominal ship, shape (balances, rows).
        residual_after: residual of each balance with the corrected ship, likewise.
        findings: identified effects, in the order in which they were found.
        shape: residual of a balance over one signal, where no effect explains it; else None.
        shape_windows: windows in which the shape acts [s].
        shape_regime: operating regime in which the shape acts, in words.
        explained: share of the residual's power beyond the instruments' noise that the effects explain.
        left_over: frequency band in which the residual exceeds noise; None if it is noise.
        ranking: candidate effects, the best first, each with its threshold.
        detectable: smallest effects that the recording would have shown.
        fit_before: FitPercent of the nominal ship by column on the held-out data, without channels that
            are constant there.
        fit_after: FitPercent of the corrected ship, likewise.
        held_out_gain: 2 Δ log L of the corrected ship on the held-out data.
        excited: whether the commands move enough to distinguish effects.
        line: whether the commands are interpolated linearly between rows; otherwise they are held.
        highest_Hz: highest frequency that counts [Hz].
        rows_averaged: rows of the recording that are averaged in each row of the arrays.
        limits: limits of the recording that may prevent a verdict, a sentence each.
        warnings: remarks on the recording and the correction, a sentence each.
        undecidable: whether the recording is too short, or excites too little, for ``nothing-missing``.
        parameters: parameters that were calibrated or free, or that the recording changes clearly.
        balance_verdicts: verdict on each balance.
        biased: for each finding, the parameter of the ship file that would explain it as well, or None.
        formula: formula of the residual that the held-out data confirm; else None.
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
    parameters: list[ParameterChange] = field(default_factory=list)
    biased: list[BiasedParameter | None] = field(default_factory=list)
    balance_verdicts: tuple[BalanceVerdict, ...] = ()
    formula: Formula | None = None

    @property
    def held_rows(self) -> NDArray[np.bool_]:
        """Mask of the held-out rows, shape (rows,)."""
        half = 0.5 * float(self.time_s[1] - self.time_s[0])
        inside = [(self.time_s > a - half) & (self.time_s < b - half) for a, b in self.held_out]
        return np.asarray(np.any(inside, axis=0))
