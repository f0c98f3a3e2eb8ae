"""Base class of the observers: limits of the measurements, record, inertia."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.observers import ESTIMATE, Measurement, ObserverError, get_observer, observer_names
from shaftline.observers.base import code_of
from shaftline.observers.records import is_plausible, pitch_is_known, store_sample
from shaftline.plant import Ship, load_ship

from .screw import INERTIA, SHIP

GOOD = Measurement(10.0, 1.4e5, 1.3, 0.0, 8.0)
DIVIDING = [
    name for name in observer_names() if name.startswith(("aug", "luen", "shaft-k", "imm", "ran"))
]


@pytest.mark.parametrize(
    ("field", "most"), [("shaft_speed", 1e4), ("shaft_torque", 1e8), ("pitch_ratio", 2.6)]
)
def test_measurements_are_plausible_within_their_signals_bounds(field: str, most: float) -> None:
    for sign in (1.0, -1.0):
        assert is_plausible(GOOD._replace(**{field: sign * most}))
        assert not is_plausible(GOOD._replace(**{field: sign * most * 1.000001}))
    assert not is_plausible(GOOD._replace(**{field: math.nan}))


def test_a_failed_accelerometer_is_no_implausible_measurement() -> None:
    assert is_plausible(GOOD._replace(shaft_acceleration=math.nan, advance_velocity=math.nan))


def test_pitch_is_known_to_a_tenth_beyond_the_ships_range(frigate: Ship) -> None:
    plant = frigate.record()  # 0.6 to 1.4
    assert [pitch_is_known(plant, p) for p in (0.4999, 0.5001, 1.0, 1.4999, 1.5001)] == [
        False,
        True,
        True,
        True,
        False,
    ]


def test_without_a_propeller_there_is_nothing_to_observe(servo: Ship) -> None:
    coupled = servo.with_values({"transmission.inertia_propeller_side_kg_m2": 1.0})
    for name in observer_names():
        with pytest.raises(ObserverError, match=r"servo: the observer .* needs a propeller"):
            get_observer(name).discretise(coupled, 0.01)


def test_stored_sample() -> None:
    estimate = np.zeros(1, ESTIMATE)[0]
    estimate["x"] = 7.0
    store_sample(estimate, GOOD, 6.5, True)
    assert estimate["started"] == estimate["valid"] == 1
    names = ("shaft_speed", "shaft_torque", "pitch_ratio", "advance_velocity")
    assert [estimate[name] for name in names] == [10.0, 1.4e5, 1.3, 6.5]
    assert estimate["x"].tolist() == [7.0] * 4
    store_sample(estimate, GOOD, 6.5, False)
    assert estimate["valid"] == 0


@pytest.mark.parametrize("name", observer_names())
def test_a_record_holds_the_code_of_its_observer(name: str) -> None:
    observer = get_observer(name)
    record = observer.discretise(SHIP, 0.02)
    assert record["kind"] == observer.kind == code_of(observer.update)
    assert record["dt"] == 0.02
    assert record["ship"] == SHIP.record()
    assert bool(record["uses_instruments"]) == (name != "oracle")


def test_each_record_has_its_own_ship_model(frigate: Ship) -> None:
    one, other = (get_observer("power-balance").discretise(frigate, 0.05) for _ in range(2))
    one["ship"]["density"] = 1.0
    assert other["ship"]["density"] == 1025.0


def test_inertia_is_that_behind_the_torque_meter() -> None:
    assert get_observer("luenberger").inertia(SHIP) == INERTIA
    bare = SHIP.with_values({"transmission.inertia_propeller_side_kg_m2": 0.0})
    assert get_observer("luenberger").inertia(bare) == 1500.0  # entrained water alone


@pytest.mark.parametrize("ship", ["esso-osaka", "kvlcc2"])
@pytest.mark.parametrize("name", DIVIDING)
def test_without_inertia_behind_the_torque_meter_an_observer_is_refused(
    ship: str, name: str
) -> None:
    bare = get_observer(name).name
    words = rf"{ship}: the observer '{bare}' .*transmission\.inertia_propeller_side_kg_m2 is 0"
    with pytest.raises(ObserverError, match=words + ".*give .* or take an observer .*'power-bal"):
        get_observer(name).discretise(load_ship(ship), 0.05)


@pytest.mark.parametrize("name", [name for name in observer_names() if name not in DIVIDING])
def test_the_other_observers_need_no_inertia(name: str) -> None:
    assert get_observer(name).discretise(load_ship("kvlcc2"), 0.05)["dt"] == 0.05


@pytest.mark.parametrize("ship", ["tito-neri-sine", "tito-neri-staircase", "rov-thruster"])
@pytest.mark.parametrize("name", observer_names())
def test_a_torque_independent_of_the_inflow_is_refused(ship: str, name: str) -> None:
    observer, bollard = get_observer(name), load_ship(ship)
    if observer.name in ("none", "oracle"):
        assert observer.discretise(bollard, 0.05)["dt"] == 0.05
        return
    words = (
        rf"{ship}: the observer '{observer.name}' .*propeller\.model is 'bollard'.*allowed: b-ser"
    )
    with pytest.raises(ObserverError, match=words):
        observer.discretise(bollard, 0.05)


def test_codes_depend_on_the_name_of_the_kernel() -> None:
    kinds = {name: get_observer(name).kind for name in observer_names()}
    assert kinds["luenberger"] == kinds["luenberger-high"] == kinds["shaft-kalman"]
    assert kinds["random-walk-kalman"] != kinds["random-walk-kalman-printed"]
    assert len(set(kinds.values())) == 11
