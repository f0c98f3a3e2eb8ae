"""Time constants beside the time step: each one is resolved to 1 %, or refused by its key."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Schedule, State, equilibrium, load_ship, simulate
from shaftline.plant.keys import KeyInfo, Section, is_lag
from shaftline.plant.ship import Ship, ShipError
from shaftline.plant.state import LAGS
from shaftline.plant.time_constants import SHAFT, SWAY_AND_YAW, time_constants

SHIPS = sorted(path.stem for path in (Path(__file__).parents[2] / "plant/ships").glob("*.toml"))
STEP = 0.05
TURNING = load_ship("frigate-turning")


def _lags(ship: Ship) -> list[str]:
    """Dotted keys of all time constants of a ship's sections."""
    return [
        f"{name}.{key}"
        for name in type(ship).model_fields
        if isinstance(section := getattr(ship, name), Section)
        for key, info in type(section).model_fields.items()
        if is_lag(info)
    ]


@pytest.mark.parametrize("key", _lags(TURNING))
@pytest.mark.parametrize("share", [0.02, 0.34, 0.99])
def test_one_below_the_time_step_is_refused_by_key_value_and_limit(key: str, share: float) -> None:
    step = 0.4  # above the lowest value that each key allows
    value = share * step if share * step >= 0.05 else 0.05
    slow = TURNING.with_values(dict.fromkeys(_lags(TURNING), 1.0))
    with pytest.raises(ShipError, match=rf"{key} = {value:.4g} s is shorter than .* = 0.4 s"):
        slow.with_values({key: value, "integration.time_step_s": step})


@pytest.mark.parametrize("key", _lags(TURNING))
def test_one_of_a_time_step_is_allowed_and_0_where_it_leaves_the_lag_out(key: str) -> None:
    TURNING.with_values({key: STEP})
    if TURNING.parameter(key).info.neutral == 0.0:
        TURNING.with_values({key: 0.0, "rudder.rate_limit_rad_s": math.inf})


def test_every_state_that_lags_has_a_key_that_is_looked_at() -> None:
    fields = {TURNING.parameter(key).field for key in _lags(TURNING)}
    assert set(LAGS.values()) - fields == {"armature_inductance"}  # by its share of the resistance


@pytest.mark.parametrize("z", [0.2, 0.5, 1.0])
def test_a_step_response_is_exact_to_one_percent_down_to_the_limit(z: float) -> None:
    ship = TURNING.with_values({"rudder.time_constant_s": STEP / z})
    start = equilibrium(ship, 20.0, 1.2).state
    run = simulate(ship, Schedule(20.0, 1.2, rudder_command=1e-3), 20 * STEP, initial=start)
    assert run["rudder_angle"] / 1e-3 == pytest.approx(1.0 - np.exp(-z * np.arange(21)), abs=0.0072)


def test_the_limit_is_where_the_error_of_a_step_response_passes_one_percent() -> None:
    def error(z: float) -> float:
        factor = float(sum((-z) ** k / math.factorial(k) for k in range(5)))
        return max(abs(factor**n - math.exp(-z * n)) for n in range(1, 50))

    assert error(1.0) == pytest.approx(0.0071, abs=1e-4)
    assert error(1.1) > 0.01
    assert error(2.8) > 1.0


@pytest.mark.parametrize("name", SHIPS)
def test_the_packaged_ships_resolve_all_of_theirs(name: str) -> None:
    ship = load_ship(name)
    assert min(time_constants(ship).values(), default=1.0) >= ship.time_step_s


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        (
            "tito-neri-sine",
            {"integration.time_step_s": 1e-3},
            "armature_inductance_H / armature_res",
        ),
        (
            "frigate",
            {"transmission.viscous_friction_engine_side_N_m_s_rad": 9e6},
            "viscous friction",
        ),
        ("rov-thruster", {"prime_mover.motor_constant_V_s_rad": 5.0}, "back-EMF"),
        ("towing-tank", {"transmission.arctangent_friction_engine_side_N_m": 3e4}, "arctangent"),
        ("kvlcc2", {"manoeuvring.Y_v": -20.0}, "sway and yaw"),
        ("kvlcc2", {"manoeuvring.N_r": -5.0}, "sway and yaw"),
    ],
)
def test_what_damps_a_motion_faster_than_the_time_step_is_refused(
    name: str, change: dict[str, float], words: str
) -> None:
    with pytest.raises(ShipError, match=words) as caught:
        load_ship(name).with_values(change)
    assert "integration.time_step_s" in str(caught.value)


def test_the_shafts_is_its_inertia_over_what_damps_it() -> None:
    ship = load_ship("frigate").with_values(
        {
            "transmission.viscous_friction_engine_side_N_m_s_rad": 1000.0,
            "transmission.viscous_friction_propeller_side_N_m_s_rad": 500.0,
        }
    )
    inertia = 68108.0
    assert time_constants(ship)[SHAFT] == pytest.approx(inertia / 1500.0)


@pytest.mark.parametrize("name", ["kvlcc2", "frigate-turning", "esso-osaka", "ddg-51-surrogate"])
def test_that_of_sway_and_yaw_is_of_the_matrix_of_derivatives(name: str) -> None:
    """``(M - A) dx/dt = N x`` of x = (v/U, r L/U) without dimension, by the keys of the ship's file."""
    ship = load_ship(name)
    own = ship.manoeuvring
    area = own.draught_m if own.normalised_by == "length-draught" else own.length_m
    mass = own.displacement_kg / (0.5 * ship.water.density_kg_m3 * own.length_m**2 * area)
    along = ship.hull.mass_kg / own.displacement_kg * mass
    off, gyration = (
        at / own.length_m for at in (own.centre_of_gravity_m, own.radius_of_gyration_m)
    )
    inertia = np.array(
        [
            [mass - own.Y_vdot, mass * off - own.Y_rdot],
            [mass * off - own.N_vdot, mass * (gyration**2 + off**2) - own.N_rdot],
        ]
    )
    damping = np.array([[own.Y_v, own.Y_r - along], [own.N_v, own.N_r - mass * off]])
    fastest = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, damping)).real).max()
    seconds_a_length = own.length_m / (0.5 * math.sqrt(9.80665 * own.length_m))
    assert time_constants(ship)[SWAY_AND_YAW] == pytest.approx(seconds_a_length / fastest, rel=1e-5)


def _with_term(rate: str, **parameters: float) -> dict[str, Any]:
    term = {
        "id": "mine",
        "acts_on": "inflow_velocity",
        "expression": "u - advance_velocity",
        "state": "u",
        "rate": rate,
        "parameters": parameters,
    }
    return {"term": [term]}


@pytest.mark.parametrize(
    ("rate", "parameters", "fastest"),
    [
        ("(advance_velocity - u) / tau", {"tau": 0.017}, 0.017),
        ("(advance_velocity - u) / tau", {"tau": 0.001}, 0.001),
        ("(advance_velocity - u) * abs(shaft_speed) * k", {"k": 10.0}, None),
        ("1e4 * (1 - u ** 2)", {}, 5e-5),
    ],
)
def test_a_terms_state_that_is_too_fast_is_refused(
    rate: str, parameters: dict[str, float], fastest: float | None
) -> None:
    with pytest.raises(
        ShipError, match=r"term 'mine': its state u .*time_step_s = 0.05 s"
    ) as caught:
        load_ship("frigate").with_values(_with_term(rate, **parameters))
    if fastest is not None:
        assert f"a time constant of {fastest:.4g} s" in str(caught.value)


@pytest.mark.parametrize(
    ("rate", "parameters"),
    [("(advance_velocity - u) / tau", {"tau": 0.05}), ("shaft_speed", {}), ("-u ** 3", {})],
)
def test_a_terms_state_that_is_slow_enough_is_carried(
    rate: str, parameters: dict[str, float]
) -> None:
    load_ship("frigate").with_values(_with_term(rate, **parameters))


def test_a_number_is_moved_out_of_what_the_step_cannot_resolve() -> None:
    info = load_ship("frigate").parameter("propeller.inflow_lag_s").info
    assert info == KeyInfo("s", 0.0, 60.0, 0.0, gap=STEP)
    assert [info.inside(v) for v in (-1.0, 0.0, 0.02, 0.03, 0.2, 99.0)] == [0, 0, 0, STEP, 0.2, 60]
    lagging = load_ship("frigate").with_values({"propeller.inflow_lag_s": 1.0})
    assert lagging.parameter("propeller.inflow_lag_s").info.low == STEP


def test_the_range_of_an_armature_ends_where_the_step_does_not_resolve_it() -> None:
    ship = load_ship("tito-neri-sine")
    for key in ("armature_inductance_H", "armature_resistance_ohm"):
        number = ship.parameter(f"prime_mover.{key}")
        edge = number.info.low if key.endswith("H") else number.info.high
        moved = ship.with_values({number.key: edge})
        (constant,) = moved.prime_mover.time_constants.values()
        assert constant == pytest.approx(ship.time_step_s)


@pytest.mark.parametrize(
    "changes",
    [
        {"transmission.gear_ratio": 50.0},
        {"prime_mover.speed_min_rpm": 1.0},
        {
            "transmission.inertia_engine_side_kg_m2": 400.0,
            "transmission.inertia_propeller_side_kg_m2": 400.0,
        },
    ],
)
@pytest.mark.parametrize("name", ["frigate", "ferry"])
def test_engine_friction_brings_a_light_shaft_to_rest_without_chatter(
    name: str, changes: dict[str, float]
) -> None:
    """Its slope at standstill would stop each of these shafts within a time step."""
    ship = load_ship(name).with_values(changes)
    pitch = ship.propeller.pitch_ratio_min
    begin = State(pitch, 0.05 * ship.shaft_speeds[0], 0.0)
    run = simulate(ship, Schedule(0.0, pitch), 120.0, initial=begin)
    late = run[run["time"] > 60.0]
    assert np.abs(late["shaft_speed"]).max() < 1e-3 * run["shaft_speed"][0]
    assert run["ship_speed"].min() > -1e-3


def test_friction_that_would_stop_a_shaft_within_a_step_brings_it_to_rest_without_chatter() -> None:
    ship = load_ship("rov-thruster").with_values(
        {"transmission.coulomb_friction_engine_side_N_m": 0.5}
    )  # alone it slows the shaft by 3.7 rad/s in a step, 74 times the stiction speed
    start = equilibrium(ship, 10.0, ship.propeller.pitch_ratio_max).state
    run = simulate(ship, Schedule(0.0, ship.propeller.pitch_ratio_max), 3.0, initial=start)
    late = run["shaft_speed"][run["time"] > 1.5]
    assert np.abs(late).max() < 1e-6
