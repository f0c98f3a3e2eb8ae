from __future__ import annotations

import numba
import numpy as np
from scipy import stats

from shaftline.envs.randomness import _bits, normal
from shaftline.envs.records import EPISODE


@numba.njit  # kept nowhere: code compiled here would outlive a change of the generator
def _many(episode, count):  # type: ignore[no-untyped-def]
    out = np.empty(count)
    for i in range(count):
        out[i] = normal(episode)
    return out


def _numbers(seed: int, count: int) -> np.ndarray:
    episode = np.zeros(1, EPISODE)[0]
    episode["random"] = seed
    return np.asarray(_many(episode, count))


def test_numbers_are_standard_normal_and_independent() -> None:
    x = _numbers(1, 1_000_000)
    assert stats.kstest(x, "norm").pvalue > 1e-3
    for moment, expected in ((2, 1.0), (4, 3.0), (6, 15.0)):
        assert abs(np.mean(x**moment) / expected - 1.0) < 0.02
    # the tail has code of its own
    for side in (x, -x):
        assert abs(np.mean(side > 3.5) / stats.norm.sf(3.5) - 1.0) < 0.2
        assert np.sum(side > 3.72) > 50  # beyond every layer
    # the layers' edges too: each bin of a fine histogram has its share
    counts, edges = np.histogram(x, np.linspace(-3.0, 3.0, 121))
    expected = len(x) * np.diff(stats.norm.cdf(edges))
    assert np.sum((counts - expected) ** 2 / expected) < stats.chi2.ppf(0.999, 119)
    for lag in (1, 2, 5):
        assert abs(np.corrcoef(x[:-lag], x[lag:])[0, 1]) < 4e-3


def test_the_stream_follows_its_seed() -> None:
    assert np.array_equal(_numbers(7, 1000), _numbers(7, 1000))
    assert not np.array_equal(_numbers(7, 1000), _numbers(8, 1000))


def test_the_bits_are_splitmix64s() -> None:
    """The published sequence of seed 1234567 (Steele, Lea & Flood 2014, reference implementation)."""
    episode = np.zeros(1, EPISODE)[0]
    episode["random"] = 1234567
    published = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    assert [int(_bits(episode)) for _ in published] == published
