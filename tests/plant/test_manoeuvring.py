"""Sway and yaw: the published formulas by hand, and what must hold whatever a ship's numbers are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from shaftline.plant import (
    Schedule,
    Ship,
    approach,
    load_ship,
    nomoto,
    simulate,
)
from shaftline.plant.dynamics import evaluate
from shaftline.plant.manoeuvring import (
    drift_inflow,
    hull_area,
    hull_forces,
    planar_inertia,
    reference_speed,
)
from shaftline.plant.state import Inputs, State

KNOT = 1852.0 / 3600.0
SPEEDS = {"kvlcc2": 1.18, "esso-osaka": 7.0 * KNOT, "ddg-51-surrogate": 22.0 * KNOT}
PATH = ("position", "cross_track", "heading", "ship_speed", "sway_speed", "yaw_rate")


def turned(name: str, degrees: float, seconds: float, **values: float) -> NDArray[Any]:
    """A voyage from the straight course with the rudder at an angle."""
    ship = load_ship(name)
    point = approach(ship, SPEEDS[name])
    changed = ship.with_values({key.replace("__", "."): value for key, value in values.items()})
    state = point.state._replace(
        ship_speed=point.state.ship_speed + changed.hull.current_m_s,
        sway_speed=changed.manoeuvring.cross_current_m_s,
    )
    orders = Schedule(
        point.inputs.drive, point.inputs.pitch_command, rudder_command=math.radians(degrees)
    )
    return simulate(changed, orders, seconds, initial=state)


def test_hull_forces_by_hand() -> None:
    """Yasukawa & Yoshimura (2015), eqs. 8 and 9, KVLCC2 at U = 1.1 m/s, v = -0.2 m/s, r = 0.06 rad/s."""
    plant = load_ship("kvlcc2").record()
    v, r = -0.2 / 1.1, 0.06 * 7.0 / 1.1
    force = 0.5 * 1000.0 * 7.0 * 0.455 * 1.1**2
    x = -0.040 * v**2 + 0.002 * v * r + 0.011 * r**2 + 0.771 * v**4
    y = -0.315 * v + 0.083 * r - 1.607 * v**3 + 0.379 * v**2 * r - 0.391 * v * r**2 + 0.008 * r**3
    n = -0.137 * v - 0.049 * r - 0.030 * v**3 - 0.294 * v**2 * r + 0.055 * v * r**2 - 0.013 * r**3
    found = hull_forces(plant, 1.1, -0.2, 0.06)
    assert found == pytest.approx((force * x, force * y, force * 7.0 * n), rel=1e-12)


def test_hull_forces_with_moduli_and_by_the_square_of_the_length() -> None:
    """SNAME's first prime system, with v |v| and r |r|, of the destroyer."""
    plant = load_ship("ddg-51-surrogate").record()
    length, speed = 142.0368, 9.0
    v, r = -1.2 / speed, 0.02 * length / speed
    force = 0.5 * 1025.0 * length**2 * speed**2
    y = -0.0101226 * v + 0.00314090 * r - 0.02 * v * abs(v) - 0.004 * r * abs(r)
    n = -0.00819351828 * v - 0.00177851620 * r - 0.00185 * r * abs(r)
    found = hull_forces(plant, speed, -1.2, 0.02)
    assert found == pytest.approx((force * 0.002 * v * r, force * y, force * length * n), rel=1e-12)
    assert hull_area(plant) == pytest.approx(length**2, rel=1e-15)


@pytest.mark.parametrize("key", ["Y_rr", "N_vv", "Y_vvv", "N_rrr", "Y_vrr", "N_vvr"])
def test_every_derivative_acts_at_its_place(key: str) -> None:
    ship = load_ship("kvlcc2")
    given = getattr(ship.manoeuvring, key)
    more = ship.with_values({f"manoeuvring.{key}": given + 0.01})
    u, v, r = 1.1, -0.2 / 1.1, 0.06 * 7.0 / 1.1
    monomial = {
        "Y_rr": r * abs(r),
        "N_vv": v * abs(v),
        "Y_vvv": v**3,
        "N_rrr": r**3,
        "Y_vrr": v * r * r,
        "N_vvr": v * v * r,
    }[key]
    before, after = (hull_forces(one.record(), u, -0.2, 0.06) for one in (ship, more))
    difference = [b - a for a, b in zip(before, after, strict=True)]
    force = 0.5 * 1000.0 * 7.0 * 0.455 * 1.1**2 * 0.01 * monomial
    expected = [0.0, force, 0.0] if key[0] == "Y" else [0.0, 0.0, 7.0 * force]
    assert difference == pytest.approx(expected, rel=1e-8, abs=1e-9)


def test_reference_speed_is_that_of_the_ship_until_she_turns_on_the_spot() -> None:
    plant = load_ship("kvlcc2").record()
    assert reference_speed(plant, 0.9, -0.3, 0.05) == pytest.approx(math.hypot(0.9, 0.3))
    assert reference_speed(plant, 0.0, 0.0, -0.3) == pytest.approx(0.3 * 7.0 / 1.5)


@pytest.mark.parametrize(("across", "gain"), [(-0.3, 1.6), (0.3, 1.1)])
def test_wake_fades_with_drift(across: float, gain: float) -> None:
    """Eq. 20: 1 + (1 - exp(-C_1 |beta_P|)) (C_2 - 1), C_1 = 2, C_2 = 1.6 or 1.1 by the side."""
    plant = load_ship("kvlcc2").record()
    drift = -(across - 4.83 * 0.02) / 1.2
    expected = 1.0 + (1.0 - math.exp(-2.0 * abs(drift))) * (gain - 1.0)
    assert drift_inflow(plant, 1.2, across, 0.02) == pytest.approx(expected, rel=1e-12)


def test_inertia_by_hand() -> None:
    """Eqs. 3 to 5 with I_z about midship, m (k^2 + x_G^2), and added masses by rho L^2 d / 2."""
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(load_ship("kvlcc2").record())
    scale = 0.5 * 1000.0 * 49.0 * 0.455
    assert sway == pytest.approx(3270.0 + 0.223 * scale, rel=1e-12)
    assert sway_yaw == yaw_sway == pytest.approx(3270.0 * 0.25, rel=1e-12)
    inertia = 3270.0 * (1.75**2 + 0.25**2) + 0.011 * scale * 49.0
    assert yaw == pytest.approx(inertia, rel=1e-12)


def test_accelerations_satisfy_the_equations_of_motion() -> None:
    """Eqs. 3 to 5 as they stand in the module's docstring, with the forces that act on the hull."""
    ship = load_ship("kvlcc2").with_values({"rudder.area_m2": 0.0})
    plant = ship.record()
    u, v, r = 1.1, -0.2, 0.06
    state = State(0.721, 1e-9, u, sway_speed=v, yaw_rate=r)
    rate, out = evaluate(plant, state, Inputs(1e-9, 0.721), 0.721)
    x, y, n = hull_forces(plant, math.hypot(u, v), v, r)
    x += 0.78 * out.thrust - out.resistance
    m, scale = 3270.0, 0.5 * 1000.0 * 49.0 * 0.455
    mx, my, jz = 0.022 * scale, 0.223 * scale, 0.011 * scale * 49.0
    inertia = m * (1.75**2 + 0.25**2)
    du, dv, dr = rate.ship_speed, rate.sway_speed, rate.yaw_rate
    surge = (m + mx) * du - (m + my) * v * r - m * 0.25 * r**2
    assert surge == pytest.approx(x, rel=1e-4)  # m + m_x stands rounded in the ship's file
    assert (m + my) * dv + m * 0.25 * dr + (m + mx) * u * r == pytest.approx(y, rel=1e-4)
    assert (inertia + jz) * dr + m * 0.25 * (dv + u * r) == pytest.approx(n, rel=1e-9)


@pytest.mark.parametrize("name", ["esso-osaka", "ddg-51-surrogate"])
def test_mirrored_rudder_gives_the_mirrored_track_exactly(name: str) -> None:
    starboard, port = turned(name, 15.0, 300.0), turned(name, -15.0, 300.0)
    for signal in ("position", "ship_speed", "shaft_speed", "thrust", "shaft_torque"):
        np.testing.assert_array_equal(starboard[signal], port[signal])
    for signal in ("cross_track", "heading", "sway_speed", "yaw_rate", "rudder_angle"):
        np.testing.assert_array_equal(starboard[signal], -port[signal])
    assert starboard["heading"][-1] > 0.4
    assert starboard["cross_track"][-1] > 0.0


@pytest.mark.parametrize("name", SPEEDS)
def test_in_a_current_the_track_relative_to_the_water_is_the_same(name: str) -> None:
    """Galilei: but for what steps of other variables round and cut off."""
    along, across, seconds = 0.3 * SPEEDS[name], -0.2 * SPEEDS[name], 60.0
    step = {"integration__time_step_s": 0.01}
    still = turned(name, 20.0, seconds, **step)
    current = {"hull__current_m_s": along, "manoeuvring__cross_current_m_s": across}
    carried = turned(name, 20.0, seconds, **current, **step)
    assert still["heading"][-1] > 0.03
    for signal, drift in (("position", along), ("cross_track", across)):
        relative = carried[signal] - drift * carried["time"]
        np.testing.assert_allclose(relative, still[signal], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(carried["heading"], still["heading"], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(carried["thrust"], still["thrust"], rtol=1e-9)


@pytest.mark.parametrize("name", SPEEDS)
def test_a_drifting_ship_loses_kinetic_energy(name: str) -> None:
    """Without thrust and rudder: half of the state's quadratic form by the matrix of inertia."""
    free = {"rudder.area_m2": 0.0, "hull.thrust_deduction": 0.0}
    ship = load_ship(name).with_values(free)
    plant, m = ship.record(), ship.manoeuvring
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(plant)
    for u, v, r in ((1.0, -0.2, 0.3), (1.0, 0.3, 0.1), (0.5, 0.5, -0.4), (1.0, 0.0, 0.2)):
        u, v, r = u * SPEEDS[name], v * SPEEDS[name], r * SPEEDS[name] / m.length_m
        pitch = ship.propeller.pitch_ratio_min
        state = State(pitch, 1e-9, u, sway_speed=v, yaw_rate=r)  # a screw at rest pushes nothing
        rate, out = evaluate(plant, state, Inputs(1e-9, pitch), pitch)
        power = float(plant["mass"]) * u * rate.ship_speed
        power += v * (sway * rate.sway_speed + sway_yaw * rate.yaw_rate)
        power += r * (yaw_sway * rate.sway_speed + yaw * rate.yaw_rate)
        assert power < 0.0
        # inertial forces do no work, but for what unequal added masses do: the hull's N_v holds the rest
        x, y, n = hull_forces(plant, reference_speed(plant, u, v, r), v, r)
        work = u * (x - out.resistance) + v * y + r * n
        munk = (sway - float(plant["mass"])) * u * v * r
        assert power == pytest.approx(work + munk, rel=1e-9)


@pytest.mark.parametrize("name", SPEEDS)
def test_a_ship_that_sails_straight_is_the_ship_without_the_sections_to_the_bit(name: str) -> None:
    ship = load_ship(name)
    tree = ship.model_dump(exclude_unset=True)
    del tree["manoeuvring"], tree["rudder"]
    drag = {"rudder.profile_drag": 0.0}  # what a rudder amidships still has
    point = approach(ship, SPEEDS[name])
    start = point.state._replace(ship_speed=0.8 * SPEEDS[name])
    orders = Schedule(lambda t: point.inputs.drive * (1.0 + 0.01 * t), point.inputs.pitch_command)
    turns = simulate(ship.with_values(drag), orders, 20.0, initial=start)
    plain = simulate(Ship.model_validate(tree), orders, 20.0, initial=start)
    for signal in ("ship_speed", "shaft_speed", "thrust", "shaft_torque", "position"):
        np.testing.assert_array_equal(turns[signal], plain[signal])
    assert plain["ship_speed"][-1] > plain["ship_speed"][0]
    for signal in ("sway_speed", "yaw_rate", "heading", "cross_track"):
        assert not turns[signal].any()


@pytest.mark.parametrize("name", ["kvlcc2", "ddg-51-surrogate"])
def test_steps_in_a_turn_converge_with_the_fourth_power(name: str) -> None:
    def end(step: float) -> NDArray[np.float64]:
        gear = {"rudder__time_constant_s": 1.0, "rudder__rate_limit_rad_s": math.inf}
        run = turned(name, 20.0, 20.0, integration__time_step_s=step, **gear)
        return np.array([run[signal][-1] for signal in PATH])

    exact = end(0.0125)
    coarse, fine = (np.abs(end(step) - exact).max() for step in (0.4, 0.2))
    assert 3.6 < math.log2(coarse / fine) < 4.6


def kvlcc2_rates(rev: float, order: float) -> Any:
    """The equations of the docstrings once more, from the file's numbers, with eq. 25 as printed."""
    ship = load_ship("kvlcc2")
    m, k, d, table = ship.manoeuvring, ship.rudder, 0.216, ship.propeller.open_water
    assert table is not None
    curve = PchipInterpolator(table.advance_ratio, table.thrust_coefficient[0])
    rho, length, draught = 1000.0, 7.0, 0.455
    mass, scale = m.displacement_kg, 0.5 * rho * length**2 * draught
    mx, my = ship.hull.mass_kg - mass, -m.Y_vdot * scale
    off, inertia = mass * m.centre_of_gravity_m, mass * (1.75**2 + 0.25**2)
    inertia += -m.N_rdot * scale * length**2

    def rates(_: float, s: NDArray[np.float64]) -> list[float]:
        _, _, heading, u, v, r, rudder = s
        speed = math.hypot(u, v)
        a, b = v / speed, r * length / speed
        drift = -(v + m.propeller_position_m * r) / speed
        gain = m.wake_drift_gain_port if drift > 0.0 else m.wake_drift_gain_starboard
        inflow = 0.6 * u * (1.0 + (1.0 - math.exp(-2.0 * abs(drift))) * (gain - 1.0))
        j = 2.0 * math.pi * inflow / (rev * d)
        kt = float(curve(j))
        thrust = rho * d**4 * (rev / 2.0 / math.pi) ** 2 * kt
        race = 1.0 + k.race_gain * (math.sqrt(1.0 + 8.0 * kt / (math.pi * j * j)) - 1.0)
        along = k.wake_ratio * inflow * math.sqrt(k.race_share * race**2 + 1.0 - k.race_share)
        cross = v + k.yaw_lever_m * r
        cross *= k.straightening_port if cross < 0.0 else k.straightening_starboard
        attack = rudder + math.atan2(cross, along)
        pressure = 0.5 * rho * k.area_m2 * (along**2 + cross**2)
        normal = pressure * k.normal_force_slope * math.sin(attack)
        force = 0.5 * rho * length * draught * speed**2
        hx = m.X_vv * a * a + m.X_vr * a * b + m.X_rr * b * b + m.X_vvvv * a**4
        hy = m.Y_v * a + m.Y_r * b + m.Y_vvv * a**3 + m.Y_vvr * a * a * b
        hy += m.Y_vrr * a * b * b + m.Y_rrr * b**3
        hn = m.N_v * a + m.N_r * b + m.N_vvv * a**3 + m.N_vvr * a * a * b
        hn += m.N_vrr * a * b * b + m.N_rrr * b**3
        big_x = force * hx - 35.04 * u * u + 0.78 * thrust
        big_x -= (1.0 - k.steering_deduction) * normal * math.sin(rudder)
        big_y = force * hy - (1.0 + k.hull_force_share) * normal * math.cos(rudder)
        lever = k.position_m + k.hull_force_share * k.hull_force_position_m
        big_n = force * length * hn - lever * normal * math.cos(rudder)
        left = np.array([[mass + mx, 0.0, 0.0], [0.0, mass + my, off], [0.0, off, inertia]])
        right = [
            big_x + (mass + my) * v * r + off * r * r,
            big_y - (mass + mx) * u * r,
            big_n - off * u * r,
        ]
        du, dv, dr = np.linalg.solve(left, right)
        gear = np.clip(
            (order - rudder) / k.time_constant_s, -k.rate_limit_rad_s, k.rate_limit_rad_s
        )
        ground = (
            u * math.cos(heading) - v * math.sin(heading),
            u * math.sin(heading) + v * math.cos(heading),
        )
        return [*ground, r, du, dv, dr, float(gear)]

    return rates


@pytest.mark.parametrize("degrees", [35.0, -20.0])
def test_agrees_with_scipy_on_the_equations_written_once_more(degrees: float) -> None:
    point = approach(load_ship("kvlcc2"), 1.18)
    run = turned("kvlcc2", degrees, 60.0, integration__time_step_s=0.01)
    rates = kvlcc2_rates(point.inputs.drive, math.radians(degrees))
    start = [0.0, 0.0, 0.0, point.state.ship_speed, 0.0, 0.0, 0.0]
    solved = solve_ivp(rates, (0.0, 60.0), start, "DOP853", rtol=1e-10, atol=1e-12, max_step=0.05)
    for signal, value in zip((*PATH, "rudder_angle"), solved.y[:, -1], strict=True):
        assert run[signal][-1] == pytest.approx(value, rel=2e-5, abs=2e-5), signal
    assert abs(run["heading"][-1]) > 2.0


def test_the_tankers_steady_turn() -> None:
    """Taylor's coefficients at 10 degrees of rudder: by the linear equations r' is 0.1658."""
    end = turned("esso-osaka", 10.0, 6000.0)[-1]
    speed = math.hypot(end["ship_speed"], end["sway_speed"])
    assert end["yaw_rate"] * 325.0 / speed == pytest.approx(0.1656, abs=1e-4)
    assert 2.0 * speed / end["yaw_rate"] / 325.0 == pytest.approx(12.07, abs=0.01)


def test_the_destroyer_steers_as_published() -> None:
    """Taylor (2000): K = 2.04 and T = 1.9287 ship lengths at 22 kn."""
    ship = load_ship("ddg-51-surrogate")
    point = approach(ship, SPEEDS["ddg-51-surrogate"])
    found = nomoto(ship, point)
    assert (found.gain, found.time) == pytest.approx((2.040, 1.929), abs=1e-3)
    end = turned("ddg-51-surrogate", 10.0, 1200.0)[-1]
    speed = math.hypot(end["ship_speed"], end["sway_speed"])
    assert 2.0 * speed / end["yaw_rate"] / 142.0368 == pytest.approx(6.58, abs=0.01)
    assert speed / point.state.ship_speed == pytest.approx(0.809, abs=1e-3)
    assert end["ship_speed"] / point.state.ship_speed == pytest.approx(0.805, abs=1e-3)
    assert end["shaft_speed"] / point.state.shaft_speed == pytest.approx(0.892, abs=1e-3)
