from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    State,
    ValidityWarning,
    departures,
    equilibrium,
    load_ship,
    ship_names,
    simulate,
    simulate_recording,
)
from shaftline.plant.record import SECTIONS
from shaftline.plant.signals import SAMPLE
from shaftline.plant.validity import Validity

ROWS = [row for section in SECTIONS for row in section.validity]
IDLE, TOP = 350.0 * np.pi / 30.0 / 7.38, 1000.0 * np.pi / 30.0 / 7.38


def run_of(**signals: Any) -> Any:
    """Samples of an easy run of the frigate, a second apart, with some signals of one's own."""
    size = max(np.size(values) for values in signals.values())
    samples = np.zeros(size, SAMPLE)
    samples["time"] = np.arange(size)
    easy = {
        "drive": 5.0,
        "pitch_command": 1.2,
        "shaft_speed": 9.0,
        "advance_velocity": 3.0,
        "pitch_ratio": 1.2,
        "ship_speed": 6.5,
    }
    for name, value in (easy | signals).items():
        samples[name] = value
    return samples


def test_every_range_is_declared_for_a_reader() -> None:
    assert {row.quantity for row in ROWS} >= {"engine speed", "the propeller's advance ratio J"}
    for row in ROWS:
        assert all((row.quantity, row.unit, row.beyond))


@pytest.mark.parametrize("name", [name for name in ship_names() if load_ship(name).has_diesel])
def test_steady_running_leaves_no_range(name: str) -> None:
    ship = load_ship(name)
    pitch = ship.propeller.pitch_ratio_max
    start = equilibrium(ship, 0.6 * ship.diesel.rack_max_mm, pitch)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ValidityWarning)
        simulate(ship, Schedule(start.inputs.drive, pitch), 5.0, initial=start.state)


def test_engine_below_idle_speed_is_named_with_its_range_and_time(frigate: Ship) -> None:
    (found,) = departures(frigate, run_of(shaft_speed=[IDLE, 5.0, 4.0, 3.0], advance_velocity=1.0))
    assert (found.row.quantity, found.first_s, found.share) == ("engine speed", 2.0, 0.5)
    assert found.limits == pytest.approx((36.652, 104.720), abs=1e-3)
    assert str(found).startswith(
        "engine speed left its range of validity (36.65 to 104.7 rad/s) at 2 s: it spans 22.14 to "
        "36.9 rad/s and is outside for 50 % of the run; "
    )
    assert "\n" not in str(found)


@pytest.mark.parametrize(
    ("signals", "quantities"),
    [
        ({"shaft_speed": [TOP, 1.01 * TOP]}, ["engine speed"]),
        ({"shaft_speed": [IDLE, TOP]}, []),
        ({"advance_velocity": [6.0, 9.7]}, ["the propeller's advance ratio J"]),
        ({"advance_velocity": [6.0, -1.6]}, ["the propeller's advance ratio J"]),
        ({"advance_velocity": [9.6, -1.5]}, []),
        ({"pitch_ratio": [1.4, 1.41]}, ["the blades' pitch ratio P/D"]),
        ({"pitch_ratio": [0.49, 0.5]}, ["the blades' pitch ratio P/D"]),
        ({"pitch_command": [0.6, 1.4, 0.0]}, ["pitch command"]),
        ({"drive": [0.0, 26.0]}, []),
        ({"drive": [-1.0, 20.0]}, ["fuel rack command"]),
        ({"shaft_speed": [-0.1, -0.2]}, ["engine speed", "the propeller's shaft speed"]),
        ({"shaft_speed": [0.0], "advance_velocity": [0.0]}, ["engine speed"]),
    ],
)
def test_each_range_of_a_diesel_ship(frigate: Ship, signals: Any, quantities: list[str]) -> None:
    found = departures(frigate, run_of(**signals))
    assert sorted(one.row.quantity for one in found) == sorted(quantities)


def test_four_quadrant_curves_hold_astern_and_at_any_inflow() -> None:
    ship = load_ship("towing-tank")
    samples = run_of(shaft_speed=[-50.0, 50.0], advance_velocity=[3.0, -3.0], pitch_ratio=[1.0])
    assert departures(ship, samples) == []


def test_bollard_curves_hold_without_inflow_in_either_direction() -> None:
    ship = load_ship("tito-neri-sine")
    still = run_of(shaft_speed=[-50.0, 50.0], advance_velocity=[0.0], pitch_ratio=[1.0])
    assert departures(ship, still) == []
    still["advance_velocity"] = 0.5
    (found,) = departures(ship, still)
    assert found.row.quantity == "the propeller's advance ratio J"


def test_table_has_the_range_of_its_rows() -> None:
    ship = load_ship("kvlcc2")
    j = np.array([1.0, 1.1])
    samples = run_of(shaft_speed=[2.0 * np.pi], advance_velocity=j * 0.216, pitch_ratio=[0.721])
    (found,) = departures(ship, samples)
    assert found.limits == (-0.2, 1.0)
    assert found.reached == pytest.approx((1.0, 1.1))


def test_infinite_limits_are_written_in_words(frigate: Ship) -> None:
    found = departures(frigate, run_of(shaft_speed=[-0.1]))[0]
    assert "(at least 0 rad/s)" in str(found)
    row = Validity("depth", "-", lambda _, s: s["time"], lambda _: (-np.inf, 0.5), "nothing known")
    assert "(at most 0.5)" in str(found._replace(row=row, limits=(-np.inf, 0.5)))


def test_simulation_warns_once_for_each_range(frigate: Ship, design_point: Equilibrium) -> None:
    coast = Schedule(0.0, 1.4)
    with pytest.warns(ValidityWarning) as heard:
        simulate(frigate, coast, 60.0, initial=design_point.state)
    said = [str(one.message) for one in heard]
    assert [line.split(" left")[0] for line in said] == [
        "frigate: the propeller's advance ratio J",
        "frigate: engine speed",
    ]
    assert all(one.filename == __file__ for one in heard)


def test_simulated_recording_warns(frigate: Ship) -> None:
    table = pd.DataFrame(
        {"time_s": np.arange(60.0), "fuel_rack_mm": 0.0, "pitch_ratio_command": 1.4}
    )
    table = table.assign(pitch_ratio=1.4, shaft_speed_rad_s=10.5, ship_speed_m_s=8.7)
    with pytest.warns(ValidityWarning, match="frigate: engine speed left its range"):
        simulate_recording(frigate, table)


def test_start_from_rest_says_that_the_engine_stands(frigate: Ship) -> None:
    with pytest.warns(ValidityWarning, match=r"engine speed .* outside for 100 % of the run"):
        simulate(frigate, Schedule(20.0, 1.0), 5.0, initial=State(1.0, 0.0, 0.0))
