"""Linear steering against the equations of the publications, solved once more."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    approach,
    load_ship,
    nomoto,
    simulate,
)
from shaftline.plant.steering import sway_yaw_model

KNOT = 1852.0 / 3600.0


@pytest.fixture(scope="module")
def osaka() -> tuple[Ship, Equilibrium]:
    ship = load_ship("esso-osaka")
    return ship, approach(ship, 7.0 * KNOT)


def test_linear_steering_is_that_of_the_derivatives(osaka: tuple[Ship, Equilibrium]) -> None:
    """M (v', r')^T = D (v, r)^T + b delta without dimension, as in Taylor (2000), section 2.3.

    The rudder adds its normal force's slope and its profile drag, both by the cross flow v + x_R r.
    """
    ship, point = osaka
    length, m = 325.0, ship.manoeuvring
    unit = 0.5 * 1025.0 * length**3
    mass, total, off = m.displacement_kg / unit, ship.hull.mass_kg / unit, -7.62 / length
    gyration = (81.25**2 + 7.62**2) / length**2
    inertia = np.array(
        [
            [mass - m.Y_vdot, mass * off - m.Y_rdot],
            [mass * off - m.N_vdot, mass * gyration - m.N_rdot],
        ]
    )
    lift, drag = 119.8 / length**2 * 2.2168738, 119.8 / length**2 * 0.0085
    lever = np.array([1.0, -0.5])
    damping = np.array([[m.Y_v, m.Y_r - total], [m.N_v, m.N_r - mass * off]])
    damping -= (lift + drag) * np.outer(lever, lever)
    rudder = -lift * lever
    a, b = np.linalg.solve(inertia, damping), np.linalg.solve(inertia, rudder)
    found = nomoto(ship, point)
    assert sorted(p.real for p in found.poles) == pytest.approx(
        sorted(np.linalg.eigvals(a).real), rel=1e-6
    )
    gain = -np.linalg.solve(a, b)[1]
    assert found.gain == pytest.approx(gain, rel=1e-6)
    zero = a[0, 0] - a[1, 0] * b[0] / b[1]
    assert found.zero == pytest.approx(zero, rel=1e-6)
    time = -np.trace(a) / np.linalg.det(a) + 1.0 / zero
    assert found.time == pytest.approx(time, rel=1e-6)


def test_the_tankers_gain_is_her_steady_turn_at_small_angles(
    osaka: tuple[Ship, Equilibrium],
) -> None:
    ship, point = osaka
    found = nomoto(ship, point)
    orders = Schedule(point.inputs.drive, 0.715, rudder_command=1e-3)
    end = simulate(ship, orders, 3000.0, initial=point.state)[-1]
    turning = end["yaw_rate"] * 325.0 / end["ship_speed"]
    assert found.gain == pytest.approx(turning / 1e-3, rel=1e-4)
    assert found.gain == pytest.approx(0.9454, abs=1e-4)
    assert all(pole.real < 0.0 for pole in found.poles)


def test_the_model_tanker_leaves_her_course_to_one_side() -> None:
    ship = load_ship("kvlcc2")
    model = sway_yaw_model(ship, approach(ship, 1.18))
    assert model.state_labels == ["sway_speed", "yaw_rate"]
    assert model.input_labels == ["rudder_angle"]
    assert model.B[1, 0] > 0.0  # rudder to starboard turns to starboard
    assert model.B[0, 0] < 0.0  # and pushes the stern to port
    assert model.A[0, 1] < 0.0  # the centripetal force


def test_a_gears_lag_does_not_matter() -> None:
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, 22.0 * KNOT)
    slow = ship.with_values({"rudder.time_constant_s": 9.0, "rudder.rate_limit_rad_s": 0.01})
    assert nomoto(slow, point) == nomoto(ship, point)


@pytest.mark.parametrize(
    ("name", "values", "lacking"),
    [
        ("frigate", {}, "manoeuvring.length_m"),
        ("kvlcc2", {"rudder.area_m2": 0.0}, "rudder.area_m2"),
    ],
)
def test_a_ship_that_cannot_be_steered_is_refused(
    name: str, values: dict[str, float], lacking: str
) -> None:
    ship = load_ship(name).with_values(values)
    with pytest.raises(
        ShipError, match=f"{name} cannot be steered: the ship file has no {lacking}"
    ):
        nomoto(ship, approach(ship, 1.0 if name == "kvlcc2" else 8.0))


def test_steering_asks_for_a_speed(osaka: tuple[Ship, Equilibrium]) -> None:
    ship, point = osaka
    stopped = point._replace(state=point.state._replace(ship_speed=0.0))
    with pytest.raises(ShipError, match="Nomoto's model needs a ship speed above 0 m/s, not 0 m/s"):
        nomoto(ship, stopped)
