from __future__ import annotations

import numpy as np
import pytest

from shaftline.baselines.combinator import Combinator, combinator_curve, curve_through, full_pitch
from shaftline.baselines.steady_points import steady_point
from shaftline.plant import Ship, ShipError, load_ship

from .voyage import sail

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


@by_ship
def test_curve_is_the_standard_one(ship: Ship) -> None:
    curve = combinator_curve(ship)
    early, late = curve.lever <= 0.45, curve.lever > 0.45
    assert np.ptp(curve.shaft_speed[early]) < 1e-12
    assert np.all(np.diff(curve.pitch_ratio[early]) > 0)
    assert np.ptp(curve.pitch_ratio[late]) < 1e-12
    assert np.all(np.diff(curve.shaft_speed[late]) > 0)
    shares = [
        steady_point(ship, n, p).torque_share
        for n, p in zip(curve.shaft_speed, curve.pitch_ratio, strict=True)
    ]
    assert max(shares) == pytest.approx(0.97, abs=1e-4)


@by_ship
@pytest.mark.parametrize("share", [0.45, 0.7, 0.95])
def test_ordered_speed_is_reached_in_calm_water(ship: Ship, share: float) -> None:
    combinator = Combinator(ship)
    order = share * combinator.curve.ship_speed[-1]
    end = sail(combinator, ship, order, 900.0)[-1]
    assert end.ship_speed == pytest.approx(order, rel=0.01)
    assert end.shaft_speed == pytest.approx(float(combinator.set_points(order)[1]), rel=1e-3)


@by_ship
def test_resistance_costs_speed_at_the_same_lever(ship: Ship) -> None:
    combinator = Combinator(ship)
    order = 0.8 * combinator.curve.ship_speed[-1]
    end = sail(combinator, ship, order, 900.0, resistance=1.15)[-1]
    assert end.ship_speed == pytest.approx(combinator.steady(order, 1.15).ship_speed, rel=1e-3)
    assert 0.95 * order < end.ship_speed < 0.99 * order


def test_episodes_begin_afresh_and_batches_equal_singles() -> None:
    combinator = Combinator("frigate")
    rows = np.array(
        [[8.0, 9.0, 1e5, 1.2, 15.0, 7.0, 6.6, 1.0], [11.0, 12.0, 2e5, 1.3, 28.0, 9.0, 8.5, 0.0]]
    )
    actions, state = combinator.predict(rows)
    assert actions.dtype == np.float32
    assert actions.shape == (2, 2)
    assert state.shape == (2, 1)
    again, later = combinator.predict(rows, state + 5.0, np.array([True, False]))
    np.testing.assert_array_equal(again[0], actions[0])
    assert later[1, 0] != state[1, 0]
    single, _ = combinator.predict(rows[1])
    np.testing.assert_array_equal(single, actions[1])
    assert np.all(np.abs(actions) <= 1.0)


def test_bad_curves_are_refused() -> None:
    ferry = SHIPS[1]
    with pytest.raises(ValueError, match="must rise"):
        curve_through(ferry, [0, 1], [0.8, 0.5], [50.0, 40.0])
    with pytest.raises(ValueError, match="out of range"):
        combinator_curve(ferry, full_pitch_lever=1.0)
    with pytest.raises(ShipError, match="diesel"):
        full_pitch(load_ship("tito-neri-sine"))
