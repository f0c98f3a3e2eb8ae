from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Equilibrium, Schedule, Ship, ShipError, equilibrium, load_ship, simulate
from shaftline.plant.drives.diesel import (
    Diesel,
    diesel_torque,
    drive_diesel,
    rack_of_torque,
    rack_torque,
    torque_limit,
)
from shaftline.plant.dynamics import settle_lags
from shaftline.plant.state import Inputs, State

GEAR = 7.38
IDLE, TOP = 350.0 * math.pi / 30.0, 1000.0 * math.pi / 30.0
STEP = 1e-30


@pytest.fixture
def plant(frigate: Ship) -> Any:
    return frigate.record()


def rack_map(engine_speed: Any, rack: Any) -> Any:
    """Brake torque of the frigate's engine, thesis Table B-1 [N m]."""
    return -45.5 * engine_speed + 1428.6 * rack - 7381.0


@pytest.mark.parametrize(("engine_speed", "rack"), [(0.0, 0.0), (78.0, 22.0), (104.0, 40.0)])
def test_rack_map_is_the_thesis_line(plant: Any, engine_speed: float, rack: float) -> None:
    expected = rack_map(engine_speed, rack)
    assert rack_torque(plant, engine_speed, rack) == pytest.approx(expected, rel=1e-14)


def test_derating_takes_its_share_of_the_torque(plant: Any) -> None:
    plant["derating"] = 0.12
    assert rack_torque(plant, 78.0, 22.0) == pytest.approx(0.88 * rack_map(78.0, 22.0), rel=1e-14)


def test_curvature_bends_the_map_about_its_speed(plant: Any) -> None:
    plant["torque_curvature"], plant["torque_curvature_speed"] = -1.5, 60.0
    for speed, bend in ((50.0, -150.0), (60.0, 0.0), (80.0, -600.0)):
        found = rack_torque(plant, speed, 22.0)
        assert found == pytest.approx(rack_map(speed, 22.0) + bend, rel=1e-14)


def test_rack_of_torque_inverts_the_rack_map(plant: Any) -> None:
    plant["derating"], plant["torque_curvature"] = 0.1, -1.5
    for speed, rack in ((40.0, 10.0), (100.0, 35.0)):
        found = rack_of_torque(plant, speed, rack_torque(plant, speed, rack))
        assert found == pytest.approx(rack, rel=1e-12)


@pytest.mark.parametrize(
    ("engine_speed", "limit"),
    [
        (IDLE, 15000.0),
        (IDLE + 10.0, 19670.0),
        (IDLE + 49.0, 37883.0),
        (IDLE + 50.0, 38000.0),
        (TOP, 38000.0),
        (IDLE - 5.0, 12665.0),
        (0.8 * IDLE, 15000.0 - 467.0 * 0.2 * IDLE),
        (0.5 * IDLE, 15000.0 - 467.0 * 0.2 * IDLE),
        (0.0, 15000.0 - 467.0 * 0.2 * IDLE),
        (-200.0, 15000.0 - 467.0 * 0.2 * IDLE),
    ],
)
def test_envelope_rises_from_idle_speed_and_is_flat(
    plant: Any, engine_speed: float, limit: float
) -> None:
    assert torque_limit(plant, engine_speed) == pytest.approx(limit, rel=1e-12)


def test_steep_envelope_falls_to_half_its_torque_at_idle_speed_and_no_further(plant: Any) -> None:
    plant["torque_limit_slope"] = 15000.0 / 4.0
    assert torque_limit(plant, IDLE - 1.0) == pytest.approx(11250.0)
    for speed in (IDLE - 2.0, 0.9 * IDLE, 0.0, -IDLE):
        assert torque_limit(plant, speed) == pytest.approx(7500.0)


def test_engine_without_an_idle_speed_is_refused(frigate: Ship) -> None:
    with pytest.raises(ShipError, match=r"speed_min_rpm.*greater than 0"):
        frigate.with_values({"prime_mover.speed_min_rpm": 0.0})


def test_no_ceiling_brakes_the_engine(plant: Any) -> None:
    """One that was driven has a negative share of the rated power."""
    plant["charge_lag"], plant["smoke_limit"], plant["smoke_limit_rise"] = 4.0, 1e4, 1e5
    for share, torque in ((-0.05, 5e3), (-0.3, 0.0)):
        assert drive_diesel(plant, 78.0, 40.0, 0.0, share, 0.0).brake_torque == pytest.approx(
            torque
        )


def test_torque_stays_inside_the_envelope(plant: Any) -> None:
    corner = IDLE + 23000.0 / 467.0  # where the envelope turns flat
    at_corner = (38000.0 + 7381.0 + 45.5 * corner) / 1428.6
    below, above = (diesel_torque(plant, corner, at_corner + d) for d in (-0.1, 0.1))
    assert below == pytest.approx(38000.0 - 142.86, rel=1e-9)
    assert above == pytest.approx(38000.0, rel=1e-12)
    assert diesel_torque(plant, IDLE, 40.0) == pytest.approx(15000.0)
    assert diesel_torque(plant, TOP, 0.0) == pytest.approx(rack_map(TOP, 0.0))  # brakes below


def test_beyond_the_envelope_the_rack_has_no_slope(plant: Any) -> None:
    inside, beyond = (
        complex(diesel_torque(plant, 78.0 + 0j, rack + STEP * 1j)).imag / STEP
        for rack in (20.0, 40.0)
    )
    assert inside == pytest.approx(1428.6)
    assert beyond == 0.0


def test_without_a_lag_the_torque_is_the_maps(plant: Any) -> None:
    torque, rate, *_ = drive_diesel(plant, 78.0, 22.0, 123.0, 0.0, 0.0)
    assert torque == pytest.approx(rack_map(78.0, 22.0))
    assert rate == 0.0


def test_lagging_torque_is_in_force_and_follows(plant: Any) -> None:
    plant["engine_lag"] = 1.5
    torque, rate, *_ = drive_diesel(plant, 78.0, 22.0, 9000.0, 0.0, 0.0)
    assert torque == 9000.0
    assert rate == pytest.approx((rack_map(78.0, 22.0) - 9000.0) / 1.5, rel=1e-12)


def test_record_holds_its_speeds_in_radians_and_a_rack_that_ends_at_nothing(plant: Any) -> None:
    assert plant["engine_speed_min"] == pytest.approx(36.6519, abs=1e-4)
    assert plant["engine_speed_max"] == pytest.approx(104.7198, abs=1e-4)
    assert (plant["drive_min"], plant["drive_max"]) == (0.0, 40.0)
    assert plant["rack_rate_limit"] == math.inf
    assert plant["prime_mover"] == Diesel.code == 0


def test_it_is_driven_by_its_rack() -> None:
    assert Diesel.balance == "engine"
    assert Diesel.demand.column == "fuel_rack_mm"
    assert (Diesel.demand.low, Diesel.demand.high, Diesel.demand.unit) == (0, 200, "mm")


def test_a_base_consumption_needs_a_rated_power() -> None:
    ferry = load_ship("ferry")
    tree = ferry.model_dump(exclude_unset=True)
    del tree["prime_mover"]["fuel_rated_power_W"]
    with pytest.raises(ValueError, match="fuel_rated_power_W is missing"):
        Ship.model_validate(tree)
    tree["prime_mover"]["fuel_base_g_kWh"] = 0.0
    assert Ship.model_validate(tree).name == "ferry"
    with pytest.raises(ShipError, match="fuel_base_g_kWh"):
        ferry.with_values({"prime_mover.fuel_base_g_kWh": -1.0})


def test_running_speeds_are_in_order(frigate: Ship) -> None:
    close = frigate.with_values({"prime_mover.speed_min_rpm": 999.9})
    assert close.shaft_speeds[0] < close.shaft_speeds[1]
    with pytest.raises(ShipError, match=r"speed_min_rpm = .* must be below speed_max_rpm"):
        frigate.with_values({"prime_mover.speed_min_rpm": 1000.0})


def rack_step(ship: Ship, to: float, start: Equilibrium, duration: float = 20.0) -> NDArray[Any]:
    return simulate(ship, Schedule(to, 1.4), duration, initial=start.state)


def test_brake_torque_of_a_steady_ship_is_the_rack_map(frigate: Ship) -> None:
    found = equilibrium(frigate, 20.0, 1.2)
    expected = rack_map(GEAR * found.state.shaft_speed, 20.0)
    assert found.outputs.brake_torque == pytest.approx(expected, rel=1e-12)


def test_engine_stays_inside_its_envelope_on_a_voyage(frigate: Ship) -> None:
    samples = rack_step(frigate, 40.0, equilibrium(frigate, 9.4, 1.4), 60.0)
    limit = np.minimum(15000.0 + 467.0 * (GEAR * samples["shaft_speed"] - IDLE), 38000.0)
    assert np.all(samples["brake_torque"] <= limit * (1.0 + 1e-12))
    assert samples["brake_torque"][0] == pytest.approx(limit[0])  # the step does reach it


def test_engine_lag_is_first_order(frigate: Ship) -> None:
    heavy = {"transmission.inertia_engine_side_kg_m2": 1e9}  # keeps its speed whatever the torques
    ship = frigate.with_values({**heavy, "prime_mover.lag_s": 1.5})
    start = equilibrium(ship, 20.0, 1.4)
    samples = rack_step(ship, 25.0, start, 6.0)
    rise = (samples["brake_torque"] - start.outputs.brake_torque) / (5.0 * 1428.6)
    np.testing.assert_allclose(rise, 1.0 - np.exp(-samples["time"] / 1.5), atol=1e-3)


def test_rack_travels_at_its_rate(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"prime_mover.rack_rate_limit_mm_s": 2.0})
    step = Schedule(lambda t: np.where(t < 1.0, 22.0, 28.0), 1.4)
    s = simulate(ship, step, 6.0, initial=design_point.state)
    rack = (s["brake_torque"] - rack_map(GEAR * s["shaft_speed"], 0.0)) / 1428.6
    expected = np.clip(22.0 + 2.0 * (s["time"] - 1.0), 22.0, 28.0)
    np.testing.assert_allclose(rack[:-1], expected[:-1], rtol=1e-9)


def test_rack_stops_at_its_ends(frigate: Ship) -> None:
    start = equilibrium(frigate, 34.0, 1.4)
    beyond, at = (rack_step(frigate, rack, start) for rack in (60.0, 40.0))
    np.testing.assert_array_equal(beyond["shaft_speed"], at["shaft_speed"])


def waiting(frigate: Ship) -> Any:
    """The frigate's record with a smoke limit and a loading limit."""
    return frigate.with_values(
        {
            "prime_mover.charge_air_lag_s": 4.0,
            "prime_mover.smoke_limit_N_m": 17e3,
            "prime_mover.smoke_limit_rise_N_m": 25e3,
            "prime_mover.warmth_lag_s": 90.0,
            "prime_mover.loading_limit_N_m": 23e3,
            "prime_mover.loading_limit_rise_N_m": 19e3,
        }
    ).record()


@pytest.mark.parametrize(
    ("charge", "warmth", "torque"),
    [(0.0, 1.0, 17e3), (0.4, 1.0, 27e3), (1.0, 0.0, 23e3), (1.0, 0.2, 26.8e3), (1.0, 1.0, 3e4)],
)
def test_a_diesel_waits_for_air_and_warmth(
    frigate: Ship, charge: float, warmth: float, torque: float
) -> None:
    plant = waiting(frigate)
    rack = rack_of_torque(plant, 80.0, 3e4)
    found = drive_diesel(plant, 80.0, rack, 0.0, charge, warmth)
    assert found.brake_torque == pytest.approx(torque, rel=1e-12)
    share = torque * 80.0 / (38e3 * TOP)  # of the rated power
    assert found.charge_rate == pytest.approx((share - charge) / 4.0, rel=1e-12)
    assert found.warmth_rate == pytest.approx((share - warmth) / 90.0, rel=1e-12)


def test_a_ship_settles_where_air_and_warmth_are_those_of_her_power(frigate: Ship) -> None:
    plant = waiting(frigate)
    plant["engine_lag"] = 0.2
    inputs = Inputs(rack_of_torque(plant, 95.0, 33e3), 1.3)
    found = settle_lags(plant, State(1.3, 95.0 / GEAR, 9.0), inputs)
    assert found.brake_torque == pytest.approx(33e3, rel=1e-9)
    share = 33e3 * 95.0 / (38e3 * TOP)
    assert (found.charge, found.warmth) == pytest.approx((share, share), rel=1e-9)


def test_a_lag_of_air_needs_its_limits(frigate: Ship) -> None:
    with pytest.raises(ShipError, match=r"smoke_limit_N_m is missing.*with a charge_air_lag_s"):
        frigate.with_values({"prime_mover.charge_air_lag_s": 4.0})
