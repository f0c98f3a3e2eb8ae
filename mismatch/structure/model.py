"""A ship fitted to recordings: effects, numbers and what else was free."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Placed

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A fitted ship.

    Args:
        effects: with their values.
        numbers: how far each doubtful number has moved, shape (doubts,).
        nuisance: shift of the first pitch ratio, shaft speed and ship speed of each recording, in
            deviations, and then of each channel's clock, in rows; shape (3 recordings + channels,).
        score: 2 log L with the priors [-].
        error: measured minus simulated on the fitted rows, shape (channels, rows).
        columns: what each free value moves there, shape (free values, channels, rows).
        precision: of each free value's prior, 0 where it has none; shape (free values,).
        units: what 1 in its coordinate is of each free value in its own unit; likewise.
    """

    effects: tuple[Placed, ...]
    numbers: Floats
    nuisance: Floats
    score: float
    error: Floats = field(repr=False)
    columns: Floats = field(repr=False)
    precision: Floats = field(repr=False)
    units: Floats = field(repr=False)

    @property
    def labels(self) -> frozenset[str]:
        """Of its effects."""
        return frozenset(placed.effect.label for placed in self.effects)

    @property
    def size(self) -> int:
        """How many values its effects have."""
        return sum(len(placed.values) for placed in self.effects)
