"""What every method of identification finds: values, and how sure they are together."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray


@dataclass(frozen=True)
class Found:
    """Numbers of a ship as one method finds them.

    Args:
        keys: dotted keys of the ship's file, n of them.
        values: each in its key's unit.
        covariance: of their errors, shape (n, n), in those units.
        tables: what the method shows on the way, by file name without extension: states, frequency
            responses, the search's steps.
        remarks: what a reader must know of it, a sentence each.
        score: 2 log L where the method has one, else 0.
        line: whether the demands were taken as straight lines between rows instead of held.
        freedom: degrees of freedom of each number's variance [-], shape (n,); None where it is known as
            well as a variance of very many rows.
    """

    keys: tuple[str, ...]
    values: tuple[float, ...]
    covariance: NDArray[np.float64]
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    score: float = 0.0
    line: bool = False
    freedom: NDArray[np.float64] | None = None

    @property
    def standard_errors(self) -> NDArray[np.float64]:
        """Of each number, in its key's unit."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def degrees(self) -> NDArray[np.float64]:
        """Degrees of freedom of each number's variance; infinite where nothing is said of them."""
        return np.full(len(self.keys), np.inf) if self.freedom is None else self.freedom

    def beside(self, other: Found, share: float) -> Found:
        """Return these numbers with the doubt that another model of the same data is the true one.

        The covariance is that of the mixture of both about these values: the other's errors, and how
        far its values lie from these, count by its share.

        Args:
            other: the same numbers by the other model.
            share: probability of the other model.
        """
        if not share > 0.0:
            return self
        apart = np.array(other.values) - np.array(self.values)
        there = other.covariance + np.outer(apart, apart)
        return replace(self, covariance=(1.0 - share) * self.covariance + share * there)

    @property
    def correlation(self) -> NDArray[np.float64]:
        """Of the numbers' errors, shape (n, n)."""
        scale = np.where(self.standard_errors > 0.0, self.standard_errors, 1.0)
        own: Any = self.covariance / np.outer(scale, scale)
        return np.asarray(own)
