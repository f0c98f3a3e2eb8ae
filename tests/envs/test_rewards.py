"""Each reward term by hand, at its limit from both sides, and what they add up to."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from shaftline.envs import TERMS, Weights, tasks
from shaftline.envs.rewards import (
    REWARD_TERMS,
    Instant,
    add_terms,
    clear_terms,
    fuel_of_all,
    reward_of,
    running_cost,
)
from shaftline.plant import load_ship
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.state import Outputs

GEAR, LOWEST, HIGHEST = 7.38, 350.0 * math.pi / 30.0, 1000.0 * math.pi / 30.0
SPEED = 10.0  # of the shaft [rad/s]
LIMIT = 15e3 + 467.0 * (GEAR * SPEED - LOWEST)  # of the brake torque there [N m]
QUIET = Instant(
    order=8.0, ship_speed=8.0, shaft_speed=SPEED, rack=10.0, drive=10.0, drive_before=10.0,
    torque_before=2e5, mean_torque=2e5, mean_brake_torque=2e4, attack=3.0, mean_attack=3.0,
    outside_bucket=0.0, heading_error=0.0,
    track_error=0.0, rudder_turn=0.0, dt=0.05,
)  # fmt: skip
"""No term but the fuel's has anything to say."""


def rack_at(torque: float, shaft_speed: float = SPEED) -> float:
    """Fuel rack [mm] whose rack map asks for a brake torque."""
    return (torque + 45.5 * GEAR * shaft_speed + 7381.0) / 1428.6


def outputs(**values: float) -> Outputs:
    plain = dict.fromkeys(Outputs._fields, 0.0) | {
        "pitch_ratio": 1.2, "advance_velocity": 7.0, "submergence": 4.0, "shaft_torque": 2e5,
        "brake_torque": 2e4,
    }  # fmt: skip
    return Outputs(**(plain | values))


def terms_of(now: Instant = QUIET, share: float = 1.0, fuel: float = 0.0, **out: float) -> Any:
    terms = np.zeros(1, REWARD_TERMS)[0]
    add_terms(terms, load_ship("frigate").record(), outputs(**out), now, share, fuel)
    return {name: float(terms[name]) for name in TERMS if terms[name] != 0.0}


def test_a_quiet_instant_costs_nothing() -> None:
    assert terms_of() == {}


@pytest.mark.parametrize(("speed", "error"), [(8.5, 0.5), (6.0, 2.0)])
def test_speed_error_counts_both_ways(speed: float, error: float) -> None:
    assert terms_of(QUIET._replace(ship_speed=speed), share=0.5) == {
        "speed_error_m_s": 0.5 * error, "speed_error_squared_m2_s2": 0.5 * error**2,
    }  # fmt: skip


def test_fuel_is_that_of_both_engines() -> None:
    assert terms_of(fuel=0.4, share=0.25) == {"fuel_kg_s": 0.1}
    plant = load_ship("frigate").record()
    one = fuel_rate(plant, GEAR * SPEED, 2e4)
    assert one > 0.01
    assert fuel_of_all(plant, SPEED, 2e4) == pytest.approx(2.0 * one)


@pytest.mark.parametrize(
    ("share_of_limit", "expected", "near"),
    [(0.94, 0.0, 0.0), (0.96, 0.0, 0.2), (0.99, 0.0, 0.8), (1.01, 0.01, 1.0), (1.1, 0.1, 1.0),
     (1.5, 0.5, 1.0)],
)  # fmt: skip
@pytest.mark.parametrize("shaft_speed", [SPEED, 0.98 * HIGHEST / GEAR])
def test_overload_counts_from_the_envelope_on_and_nearness_from_a_twentieth_below(
    share_of_limit: float, expected: float, near: float, shaft_speed: float
) -> None:
    limit = min(15e3 + 467.0 * (GEAR * shaft_speed - LOWEST), 38e3)
    now = QUIET._replace(
        shaft_speed=shaft_speed, rack=rack_at(share_of_limit * limit, shaft_speed)
    )  # fmt: skip
    found = terms_of(now, share=0.5)
    both = {"overload": 0.5 * expected, "near_limit": 0.5 * near}
    assert found == pytest.approx({name: value for name, value in both.items() if value})


def test_overload_is_of_the_rack_not_of_its_command() -> None:
    assert terms_of(QUIET._replace(drive=40.0, drive_before=40.0)) == {}
    assert terms_of(QUIET._replace(rack=rack_at(1.2 * LIMIT))) == pytest.approx(
        {"overload": 0.2, "near_limit": 1.0}
    )


@pytest.mark.parametrize("torque", [1.9e5, 2.1e5])
def test_torque_rate_is_the_change_at_the_gauge_over_a_step(torque: float) -> None:
    found = terms_of(QUIET._replace(mean_torque=torque), share=0.1, shaft_torque=torque)
    assert found == pytest.approx({"torque_rate_kN_m_s": 0.1 * 10.0 / 0.05})


@pytest.mark.parametrize("mean", [1.8e5, 2.2e5])
def test_torque_swing_is_the_distance_from_the_mean(mean: float) -> None:
    assert terms_of(QUIET._replace(mean_torque=mean), share=0.25) == pytest.approx(
        {"torque_swing_kN_m": 0.25 * 20.0}
    )


@pytest.mark.parametrize("mean", [1.5e4, 2.5e4])
def test_engine_swing_is_that_of_the_brake_torque(mean: float) -> None:
    assert terms_of(QUIET._replace(mean_brake_torque=mean), share=0.25) == pytest.approx(
        {"engine_swing_kN_m": 0.25 * 5.0}
    )


@pytest.mark.parametrize("attack", [1.0, 5.0])
def test_attack_swing_and_what_lies_outside_the_bucket_are_in_degrees(attack: float) -> None:
    now = QUIET._replace(attack=attack, outside_bucket=0.4)
    assert terms_of(now, share=0.25) == pytest.approx(
        {"attack_swing_deg": 0.25 * 2.0, "outside_bucket_deg": 0.25 * 0.4}
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


def test_the_running_cost_is_the_weighted_sum() -> None:
    weights, terms = np.zeros((2, 1), REWARD_TERMS)[:, 0]
    for i, name in enumerate(TERMS):
        weights[name], terms[name] = 10.0**i, i + 1.0
    assert running_cost(weights, terms) == sum((i + 1.0) * 10.0**i for i in range(len(TERMS)))
    for name in TERMS:
        alone = np.zeros(1, REWARD_TERMS)[0]
        alone[name] = 2.0
        assert running_cost(weights, alone) == 2.0 * weights[name]


@pytest.mark.parametrize(
    ("cost", "reward"),
    [(0.0, 0.0), (3.5, -3.5), (4.0, -4.0), (4.5, -4.0), (math.inf, -4.0), (math.nan, -4.0),
     (-2.0, 0.0)],
)  # fmt: skip
def test_an_interval_costs_from_nothing_to_the_tasks_worst(cost: float, reward: float) -> None:
    assert reward_of(cost, False, 4.0, 600, 17) == reward


def test_a_failure_costs_a_worst_episode_and_what_is_left_of_it() -> None:
    for cost in (0.0, 3.5, 99.0, math.nan):
        assert reward_of(cost, True, 4.0, 600, 0) == -4.0 * 1200
        assert reward_of(cost, True, 4.0, 600, 599) == -4.0 * 601


@settings(max_examples=300, deadline=None)
@given(
    costs=st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=60),
    other=st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=60),
    worst=st.floats(1e-6, 1e9),
    data=st.data(),
)
def test_no_failure_outscores_any_sequence_of_costs_without_one(
    costs: list[float], other: list[float], worst: float, data: st.DataObject
) -> None:
    """By the worst cost or more, whatever the costs, whenever it fails; and a later one never loses."""
    n = len(costs)

    def returned(costs: list[float], failing: int | None) -> float:
        """Return the sum of rewards, added one by one as an agent does."""
        total = 0.0
        for k, cost in enumerate(costs):
            total += reward_of(cost, k == failing, worst, n, k)
            if k == failing:
                break
        return total

    kept = returned(costs, None)
    failing = data.draw(st.integers(0, n - 1))
    failed = returned((other * n)[:n], failing)
    assert failed < kept
    assert failed <= -worst * n < 0.0
    assert kept >= -worst * n * (1.0 + 1e-12)
    if failing + 1 < n:
        rounding = 1e-12 * worst * n
        assert returned((other * n)[:n], failing + 1) >= failed - rounding


def test_weights_are_costs_and_few_have_a_default() -> None:
    needed = [name for name, field in Weights.model_fields.items() if field.is_required()]
    assert needed == list(TERMS[:7])
    plain = Weights(**dict.fromkeys(needed, 0.0))
    assert [getattr(plain, name) for name in TERMS[7:]] == 9 * [0.0]
    with pytest.raises(ValidationError, match="frozen"):
        plain.overload = 1.0
    with pytest.raises(ValidationError, match="finite"):
        Weights(**(dict.fromkeys(needed, 0.0) | {"overload": math.inf}))
    for name in TERMS:
        with pytest.raises(ValidationError, match=f"(?s){name}.*greater than or equal to 0"):
            Weights(**(dict.fromkeys(needed, 0.0) | {name: -1.0}))


def test_steering_terms_are_in_degrees_and_metres_and_count_both_ways() -> None:
    for sign in (-1.0, 1.0):
        now = QUIET._replace(
            heading_error=sign * math.radians(3.0), track_error=sign * 20.0,
            rudder_turn=sign * math.radians(0.1),
        )  # fmt: skip
        assert terms_of(now, share=0.25) == pytest.approx(
            {
                "heading_error_deg": 0.75,
                "track_error_m": 5.0,
                "rudder_rate_deg_s": 0.25 * 0.1 / 0.05,
            }
        )


def test_the_page_of_steering_tells_its_weights() -> None:
    page = (Path(__file__).parents[2] / "docs/steering.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"\| steered weight \|.*?\n\n", page, re.DOTALL)
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()[2:-1]]
    told = {name.strip("`"): [*map(float, row)] for name, *row in rows}
    weights = [task.weights.model_dump() for task in tasks(steered=True).values()]
    meant = {n: [w[n] for w in weights] for n in TERMS if any(w[n] for w in weights)}
    worst = [task.worst_cost for task in tasks(steered=True).values()]
    assert told == meant | {"worst_cost": worst}


def test_the_page_tells_every_term_as_it_is_declared() -> None:
    page = (Path(__file__).parents[2] / "docs/environment.md").read_text(encoding="utf-8")
    terms, weights, asked = (
        [line.strip("| ").split(" | ") for line in found.splitlines()[2:-1]]
        for found in re.findall(r"\| (?:term|weight|task) \|.*?\n\n", page, re.DOTALL)
    )
    assert {name.strip("`"): meaning.replace("\\|", "|") for name, meaning, _ in terms} == {
        name: field.description for name, field in Weights.model_fields.items()
    }
    assert {name.strip("`"): [*map(float, row)] for name, *row in weights} == {
        name: [getattr(task.weights, name) for task in tasks().values()] for name in TERMS
    } | {"worst_cost": [task.worst_cost for task in tasks().values()]}
    assert {name.strip("`"): (ship, text) for name, ship, text in asked} == {
        name: (task.vessel, task.description) for name, task in tasks().items()
    }
