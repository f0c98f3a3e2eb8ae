"""Dropouts and spikes are mended and told of; events of a voyage are left alone."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.checks import find_spikes
from shaftline.plant import RecordingError

from .conftest import Load
from .trials import NOISE

TORQUE = "shaft_torque_N_m"


def noisy(rows: int = 600) -> np.ndarray:
    noise = np.random.default_rng(0).standard_normal(rows)
    return np.asarray(np.sin(0.02 * np.arange(rows)) + 0.02 * noise)


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("size", [-5.0, 5.0, 1e300])
def test_what_jumps_away_and_back_is_found(width: int, size: float) -> None:
    values, true = noisy(), np.zeros(600, dtype=bool)
    for first in (2, 50, 300, 310, 600 - width - 2):
        true[first : first + width] = True
    values[true] += size
    np.testing.assert_array_equal(find_spikes(values), true)


def test_events_that_stay_longer_or_do_not_come_back_are_none() -> None:
    step, pulse, still = noisy(), noisy(), np.zeros(600)
    step[300:] += 5.0
    pulse[300:304] += 5.0  # four rows
    still[300:] = 1.0
    still[400] = 2.0
    for values in (noisy(), step, pulse, still, np.zeros(2), np.zeros(0)):
        assert not find_spikes(values).any()


def test_they_are_mended_before_anything_is_made_of_them(load: Load, calm: pd.DataFrame) -> None:
    hit = np.random.default_rng(3).random(len(calm)) < 0.02
    hit[:2] = hit[-2:] = False
    for lost in (0.0, 3e9):  # a dropout; and what no ship reaches
        found = load(calm.assign(**{TORQUE: calm[TORQUE].where(~hit, lost)}))
        np.testing.assert_allclose(found[TORQUE], calm[TORQUE], atol=12.0 * NOISE[TORQUE])
        (said,) = (said for said in found.warnings if "spikes" in said)
        assert f"{TORQUE}: {hit.sum()} of {len(calm)} values" in said
        assert f"first in row {np.argmax(hit) + 1} ({lost:.4g} N m)" in said


def test_a_channel_of_little_else_is_refused(load: Load, calm: pd.DataFrame) -> None:
    table = calm.copy()
    table.loc[np.arange(5, len(calm) - 5, 12), TORQUE] = 0.0
    with pytest.raises(
        RecordingError, match=rf"{TORQUE}: \d+ of 1800 values are spikes .* at most 5%"
    ):
        load(table)


def test_orders_are_never_mended(load: Load, calm: pd.DataFrame) -> None:
    table = calm.copy()
    table.loc[700, "fuel_rack_mm"] = 30.0
    assert load(table)["fuel_rack_mm"][700] == 30.0
