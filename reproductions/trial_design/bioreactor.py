"""Fed-batch bioreactor with an unknown growth rate: which second experiment finds its law?

The example of Strouwen and Micluța-Câmpeanu 2026 (arXiv 2604.01231): substrate s and biomass x in g/L,
volume v in L, feed q in L/h,

    ds/dt = -mu(s) x / y + q / v (s_in - s),   dx/dt = mu(s) x - q / v x,   dv/dt = q.

The true growth rate is that of Monod. The first experiment has no feed. The feed of the second one is
constant in each of 15 hours, and the substrate is measured every hour. The published criterion is the
mean over all pairs of laws of the largest squared difference of the predicted substrate. The published
laws come from a symbolic regression; here they are ten laws of the literature and powers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
import scipy
from numpy.typing import NDArray

from shaftline.mismatch.planning.evidence import Noise, Predictions
from shaftline.mismatch.planning.exchange import exchange

from .criteria import CRITERIA, RANDOM, Criterion

Floats = NDArray[np.float64]

HOURS, STEPS = 15, 20
"""Number of intervals of the feed [h], and of integration steps in each."""

FEED_SUBSTRATE, YIELD, START = 50.0, 0.777, (1.0, 1.0, 7.0)
"""Substrate of the feed [g/L], biomass by substrate [g/g], and the first state."""

MOST_FEED = 10.0
"""Largest feed [L/h]."""

NOISES = (0.1, 0.5)
"""Standard deviations of the measured substrate [g/L]: the published one, and a harder one."""

TRIED = 5
"""Number of feeds between which the exchange chooses."""

PRIOR = 2.0
"""Standard deviation of the logarithm of a parameter before the first experiment."""

ALIKE = 6.0
"""Difference in 2 log L within which laws are indistinguishable."""


class Law(NamedTuple):
    """A growth rate of positive parameters, with their first guesses."""

    name: str
    guess: tuple[float, ...]


LAWS = (
    Law("Monod", (0.4, 4.0)),
    Law("constant", (0.05,)),
    Law("linear", (0.08,)),
    Law("Tessier", (0.4, 4.0)),
    Law("Moser", (0.2, 1.0)),
    Law("Haldane", (0.4, 4.0, 50.0)),
    Law("tanh", (0.4, 4.0)),
    Law("power", (0.08, 0.9)),
    Law("parabola", (0.1, 0.01)),
    Law("square root", (0.08,)),
)
TRUTH, TRUE = 0, np.array([0.421, 4.39])
"""Index and parameters of the true law: largest growth rate [1/h], half saturation [g/L]."""

NESTING = {"Haldane"}
"""Laws that contain the true one as a limit: no experiment refutes them."""


@numba.njit(cache=True)
def _growth(law: int, p: Floats, s: float) -> float:
    s = max(s, 0.0)
    rate: float = 0.0
    if law == 0:
        rate = p[0] * s / (p[1] + s)
    elif law == 1:
        rate = p[0] * s / (1e-3 + s)  # constant, until nothing is left
    elif law == 2:
        rate = p[0] * s
    elif law == 3:
        rate = p[0] * (1.0 - math.exp(-s / p[1]))
    elif law == 4:
        rate = p[0] * s * s / (p[1] + s * s)
    elif law == 5:
        rate = p[0] * s / (p[1] + s + s * s / p[2])
    elif law == 6:
        rate = p[0] * math.tanh(s / p[1])
    elif law == 7:
        rate = p[0] * s ** min(p[1], 3.0)
    elif law == 8:
        rate = p[0] * s - p[1] * s * s
    else:
        rate = p[0] * math.sqrt(s)
    return rate if rate > 0.0 else 0.0


@numba.njit(cache=True)
def _substrate(law: int, p: Floats, feed: Floats) -> Floats:
    """Return the substrate at every hour, shape (16,), by the classic Runge-Kutta method."""
    found = np.empty(HOURS + 1)
    state = np.array(START)
    found[0] = state[0]
    h = 1.0 / STEPS
    slope, total, trial = np.empty(3), np.empty(3), np.empty(3)
    for hour in range(HOURS):
        for _ in range(STEPS):
            total[:] = 0.0
            trial[:] = state
            for stage in range(4):
                s, x, v = trial
                rate = _growth(law, p, s) * x
                slope[0] = -rate / YIELD + feed[hour] / v * (FEED_SUBSTRATE - s)
                slope[1] = rate - feed[hour] / v * x
                slope[2] = feed[hour]
                weight = 1.0 if stage in (0, 3) else 2.0
                total += weight / 6.0 * slope
                if stage < 3:
                    trial[:] = state + (h if stage == 2 else 0.5 * h) * slope
            state = state + h * total
        found[hour + 1] = state[0]
    return found


class Fitted(NamedTuple):
    """A law fitted to experiments.

    Args:
        law: index in :data:`LAWS`.
        logs: logarithms of its parameters.
        lack: -2 log L but for a constant, with the parameters' prior.
        covariance: of the logarithms.
    """

    law: int
    logs: Floats
    lack: float
    covariance: Floats


def fit(law: int, feeds: Sequence[Floats], measured: Sequence[Floats], noise: float) -> Fitted:
    """Return a law fitted to the substrate of some experiments, from its guess with a wide prior."""
    guess = np.log(LAWS[law].guess)

    def residuals(logs: Floats) -> Floats:
        p = np.exp(logs)
        parts = [
            (_substrate(law, p, feed) - y)[1:] / noise
            for feed, y in zip(feeds, measured, strict=True)
        ]
        both = np.concatenate([*parts, (logs - guess) / PRIOR])
        return np.asarray(np.clip(np.nan_to_num(both, nan=1e6), -1e6, 1e6))

    found = scipy.optimize.least_squares(residuals, guess, method="trf", x_scale=1.0)
    slopes = np.asarray(found.jac)
    return Fitted(law, found.x, 2.0 * found.cost, np.linalg.inv(slopes.T @ slopes))


def plausible(fits: Sequence[Fitted]) -> list[Fitted]:
    """Return the laws that the experiments do not distinguish from the best one."""
    least = min(one.lack for one in fits)
    return [one for one in fits if one.lack - least < ALIKE]


def predictions_of(laws: Sequence[Fitted], feed: Floats) -> Predictions:
    """Return what laws predict for a feed, with the derivatives by unknowns of unit variance."""
    own = np.array([_substrate(one.law, np.exp(one.logs), feed) for one in laws])
    effects, owners = [], []
    for k, one in enumerate(laws):
        for direction in np.linalg.cholesky(one.covariance).T:
            step = 1e-3 / max(1.0, float(np.max(np.abs(direction))))
            changed = _substrate(one.law, np.exp(one.logs + step * direction), feed)
            effects.append((changed - own[k]) / step)
            owners.append(k)
    none = np.zeros((0, 1, HOURS + 1))
    return Predictions(
        own[:, None], none, np.zeros(0, dtype=bool), np.array(effects)[:, None], np.array(owners)
    )


class Outcome(NamedTuple):
    """What a second experiment leaves.

    Args:
        way: how its feed was chosen.
        left: names of the indistinguishable laws.
        right: whether the true law is the best one, apart from laws that contain it.
        alone: whether nothing else is left, but for laws that contain it.
    """

    way: str
    left: tuple[str, ...]
    right: bool
    alone: bool


def second_experiments(seed: int, noise: float) -> tuple[int, list[Outcome]]:
    """Return the number of laws that the first experiment leaves, and what each second one leaves."""
    generator = np.random.default_rng([20_26, seed])
    nothing = np.zeros(HOURS)

    def measure(feed: Floats) -> Floats:
        return _substrate(TRUTH, TRUE, feed) + noise * generator.standard_normal(HOURS + 1)

    first = measure(nothing)
    known = plausible([fit(k, [nothing], [first], noise) for k in range(len(LAWS))])
    start = generator.uniform(0.0, MOST_FEED, HOURS)
    feeds = {RANDOM: start}
    choices = {0: np.linspace(0.0, MOST_FEED, TRIED)}
    for way, criterion in CRITERIA.items():

        def merit(levels: Floats, criterion: Criterion = criterion) -> float:
            return criterion(predictions_of(known, levels[0]), [Noise(noise)])

        found, _ = exchange(start[None], choices, merit, sweeps=5)
        feeds[way] = found[0]
    outcomes = []
    state = generator.bit_generator.state
    for way, feed in feeds.items():
        generator.bit_generator.state = state  # equal noise in all ways
        both = [first, measure(feed)]
        fits = [fit(k, [nothing, feed], both, noise) for k in range(len(LAWS))]
        left = [LAWS[one.law].name for one in plausible(fits)]
        best = min((f for f in fits if LAWS[f.law].name not in NESTING), key=lambda f: f.lack)
        others = [name for name in left if name not in NESTING]
        right = best.law == TRUTH
        outcomes.append(Outcome(way, tuple(left), right, right and len(others) == 1))
    return len(known), outcomes
