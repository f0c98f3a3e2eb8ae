from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Equilibrium, Schedule, Ship, equilibrium, simulate
from shaftline.plant.shaft import friction_torque, quadratic_drag

GEAR, EFFICIENCY = 7.38, 0.95


def rack_map(engine_speed: Any, rack: Any) -> Any:
    """Brake torque of the frigate's engine, thesis Table B-1 [N m]."""
    return -45.5 * engine_speed + 1428.6 * rack - 7381.0


def rack_step(ship: Ship, to: float, start: Equilibrium, duration: float = 20.0) -> NDArray[Any]:
    return simulate(ship, Schedule(to, 1.4), duration, initial=start.state)


def heavy(ship: Ship, **values: float) -> Ship:
    """The same ship with a shaft that keeps its speed whatever the torques."""
    keys = {f"prime_mover.{key}": value for key, value in values.items()}
    return ship.with_values({"transmission.inertia_engine_side_kg_m2": 1e9, **keys})


@pytest.mark.parametrize("omega", [1.0, 5.0, 14.0])
def test_coulomb_friction_is_its_torque_beyond_creep(omega: float) -> None:
    assert friction_torque(5e3, 0.0, omega) == 5e3
    assert friction_torque(5e3, 0.0, -omega) == -5e3


def test_friction_vanishes_at_rest() -> None:
    assert friction_torque(5e3, 300.0, 0.0) == 0.0


@pytest.mark.parametrize("kind", ["coulomb_friction", "viscous_friction"])
@pytest.mark.parametrize("side", ["engine", "propeller"])
def test_friction_stands_on_its_side_of_the_gauge(frigate: Ship, kind: str, side: str) -> None:
    unit, value = ("N_m", 5e3) if kind == "coulomb_friction" else ("N_m_s_rad", 400.0)
    ship = frigate.with_values({f"transmission.{kind}_{side}_side_{unit}": value})
    found = equilibrium(ship, 22.0, 1.4)
    friction = value if unit == "N_m" else value * found.state.shaft_speed
    driving = found.outputs.brake_torque * GEAR * EFFICIENCY
    before, behind = (friction, 0.0) if side == "engine" else (0.0, friction)
    assert found.outputs.shaft_torque == pytest.approx(driving - before, rel=1e-9)
    assert found.outputs.shaft_torque == pytest.approx(
        found.outputs.propeller_torque + behind, rel=1e-9
    )


def test_quadratic_drag_opposes_behind_the_gauge(frigate: Ship) -> None:
    ship = frigate.with_values({"transmission.quadratic_drag_N_m_s2_rad2": 40.0})
    assert [quadratic_drag(ship.record(), w) for w in (-3.0, 0.0, 3.0)] == [-360.0, 0.0, 360.0]
    found = equilibrium(ship, 22.0, 1.4)
    drag = 40.0 * found.state.shaft_speed**2
    driving = found.outputs.brake_torque * GEAR * EFFICIENCY
    assert found.outputs.shaft_torque == pytest.approx(driving, rel=1e-9)
    assert driving - drag == pytest.approx(found.outputs.propeller_torque, rel=1e-9)


def test_brake_torque_is_the_rack_map(frigate: Ship) -> None:
    found = equilibrium(frigate, 20.0, 1.2)
    expected = rack_map(GEAR * found.state.shaft_speed, 20.0)
    assert found.outputs.brake_torque == pytest.approx(expected, rel=1e-12)


def test_derating_takes_its_share_of_the_torque(frigate: Ship) -> None:
    found = equilibrium(frigate.with_values({"prime_mover.derating_fraction": 0.12}), 22.0, 1.4)
    expected = 0.88 * rack_map(GEAR * found.state.shaft_speed, 22.0)
    assert found.outputs.brake_torque == pytest.approx(expected, rel=1e-12)


def test_curvature_bends_the_map_about_its_speed(frigate: Ship) -> None:
    ship = frigate.with_values(
        {
            "prime_mover.torque_curvature_N_m_s2_rad2": -1.5,
            "prime_mover.torque_curvature_speed_rad_s": 60.0,
        }
    )
    found = equilibrium(ship, 22.0, 1.4)
    engine_speed = GEAR * found.state.shaft_speed
    expected = rack_map(engine_speed, 22.0) - 1.5 * (engine_speed - 60.0) ** 2
    assert found.outputs.brake_torque == pytest.approx(expected, rel=1e-12)


def test_engine_stays_inside_its_envelope(frigate: Ship) -> None:
    samples = rack_step(frigate, 40.0, equilibrium(frigate, 9.4, 1.4), 60.0)
    engine_speed = GEAR * samples["shaft_speed"]
    rising = 15000.0 + 467.0 * (engine_speed - 350.0 * math.pi / 30.0)
    limit = np.minimum(rising, 38000.0)
    assert np.all(samples["brake_torque"] <= limit * (1.0 + 1e-12))
    assert samples["brake_torque"][0] == pytest.approx(limit[0])  # the step does reach it


def test_engine_lag_is_first_order(frigate: Ship) -> None:
    ship = heavy(frigate, lag_s=1.5)
    start = equilibrium(ship, 20.0, 1.4)
    samples = rack_step(ship, 25.0, start, 6.0)
    rise = (samples["brake_torque"] - start.outputs.brake_torque) / (5.0 * 1428.6)
    np.testing.assert_allclose(rise, 1.0 - np.exp(-samples["time"] / 1.5), atol=1e-3)


@pytest.mark.parametrize("steps", [1, 12, 40])
def test_dead_time_shifts_the_response(
    frigate: Ship, design_point: Equilibrium, steps: int
) -> None:
    ship = frigate.with_values({"prime_mover.dead_time_s": 0.05 * steps})
    step = Schedule(lambda t: np.where(t < 5.0, 22.0, 27.5), 1.4)
    prompt, late = (simulate(s, step, 20.0, initial=design_point.state) for s in (frigate, ship))
    np.testing.assert_allclose(late["shaft_speed"][steps:], prompt["shaft_speed"][:-steps], 1e-9)
    assert late["shaft_speed"][140] < prompt["shaft_speed"][140]


def test_dead_time_between_steps_interpolates(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"prime_mover.dead_time_s": 0.52})
    step = Schedule(lambda t: np.where(t < 5.0, 22.0, 27.0), 1.4)
    torque = simulate(ship, step, 10.0, initial=design_point.state)["brake_torque"]
    share = (torque[110] - torque[109]) / (5.0 * 1428.6)  # 0.48 s after the step's own sample
    assert share == pytest.approx(0.6, abs=0.01)


def test_rack_travels_at_its_rate(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"prime_mover.rack_rate_limit_mm_s": 2.0})
    step = Schedule(lambda t: np.where(t < 1.0, 22.0, 28.0), 1.4)
    s = simulate(ship, step, 6.0, initial=design_point.state)
    rack = (s["brake_torque"] - rack_map(GEAR * s["shaft_speed"], 0.0)) / 1428.6
    expected = np.clip(22.0 + 2.0 * (s["time"] + 0.05 - 1.0), 22.0, 28.0)
    np.testing.assert_allclose(rack[:-1], expected[:-1], rtol=1e-9)


def test_rack_stops_at_its_ends(frigate: Ship) -> None:
    start = equilibrium(frigate, 34.0, 1.4)
    beyond, at = (rack_step(frigate, rack, start) for rack in (60.0, 40.0))
    np.testing.assert_array_equal(beyond["shaft_speed"], at["shaft_speed"])


def test_entrained_water_slows_the_start_and_not_the_end(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values({"propeller.entrained_inertia_kg_m2": 8e3})
    dry, wet = (rack_step(s, 25.0, design_point) for s in (frigate, ship))
    ratio = dry["shaft_acceleration"][0] / wet["shaft_acceleration"][0]
    assert ratio == pytest.approx((53697.0 + 14411.0 + 8e3) / (53697.0 + 14411.0))
    assert equilibrium(ship, 25.0, 1.4).state == pytest.approx(
        equilibrium(frigate, 25.0, 1.4).state, rel=1e-9
    )


def test_entrained_water_sits_behind_the_gauge(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"propeller.entrained_inertia_kg_m2": 8e3})
    s = rack_step(ship, 25.0, design_point)
    behind = s["propeller_torque"] + (14411.0 + 8e3) * s["shaft_acceleration"]
    np.testing.assert_allclose(s["shaft_torque"], behind, rtol=1e-12)
