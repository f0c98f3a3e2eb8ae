"""Results of a diagnosis, as the reports use them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

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
from .simulate.joint_replay import Floats

MOST_BLOCKS = 3000
"""Largest number of blocks over which residuals are averaged."""


@dataclass(frozen=True, repr=False)
class Outcome:
    """Results of a diagnosis: verdict, findings, residuals, simulations and the corrected ship.

    Channels that are constant on the held-out data have no FitPercent. Limits and warnings are texts.
    A biased parameter of the ship file would explain a finding as well; None where there is none.
    """

    verdict: str  # ``explained``, ``partly-explained``, ``nothing-missing`` or ``unexplained``
    ship: Ship  # nominal ship
    corrected: Ship  # corrected ship, with the reported effects, shape or formula
    time_s: Floats  # time of each row [s], shape (rows,)
    held_out: list[Window]  # windows of the held-out data [s]
    drive: Floats  # command of the prime mover [mm | V | N m], shape (rows,)
    measured: dict[str, Floats]  # measured channels by column, each of shape (rows,)
    before: dict[str, Floats]  # open-loop simulation of the nominal ship
    after: dict[str, Floats]  # open-loop simulation of the corrected ship
    balances: list[tuple[str, str]]  # name and unit of each balance
    residual_before: Floats  # residuals with the nominal ship, shape (balances, rows)
    residual_after: Floats  # residuals with the corrected ship, likewise
    findings: list[Finding]  # identified effects, in the order in which they were found
    shape: Shape | None  # residual over one signal, where no effect explains it
    shape_windows: list[Window]  # windows in which the shape acts [s]
    shape_regime: str  # operating regime in which the shape acts, in words
    explained: float  # share of the residual's power beyond noise that the effects explain
    left_over: Colour | None  # band in which the residual exceeds noise; None if it is noise
    ranking: list[tuple[Candidate, float]]  # candidate effects with thresholds, best first
    detectable: list[Detectable]  # smallest effects that the recording would have shown
    fit_before: dict[str, float]  # FitPercent of the nominal ship on the held-out data, by column
    fit_after: dict[str, float]  # FitPercent of the corrected ship, likewise
    held_out_gain: float  # 2 Δ log L of the corrected ship on the held-out data
    excited: bool  # whether the commands move enough to distinguish effects
    tried: tuple[str, ...] = ()  # labels of all effects that were candidates
    line: bool = False  # whether the commands are interpolated linearly between rows; else held
    highest_Hz: float = math.inf  # highest frequency that counts [Hz]
    rows_averaged: int = 1  # rows of the recording in each row of the arrays
    limits: list[str] = field(default_factory=list)  # limits that may prevent a verdict
    warnings: list[str] = field(default_factory=list)  # remarks on recording and correction
    undecidable: bool = False  # whether the recordings cannot decide ``nothing-missing``
    parameters: list[ParameterChange] = field(default_factory=list)  # calibrated, free or changed
    biased: list[BiasedParameter | None] = field(default_factory=list)  # one for each finding
    balance_verdicts: tuple[BalanceVerdict, ...] = ()  # verdict on each balance
    formula: Formula | None = None  # formula of the residual that the held-out data confirm
    inputs: dict[str, Floats] = field(default_factory=dict)  # other recorded inputs, (rows,)
    alternatives: dict[str, Ship] = field(default_factory=dict)  # ships of other models, by effect
    hidden: dict[str, Ship] = field(default_factory=dict)  # ships with an effect that it may hide
    calibrated: Ship | None = None  # ship of the reference period, with its tolerances

    @property
    def held_rows(self) -> NDArray[np.bool_]:
        """Mask of the held-out rows, shape (rows,)."""
        half = 0.5 * float(self.time_s[1] - self.time_s[0])
        inside = [(self.time_s > a - half) & (self.time_s < b - half) for a, b in self.held_out]
        return np.asarray(np.any(inside, axis=0))

    @property
    def noise(self) -> dict[str, tuple[float, float]]:
        """Residual of each channel on the held-out data: standard deviation and correlation time [s].

        The correlation time is that of a Gauss-Markov process with the same correlation of neighbouring
        rows.
        """
        found, rows = {}, self.held_rows
        for column, measured in self.measured.items():
            residual = (measured - self.after[column])[rows]
            deviation, near = float(np.std(residual)), 0.0
            if deviation > 0.0:
                centred = residual - residual.mean()
                near = float(np.mean(centred[1:] * centred[:-1])) / deviation**2
            near = min(near, 0.9999)
            found[column] = deviation, -self.interval_s / math.log(near) if near > 0.0 else 0.0
        return found

    @property
    def interval_s(self) -> float:
        """Sampling interval [s]."""
        return float(self.time_s[-1] - self.time_s[0]) / (len(self.time_s) - 1)

    @property
    def rows_of_a_block(self) -> int:
        """Number of rows over which residuals are averaged: 5 s; less in a short recording.

        In a recording of more than a few hours it is more, so that a figure has at most
        :data:`MOST_BLOCKS` blocks.
        """
        rows = round(min(5.0, float(self.time_s[-1]) / 60.0) / self.interval_s)
        return max(1, rows, math.ceil(len(self.time_s) / MOST_BLOCKS))


def block_statistics(values: Floats, size: int, take: Callable[..., Any] = np.mean) -> Floats:
    """Return a statistic of each block of ``size`` rows.

    >>> block_statistics(np.arange(6.0), 3)
    array([1., 4.])
    """
    count = len(values) // size
    return np.asarray(take(values[: count * size].reshape(count, size), axis=1))
