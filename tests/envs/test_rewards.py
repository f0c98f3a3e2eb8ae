"""Each reward term by hand, at its limit from both sides, goals, and the reward of an interval."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from shaftline.envs import TERMS, Goals
from shaftline.envs.rewards import (
    REWARD_TERMS,
    Instant,
    add_terms,
    clear_terms,
    goal_value,
    goals_record,
    reward_of,
    total_fuel_flow,
)
from shaftline.plant import load_ship
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.state import Outputs

GEAR, LOWEST, HIGHEST = 7.38, 350.0 * math.pi / 30.0, 1000.0 * math.pi / 30.0
SPEED = 10.0  # of the shaft [rad/s]
LIMIT = 15e3 + 467.0 * (GEAR * SPEED - LOWEST)  # of the brake torque there [N m]
QUIET = Instant(
    order=8.0, ship_speed=8.0, shaft_speed=SPEED, rack=10.0, drive=10.0, drive_before=10.0,
    mean_torque=2e5, mean_brake_torque=2e4, attack=3.0, mean_attack=3.0, outside_bucket=0.0,
    pitch_before=1.2, mean_speed=8.0, reference_fuel=0.0, reference_power=4e6,
    heading_error=0.0, track_error=0.0, rudder_turn=0.0, dt=0.05,
)  # fmt: skip
"""An instant in which every term but the fuel flow is 0."""


def rack_at(torque: float, shaft_speed: float = SPEED) -> float:
    """Fuel rack [mm] whose rack map asks for a brake torque."""
    return (torque + 45.5 * GEAR * shaft_speed + 7381.0) / 1428.6


def outputs(**values: float) -> Outputs:
    plain = dict.fromkeys(Outputs._fields, 0.0) | {
        "pitch_ratio": 1.2,
        "advance_velocity": 7.0,
        "submergence": 4.0,
        "shaft_torque": 2e5,
        "brake_torque": 2e4,
    }
    return Outputs(**(plain | values))


def terms_of(now: Instant = QUIET, share: float = 1.0, fuel: float = 0.0, **out: float) -> Any:
    terms = np.zeros(1, REWARD_TERMS)[0]
    add_terms(terms, load_ship("frigate").record(), outputs(**out), now, share, fuel)
    return {name: float(terms[name]) for name in TERMS if terms[name] != 0.0}


def test_at_the_order_in_a_steady_state_every_term_is_zero() -> None:
    assert terms_of() == {}


@pytest.mark.parametrize(("speed", "error"), [(8.5, 0.5), (6.0, 2.0)])
def test_speed_error_counts_both_ways(speed: float, error: float) -> None:
    assert terms_of(QUIET._replace(ship_speed=speed), share=0.5) == {"speed_error_m_s": 0.5 * error}


def test_fuel_is_that_of_both_engines() -> None:
    assert terms_of(fuel=0.4, share=0.25) == {"fuel_kg_s": 0.1}
    plant = load_ship("frigate").record()
    one = fuel_rate(plant, GEAR * SPEED, 2e4)
    assert one > 0.01
    assert total_fuel_flow(plant, SPEED, 2e4) == pytest.approx(2.0 * one)


def test_nox_is_that_of_both_engines() -> None:
    ship = load_ship("frigate").with_values({"emissions.nox_base_g_kWh": 9.0})
    terms = np.zeros(1, REWARD_TERMS)[0]
    add_terms(terms, ship.record(), outputs(brake_torque=2e4), QUIET, 0.25, 0.0)
    one = 9.0 * GEAR * SPEED * 2e4 / 3.6e6  # g/s at 9 g/kWh
    assert terms["nox_g_s"] == pytest.approx(0.25 * 2.0 * one)


@pytest.mark.parametrize(
    ("share_of_limit", "expected", "near"),
    [
        (0.94, 0.0, 0.0),
        (0.96, 0.0, 0.2),
        (0.99, 0.0, 0.8),
        (1.01, 0.01, 1.0),
        (1.1, 0.1, 1.0),
        (1.5, 0.5, 1.0),
    ],
)
@pytest.mark.parametrize("shaft_speed", [SPEED, 0.98 * HIGHEST / GEAR])
def test_overload_counts_from_the_envelope_on_and_nearness_from_a_twentieth_below(
    share_of_limit: float, expected: float, near: float, shaft_speed: float
) -> None:
    limit = min(15e3 + 467.0 * (GEAR * shaft_speed - LOWEST), 38e3)
    now = QUIET._replace(shaft_speed=shaft_speed, rack=rack_at(share_of_limit * limit, shaft_speed))
    found = terms_of(now, share=0.5)
    both = {"overload": 0.5 * expected, "near_limit": 0.5 * near}
    assert found == pytest.approx({name: value for name, value in both.items() if value})


def test_overload_is_of_the_rack_not_of_its_command() -> None:
    assert terms_of(QUIET._replace(drive=40.0, drive_before=40.0)) == {}
    assert terms_of(QUIET._replace(rack=rack_at(1.2 * LIMIT))) == pytest.approx(
        {"overload": 0.2, "near_limit": 1.0}
    )


@pytest.mark.parametrize(("fuel", "excess"), [(0.3, 0.2), (0.25, 0.0), (0.2, -0.2), (0.0, -1.0)])
def test_fuel_excess_is_relative_to_the_reference_and_negative_below_it(
    fuel: float, excess: float
) -> None:
    found = terms_of(QUIET._replace(reference_fuel=0.25), share=0.5, fuel=fuel)
    assert found.get("fuel_excess", 0.0) == pytest.approx(0.5 * excess)
    assert found.get("fuel_kg_s", 0.0) == 0.5 * fuel


@pytest.mark.parametrize("gain", [-0.1, 0.1])
def test_way_that_is_gained_counts_as_fuel_saved(gain: float) -> None:
    """Kinetic energy changes by m v (v - mean) / 20 s; the reference tows the ship at 4 MW."""
    now = QUIET._replace(reference_fuel=0.25, mean_speed=8.0 - gain)
    mass = float(load_ship("frigate").record()["mass"])
    expected = -mass * (8.0 - gain) * gain / 20.0 / 4e6
    assert abs(expected) > 0.02
    assert terms_of(now, fuel=0.25)["fuel_excess"] == pytest.approx(expected)


@pytest.mark.parametrize("mean", [1.8e5, 2.2e5])
def test_torque_fluctuation_is_a_share_of_the_highest_shaft_torque(mean: float) -> None:
    assert terms_of(QUIET._replace(mean_torque=mean), share=0.25) == pytest.approx(
        {"torque_fluctuation": 0.25 * 2e4 / (38e3 * GEAR)}
    )


@pytest.mark.parametrize("mean", [1.5e4, 2.5e4])
def test_engine_fluctuation_is_a_share_of_the_highest_engine_torque(mean: float) -> None:
    assert terms_of(QUIET._replace(mean_brake_torque=mean), share=0.25) == pytest.approx(
        {"engine_fluctuation": 0.25 * 5e3 / 38e3}
    )


def test_an_engine_without_a_highest_torque_has_no_fluctuation_terms() -> None:
    ship = load_ship("frigate").with_values({"prime_mover.torque_limit_N_m": math.inf})
    terms = np.zeros(1, REWARD_TERMS)[0]
    now = QUIET._replace(mean_torque=1e5, mean_brake_torque=1e4)
    add_terms(terms, ship.record(), outputs(), now, 1.0, 0.0)
    assert not any(terms)


@pytest.mark.parametrize("attack", [1.0, 5.0])
def test_attack_fluctuation_and_angles_outside_the_bucket_are_in_degrees(attack: float) -> None:
    now = QUIET._replace(attack=attack, outside_bucket=0.4)
    assert terms_of(now, share=0.25) == pytest.approx(
        {"attack_fluctuation_deg": 0.25 * 2.0, "outside_bucket_deg": 0.25 * 0.4}
    )


@pytest.mark.parametrize("before", [1.1, 1.3])
def test_pitch_travel_is_a_sum_not_a_mean(before: float) -> None:
    assert terms_of(QUIET._replace(pitch_before=before), share=0.1) == pytest.approx(
        {"pitch_travel": 0.1}
    )


@pytest.mark.parametrize("before", [9.0, 11.0])
def test_rack_travel_is_a_sum_not_a_mean(before: float) -> None:
    assert terms_of(QUIET._replace(drive_before=before), share=0.1) == {"rack_travel_mm": 1.0}


@pytest.mark.parametrize(("share_of_limit", "expected"), [(0.999, 0.0), (1.001, 0.001), (1.3, 0.3)])
def test_cavitation_counts_from_burrills_limit_on(share_of_limit: float, expected: float) -> None:
    square = 7.0**2 + (0.35 * 4.2 * SPEED) ** 2
    sigma = (101325.0 - 1671.0 + 1025.0 * 9.81 * 4.0) / (0.5 * 1025.0 * square)
    area = 0.9 * math.pi / 4.0 * 4.2**2 * (1.067 - 0.229 * 1.2)
    limit = 0.5 * 1025.0 * square * area * 0.28 * (sigma - 0.03) ** 0.57
    found = terms_of(share=0.5, thrust=share_of_limit * limit)
    assert found == pytest.approx({"cavitation": 0.5 * expected} if expected else {}, rel=0.01)


@pytest.mark.parametrize(
    ("share_of_highest", "expected"), [(0.999, 0.0), (1.001, 1e-3), (1.1, 0.1)]
)
def test_overspeed_counts_from_the_highest_speed_on(
    share_of_highest: float, expected: float
) -> None:
    found = terms_of(QUIET._replace(shaft_speed=share_of_highest * HIGHEST / GEAR), share=0.5)
    assert found == pytest.approx({"overspeed": 0.5 * expected} if expected else {})


def test_steps_add_up_and_are_cleared() -> None:
    terms = np.zeros(1, REWARD_TERMS)[0]
    for ship_speed in (8.2, 7.4):
        now = QUIET._replace(ship_speed=ship_speed)
        add_terms(terms, load_ship("frigate").record(), outputs(), now, 0.5, 0.2)
    assert terms["speed_error_m_s"] == pytest.approx(0.4)
    assert terms["fuel_kg_s"] == pytest.approx(0.2)
    clear_terms(terms)
    assert not any(terms)


def test_steering_terms_are_in_degrees_and_metres_and_count_both_ways() -> None:
    for sign in (-1.0, 1.0):
        now = QUIET._replace(
            heading_error=sign * math.radians(3.0),
            track_error=sign * 20.0,
            rudder_turn=sign * math.radians(0.1),
        )
        assert terms_of(now, share=0.25) == pytest.approx(
            {
                "heading_error_deg": 0.75,
                "track_error_m": 5.0,
                "rudder_rate_deg_s": 0.25 * 0.1 / 0.05,
            }
        )


@pytest.mark.parametrize(
    ("x", "value"),
    [
        (-9.0, 1.0),
        (0.3, 1.0),
        (0.3 + 1e-9, 1.0),
        (0.3 + 2.0 / 3.0, 0.5),
        (2.3, 0.1),
        (0.3 + 4.0, 1.0 / 37.0),
        (0.3 + 2e3, 1.0 / 9000001.0),
        (1e300, 0.0),
        (math.inf, 0.0),
        (math.nan, 0.0),
        (-math.inf, 1.0),
    ],
)
def test_the_value_of_a_goal_is_one_within_and_a_tenth_one_margin_beyond(
    x: float, value: float
) -> None:
    assert goal_value(x, 0.3, 2.0) == pytest.approx(value, abs=1e-12)


def goal(within: float, margin: float, weight: float | None = None) -> dict[str, Any]:
    """Return the fields of a goal."""
    return {"within": within, "margin": margin, "weight": weight}


def reward(goals: Goals, **terms: float) -> float:
    """Return the reward of an interval with these terms, the others 0."""
    record = np.zeros(1, REWARD_TERMS)[0]
    for name, value in terms.items():
        record[name] = value
    return reward_of(goals_record(goals), record)


def test_goals_without_weight_multiply() -> None:
    goals = Goals.model_validate(
        {"speed_error_m_s": goal(0.1, 2.0), "overload": goal(0.0, 0.1)},
    )
    assert reward(goals) == 1.0
    assert reward(goals, speed_error_m_s=2.1) == pytest.approx(0.1)
    assert reward(goals, overload=0.1) == pytest.approx(0.1)
    assert reward(goals, speed_error_m_s=2.1, overload=0.1) == pytest.approx(0.01)
    assert reward(goals, speed_error_m_s=math.nan) == 0.0
    assert reward(goals, fuel_kg_s=9.0, heading_error_deg=90.0) == 1.0  # terms without a goal


def test_goals_with_weights_share_and_are_scaled_by_the_factors() -> None:
    goals = Goals.model_validate(
        {
            "speed_error_m_s": goal(0.0, 1.0),
            "cavitation": goal(0.0, 0.5, 0.5),
            "fuel_excess": goal(-0.2, 0.4, 0.3),
        }
    )
    assert reward(goals, fuel_excess=-0.3) == 1.0
    assert reward(goals, fuel_excess=0.2) == pytest.approx(1.0 - 0.3 * 0.9)
    assert reward(goals, fuel_excess=-0.3, cavitation=0.5) == pytest.approx(1.0 - 0.5 * 0.9)
    both = 1.0 - 0.8 * 0.9
    assert reward(goals, fuel_excess=0.2, cavitation=0.5) == pytest.approx(both)
    assert reward(goals, fuel_excess=0.2, cavitation=0.5, speed_error_m_s=1.0) == pytest.approx(
        0.1 * both
    )
    assert reward(goals, fuel_excess=math.nan, cavitation=math.inf) == pytest.approx(0.2)


@pytest.mark.parametrize("name", TERMS)
def test_every_term_may_be_a_goal_of_either_kind(name: str) -> None:
    factor = Goals.model_validate({name: {"within": 1.0, "margin": 0.5}})
    share = Goals.model_validate({name: {"within": 1.0, "margin": 0.5, "weight": 1.0}})
    for goals in (factor, share):
        assert list(goals.used) == [name]
        assert reward(goals, **{name: 1.0}) == 1.0
        assert reward(goals, **{name: 1.5}) == pytest.approx(0.1)
        others = dict.fromkeys(set(TERMS) - {name}, 99.0)
        assert reward(goals, **others) == 1.0


NUMBER = st.floats(allow_nan=True, allow_infinity=True)
GOAL = st.builds(
    lambda within, margin, weight: {"within": within, "margin": margin, "weight": weight},
    st.floats(-1e3, 1e3),
    st.floats(1e-9, 1e9),
    st.none() | st.floats(1e-6, 1.0 / len(TERMS)),
)


@settings(max_examples=300, deadline=None)
@given(
    goals=st.dictionaries(st.sampled_from(TERMS), GOAL, min_size=1),
    values=st.lists(NUMBER, min_size=len(TERMS), max_size=len(TERMS)),
)
def test_a_reward_lies_between_zero_and_one_and_falls_with_every_term(
    goals: dict[str, Any], values: list[float]
) -> None:
    chosen, terms = Goals.model_validate(goals), dict(zip(TERMS, values, strict=True))
    found = reward(chosen, **terms)
    assert 0.0 <= found <= 1.0
    for name in goals:
        assert reward(chosen, **terms | {name: math.inf}) <= found
        assert reward(chosen, **terms | {name: math.nan}) <= found
        assert reward(chosen, **terms | {name: -1e3}) >= found


@pytest.mark.parametrize(
    ("goals", "words"),
    [
        ({}, "a task needs at least one goal"),
        ({"overload": None}, "a task needs at least one goal"),
        (
            {
                "overload": {"within": 0.0, "margin": 1.0, "weight": 0.6},
                "cavitation": {"within": 0.0, "margin": 1.0, "weight": 0.5},
            },
            r"the weights of the goals add up to 1\.1; at most 1 is allowed",
        ),
        ({"overload": {"within": 0.0, "margin": 0.0}}, "(?s)overload.margin.*greater than 0"),
        ({"overload": {"within": 0.0, "margin": -1.0}}, "(?s)overload.margin.*greater than 0"),
        ({"overload": {"within": 0.0, "margin": math.inf}}, "(?s)overload.margin.*finite"),
        ({"overload": {"within": math.nan, "margin": 1.0}}, "(?s)overload.within.*finite"),
        ({"overload": {"within": 0.0}}, "(?s)overload.margin.*required"),
        ({"overload": {"within": 0.0, "margin": 1.0, "weight": 0.0}}, "(?s)weight.*greater than 0"),
        ({"overload": {"within": 0.0, "margin": 1.0, "weight": 1.1}}, "(?s)weight.*equal to 1"),
        ({"fog": {"within": 0.0, "margin": 1.0}}, "(?s)fog.*not permitted"),
    ],
)
def test_goals_that_make_no_reward_are_refused(goals: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Goals.model_validate(goals)


def test_weights_may_add_up_to_one_and_goals_are_frozen() -> None:
    third = {"within": 0.0, "margin": 1.0, "weight": 1.0 / 3.0}
    goals = Goals.model_validate(dict.fromkeys(TERMS[:3], third))
    assert reward(goals, **dict.fromkeys(TERMS[:3], math.inf)) == pytest.approx(0.0, abs=1e-12)
    over = Goals.model_validate(
        {"overload": goal(0, 1, 0.5), "cavitation": goal(0, 1, 0.5 + 5e-10)}
    )
    assert reward(over, overload=math.inf, cavitation=math.inf) == 0.0  # rounding is no penalty
    with pytest.raises(ValidationError, match="frozen"):
        goals.overload = None
