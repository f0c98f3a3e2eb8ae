"""Ventilation: the heads by hand, the hysteresis, thrust over shaft speed, and what a rough sea does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    get_sea,
    load_ship,
    realise,
    simulate,
)
from shaftline.plant.propeller import propeller_load
from shaftline.plant.ventilation import (
    can_ventilate,
    lost_suction,
    relative_submergence,
    suction_head,
    surface_factor,
    ventilation_rate,
)

RADIUS = 2.1  # m
ONSET, GAIN, HYSTERESIS = 0.4, 0.5, 0.3
GROWTH, WASHOUT = 0.5, 1.5  # s
LOSSES = {
    "ventilation.thrust_loss": 0.75,
    "ventilation.torque_loss": 0.68,
    "ventilation.surface_loss": 1.0,
}


@pytest.fixture
def airy(plant: Any) -> Any:
    plant["ventilation_onset_submergence"], plant["ventilation_suction_gain"] = ONSET, GAIN
    plant["ventilation_hysteresis"] = HYSTERESIS
    return plant


def rest(plant: Any, degree: float, relative: float, suction: float) -> float:
    """Where a degree comes to rest."""
    for _ in range(3000):
        degree += 0.2 * ventilation_rate(plant, degree, relative, suction)
    return degree


def test_heads_by_hand(plant: Any) -> None:
    """The suction head is the thrust over the disc area as a column of water."""
    load = propeller_load(plant, 6.0, 9.0, 1.2, 4.0, 0.0)
    column = load.thrust / (1025.0 * 9.81 * math.pi * RADIUS**2)
    assert suction_head(plant, load.thrust_coefficient, 9.0) == pytest.approx(
        column / RADIUS, rel=1e-6
    )
    assert relative_submergence(plant, 3.15) == pytest.approx(1.5)
    assert suction_head(plant, 0.3, 8.0) == pytest.approx(4.0 * suction_head(plant, 0.3, 4.0))


@pytest.mark.parametrize(
    ("relative", "suction", "ends_dry", "ends_wet"),
    [
        (0.39, 0.0, 1, 1),
        (0.41, 0.0, 0, 1),
        (0.69, 0.0, 0, 1),
        (0.71, 0.0, 0, 0),
        (0.89, 1.0, 1, 1),
        (0.91, 1.0, 0, 1),
        (1.19, 1.0, 0, 1),
        (1.21, 1.0, 0, 0),
    ],
)
def test_air_comes_at_the_onset_and_stays_until_recovery(
    airy: Any, relative: float, suction: float, ends_dry: int, ends_wet: int
) -> None:
    """The folds of the two branches lie where the file says, to a hundredth of h/R."""
    assert rest(airy, 0.0, relative, suction) == pytest.approx(ends_dry, abs=0.12)
    assert rest(airy, 1.0, relative, suction) == pytest.approx(ends_wet, abs=0.12)


def test_air_grows_and_washes_out_with_its_times(airy: Any) -> None:
    assert ventilation_rate(airy, 0.25, -4.0, 0.0) == pytest.approx(0.75 / GROWTH)
    assert ventilation_rate(airy, 0.25, 9.0, 0.0) == pytest.approx(-0.25 / WASHOUT)
    assert ventilation_rate(airy, 1.0, -4.0, 0.0) == ventilation_rate(airy, 0.0, 9.0, 0.0) == 0.0


def test_a_fully_ventilated_blade_keeps_a_quarter_and_the_static_head(plant: Any) -> None:
    """T = T0 / 4 + rho g h A_E by two-term thin-plate theory, where the suction exceeds the head."""
    plant["ventilation_thrust_loss"] = 0.75
    depth, speed = 0.3 * RADIUS, 14.0
    air, water = (propeller_load(plant, 3.0, speed, 1.2, depth, a).thrust for a in (1.0, 0.0))
    head = 1025.0 * 9.81 * depth * 0.9 * math.pi * RADIUS**2
    assert 0.05 * water < head < 0.7 * 0.75 * water
    assert air == pytest.approx(0.25 * water + head, rel=1e-6)


def test_a_share_of_suction_is_lost_between_none_and_all(plant: Any) -> None:
    plant["expanded_area_ratio"] = 0.6
    shares = [lost_suction(plant, 1.0, suction) for suction in (-1.0, 0.0, 0.1, 1.0, 10.0, 1e6)]
    assert shares[:2] == [0.0, 0.0]
    assert np.all(np.diff(shares[2:]) > 0.0)
    assert shares[2] == 0.0
    assert shares[4] == pytest.approx(1.0 - 0.6 / 7.5, rel=1e-12)
    assert shares[-1] == pytest.approx(1.0, abs=1e-5)
    assert lost_suction(plant, -3.0, 1.0) == pytest.approx(1.0)  # above the surface: no head left
    plant["ventilation_static_head"] = 0.0
    assert [lost_suction(plant, 1.0, suction) for suction in (-1.0, 0.1, 10.0)] == 3 * [1.0]


@pytest.mark.parametrize("relative", [0.0, 0.25, 0.5, 1.0])
def test_loss_of_disc_area_is_the_printed_curve(relative: float) -> None:
    printed = 1.0 - 0.675 * (1.0 - 0.769 * relative) ** 1.258
    assert surface_factor(relative) == pytest.approx(printed, rel=1e-12)


def test_loss_of_disc_area_ends_at_its_corners() -> None:
    assert surface_factor(1.57) == 1.0
    assert surface_factor(1.3) == pytest.approx(1.0, abs=0.01)
    assert surface_factor(-0.6) == surface_factor(-30.0) == 0.0
    above = [surface_factor(h) for h in np.linspace(-2.0, 3.0, 400)]
    assert np.all(np.diff(above) >= 0.0)


def test_deep_water_loses_nothing_to_the_last_bit(frigate: Ship) -> None:
    lossy, plain = frigate.with_values(LOSSES).record(), frigate.record()
    depth = 4.0 * RADIUS
    assert propeller_load(lossy, 6.0, 9.0, 1.2, depth, 0.0) == propeller_load(
        plain, 6.0, 9.0, 1.2, depth, 0.0
    )


def settled_thrust(ship: Ship, relative: float, speeds: Any, pitch: float, v: float) -> Any:
    """Steady thrust [N] at rising shaft speeds, each from the air of the one before."""
    plant, degree, found = ship.record(), 0.0, []
    radius = 0.5 * ship.propeller.diameter_m
    for speed in speeds:
        coefficient = propeller_load(plant, v, speed, pitch, relative * radius, 0.0)[2]
        suction = suction_head(plant, coefficient, speed)
        for _ in range(200):
            degree += 0.2 * ventilation_rate(plant, degree, relative, suction)
        found.append(propeller_load(plant, v, speed, pitch, relative * radius, degree).thrust)
    return np.array(found)


@pytest.mark.parametrize("relative", [0.5, 0.8, 1.0, 1.5])
@pytest.mark.parametrize(
    ("name", "top", "pitch"), [("towing-tank", 80.0, 1.0), ("frigate", 22.0, 1.2)]
)
def test_thrust_rises_drops_and_rises_again_with_the_shaft_speed(
    name: str, top: float, pitch: float, relative: float
) -> None:
    """A slower shaft gives more thrust near the surface: the motive of anti-spin."""
    ship = load_ship(name).with_values(LOSSES)
    speeds = np.linspace(0.1, 1.0, 120) * top
    thrust = settled_thrust(ship, relative, speeds, pitch, 0.0)
    rises = np.diff(thrust) > 0.0
    falls = np.flatnonzero(~rises)
    first, last = falls[0], falls[-1]
    assert first > 5  # it rises before
    assert last < 115  # and after
    assert np.all(~rises[first : last + 1])  # and drops once
    assert thrust[last + 1] < 0.75 * thrust[first]
    # afterwards slower than the square by which it rose
    grown = thrust[-1] / thrust[last + 1]
    assert grown < (speeds[-1] / speeds[last + 1]) ** 1.8
    assert thrust[first] > np.interp(1.25 * speeds[first], speeds, thrust)  # a quarter slower, more


@pytest.mark.parametrize(
    ("thrust", "torque", "can"), [(0.0, 0.0, False), (0.1, 0.0, True), (0.0, 0.1, True)]
)
def test_either_loss_switches_ventilation_on(
    plant: Any, thrust: float, torque: float, can: bool
) -> None:
    plant["ventilation_thrust_loss"], plant["ventilation_torque_loss"] = thrust, torque
    assert can_ventilate(plant) is can


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("hysteresis", 0.0, "0.05"),
        ("suction_gain", -0.1, "greater than or equal to 0"),
        ("surface_loss", 1.5, "less than or equal to 1"),
        ("recovery_submergence", 1.3, "recovery_submergence"),
    ],
)
def test_numbers_out_of_range_are_refused(
    frigate: Ship, key: str, value: float, reason: str
) -> None:
    with pytest.raises(ShipError, match=reason):
        frigate.with_values({f"ventilation.{key}": value})


@pytest.fixture(scope="module")
def shallow(frigate: Ship) -> Ship:
    return frigate.with_values({"propeller.depth_m": 3.0})


@pytest.fixture(scope="module")
def ventilating(shallow: Ship) -> Ship:
    return shallow.with_values(LOSSES | {"ventilation.onset_submergence": 0.3})


def voyage(ship: Ship) -> NDArray[Any]:
    sea = get_sea("state-6")
    assert sea is not None
    start = equilibrium(ship, 22.0, 1.4)
    waves = realise(sea, 3.0, seed=3)
    return simulate(ship, Schedule(22.0, 1.4), 200.0, initial=start.state, sea=waves)


@pytest.fixture(scope="module")
def rough(ventilating: Ship) -> NDArray[Any]:
    return voyage(ventilating)


def test_rough_sea_ventilates_a_shallow_propeller(rough: NDArray[Any]) -> None:
    assert rough["ventilation"].max() > 0.5
    assert np.mean(rough["ventilation"] < 0.01) > 0.1  # and lets it breathe out
    assert np.all((rough["ventilation"] >= 0.0) & (rough["ventilation"] <= 1.0))


def test_ventilated_shaft_loses_thrust_and_races(rough: NDArray[Any], shallow: Ship) -> None:
    plant, full = shallow.record(), rough["ventilation"] > 0.8
    sound = [
        propeller_load(plant, s["advance_velocity"], s["shaft_speed"], 1.4, s["submergence"], 0.0)
        for s in rough[full]
    ]
    assert rough["thrust"][full].sum() < 0.7 * sum(load.thrust for load in sound)
    assert rough["propeller_torque"][full].sum() < 0.8 * sum(load.torque for load in sound)
    without = voyage(shallow)
    assert rough["shaft_speed"].max() > without["shaft_speed"].max() + 0.2


def test_air_comes_near_the_surface_and_leaves_deeper(rough: NDArray[Any]) -> None:
    """Where the degree passes a half, rising and falling."""
    half = rough["ventilation"] > 0.5
    relative = rough["submergence"] / RADIUS
    comes = np.flatnonzero(half[1:] & ~half[:-1])
    leaves = np.flatnonzero(~half[1:] & half[:-1])
    assert len(comes) > 2
    assert relative[comes].max() < relative[leaves].min()


def test_deep_propeller_never_ventilates(ventilating: Ship) -> None:
    deep = ventilating.with_values({"propeller.depth_m": 15.0})
    assert np.all(voyage(deep)["ventilation"] == 0.0)


def test_a_steady_state_near_the_surface_holds(ventilating: Ship) -> None:
    """Air is at rest too: simulated on, nothing moves."""
    near = ventilating.with_values({"propeller.depth_m": 0.3 * RADIUS})
    start = equilibrium(near, 22.0, 1.4)
    assert start.state.ventilation > 0.9
    samples = simulate(near, Schedule(22.0, 1.4), 20.0, initial=start.state)
    for name in ("shaft_speed", "ship_speed", "ventilation"):
        np.testing.assert_allclose(samples[name], samples[name][0], rtol=1e-8)


def test_the_reach_of_the_switch_solves_its_equation(airy: Any) -> None:
    """The fold of the dry branch by a root of the rate's slope, to 1e-4 of h/R."""

    def highest(relative: float) -> float:
        degrees = np.linspace(0.0, 0.3, 301)
        rates = [ventilation_rate(airy, a, relative, 0.0) for a in degrees]
        return float(min(rates))

    assert brentq(highest, 0.2, 0.6, xtol=1e-6) == pytest.approx(ONSET, abs=1e-4)
