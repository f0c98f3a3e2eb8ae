"""The states, declared once, and what follows from their declaration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.plant import load_ship
from shaftline.plant.state import (
    LAGGING,
    LAGS,
    STATE,
    WAITING,
    Inputs,
    State,
    _root,
    active_states,
    get_state,
    motion_state,
    set_state,
    shift_state,
    without_lags,
    zero_lag_rates,
)

COUNTING = State(*(float(k) for k in range(1, 9)))


@pytest.mark.parametrize(
    ("fields", "states"),
    [
        ({}, ["pitch_ratio", "shaft_speed", "ship_speed"]),
        ({"pitch_ratio_min": 1.4}, ["shaft_speed", "ship_speed"]),
        ({"hull_fixed": 1}, ["pitch_ratio", "shaft_speed"]),
        ({"speed_held": 1}, ["pitch_ratio", "ship_speed"]),
        ({"engine_lag": 0.1}, ["pitch_ratio", "shaft_speed", "ship_speed", "brake_torque"]),
        ({"inflow_lag": 0.1}, ["pitch_ratio", "shaft_speed", "ship_speed", "inflow"]),
        (
            {"ventilation_torque_loss": 0.1},
            ["pitch_ratio", "shaft_speed", "ship_speed", "ventilation"],
        ),
    ],
    ids=str,
)
def test_a_ship_has_the_states_of_its_record(
    plant: Any, fields: dict[str, float], states: list[str]
) -> None:
    for name, value in fields.items():
        plant[name] = value
    assert active_states(plant) == states


def test_a_motor_has_a_current_where_it_has_inductance() -> None:
    tug = load_ship("tito-neri-sine").record()
    assert active_states(tug) == ["shaft_speed", "motor_current"]
    assert active_states(without_lags(tug)) == ["shaft_speed"]


def test_lags_are_named_with_their_fields(plant: Any) -> None:
    assert LAGS == {
        "brake_torque": "engine_lag",
        "inflow": "inflow_lag",
        "motor_current": "armature_inductance",
        "charge": "charge_lag",
        "warmth": "warmth_lag",
        "rudder_angle": "rudder_lag",
    }
    prompt, waiting = (
        {name for name, lags in probe._asdict().items() if lags} for probe in (LAGGING, WAITING)
    )
    assert waiting == {"charge", "warmth"}
    assert prompt | waiting == set(LAGS)
    assert set(LAGGING) == {0.0, 1.0}


def test_without_lags_is_a_copy_that_is_prompt(plant: Any) -> None:
    plant["engine_lag"], plant["inflow_lag"], plant["speed_log_lag"] = 1.5, 2.0, 5.0
    prompt = without_lags(plant)
    assert (prompt["engine_lag"], prompt["inflow_lag"]) == (0.0, 0.0)
    assert (plant["engine_lag"], plant["inflow_lag"]) == (1.5, 2.0)
    assert prompt["speed_log_lag"] == 5.0  # an instrument's, no state of the plant
    assert prompt["mass"] == plant["mass"]


def test_a_state_moves_field_by_field() -> None:
    rate = State(*(10.0 * x for x in COUNTING))
    assert shift_state(COUNTING, rate, 0.5) == tuple(6.0 * x for x in COUNTING)


def test_a_state_survives_its_record() -> None:
    record = np.zeros(1, STATE)[0]
    set_state(record, COUNTING)
    assert tuple(record) == tuple(COUNTING)
    assert get_state(record) == COUNTING
    assert STATE.names == State._fields


@pytest.mark.parametrize(
    ("rate", "beside", "lags", "found"),
    [
        (6.0, 4.0, 1.0, 8.0),  # falls by 2 for each unit: 3 units on
        (-1.0, -5.0, 1.0, 4.75),
        (6.0, 6.0, 1.0, 5.0),  # nothing leads it anywhere
        (6.0, 4.0, 0.0, 5.0),  # no lag
    ],
)
def test_root_of_a_rate_that_is_a_line(
    rate: float, beside: float, lags: float, found: float
) -> None:
    assert _root(5.0, rate, beside, lags) == found


def test_rates_vanish_for_the_lags_alone() -> None:
    rate = State(*(2.0 for _ in COUNTING))
    beside = State(*(1.0 for _ in COUNTING))
    found = zero_lag_rates(COUNTING, rate, beside, LAGGING)
    expected = [x + 2.0 * lags for x, lags in zip(COUNTING, LAGGING, strict=True)]
    assert list(found) == expected


def test_state_of_the_motion_alone() -> None:
    assert motion_state(1.2, 10.0, 8.0) == State(1.2, 10.0, 8.0)


def test_absent_states_and_disturbances_are_nothing() -> None:
    assert tuple(State(1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0, *18 * (0.0,))
    assert tuple(Inputs(22.0, 1.4)) == (22.0, 1.4, *6 * (0.0,), 1.0, *6 * (0.0,), 6 * (0.0,))
