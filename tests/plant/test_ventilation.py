from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Schedule, Ship, ShipError, equilibrium, get_sea, realise, simulate
from shaftline.plant.ventilation import can_ventilate, ventilation_rate, ventilation_state

RADIUS = 2.1  # m
ONSET, RECOVERY = 1.0, 1.3  # h/R
GROWTH, WASHOUT = 0.5, 1.5  # s


@pytest.mark.parametrize(
    ("relative", "before", "after"),
    [
        (0.5, False, True),
        (0.99, False, True),
        (1.01, False, False),
        (1.15, False, False),
        (1.15, True, True),
        (0.99, True, True),
        (1.29, True, True),
        (1.31, True, False),
        (1.31, False, False),
    ],
)
def test_air_comes_at_the_onset_and_stays_until_recovery(
    plant: Any, relative: float, before: bool, after: bool
) -> None:
    assert ventilation_state(plant, before, relative * RADIUS, 0.2) is after


def test_at_the_very_onset_there_is_no_air_and_at_the_very_recovery_there_is(plant: Any) -> None:
    plant["diameter"], plant["ventilation_recovery_submergence"] = 4.0, 1.5
    assert ventilation_state(plant, False, 2.0, 0.0) is False
    assert ventilation_state(plant, True, 3.0, 0.0) is True


@pytest.mark.parametrize(("before", "without"), [(False, ONSET), (True, RECOVERY)])
def test_loading_draws_air_from_deeper(plant: Any, before: bool, without: float) -> None:
    plant["ventilation_loading_gain"] = 2.0
    for relative, air in ((without + 0.39, True), (without + 0.41, False)):
        assert ventilation_state(plant, before, relative * RADIUS, 0.2) is air


def test_air_grows_and_washes_out_with_its_times(plant: Any) -> None:
    assert ventilation_rate(plant, 0.25, True) == pytest.approx(0.75 / GROWTH)
    assert ventilation_rate(plant, 0.25, False) == pytest.approx(-0.25 / WASHOUT)
    assert ventilation_rate(plant, 1.0, True) == ventilation_rate(plant, 0.0, False) == 0.0


@pytest.mark.parametrize(
    ("thrust", "torque", "can"), [(0.0, 0.0, False), (0.1, 0.0, True), (0.0, 0.1, True)]
)
def test_either_loss_switches_ventilation_on(
    plant: Any, thrust: float, torque: float, can: bool
) -> None:
    plant["ventilation_thrust_loss"], plant["ventilation_torque_loss"] = thrust, torque
    assert can_ventilate(plant) is can


def test_recovery_lies_no_higher_than_onset(frigate: Ship) -> None:
    keys = ("ventilation.onset_submergence", "ventilation.recovery_submergence")
    frigate.with_values(dict(zip(keys, (1.2, 1.2), strict=True)))
    with pytest.raises(ShipError, match="recovery_submergence must not be below onset_submergence"):
        frigate.with_values(dict(zip(keys, (1.2, 1.1), strict=True)))


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


def test_rough_sea_ventilates_a_shallow_propeller(rough: NDArray[Any]) -> None:
    assert rough["ventilation"].max() > 0.5
    assert np.mean(rough["ventilation"] < 0.01) > 0.1  # and lets it breathe out
    assert np.all((rough["ventilation"] >= 0.0) & (rough["ventilation"] <= 1.0))


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


def test_deep_propeller_never_ventilates(ventilating: Ship) -> None:
    deep = ventilating.with_values({"propeller.depth_m": 15.0})
    assert np.all(voyage(deep)["ventilation"] == 0.0)
