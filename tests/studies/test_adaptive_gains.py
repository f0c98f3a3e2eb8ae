"""The table of adaptive gains: its bounds, its words, and one cell computed anew."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import get_observer
from shaftline.observers.metrics import with_noise
from shaftline.studies import adaptive_gains as study
from shaftline.studies.adaptive_gains import BEST_FIXED, NAMES, ORACLE, TOLD

CASE = study.Case("state-6", 22.0, 1.4)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return study.scored([CASE], (30.0, 60.0), 1)


def test_cells_are_the_mean_of_what_is_accounted_for(table: pd.DataFrame) -> None:
    clean = study.readings(CASE, study.SEA_SEED)
    white = np.random.default_rng(study.NOISE_SEED).standard_normal(clean.shape)
    noisy = with_noise(clean, 60.0, white)
    own = study.accounted_for(get_observer("immersion-invariance-adaptive"), noisy)
    cell = table[table["snr_db"] == 60.0].iloc[0]
    assert cell["adaptive, optimal"] == pytest.approx(own)
    assert 90.0 < own < 100.0


def test_the_filter_is_told_the_noise_as_it_is() -> None:
    clean = study.readings(CASE, study.SEA_SEED)
    white = np.random.default_rng(1).standard_normal(clean.shape)
    noise = (with_noise(clean, 45.0, white) - clean).std(axis=0)
    told = study.told_the_noise(clean, 45.0)
    assert told.speed_noise == pytest.approx(noise[0], rel=0.02)
    assert told.torque_noise == pytest.approx(noise[1], rel=0.02)


def test_the_oracle_bounds_the_grid_and_the_single_gain(table: pd.DataFrame) -> None:
    gains = [float(gain) for gain in study.GRID]
    assert (table[ORACLE] == table[gains].max(axis=1)).all()
    assert (table[ORACLE] >= table[BEST_FIXED]).all()
    assert table[BEST_FIXED].mean() == pytest.approx(table[gains].mean().max())
    for row in table.to_dict("records"):
        assert row[row["gain"]] == row[ORACLE]
    assert table["gain"].iloc[0] < 0.5 * table["gain"].iloc[1]  # more noise, less gain


def test_one_setting_is_near_the_oracle_at_either_noise(table: pd.DataFrame) -> None:
    assert (table["adaptive, optimal"] > table[ORACLE] - 2.0).all()
    for name in ("I&I, gamma 1", "I&I, gamma 4", "I&I, gamma 20"):
        assert (table[name] < table[ORACLE] - 2.0).any()


def test_tables_and_words(table: pd.DataFrame) -> None:
    by_snr = study.by_snr(table).set_index("observer")
    assert list(by_snr.columns) == ["30 dB", "60 dB", "mean"]
    assert set(by_snr.index) == {*NAMES, TOLD, BEST_FIXED, ORACLE}
    assert by_snr.loc[ORACLE, "30 dB"] == pytest.approx(table[ORACLE].iloc[0])
    by_sea = study.by_sea(table)
    assert by_sea["sea"].tolist() == ["state-6"]
    assert by_sea[ORACLE].iloc[0] == pytest.approx(table[ORACLE].mean())
    words = study.meaning(table)
    assert f"mean of {table['adaptive, optimal'].mean():.1f} %" in words
    assert "{" not in words
    assert study.drawn(table).axes[0].get_xlabel() == "signal-to-noise ratio [dB]"
