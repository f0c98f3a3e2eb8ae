"""The kernels' stream of random numbers is NumPy's, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.core.random_stream import fill_uniform


@pytest.mark.parametrize("seed", [0, 1, 7, 2**31 - 1, 2**31, 2**32 - 1])
def test_ends_of_the_seeds_range_give_numpys_numbers(seed: int) -> None:
    found = np.empty(1000)
    fill_uniform(seed, found)
    assert np.array_equal(found, np.random.default_rng(seed).random(1000))


def test_seeds_of_all_sizes_give_numpys_numbers() -> None:
    for seed in (np.random.default_rng(3).random(2000) * 2.0 ** np.linspace(1, 32, 2000)).astype(
        int
    ):
        found = np.empty(5)
        fill_uniform(int(seed), found)
        assert np.array_equal(found, np.random.default_rng(int(seed)).random(5)), seed
