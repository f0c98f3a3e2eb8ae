"""Which ship a diagnosis ends with."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.judge.correction import OF_NOISE, WORSE, FreeRunning, corrected_ship

MEASURED = np.array([0.0, 3.0, -3.0, 100.0])
NOISE = 0.5


class Ship:
    """Follows a channel with an error at every row."""

    def __init__(self, name: str, error: float) -> None:
        self.name, self.error = name, error

    def record(self) -> Ship:
        return self


def free() -> FreeRunning:
    """The last row is not set aside."""
    replay: Any = SimpleNamespace(
        recorded={"speed": MEASURED},
        noise_rms={"speed": NOISE},
        simulate_channels=lambda ship: {
            "speed": MEASURED + ship.error * np.array([1.0, -1.0, 1.0, 50.0])
        },
    )
    return FreeRunning(replay, np.array([0, 1, 2]))


def taken(*candidates: Ship, **worth: float) -> tuple[str, float, list[str]]:
    nominal: Any = Ship("nominal", 2.0)
    some: Any = candidates
    ship, gain, spoilt = corrected_ship(
        nominal, some, lambda ship: worth.get(ship.name, 0.0), free()
    )
    return ship.name, gain, spoilt


def test_the_error_is_the_rms_on_the_rows_set_aside() -> None:
    ship: Any = Ship("any", 2.0)
    assert free().errors(ship) == {"speed": pytest.approx(2.0)}


def test_the_first_that_gains_and_is_no_worse_is_taken() -> None:
    all_of_it, less = Ship("all", 1.0), Ship("less", 1.5)
    assert taken(all_of_it, less, all=50.0, less=40.0) == ("all", 50.0, [])
    assert taken(all_of_it, less, all=-1.0, less=40.0) == ("less", 40.0, [])
    assert taken(all_of_it, less) == ("nominal", 0.0, [])


def test_one_that_runs_worse_is_not_taken_however_likely() -> None:
    limit = (1.0 + WORSE) * 2.0 + OF_NOISE * NOISE
    assert taken(Ship("all", 1.001 * limit), all=500.0) == ("nominal", 0.0, ["speed"])
    assert taken(Ship("all", 0.999 * limit), all=500.0) == ("all", 500.0, [])
    assert taken(Ship("all", float("nan")), all=500.0) == ("nominal", 0.0, ["speed"])


def test_a_heading_is_judged_only_where_no_rate_of_turn_is() -> None:
    """What the rate was off since the start stands in it, right or wrong by chance."""
    measured = {"heading_rad": MEASURED, "yaw_rate_rad_s": MEASURED}
    for recorded, judged in ((measured, {"yaw_rate_rad_s"}), ({"heading_rad": MEASURED}, None)):
        replay: Any = SimpleNamespace(
            recorded=recorded,
            simulate_channels=lambda ship: dict.fromkeys(measured, MEASURED + 1.0),
        )
        ship: Any = Ship("any", 0.0)
        found = FreeRunning(replay, np.array([0, 1])).errors(ship)
        assert set(found) == (judged or {"heading_rad"})
