"""FitPercent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.mismatch import fit_percent
from shaftline.mismatch.judge.held_out import fit_percents

Y = np.sin(np.linspace(0.0, 9.0, 100))


def test_perfect_is_100_and_the_mean_0() -> None:
    assert fit_percent(Y, Y) == 100.0
    assert fit_percent(Y, np.full(100, Y.mean())) == pytest.approx(0.0, abs=1e-9)


def test_it_is_the_distance_over_the_spread() -> None:
    # off by 1 everywhere: norm 2, over the norm sqrt(2 (1.5^2 + 0.5^2)) of 1, 2, 3, 4 about 2.5
    assert fit_percent([1.0, 2.0, 3.0, 4.0], [2.0, 3.0, 4.0, 5.0]) == pytest.approx(
        100.0 * (1.0 - 2.0 / math.sqrt(5.0))
    )


@pytest.mark.parametrize("level", [0.0, 1.4, 0.1 + 0.2, -7e6])
def test_a_constant_channel_has_none(level: float) -> None:
    constant = np.full(1001, level)
    constant[::2] *= 1.0 + 1e-15  # what resampling leaves
    assert math.isnan(fit_percent(constant, constant + 0.01))
    moving = constant.copy()
    moving[7] += 1e-6 * max(abs(level), 1.0)
    assert math.isfinite(fit_percent(moving, constant))


def test_constant_channels_are_left_out_and_only_some_rows_judged() -> None:
    rows = np.arange(50, 100)
    stays = np.where(np.arange(100) < 50, Y, 1.2)
    found = fit_percents({"moves": Y, "stays": stays}, {"moves": 0.9 * Y, "stays": Y}, rows)
    assert found == {"moves": fit_percent(Y[50:], 0.9 * Y[50:])}
