from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Schedule, Ship, equilibrium, get_sea, realise, simulate
from shaftline.plant.propeller import propeller_load
from shaftline.plant.ventilation import ventilation_rate, ventilation_state

RADIUS = 2.1  # m
ONSET, RECOVERY = 1.0, 1.3  # h/R
GROWTH, WASHOUT = 0.5, 1.5  # s


@pytest.fixture(scope="module")
def shallow(frigate: Ship) -> Ship:
    return frigate.with_values({"propeller.depth_m": 3.0})


@pytest.fixture(scope="module")
def ventilating(shallow: Ship) -> Ship:
    return shallow.with_values({"ventilation.thrust_loss": 0.7, "ventilation.torque_loss": 0.6})


def voyage(ship: Ship) -> NDArray[Any]:
    sea = get_sea("state-6")
    assert sea is not None
    start = equilibrium(ship, 22.0, 1.4)
    waves = realise(sea, 3.0, seed=3)
    return simulate(ship, Schedule(22.0, 1.4), 200.0, initial=start.state, sea=waves)


@pytest.fixture(scope="module")
def rough(ventilating: Ship) -> NDArray[Any]:
    return voyage(ventilating)


@pytest.mark.parametrize(
    ("relative", "before", "after"),
    [
        (0.99, False, True),
        (1.01, False, False),
        (1.15, True, True),
        (1.29, True, True),
        (1.31, True, False),
    ],
)
def test_air_comes_at_the_onset_and_stays_until_recovery(
    ventilating: Ship, relative: float, before: bool, after: bool
) -> None:
    plant = ventilating.record()
    assert ventilation_state(plant, before, relative * RADIUS, 0.2) is after


def test_loading_draws_air_from_deeper(ventilating: Ship) -> None:
    plant = ventilating.with_values({"ventilation.loading_gain": 2.0}).record()
    assert ventilation_state(plant, False, 1.2 * RADIUS, 0.2)
    assert not ventilation_state(plant, False, 1.2 * RADIUS, 0.05)


def test_air_grows_and_washes_out_with_its_times(ventilating: Ship) -> None:
    plant = ventilating.record()
    assert ventilation_rate(plant, 0.25, True) == pytest.approx(0.75 / GROWTH)
    assert ventilation_rate(plant, 0.25, False) == pytest.approx(-0.25 / WASHOUT)


def test_rough_sea_ventilates_a_shallow_propeller(rough: NDArray[Any]) -> None:
    assert rough["ventilation"].max() > 0.5
    assert np.mean(rough["ventilation"] < 0.01) > 0.1  # and lets it breathe out
    assert np.all((rough["ventilation"] >= 0.0) & (rough["ventilation"] <= 1.0))


def test_air_takes_its_share_of_thrust_and_torque(ventilating: Ship) -> None:
    plant = ventilating.record()
    deep, half = (propeller_load(plant, 8.0, 10.5, 1.4, 3.0, degree) for degree in (0.0, 0.5))
    assert half.thrust / deep.thrust == pytest.approx(1.0 - 0.5 * 0.7)
    assert half.torque / deep.torque == pytest.approx(1.0 - 0.5 * 0.6)


def test_ventilated_shaft_loses_thrust_and_races(rough: NDArray[Any], shallow: Ship) -> None:
    sound = voyage(shallow)
    full = rough["ventilation"] > 0.8
    assert rough["thrust"][full].mean() < 0.7 * sound["thrust"][full].mean()
    assert rough["propeller_torque"][full].mean() < 0.9 * sound["propeller_torque"][full].mean()
    assert rough["shaft_speed"].max() > sound["shaft_speed"].max() + 0.2


def test_turning_points_show_the_hysteresis(rough: NDArray[Any]) -> None:
    rising = np.diff(rough["ventilation"]) > 0.0
    relative = rough["submergence"] / RADIUS
    starts = np.flatnonzero(rising[1:] & ~rising[:-1]) + 1
    ends = np.flatnonzero(~rising[1:] & rising[:-1]) + 1
    assert len(starts) > 5
    # the state that was read one sample before acts over a step
    assert np.all(relative[starts - 1] < ONSET)
    assert np.all(relative[ends - 1] > RECOVERY)


def test_deep_propeller_never_ventilates(frigate: Ship, ventilating: Ship) -> None:
    deep = ventilating.with_values({"propeller.depth_m": 15.0})
    assert np.all(voyage(deep)["ventilation"] == 0.0)
