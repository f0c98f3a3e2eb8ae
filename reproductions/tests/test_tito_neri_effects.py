"""The catalogue on Tito Neri's five steady states."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from reproductions.tito_neri import effects
from shaftline.cli import tour_command
from shaftline.plant import load_ship


def test_errors_are_those_of_the_settled_simulation() -> None:
    points = tour_command.operating_points().query("model == 'tito-neri-sine'")
    found = effects.errors(load_ship("tito-neri-sine"))
    assert found[:, 0] == pytest.approx(points["speed_error_percent"].to_numpy(), abs=1e-3)
    assert found[:, 1] == pytest.approx(points["current_error_percent"].to_numpy(), abs=1e-3)


def test_a_dead_zone_brings_the_sine_set_nearer() -> None:
    ship = load_ship("tito-neri-sine")
    every = np.arange(5)
    value = effects.fit_effect(ship, "command-dead-zone", every)
    corrected = ship.with_values({"prime_mover.command_dead_zone_V": value})
    before = effects.rms(effects.errors(ship))
    assert effects.rms(effects.errors(corrected)) < 0.7 * before


def test_findings_say_so_where_nothing_is_missing() -> None:
    rows = [("a", "one", 1.0, "k", 2.0, 1.9, 1.95), ("a", "two", 1.0, "k", 2.0, 1.9, 1.97)]
    columns = [
        "model",
        "effect",
        "value",
        "key",
        "before_percent",
        "after_percent",
        "unseen_percent",
    ]
    said = effects.findings(pd.DataFrame(rows, columns=columns))
    assert "do not show that anything is missing" in said
    assert "not decided" in said
