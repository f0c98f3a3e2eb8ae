"""Base class of the controllers: measurements, controller state, shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.baselines import Controller, Measurements, measurements_of
from shaftline.baselines.controller import OBSERVED, resume_state
from shaftline.plant import Ship, load_ship


class Counting(Controller):
    """Command the measured pitch, and the first fuel rack plus the number of calls."""

    def initial_state(self, signals: Measurements) -> NDArray[Any]:
        return signals.fuel_rack[:, None].copy()

    def act(self, signals: Measurements, memory: NDArray[Any]) -> Any:
        memory += 1.0
        return signals.pitch_ratio, memory[:, 0]


ROW = [8.0, 9.0, 1e5, 1.2, 15.0, 7.0, 6.6, 1.0]


def test_measurements_by_name() -> None:
    assert Measurements._fields == (
        "speed_order",
        "shaft_speed",
        "shaft_torque",
        "pitch_ratio",
        "fuel_rack",
        "ship_speed",
        "advance_velocity",
        "estimate_valid",
        "wave_inflow",
    )
    assert OBSERVED == (
        "speed_order",
        "shaft_speed",
        "measured_shaft_torque",
        "measured_pitch_ratio",
        "fuel_rack",
        "measured_ship_speed",
        "estimated_advance_velocity",
        "estimate_valid",
    )
    signals = measurements_of([ROW, ROW])
    assert [column.tolist() for column in signals[:8]] == [[x, x] for x in ROW]
    assert all(column.shape == (1,) for column in measurements_of(np.array(ROW, np.float32))[:8])
    assert measurements_of(np.array(ROW, np.float32)).shaft_torque.dtype == np.float64


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


def test_state_continues_until_an_episode_begins(frigate: Ship) -> None:
    controller, rows = Counting(frigate), np.array([ROW, ROW])
    _, first = controller.predict(rows)
    _, second = controller.predict(rows, first)
    assert second.ravel().tolist() == [17.0, 17.0]
    assert first.ravel().tolist() == [16.0, 16.0]  # the argument is not changed
    _, again = controller.predict(rows, second, np.array([False, True]))
    assert again.ravel().tolist() == [18.0, 16.0]
    _, all_again = controller.predict(rows, second, True)
    assert all_again.ravel().tolist() == [16.0, 16.0]


def test_resume_state_copies_and_keeps_the_dtype() -> None:
    fresh = np.array([[1.0], [2.0]])
    begun = resume_state(None, fresh, None)
    begun += 1.0
    assert fresh.ravel().tolist() == [1.0, 2.0]
    assert resume_state([[3], [4]], fresh, [False, False]).dtype == np.float64
    kind = np.dtype([("a", np.int64), ("b", np.float64)])
    state, new = np.zeros(2, kind), np.ones(2, kind)
    assert resume_state(state, new, [True, False])["b"].tolist() == [1.0, 0.0]
