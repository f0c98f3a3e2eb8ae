"""The true ships of the study on what a diagnosis is worth, and its figures by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions import diagnosed_ships as study
from shaftline.plant import load_ship
from shaftline.validation.equivalents import comparable, names_of
from shaftline.validation.simulator.effects import BY_KEY, EFFECTS, FRIGATE

TRUTHS = study.draw_truths()


def test_each_true_ship_has_two_effects_that_no_other_has() -> None:
    keys = [key for truth in TRUTHS for key in truth.sizes]
    assert len(TRUTHS) == 10
    assert len(keys) == len(set(keys)) == 20
    for truth in TRUTHS:
        for key, size in truth.sizes.items():
            assert 0.4 <= size / BY_KEY[key].most <= 0.8


def test_every_effect_that_counts_has_a_key_of_a_ship_file() -> None:
    ship = load_ship("frigate")
    for effect in EFFECTS:
        if effect.ship == FRIGATE and comparable(effect) and effect.window is None:
            names = list(names_of(effect))
            key = study.key_of(effect.key, names)
            assert key is not None, effect.key
            assert key.rpartition(".")[2] in names
            assert ship.parameter(key)
    assert study.key_of("no-such-effect/hull", ["fraction"]) is None


def table(rows: dict[str, tuple[float, float, float]]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {"ship": ship, "controller": "va-pitch", "made for": made, "reward": reward}
            for ship, rewards in rows.items()
            for made, reward in zip(study.MADE_FOR, rewards, strict=True)
        ]
    )


def test_the_share_is_that_of_the_sums_over_the_ships() -> None:
    """10 of 12 that the ship of the file loses come back on one ship, -1 of 3 on the other."""
    found = study.recovered_share(
        table({"a": (400.0, 410.0, 412.0), "b": (300.0, 299.0, 303.0)}), "va-pitch"
    )
    assert found["lost"] == pytest.approx(7.5)
    assert found["recovered"] == pytest.approx(4.5)
    assert found["share"] == pytest.approx(9.0 / 15.0)
    assert found["share_low"] == pytest.approx(-1.0 / 3.0)
    assert found["share_high"] == pytest.approx(10.0 / 12.0)


def test_a_share_of_nothing_is_none() -> None:
    found = study.recovered_share(table({"a": (400.0, 401.0, 400.0)}), "va-pitch")
    assert np.isnan(found["share"])


def test_the_page_names_ships_shares_and_commands(tmp_path: Path) -> None:
    returns = {"file": 400.0, "corrected": 409.0, "true": 410.0, "randomised": 402.0}
    rows = [
        {"ship": "ship-01", "controller": kind, "made for": made, "reward": reward}
        for kind in study.KINDS
        for made, reward in returns.items()
        if made != "randomised" or kind == "PPO"
    ]
    ships = {
        "ship-01": {
            "true": {"hull.fouling_fraction": 0.4},
            "corrected": {"hull.fouling_fraction": 0.38},
            "verdict": "explained",
            "named": ["hull-fouling"],
        }
    }
    text = study.write(tmp_path, ships, pd.DataFrame(rows)).read_text(encoding="utf-8")
    assert "| PPO | 400.0 | 409.0 | 410.0 | 402.0 | 10.0 | 9.0 | 90 % (90 to 90) |" in text
    assert "hull.fouling_fraction = 0.4 | 0.38 | explained | hull-fouling" in text
    assert "shaftline train --task speed-keeping --ship out/found/corrected_ship.toml" in text
    assert (tmp_path / "figures" / "diagnosed-ships.png").stat().st_size > 5_000
