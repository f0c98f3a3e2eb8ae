"""A ship fitted to recordings: effects, shifts of parameters, and nuisance values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Placed

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A fitted ship.

    Args:
        effects: with their values.
        shifts: distance of each parameter from the ship file, as its prior counts it, shape (priors,).
        nuisance: shift of the first pitch ratio, shaft speed and ship speed of each recording, in
            deviations, and then of each channel's clock, in rows; shape (3 recordings + channels,).
        score: 2 log L with the priors [-]; only differences mean anything.
    """

    effects: tuple[Placed, ...]
    shifts: Floats
    nuisance: Floats
    score: float

    @property
    def labels(self) -> frozenset[str]:
        """Labels of the effects."""
        return frozenset(placed.effect.label for placed in self.effects)

    @property
    def kinds(self) -> frozenset[tuple[str, str]]:
        """Kinds of the effects, whatever their form."""
        return frozenset(placed.effect.kind for placed in self.effects)

    @property
    def size(self) -> int:
        """Number of values that the effects have."""
        return sum(len(placed.values) for placed in self.effects)
