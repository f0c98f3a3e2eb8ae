"""What the base class does for all: readings, memory, shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.baselines import Controller, Readings, readings
from shaftline.baselines.controller import OBSERVED, resumed
from shaftline.plant import Ship, load_ship


class Counting(Controller):
    """Commands the measured pitch, and a rack that counts the calls from the first rack seen."""

    def fresh(self, seen: Readings) -> NDArray[Any]:
        return seen.fuel_rack[:, None].copy()

    def act(self, seen: Readings, memory: NDArray[Any]) -> Any:
        memory += 1.0
        return seen.pitch_ratio, memory[:, 0]


ROW = [8.0, 9.0, 1e5, 1.2, 15.0, 7.0, 6.6, 1.0]


def test_readings_have_their_names() -> None:
    assert Readings._fields == (
        "speed_order", "shaft_speed", "shaft_torque", "pitch_ratio", "fuel_rack", "ship_speed",
        "advance_velocity", "estimate_valid", "wave_inflow",
    )  # fmt: skip
    assert OBSERVED == (
        "speed_order", "shaft_speed", "measured_shaft_torque", "measured_pitch_ratio", "fuel_rack",
        "measured_ship_speed", "estimated_advance_velocity", "estimate_valid",
    )  # fmt: skip
    seen = readings([ROW, ROW])
    assert [column.tolist() for column in seen[:8]] == [[x, x] for x in ROW]
    assert all(column.shape == (1,) for column in readings(np.array(ROW, np.float32))[:8])
    assert readings(np.array(ROW, np.float32)).shaft_torque.dtype == np.float64


def test_a_ship_may_be_given_by_name(frigate: Ship) -> None:
    by_name, by_ship = Counting("ferry"), Counting(frigate, 0.25)
    assert by_name.ship == load_ship("ferry")
    assert (by_name.interval_s, by_ship.interval_s) == (0.5, 0.25)
    assert by_ship.plant == frigate.record()
    assert Counting().ship == frigate


def test_one_observation_or_many(frigate: Ship) -> None:
    controller = Counting(frigate)
    one, memory = controller.predict(ROW)
    assert one.shape == (2,)
    assert one.dtype == np.float32
    assert one == pytest.approx([0.5, 16.0 / 20.0 - 1.0])  # P/D 0.6 to 1.4, rack 0 to 40 mm
    assert memory.tolist() == [[16.0]]
    many, memory = controller.predict(np.array([ROW, ROW]))
    assert many.shape == (2, 2)
    assert np.array_equal(many, [one, one])
    table, _ = controller.predict(np.array([ROW]))
    assert table.shape == (1, 2)


def test_memory_goes_on_until_an_episode_begins(frigate: Ship) -> None:
    controller, rows = Counting(frigate), np.array([ROW, ROW])
    _, first = controller.predict(rows)
    _, second = controller.predict(rows, first)
    assert second.ravel().tolist() == [17.0, 17.0]
    assert first.ravel().tolist() == [16.0, 16.0]  # what was passed in stays untouched
    _, again = controller.predict(rows, second, np.array([False, True]))
    assert again.ravel().tolist() == [18.0, 16.0]
    _, all_again = controller.predict(rows, second, True)
    assert all_again.ravel().tolist() == [16.0, 16.0]


def test_resumed_copies_and_keeps_the_kind_of_memory() -> None:
    fresh = np.array([[1.0], [2.0]])
    begun = resumed(None, fresh, None)
    begun += 1.0
    assert fresh.ravel().tolist() == [1.0, 2.0]
    assert resumed([[3], [4]], fresh, [False, False]).dtype == np.float64
    kind = np.dtype([("a", np.int64), ("b", np.float64)])
    state, new = np.zeros(2, kind), np.ones(2, kind)
    assert resumed(state, new, [True, False])["b"].tolist() == [1.0, 0.0]
