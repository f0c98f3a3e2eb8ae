"""Result of a method of identification: estimates and their covariance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray


@dataclass(frozen=True)
class MethodResult:
    """Estimates of a method of identification.

    Args:
        keys: dotted keys of n parameters.
        values: estimates, each in its key's unit.
        covariance: covariance of the estimates, shape (n, n), in these units.
        tables: intermediate results by file name without extension: states, frequency responses, steps
            of the search.
        remarks: remarks on the estimates, a sentence each.
        score: 2 log L; 0 if the method has none.
        line: whether the commands were interpolated linearly between rows; otherwise they were held.
        freedom: degrees of freedom of each variance [-], shape (n,); None for infinitely many.

    >>> found = MethodResult(("a.b", "a.c"), (1.0, 2.0), np.array([[0.04, 0.0], [0.0, 0.09]]))
    >>> found.standard_errors
    array([0.2, 0.3])
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
        """Standard error of each estimate, in its key's unit."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def degrees(self) -> NDArray[np.float64]:
        """Degrees of freedom of each variance [-]; infinite without ``freedom``."""
        return np.full(len(self.keys), np.inf) if self.freedom is None else self.freedom

    def mix_with(self, other: MethodResult, share: float) -> MethodResult:
        """Return these estimates with the uncertainty that another model of the data is the true one.

        The covariance is that of the mixture of both models about these estimates.

        Args:
            other: estimates of the same parameters by the other model.
            share: probability of the other model [-].
        """
        if not share > 0.0:
            return self
        apart = np.array(other.values) - np.array(self.values)
        there = other.covariance + np.outer(apart, apart)
        return replace(self, covariance=(1.0 - share) * self.covariance + share * there)

    @property
    def correlation(self) -> NDArray[np.float64]:
        """Correlation of the estimates, shape (n, n)."""
        scale = np.where(self.standard_errors > 0.0, self.standard_errors, 1.0)
        own: Any = self.covariance / np.outer(scale, scale)
        return np.asarray(own)
