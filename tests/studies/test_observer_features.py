"""The comparison of observers as features: its statistics, and all of it in small."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.agents.evaluation.episodes import Setting
from shaftline.envs import DEFAULTS
from shaftline.studies.policies import observer_features
from shaftline.studies.policies.observer_features import difference, recovered


def _scores(mean: float, seeds: int = 6, spread: float = 0.1) -> Any:
    rng = np.random.default_rng(round(-100.0 * mean))
    return mean + spread * rng.standard_normal((seeds, 1)) + rng.standard_normal((seeds, 40))


def test_share_of_the_oracles_gain() -> None:
    share, low, high = recovered(_scores(-10.0), _scores(-6.0), _scores(-5.0))
    assert share == pytest.approx(0.8, abs=0.1)
    assert low < share < high
    assert high - low < 0.5


def test_a_difference_is_judged_by_the_training_seeds() -> None:
    worse, better = _scores(-10.0, spread=3.0), _scores(-9.0, spread=3.0)
    _, low, high = difference(better, worse)  # episodes alone would call it clear
    assert low < 0.0 < high
    gain, low, high = difference(_scores(-6.0), _scores(-10.0))
    assert low < gain < high
    assert low > 3.0


def test_page_and_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shaftline.agents.learning import training

    from ..agents import tiny

    monkeypatch.setattr(observer_features, "OBSERVERS", ("none", "oracle"))
    monkeypatch.setattr(observer_features, "Setting", functools.partial(Setting, episode_s=20.0))
    monkeypatch.setattr(training, "DEFAULTS", replace(DEFAULTS, episode_s=20.0))
    changes = {"n_envs": 4, "n_timesteps": 128, "legs": 1, "hyperparameters": tiny.PPO}
    page = observer_features.study(
        tmp_path / "out", tmp_path / "work", "transit", 2, 3, changes, 1, "the command"
    )
    table = pd.read_csv(tmp_path / "out" / "observers.csv")
    assert set(zip(table["instruments"], table["observer"], strict=True)) == {
        (noise, observer) for noise in ("clean", "noisy") for observer in ("none", "oracle")
    }
    assert np.isfinite(table[["reward", "gain over none", "fuel_kg_nmi"]]).all(axis=None)
    assert (table.loc[table["observer"] == "none", "gain over none"] == 0.0).all()
    crossed = pd.read_csv(tmp_path / "out" / "crossed.csv", index_col=0)
    noisy = table[table["instruments"] == "noisy"].set_index("observer")["reward"]
    for name in noisy.index:
        assert crossed.loc[name, f"run with {name}"] == pytest.approx(noisy[name])
    assert "`the command`" in page.read_text(encoding="utf-8")
