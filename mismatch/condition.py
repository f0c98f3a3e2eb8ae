"""Condition monitoring: which parameters of a ship have changed since its reference recordings.

The same parameters are identified in every recording by itself. The reference recordings give the
normal value m of a parameter and the scatter tau between recordings that its standard errors do not
explain (moment estimator of DerSimonian and Laird 1986, Controlled Clinical Trials 7(3)). The change
y - m of a later estimate y with standard error s has the variance

    s^2 + tau^2 + var(m),

with one degree of freedom less than there are references (as the prediction interval of Higgins,
Thompson and Spiegelhalter 2009, J. R. Stat. Soc. A 172(1)). This is exact where the scatter exceeds the
standard errors; where it is smaller, there are fewer false alarms than stated. An alarm is a change
beyond Student's t at the false-alarm risk of one recording, which is divided by the number of
parameters. The detection limit is the change that raises an alarm in 90 % of the recordings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy

from ..core.statistics import half_95
from ..plant.ship import Ship

DETECTED = 0.9
"""Share of the recordings in which a change of the detection limit raises an alarm."""


class Estimated(NamedTuple):
    """Estimate of a parameter from one recording."""

    value: float
    """In the unit of the key."""
    standard_error: float
    freedom: float = math.inf
    """Degrees of freedom of the standard error [-]."""


class Baseline(NamedTuple):
    """Normal value of a parameter, from the reference recordings."""

    value: float
    """Weighted mean, in the unit of the key."""
    standard_error: float
    """Standard error of the mean."""
    scatter: float
    """Standard deviation between recordings that their standard errors do not explain."""
    freedom: float
    """Degrees of freedom of mean and scatter [-]."""


class Change(NamedTuple):
    """Change of a parameter in one recording."""

    change: float
    """Estimate less the normal value, in the unit of the key."""
    half_95: float
    """Half-width of its 95 % interval."""
    threshold: float
    """Change from which an alarm is raised."""
    detection_limit: float
    """Change that raises an alarm in 90 % of the recordings."""

    @property
    def alarm(self) -> bool:
        """Whether the change exceeds the threshold."""
        return abs(self.change) > self.threshold


def baseline_of(estimates: Sequence[Estimated]) -> Baseline:
    """Return the normal value of a parameter from its estimates in the reference recordings.

    With one reference the scatter between recordings is unknown and taken as 0.

    Examples:
        >>> normal = baseline_of([Estimated(10.2, 0.1), Estimated(9.8, 0.1), Estimated(10.0, 0.1)])
        >>> round(normal.value, 3), round(normal.scatter, 3), normal.freedom
        (10.0, 0.173, 2.0)
    """
    if len(estimates) == 1:
        (only,) = estimates
        return Baseline(only.value, only.standard_error, 0.0, only.freedom)
    values = np.array([estimate.value for estimate in estimates])
    variances = np.array([estimate.standard_error**2 for estimate in estimates])
    weights = 1.0 / variances
    mean = float(weights @ values / weights.sum())
    excess = float(weights @ (values - mean) ** 2) - (len(estimates) - 1)
    between = max(excess / float(weights.sum() - weights @ weights / weights.sum()), 0.0)
    weights = 1.0 / (variances + between)
    mean = float(weights @ values / weights.sum())
    error = float(weights.sum()) ** -0.5
    return Baseline(mean, error, math.sqrt(between), len(estimates) - 1.0)


def change_of(normal: Baseline, estimate: Estimated, risk: float) -> Change:
    """Return the change of an estimate from its normal value.

    Args:
        normal: from :func:`baseline_of`.
        estimate: estimate from a later recording.
        risk: probability of an alarm without a change, for this parameter [-].
    """
    sd = math.hypot(estimate.standard_error, normal.standard_error, normal.scatter)
    freedom = max(min(normal.freedom, estimate.freedom, 1e9), 1.0)
    threshold = float(scipy.special.stdtrit(freedom, 1.0 - 0.5 * risk)) * sd
    return Change(
        estimate.value - normal.value,
        half_95(freedom) * sd,
        threshold,
        threshold + float(scipy.special.stdtrit(freedom, DETECTED)) * sd,
    )


class Trend(NamedTuple):
    """Straight line through the estimates of the later recordings over time."""

    slope: float
    """In the unit of the key for each day, or for each recording where the dates do not differ."""
    half_95: float
    """Half-width of its 95 % interval."""


def trend_of(times: Sequence[float], estimates: Sequence[Estimated], scatter: float) -> Trend:
    """Return the weighted least-squares line through estimates over time, times not all equal."""
    weights = np.array([1.0 / (r.standard_error**2 + scatter**2) for r in estimates])
    time, value = np.asarray(times, float), np.array([r.value for r in estimates])
    away = time - weights @ time / weights.sum()
    spread = float(weights @ away**2)
    slope = float(weights @ (away * value)) / spread
    rest = value - weights @ value / weights.sum() - slope * away
    freedom = len(estimates) - 2
    # A scatter larger than expected widens the interval; a smaller one is chance.
    factor = max(float(weights @ rest**2) / freedom, 1.0)
    return Trend(slope, half_95(freedom) * math.sqrt(factor / spread))


@dataclass(frozen=True)
class Monitoring:
    """Changes of the parameters of a ship since its reference recordings.

    Args:
        ship: nominal ship.
        method: method of identification.
        risk: probability that a recording without a change raises an alarm [-].
        units: unit of each parameter, by key.
        baselines: normal value of each parameter, by key.
        changes: a row for each later recording and parameter: ``recording``, ``date``, ``key``,
            ``estimate``, ``standard_error``, ``change``, ``half_95``, ``threshold``,
            ``detection_limit``, ``alarm``. Files of the same name have their folder before it.
        references: a row for each reference recording and parameter: ``recording``, ``date``, ``key``,
            ``estimate``, ``standard_error``.
        trends: trend of each parameter, by key; empty with fewer than three later recordings.
        per: unit of time of the trends, ``day`` or ``recording``.
        failed: why a recording could not be used, by file name.
        remarks: limits of the result, a sentence each.
    """

    ship: Ship
    method: str
    risk: float
    units: Mapping[str, str]
    baselines: Mapping[str, Baseline]
    changes: pd.DataFrame
    references: pd.DataFrame
    trends: Mapping[str, Trend]
    per: str
    failed: Mapping[str, str]
    remarks: tuple[str, ...]

    @property
    def alarms(self) -> pd.DataFrame:
        """Rows of ``changes`` with an alarm."""
        return self.changes[self.changes["alarm"]]
