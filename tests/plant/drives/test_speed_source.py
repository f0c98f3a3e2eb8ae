from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import (
    Schedule,
    Ship,
    ShipError,
    State,
    equilibrium,
    linearise,
    load_ship,
    simulate,
    simulate_recording,
)
from shaftline.plant.drives.speed_source import SpeedSource, holding_torque
from shaftline.plant.propeller import propeller_load
from shaftline.plant.replay import Replay
from shaftline.plant.terms import Term

RIGHT = 14411.0  # I_R of the frigate [kg m2]


@pytest.fixture(scope="module")
def held(frigate: Ship) -> Ship:
    """The frigate, its shafts held at a speed by no matter what."""
    tree = frigate.model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "speed-command", "speed_max_rad_s": 15.0}
    tree["transmission"] = {
        "inertia_propeller_side_kg_m2": RIGHT,
        "viscous_friction_propeller_side_N_m_s_rad": 300.0,
    }
    return Ship.model_validate(tree)


def test_record_says_that_the_speed_is_held(held: Ship, frigate: Ship) -> None:
    plant = held.record()
    assert (plant["drive_min"], plant["drive_max"]) == (-15.0, 15.0)
    assert (plant["prime_mover"], plant["speed_held"]) == (SpeedSource.code, 1) == (3, 1)
    assert plant["rack_rate_limit"] == math.inf
    assert frigate.record()["speed_held"] == 0
    assert frigate.turns_freely
    assert not held.turns_freely


def test_it_has_no_balance_of_its_own(held: Ship) -> None:
    assert held.balances == ("propeller", "sensor", "hull", "pitch-actuator")
    assert SpeedSource.demand.column == "shaft_speed_rad_s"
    for key in ("inertia_engine_side_kg_m2", "gear_ratio", "coulomb_friction_engine_side_N_m"):
        with pytest.raises(ShipError, match=f"{key} has no effect: frigate has a shaft whose sp"):
            held.parameter(f"transmission.{key}")
    assert held.has_key("transmission.inertia_propeller_side_kg_m2")


def test_the_shaft_is_led_from_demand_to_demand(held: Ship) -> None:
    """A demand is reached at its step's end, in a straight line; the angle is the area below it."""
    demands = np.array([10.0, 11.0, 11.0, 8.0])
    run = simulate(held, Schedule(demands, 1.2), 0.2, initial=State(1.2, 10.0, 7.0))
    assert run["shaft_speed"].tolist() == [10.0, 10.0, 11.0, 11.0, 8.0]
    rates = np.array([0.0, 20.0, 0.0, -60.0])
    np.testing.assert_allclose(run["shaft_acceleration"][:-1], rates, atol=1e-12)
    mean = np.cumsum([0.0, 10.0, 10.5, 11.0, 9.5]) * 0.05
    np.testing.assert_allclose(run["shaft_angle"], mean, rtol=1e-12)
    limited = simulate(held, Schedule(99.0, 1.2), 0.1, initial=State(1.2, 10.0, 7.0))
    assert limited["shaft_speed"][-1] == 15.0


def test_the_gauge_feels_the_load_and_what_turns_behind_it(held: Ship) -> None:
    demands = np.linspace(10.0, 12.0, 41)[1:]
    run = simulate(held, Schedule(demands, 1.2), 2.0, initial=State(1.2, 10.0, 7.0))[:-1]
    expected = run["propeller_torque"] + 300.0 * run["shaft_speed"] + RIGHT * 1.0
    np.testing.assert_allclose(run["shaft_torque"], expected, rtol=1e-9)
    load = propeller_load(
        held.record(), run["advance_velocity"][7], run["shaft_speed"][7], 1.2, 4, 0
    )
    assert run["thrust"][7] == pytest.approx(load.thrust, rel=1e-12)


def test_it_takes_the_torque_that_it_needs() -> None:
    plant = load_ship("frigate").record()
    assert holding_torque(plant, 2e5, 0.5) == 2e5 + 0.5 * (53697.0 + RIGHT)


def test_a_hull_sails_as_behind_the_shaft_that_turned_so(frigate: Ship) -> None:
    """What a diesel's shaft did, given as the demand: the same speed, thrust and torque behind it."""
    schedule = Schedule(lambda t: np.where(t < 20.0, 22.0, 26.0), 1.3)
    start = equilibrium(frigate, 22.0, 1.3).state
    run = simulate(frigate, schedule, 60.0, initial=start)
    tree = frigate.model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "speed-command", "speed_max_rad_s": 20.0}
    follower = Ship.model_validate(tree)
    again = simulate(follower, Schedule(run["shaft_speed"][1:], 1.3), 60.0, initial=start)
    np.testing.assert_allclose(again["ship_speed"], run["ship_speed"], rtol=1e-6)
    np.testing.assert_allclose(again["thrust"], run["thrust"], rtol=1e-5)
    np.testing.assert_allclose(again["propeller_torque"], run["propeller_torque"], rtol=1e-5)
    rising = slice(0, -1)
    np.testing.assert_allclose(
        again["shaft_torque"][rising], run["shaft_torque"][rising], rtol=2e-2
    )


def test_steady_at_a_speed_and_linear_about_it(held: Ship) -> None:
    point = equilibrium(held, 11.0, 1.2)
    assert point.state.shaft_speed == 11.0
    assert point.outputs.shaft_torque == pytest.approx(point.outputs.propeller_torque + 3300.0)
    model = linearise(held, point, outputs=("shaft_speed", "ship_speed", "thrust"))
    assert list(model.state_labels) == ["pitch_ratio", "ship_speed"]
    to_drive = model.input_labels.index("drive")
    assert np.asarray(model.D)[0, to_drive] == 1.0
    faster = equilibrium(held, 11.0 + 1e-5, 1.2)
    settled = np.real(model(0.0, squeeze=False))[1, to_drive]
    assert settled == pytest.approx(
        (faster.state.ship_speed - point.state.ship_speed) / 1e-5, rel=1e-4
    )


def recording(ship: Ship, interval: float = 0.2) -> pd.DataFrame:
    time = interval * np.arange(200)
    table = pd.DataFrame({"time_s": time, "pitch_ratio_command": 1.2, "thrust_N": 0.0})
    return table.assign(shaft_speed_rad_s=10.0 + np.sin(time), pitch_ratio=1.2, ship_speed_m_s=7.0)


def test_a_recorded_speed_is_followed_from_row_to_row(held: Ship) -> None:
    table = recording(held)
    replay = Replay(held, table, 2.0)
    assert replay.channels == ["pitch_ratio", "ship_speed_m_s", "thrust_N"]  # the speed is given
    found = replay.simulate(held.record())
    np.testing.assert_allclose(found["shaft_speed"], table["shaft_speed_rad_s"], atol=1e-12)
    told = simulate_recording(held, table)
    assert (told["shaft_speed_rad_s"] == table["shaft_speed_rad_s"]).all()
    coarse = told["thrust_N"][::2].to_numpy()
    fine = simulate_recording(held, recording(held, 0.1))
    assert len(coarse) == 100
    assert fine["thrust_N"].iloc[0] == pytest.approx(coarse[0])


@pytest.mark.parametrize("place", ["drive", "drive_torque"])
def test_a_term_on_the_drive_acts_on_nothing(held: Ship, place: Any) -> None:
    with pytest.raises(ShipError, match=f"'more' has no effect: acts_on = '{place}'"):
        held.with_term(Term(id="more", acts_on=place, expression="1"))
