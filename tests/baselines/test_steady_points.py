"""Steady states at a given shaft speed: all balances by hand."""

from __future__ import annotations

import math

import pytest

from shaftline.baselines.steady_points import require_diesel, steady_point
from shaftline.plant import Schedule, Ship, ShipError, equilibrium, load_ship, simulate
from shaftline.plant.cavitation import burrill_ratio
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.open_water import open_water

from .voyage import with_blades_from


def test_every_balance_is_closed(frigate: Ship) -> None:
    rough = frigate.with_values(
        {
            "transmission.coulomb_friction_engine_side_N_m": 3000.0,
            "transmission.viscous_friction_propeller_side_N_m_s_rad": 200.0,
            "propeller.relative_rotative_efficiency": 0.98,
        }
    )
    plant, omega, pitch = rough.record(), 11.0, 1.2
    point = steady_point(rough, omega, pitch, 1.3)
    v, n = point.ship_speed, omega / (2.0 * math.pi)
    assert (point.shaft_speed, point.pitch_ratio) == (omega, pitch)
    assert 2 * (1.0 - 0.07) * point.thrust == pytest.approx(1.3 * 3306.2 * v**2, rel=1e-9)
    assert point.advance_velocity == pytest.approx(0.95 * v)
    j = point.advance_velocity / (n * 4.2)
    assert point.thrust == pytest.approx(open_water(plant["kt"], j, pitch) * 1025 * n**2 * 4.2**4)
    propeller = open_water(plant["kq"], j, pitch) * 1025 * n**2 * 4.2**5 / 0.98
    brake = (propeller + 200.0 * omega + 3000.0) / (7.38 * 0.95)
    assert point.brake_torque == pytest.approx(brake)
    engine = 7.38 * omega
    rack = (brake + 45.5 * engine + 7381.0) / 1428.6
    assert point.fuel_rack == pytest.approx(rack)
    assert point.fuel_flow == pytest.approx(2.0 * fuel_rate(plant, engine, brake))
    limit = min(15000.0 + 467.0 * (engine - 350.0 * math.pi / 30.0), 38000.0)
    assert point.torque_share == pytest.approx(brake / limit)
    loading = burrill_ratio(plant, point.thrust, point.advance_velocity, omega, pitch, 4.0)
    assert point.burrill == pytest.approx(loading)


def test_it_is_where_a_simulation_ends() -> None:
    ferry = load_ship("ferry")
    point = steady_point(ferry, 45.0, 0.8, 1.1)
    begin = equilibrium(ferry, point.fuel_rack, 0.8)
    schedule = Schedule(point.fuel_rack, 0.8, resistance_factor=1.1)
    last = simulate(ferry, schedule, 400.0, initial=begin.state)[-1]
    assert last["shaft_speed"] == pytest.approx(point.shaft_speed, rel=1e-6)
    assert last["ship_speed"] == pytest.approx(point.ship_speed, rel=1e-6)
    assert last["thrust"] == pytest.approx(point.thrust, rel=1e-6)


def test_pitch_is_commanded_within_the_range_and_the_actuators_offset_acts(frigate: Ship) -> None:
    assert steady_point(frigate, 10.0, 9.9).pitch_ratio == 1.4
    shifted = frigate.with_values({"pitch_actuator.offset": -0.1})
    plain, off = steady_point(frigate, 10.0, 1.1), steady_point(shifted, 10.0, 1.2)
    assert off.ship_speed == pytest.approx(plain.ship_speed, rel=1e-9)
    assert off.pitch_ratio == 1.2
    assert off.burrill == pytest.approx(plain.burrill, rel=1e-9)


def test_a_current_carries_the_ship_and_lags_do_not_matter(frigate: Ship) -> None:
    plain = steady_point(frigate, 10.0, 1.2)
    for speed in (1.0, -1.0):
        drifting = frigate.with_values({"hull.current_m_s": speed})
        assert steady_point(drifting, 10.0, 1.2).ship_speed == pytest.approx(
            plain.ship_speed + speed, rel=1e-9
        )
    slow = frigate.with_values({"prime_mover.lag_s": 5.0, "propeller.inflow_lag_s": 3.0})
    assert steady_point(slow, 10.0, 1.2) == pytest.approx(plain, rel=1e-12)


def test_ships_that_cannot_be_ordered_are_refused(frigate: Ship) -> None:
    with pytest.raises(
        ShipError, match=r"a governor needs a diesel, not prime_mover\.type 'dc-motor'"
    ):
        require_diesel(load_ship("tito-neri-sine"))
    towed = load_ship("frigate").model_dump(exclude_unset=True) | {"propeller": {"model": "none"}}
    with pytest.raises(ShipError, match="frigate: the controller needs a propeller"):
        require_diesel(Ship.model_validate(towed))
    with pytest.raises(ShipError, match=r"but hull\.fixed is true"):
        steady_point(frigate.with_values({"hull.fixed": True}), 10.0, 1.2)
    astern = with_blades_from(frigate, -1.0)
    with pytest.raises(ValueError, match=r"pitch ratio -0\.1 the propeller does not push"):
        steady_point(astern, 10.0, -0.1)
