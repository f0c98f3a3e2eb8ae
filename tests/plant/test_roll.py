"""Roll: decay, heel in turns and in waves against closed forms, and the refusals of wrong files."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from shaftline.plant import (
    Schedule,
    Sea,
    Ship,
    ShipError,
    State,
    ValidityWarning,
    approach,
    linearise,
    load_ship,
    realise,
    simulate,
    simulate_recording,
    turning_circle,
)
from shaftline.plant.columns import ROLLING_COLUMNS, signal_columns
from shaftline.plant.dynamics import evaluate
from shaftline.plant.roll import heeled_hull_forces, roll_acceleration, slope_across
from shaftline.plant.rudder import rudder_forces
from shaftline.plant.state import Inputs
from shaftline.plant.waves import SYNC_STEPS, wave_field

GM, PERIOD, DAMPING, HULL, RUDDER = 1.5, 11.0, 0.06, 4.5, 6.5
ROLL = {
    "metacentric_height_m": GM,
    "period_s": PERIOD,
    "damping_ratio": DAMPING,
    "hull_force_depth_m": HULL,
    "rudder_force_depth_m": RUDDER,
}
SPEEDS = {"ddg-51-surrogate": 11.0, "kvlcc2": 1.18}
MODEL = {"metacentric_height_m": 0.12, "period_s": 2.0, "hull_force_depth_m": 0.1,
         "rudder_force_depth_m": 0.16}  # fmt: skip
G = 9.81


def rolling(name: str = "ddg-51-surrogate", **values: float) -> Ship:
    own = MODEL if name == "kvlcc2" else {}
    return load_ship(name).with_values({f"roll.{k}": v for k, v in (ROLL | own | values).items()})


def run(
    ship: Ship, degrees: float, seconds: float, sea: Any = None, roll: float = 0.0
) -> NDArray[Any]:
    """A voyage from the straight course with the rudder at an angle and the ship heeled [rad]."""
    point = approach(ship, SPEEDS[ship.name])
    orders = Schedule(
        point.inputs.drive, point.inputs.pitch_command, rudder_command=math.radians(degrees)
    )
    initial = point.state._replace(roll_angle=roll)
    return simulate(ship, orders, seconds, initial=initial, sea=sea)


def decay(time: NDArray[np.float64], damping: float, first: float) -> NDArray[np.float64]:
    """The free decay of a linear oscillator from rest at an angle."""
    frequency = 2.0 * math.pi / PERIOD
    damped = frequency * math.sqrt(1.0 - damping**2)
    phase = damped * time
    shape = np.cos(phase) + damping * frequency / damped * np.sin(phase)
    return np.asarray(first * np.exp(-damping * frequency * time) * shape)


def test_the_equation_by_hand_with_published_coefficients() -> None:
    """Blanke & Christensen (1993), as Perez (2005) has it: a naval vessel of 51.5 m in SI units."""
    volume, density, length, height = 357.0, 1014.0, 51.5, 1.1
    inertia, linear, lift, square = 2.3763e6 + 774000.0, 500000.0, 15500.0, 416000.0
    stiffness = density * G * volume * height
    frequency = math.sqrt(stiffness / inertia)
    plant = rolling().record()
    plant["displacement"], plant["length"] = density * volume, length
    plant["metacentric_height"], plant["roll_period"] = height, 2.0 * math.pi / frequency
    plant["roll_damping"] = linear / (2.0 * frequency * inertia)
    plant["roll_lift_damping"] = lift * math.sqrt(G * length) / (2.0 * frequency * inertia)
    plant["roll_quadratic_damping"] = square / inertia
    plant["roll_hull_depth"], plant["roll_rudder_depth"] = 1.845, 2.6
    plant["wave_slope_coefficient"] = 0.8
    assert plant["roll_period"] == pytest.approx(5.642, abs=1e-3)
    assert plant["roll_damping"] == pytest.approx(0.0713, abs=1e-4)
    angle, rate, ahead, lateral, rudder, slope = 0.2, -0.05, -8.0, 0.3, -20000.0, 0.04
    moment = -1.845 * (density * volume * lateral - rudder) - 2.6 * rudder
    moment -= stiffness * (math.sin(angle) + 0.8 * slope)
    moment -= (linear + lift * 8.0) * rate + square * rate * abs(rate)
    found = roll_acceleration(plant, angle, rate, ahead, lateral, rudder, slope)
    assert found == pytest.approx(moment / inertia, rel=1e-12)


def test_free_decay_has_the_period_and_the_decrement_of_the_file() -> None:
    ship = rolling(hull_force_depth_m=0.0, rudder_force_depth_m=0.0)
    samples = run(ship, 0.0, 60.0, roll=1e-3)
    expected = decay(samples["time"], DAMPING, 1e-3)
    np.testing.assert_allclose(samples["roll_angle"], expected, rtol=0.0, atol=2e-8)
    damped = PERIOD / math.sqrt(1.0 - DAMPING**2)
    later = np.interp(damped, samples["time"], samples["roll_angle"])
    decrement = 2.0 * math.pi * DAMPING / math.sqrt(1.0 - DAMPING**2)
    assert math.log(1e-3 / later) == pytest.approx(decrement, rel=1e-3)
    rate = np.gradient(samples["roll_angle"], samples["time"])
    np.testing.assert_allclose(samples["roll_rate"][1:-1], rate[1:-1], rtol=0.0, atol=1e-7)


def test_lift_damping_grows_with_the_speed() -> None:
    ship = rolling(lift_damping_ratio=0.3)
    samples = run(ship, 0.0, 40.0, roll=1e-3)
    froude = SPEEDS["ddg-51-surrogate"] / math.sqrt(G * ship.manoeuvring.length_m)
    expected = decay(samples["time"], DAMPING + 0.3 * froude, 1e-3)
    np.testing.assert_allclose(samples["roll_angle"], expected, rtol=0.0, atol=2e-7)


def test_quadratic_damping_takes_four_thirds_of_its_square_from_each_swing() -> None:
    """Energy lost in half a cycle: the mean amplitude falls by (4/3) beta phi^2."""
    samples = run(rolling(damping_ratio=0.0, quadratic_damping_per_rad=0.4), 0.0, 40.0, roll=0.1)
    turns = np.flatnonzero(np.diff(np.sign(samples["roll_rate"][1:])) != 0) + 1
    peaks = np.abs(samples["roll_angle"][turns])
    means = 0.5 * (peaks[1:] + peaks[:-1])
    np.testing.assert_allclose(-np.diff(peaks), 4.0 / 3.0 * 0.4 * means**2, rtol=0.03)


@pytest.mark.parametrize("name", SPEEDS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_steady_heel_balances_the_moments(name: str, side: float) -> None:
    """With the hull's force alone GM sin(phi) = -h_H u r / g; the rudder's own force acts deeper."""
    own = MODEL if name == "kvlcc2" else ROLL
    hull, height = own["hull_force_depth_m"], own["metacentric_height_m"]
    seconds = 1500.0 if name == "ddg-51-surrogate" else 600.0
    alike = run(rolling(name, rudder_force_depth_m=hull), side * 20.0, seconds)[-1]
    turning = alike["ship_speed"] * alike["yaw_rate"]
    assert math.sin(alike["roll_angle"]) == pytest.approx(-hull * turning / G / height, rel=1e-6)
    assert alike["roll_angle"] * side < 0.0
    ship = rolling(name)
    end = run(ship, side * 20.0, seconds)[-1]
    plant = ship.record()
    plant["rudder_hull_share"] = 0.0  # the force on the rudder itself
    force = rudder_forces(
        plant,
        *(
            end[name]
            for name in (
                "rudder_angle",
                "advance_velocity",
                "thrust",
                "sway_speed",
                "yaw_rate",
            )
        ),
    )[1]
    deeper = own["rudder_force_depth_m"] - hull
    lever = hull * turning + deeper * force / ship.manoeuvring.displacement_kg
    assert math.sin(end["roll_angle"]) == pytest.approx(-lever / G / height, rel=1e-5)
    # A rudder that still pushes the stern outward holds against the heel.
    against = side * force < 0.0
    assert (abs(end["roll_angle"]) < abs(alike["roll_angle"])) == against
    assert against == (name == "kvlcc2")


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_ship_heels_inward_with_the_rudder_and_then_outward(side: float) -> None:
    ship = rolling()
    turn = turning_circle(ship, approach(ship, 11.0), side * 0.5)
    inward = side * turn.track["roll_rad"].to_numpy()
    assert turn.heel is not None
    assert turn.heel.inward_rad == inward.max() > 0.01
    assert turn.heel.outward_rad == -inward.min() > 2.0 * turn.heel.inward_rad
    assert int(np.argmax(inward)) < int(np.argmin(inward))
    assert (inward[2 : int(np.argmax(inward))] > 0.0).all()
    assert 0.0 < turn.heel.steady_rad < turn.heel.outward_rad
    assert turn.heel.steady_rad == pytest.approx(-inward[-1], rel=1e-3)


def test_a_ship_without_roll_has_no_heel() -> None:
    ship = load_ship("ddg-51-surrogate")
    turn = turning_circle(ship, approach(ship, 11.0), 0.3, math.pi)
    assert turn.heel is None
    assert "roll_rad" not in turn.track


@pytest.mark.parametrize("name", SPEEDS)
def test_the_horizontal_motion_is_that_without_roll_to_the_bit(name: str) -> None:
    """Also in waves that roll the ship: the roll is driven one way unless Y_phi or N_phi is given."""
    plain, ship = load_ship(name), rolling(name, wave_slope_coefficient=0.8)
    scale = 1.0 if name == "ddg-51-surrogate" else 0.05
    sea = Sea(hs_m=2.5 * scale, tp_s=8.0 * math.sqrt(scale), heading_deg=70.0)
    waves = realise(sea, plain.propeller.depth_m, 3)
    without, with_roll = run(plain, 20.0, 100.0, waves), run(ship, 20.0, 100.0, waves)
    for signal in without.dtype.names or ():
        if signal not in ("roll_angle", "roll_rate"):
            assert with_roll[signal].tobytes() == without[signal].tobytes(), signal
    assert not without["roll_angle"].any()
    assert np.ptp(with_roll["roll_angle"]) > 0.02


def test_roll_acts_back_on_sway_and_yaw_by_its_derivatives() -> None:
    """Son & Nomoto's values; the moment of a hull that heels outward turns the ship in."""
    ship = rolling(Y_phi=-7.04e-5, N_phi=-1.468e-4)
    plant, length = ship.record(), 142.0368
    force = 0.5 * 1025.0 * length**2 * 9.0**2 * 0.1
    found = heeled_hull_forces(plant, 9.0, 0.1)
    assert found == pytest.approx((-7.04e-5 * force, -1.468e-4 * force * length), rel=1e-12)
    other = rolling("kvlcc2", Y_phi=0.01, N_phi=0.02).record()
    force = 0.5 * 1000.0 * 7.0 * 0.455 * 1.1**2 * -0.2
    expected = (0.01 * force, 0.02 * force * 7.0)
    assert heeled_hull_forces(other, 1.1, -0.2) == pytest.approx(expected, rel=1e-12)
    alone = run(rolling(), 20.0, 600.0)[-1]
    coupled = run(ship, 20.0, 600.0)[-1]
    assert alone["roll_angle"] < 0.0
    assert 1.002 < coupled["yaw_rate"] / alone["yaw_rate"] < 1.01


@pytest.mark.parametrize("heading_deg", [90.0, 50.0, -120.0])
def test_waves_roll_the_ship_as_the_slope_across_it_says(heading_deg: float) -> None:
    """The oscillator once more, driven by differences of the wave field across the ship."""
    ship = rolling(wave_slope_coefficient=0.7, hull_force_depth_m=0.0, rudder_force_depth_m=0.0)
    sea = realise(Sea(hs_m=1.0, tp_s=10.0, heading_deg=heading_deg), 4.5, 5)
    samples = run(ship, 0.0, 60.0, sea)
    frequency = 2.0 * math.pi / PERIOD

    def rates(time: float, state: NDArray[np.float64]) -> list[float]:
        place = float(np.interp(time, samples["time"], samples["position"]))
        port, starboard = (wave_field(sea, time, place, y)[1] for y in (-0.01, 0.01))
        slope = (starboard - port) / 0.02
        angle, rate = state
        righting = math.sin(angle) + 0.7 * slope
        return [rate, -(frequency**2) * righting - 2.0 * DAMPING * frequency * rate]

    solved = solve_ivp(rates, (0.0, 60.0), [0.0, 0.0], max_step=0.1, rtol=1e-8, atol=1e-10,
                       t_eval=samples["time"])  # fmt: skip
    assert np.abs(samples["roll_angle"]).max() > 0.01
    assert np.abs(solved.y[0] - samples["roll_angle"]).max() < 2e-3 * np.ptp(samples["roll_angle"])


def test_waves_along_the_ship_do_not_roll_it_until_it_turns() -> None:
    ship = rolling(wave_slope_coefficient=0.7)
    for heading_deg in (0.0, 180.0):
        sea = realise(Sea(hs_m=2.5, tp_s=9.0, heading_deg=heading_deg), 4.5, 5)
        assert np.abs(run(ship, 0.0, 60.0, sea)["roll_angle"]).max() < 1e-12
        calm, rough = run(ship, 20.0, 120.0), run(ship, 20.0, 120.0, sea)
        assert np.abs(calm["roll_angle"] - rough["roll_angle"])[SYNC_STEPS:].max() > 0.01


def test_waves_from_the_two_sides_roll_the_ship_to_the_two_sides() -> None:
    ship = rolling(wave_slope_coefficient=0.7)
    port, starboard = (
        run(ship, 0.1 * angle, 60.0, realise(Sea(hs_m=2.5, tp_s=8.0, heading_deg=angle), 4.5, 5))
        for angle in (-110.0, 110.0)
    )
    np.testing.assert_array_equal(port["roll_angle"], -starboard["roll_angle"])


def test_a_surface_that_rises_to_starboard_rolls_the_ship_to_port() -> None:
    assert slope_across(0.1, 0.0, 1.0, 0.0) == pytest.approx(0.1)  # the waves go to starboard
    assert slope_across(0.1, 1.0, 0.0, 0.0) == pytest.approx(0.0)  # along the ship
    assert slope_across(0.1, 1.0, 0.0, 0.5 * math.pi) == pytest.approx(-0.1)  # to port
    plant = rolling(wave_slope_coefficient=1.0).record()
    assert roll_acceleration(plant, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1) < 0.0
    at_rest = math.asin(0.1)  # the deck is parallel to the surface
    assert roll_acceleration(plant, -at_rest, 0.0, 0.0, 0.0, 0.0, 0.1) == pytest.approx(
        0.0, abs=1e-15
    )


def test_free_roll_loses_energy() -> None:
    ship = rolling(hull_force_depth_m=0.0, rudder_force_depth_m=0.0, quadratic_damping_per_rad=0.2)
    with pytest.warns(ValidityWarning, match="the roll angle left its range"):
        samples = run(ship, 0.0, 100.0, roll=1.2)
    frequency = 2.0 * math.pi / PERIOD
    energy = 0.5 * samples["roll_rate"] ** 2
    energy += frequency**2 * (1.0 - np.cos(samples["roll_angle"]))
    assert (np.diff(energy) <= 0.0).all()


def test_a_current_does_not_heel_the_ship() -> None:
    """Galilei: the lateral acceleration of the centre of gravity is the same in every current."""
    step = {"integration.time_step_s": 0.01}
    still = rolling(lift_damping_ratio=0.2).with_values(step)
    carried = still.with_values({"hull.current_m_s": 2.0, "manoeuvring.cross_current_m_s": -1.0})
    point = approach(still, 11.0)
    orders = Schedule(point.inputs.drive, point.inputs.pitch_command, rudder_command=0.4)
    moved = point.state._replace(ship_speed=point.state.ship_speed + 2.0, sway_speed=-1.0)
    ends = [
        simulate(ship, orders, 60.0, initial=first)["roll_angle"]
        for ship, first in ((still, point.state), (carried, moved))
    ]
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-9)


def test_the_centre_of_gravity_is_not_at_midship() -> None:
    """Lateral acceleration of G: dv/dt + u r + x_G dr/dt, at an instant that is not steady."""
    ship = rolling(rudder_force_depth_m=HULL)
    plant = ship.record()
    state = State(1.4, 12.0, 10.0, sway_speed=-0.5, yaw_rate=0.01, rudder_angle=0.3)
    rate, _ = evaluate(plant, state, Inputs(5e5, 1.4), 1.4)
    lateral = rate.sway_speed + 10.0 * 0.01 - 0.85344 * rate.yaw_rate
    frequency = 2.0 * math.pi / PERIOD
    assert abs(0.85344 * rate.yaw_rate) > 1e-3 * abs(lateral)
    expected = -(frequency**2) * HULL * lateral / (G * GM)
    assert rate.roll_rate == pytest.approx(expected, rel=1e-12)
    assert rate.roll_angle == 0.0


def test_steps_of_a_rolling_ship_converge_with_the_fourth_power() -> None:
    def end(step: float) -> NDArray[np.float64]:
        ship = rolling(lift_damping_ratio=0.2, N_phi=-1e-4).with_values(
            {"integration.time_step_s": step, "rudder.time_constant_s": 1.0}
        )
        last = run(ship, 20.0, 20.0)[-1]
        return np.array([last[name] for name in ("roll_angle", "roll_rate", "yaw_rate")])

    exact = end(0.0125)
    coarse, fine = (np.abs(end(step) - exact).max() for step in (0.4, 0.2))
    assert 3.6 < math.log2(coarse / fine) < 4.6


def test_the_linear_model_has_the_poles_of_the_roll() -> None:
    ship = rolling()
    model = linearise(ship, approach(ship, 11.0), outputs=("roll_angle",))
    assert {"roll_angle", "roll_rate"} <= set(model.state_labels)
    frequency = 2.0 * math.pi / PERIOD
    pole = frequency * complex(-DAMPING, math.sqrt(1.0 - DAMPING**2))
    assert np.abs(model.poles() - pole).min() < 1e-9
    plain = linearise(load_ship("ddg-51-surrogate"), approach(ship, 11.0), outputs=("yaw_rate",))
    assert len(plain.state_labels) == len(model.state_labels) - 2


@pytest.mark.parametrize("key", ["period_s", "damping_ratio", "hull_force_depth_m"])
def test_a_missing_key_is_named(key: str) -> None:
    values = {f"roll.{name}": value for name, value in ROLL.items() if name != key}
    with pytest.raises(
        ShipError,
        match=rf"roll\.{key} is missing; it is required with a roll\.metacentric_height_m \(unit",
    ):
        load_ship("ddg-51-surrogate").with_values(values)


def test_a_rudder_needs_its_depth() -> None:
    values = {f"roll.{name}": value for name, value in ROLL.items()}
    del values["roll.rudder_force_depth_m"]
    with pytest.raises(ShipError, match=r"roll\.rudder_force_depth_m is missing; .* and a rudder"):
        load_ship("ddg-51-surrogate").with_values(values)
    load_ship("ddg-51-surrogate").with_values({"rudder.area_m2": 0.0, **values})


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"metacentric_height_m": -0.1}, r"roll\.metacentric_height_m = -0\.1: .*unit m; allowed: >= 0"),
        ({"period_s": 0.0}, r"roll\.period_s = 0\.0: .*unit s; allowed: > 0 and <= 120"),
        ({"damping_ratio": 1.0}, r"roll\.damping_ratio = 1\.0: .*allowed: >= 0 and < 1"),
        ({"quadratic_damping_per_rad": -1.0}, r"quadratic_damping_per_rad = -1\.0: .*unit 1/rad"),
        ({"hull_force_depth_m": 50.0}, r"hull_force_depth_m = 50\.0: .*allowed: >= -30 and <= 30"),
        ({"wave_slope_coefficient": 2.0}, r"wave_slope_coefficient = 2\.0: .*allowed: >= 0 and <= 1\.5"),
        ({"gm_m": 1.0}, r"roll\.gm_m is not a known key"),
        ({"period_s": 0.3}, r"roll\.period_s / \(2 pi\) .* = 0\.04775 s is shorter than integration"),
        ({"period_s": 0.5, "lift_damping_ratio": 5.0}, r"roll\.period_s .* = 0\.01.* s is shorter"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused_by_name(values: dict[str, float], words: str) -> None:
    with pytest.raises(ShipError, match=words):
        rolling("ddg-51-surrogate", **values)


def test_a_ship_that_does_not_turn_does_not_roll(frigate: Ship) -> None:
    values = {f"roll.{name}": value for name, value in ROLL.items()}
    with pytest.raises(ShipError, match=r"roll\.metacentric_height_m has no effect without a man"):
        frigate.with_values(values)
    with pytest.raises(ShipError, match=r"roll\.metacentric_height_m has no effect: .* not turn"):
        frigate.parameter("roll.metacentric_height_m")
    with pytest.raises(ShipError, match=r"does not roll: it has no roll\.metacentric_height_m"):
        load_ship("kvlcc2").parameter("roll.period_s")
    assert rolling().parameter("roll.period_s").value == PERIOD


def test_a_search_keeps_what_the_time_step_resolves_and_a_ship_that_rolls() -> None:
    ship = rolling()
    low = ship.parameter("roll.period_s").info.low
    assert low == pytest.approx(2.0 * math.pi * 0.05, rel=1e-6)
    ship.with_values({"roll.period_s": low})
    assert ship.parameter("roll.metacentric_height_m").search_range[0] > 0.0


def test_columns_of_roll_belong_to_ships_that_roll() -> None:
    assert signal_columns(rolling())["roll_rad"] == "roll_angle"
    assert signal_columns(rolling())["roll_rate_rad_s"] == "roll_rate"
    assert not {*ROLLING_COLUMNS} & {*signal_columns(load_ship("frigate-turning"))}


def test_a_recording_begins_at_its_roll_angle() -> None:
    ship = rolling()
    samples = run(ship, 0.0, 30.0, roll=0.1)
    table = pd.DataFrame({c: samples[s] for c, s in signal_columns(ship).items()})
    again = simulate_recording(ship, table, every_signal=True)
    np.testing.assert_allclose(again["roll_rad"], samples["roll_angle"], rtol=0.0, atol=1e-6)
    level = simulate_recording(ship, table.drop(columns=[*ROLLING_COLUMNS]), every_signal=True)
    assert level["roll_rad"].iloc[0] == 0.0


def test_a_ship_that_capsizes_ends_its_manoeuvre() -> None:
    ship = rolling(metacentric_height_m=0.05)
    with pytest.raises(
        ShipError, match=r"capsizes before .*roll angle .*roll\.metacentric_height_m"
    ):
        turning_circle(ship, approach(ship, 11.0), 0.5)
