"""The equations of motion: against the thesis's, by hand with every effect, and settled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Equilibrium, Schedule, Ship, load_ship, simulate
from shaftline.plant.dynamics import evaluate, loads, settle_lags
from shaftline.plant.expressions import InputSignals
from shaftline.plant.open_water import PITCH_POWERS, b_series
from shaftline.plant.propeller import propeller_load
from shaftline.plant.state import LAGS, Inputs, State
from shaftline.plant.terms import TURNING_SIGNALS
from shaftline.plant.ventilation import suction_head, ventilation_rate

WEIGHTS = (
    3.0,
    5.0,
    7.0,
    11.0,
    13.0,
    17.0,
    19.0,
    23.0,
    29.0,
)  # of what a ship hears that does not turn
GEAR, EFFICIENCY = 7.38, 0.95
LEFT, RIGHT, MASS = 53697.0, 14411.0, 3.3e6
TOTAL = LEFT + RIGHT
STATE = State(1.2, 10.0, 8.0, 50.0, 1.3e4, 7.0, 0.3, 0.0)

# The thesis's plant in plain Python, from the numbers of its Table B-1.
_KT, _KQ = b_series("KT", 0.9, 5), b_series("KQ", 0.9, 5)


def _coefficient(matrix: NDArray[np.float64], j: float, pitch: float) -> float:
    return float(pitch ** np.array(PITCH_POWERS) @ matrix @ j ** np.arange(4))


def thesis_rate(
    x: NDArray[np.float64], rack: float, command: float, inflow: float, factor: float
) -> NDArray[np.float64]:
    """Right-hand side of thesis eq. 2-20."""
    pitch, omega, speed = x
    n = omega / (2.0 * math.pi)
    j = ((1.0 - 0.05) * speed + inflow) / (n * 4.2)
    engine = (-45.5 * 7.38 * omega + 1428.6 * rack - 7381.0) * 7.38 * 0.95
    torque = 1025.0 * 4.2**5 * n**2 * _coefficient(_KQ, j, pitch)
    thrust = 1025.0 * 4.2**4 * n**2 * _coefficient(_KT, j, pitch)
    return np.array(
        [
            (command - pitch) / 2.0,
            (engine - torque) / (53697.0 + 14411.0),
            (thrust * 2 * (1.0 - 0.07) - factor * 3306.2 * speed**2) / 3.3e6,
        ]
    )


@pytest.mark.parametrize(
    ("x", "rack", "command", "inflow", "factor"),
    [
        ((1.2, 10.0, 8.0), 22.0, 1.4, 0.0, 1.0),
        ((0.7, 12.0, 3.0), 15.0, 0.6, -0.7, 1.4),
        ((1.4, 9.0, 9.0), 20.0, 1.1, 0.5, 0.8),
    ],
)
def test_rate_is_the_thesis_right_hand_side(
    plant: Any, x: tuple[float, ...], rack: float, command: float, inflow: float, factor: float
) -> None:
    inputs = Inputs(rack, command, inflow, resistance_factor=factor)
    rate, out = evaluate(plant, State(*x), inputs, x[0])
    expected = thesis_rate(np.array(x), rack, command, inflow, factor)
    np.testing.assert_allclose(rate[:3], expected, rtol=1e-12)
    assert rate.position == x[2]
    assert rate.shaft_angle == x[1]
    assert rate[4:8] == (0.0, 0.0, 0.0, 0.0)
    assert tuple(rate[9:]) == 12 * (0.0,)
    # thesis eq. 2-19: no acceleration in it
    engine = (-45.5 * 7.38 * x[1] + 1428.6 * rack - 7381.0) * 7.38 * 0.95
    gauge = RIGHT / TOTAL * engine + LEFT / TOTAL * out.propeller_torque
    assert out.shaft_torque == pytest.approx(gauge, rel=1e-12)
    assert out.shaft_acceleration == rate.shaft_speed


@pytest.fixture
def busy(plant: Any) -> Any:
    """Every effect of loads and rates present at once."""
    fields = {
        "current": 0.5,
        "wake_slope": 0.01,
        "wake_reference_speed": 5.0,
        "inflow_lag": 2.0,
        "engine_lag": 1.5,
        "relative_rotative_efficiency": 1.05,
        "coulomb_engine_side": 4e3,
        "viscous_propeller_side": 300.0,
        "quadratic_drag": 20.0,
        "entrained_inertia": 8e3,
        "hull_fouling": 0.2,
        "ventilation_thrust_loss": 0.6,
        "ventilation_torque_loss": 0.5,
    }
    for name, value in fields.items():
        plant[name] = value
    return plant


def test_loads_with_every_effect_by_hand(busy: Any) -> None:
    inputs = Inputs(22.0, 1.4, 0.3, 0.02, 20.0, 1.0, 0.0, -1.5, 1.1, 7.0)
    found = loads(busy, STATE, inputs, 1.15)
    water = 8.0 - 0.5
    met = (1.0 - 0.05 - 0.01 * (water - 5.0)) * water + 0.3 + 0.02 * (50.0 - 20.0)
    load = propeller_load(busy, 7.0, 10.0, 1.15, 2.5, 0.3)  # in the lagging inflow
    assert found.advance_velocity == 7.0
    assert found.inflow_rate == pytest.approx((met - 7.0) / 2.0, rel=1e-12)
    assert found.submergence == 2.5
    assert (found.thrust, found.thrust_coefficient) == (load.thrust, load.thrust_coefficient)
    assert found.propeller_torque == pytest.approx(load.torque / 1.05, rel=1e-14)
    assert (found.brake_torque, found.mover.current) == (1.3e4, 0.0)
    mapped = -45.5 * GEAR * 10.0 + 1428.6 * 22.0 - 7381.0
    assert found.mover.brake_torque_rate == pytest.approx((mapped - 1.3e4) / 1.5, rel=1e-12)
    assert found.drive_torque == pytest.approx(1.3e4 * GEAR * EFFICIENCY - 4e3, rel=1e-14)
    assert found.load_torque == pytest.approx(load.torque / 1.05 + 3e3 + 2e3, rel=1e-14)
    assert found.push == pytest.approx(2 * 0.93 * load.thrust, rel=1e-14)
    assert found.resistance == pytest.approx(1.1 * 1.2 * 3306.2 * water**2, rel=1e-14)
    assert (found.mover.current_rate, found.added_pitch_rate) == (0.0, 0.0)


def test_prompt_inflow_is_met_at_once(busy: Any) -> None:
    busy["inflow_lag"] = 0.0
    inputs = Inputs(22.0, 1.4, 0.3, 0.02, 20.0, 1.0)
    found = loads(busy, STATE, inputs, 1.15)
    expected = (1.0 - 0.05 - 0.01 * 2.5) * 7.5 + 0.3 + 0.6
    assert found.advance_velocity == pytest.approx(expected, rel=1e-14)
    assert found.inflow_rate == 0.0


@pytest.mark.parametrize(
    ("acts_on", "name", "factor"),
    [
        ("inflow_velocity", "advance_velocity", 1.0),
        ("drive", "brake_torque", 1428.6),
        ("thrust", "thrust", 1.0),
        ("thrust", "push", 1.86),
        ("drive_torque", "drive_torque", 1.0),
        ("load_torque", "load_torque", 1.0),
        ("resistance", "resistance", 1.0),
        ("pitch_rate", "added_pitch_rate", 1.0),
    ],
)
def test_a_term_adds_to_its_place(frigate: Ship, acts_on: str, name: str, factor: float) -> None:
    """All that it hears, weighed so that each counts."""
    own = [name for name in InputSignals._fields if name not in TURNING_SIGNALS]
    weighed = zip(WEIGHTS, own, strict=True)
    expression = "1e-3 * (" + " + ".join(f"{w} * {signal}" for w, signal in weighed) + ")"
    term = {"id": "one", "acts_on": acts_on, "expression": expression}
    ship = frigate.with_values({"term": [term]})
    inputs = Inputs(22.0, 1.3, 0.3, 0.02, 20.0, 1.0, 0.0, -1.5, 1.1, 7.0)
    state = STATE._replace(shaft_angle=0.7)
    found, plain = (loads(s.record(), state, inputs, 1.2) for s in (ship, frigate))
    heard = (10.0, 8.0, 1.2, 1.3, 22.0, 0.95 * 8.0 + 0.3 + 0.6, 2.5, 7.0, 0.7)
    expected = 1e-3 * np.dot(heard, WEIGHTS)
    added = getattr(found, name) - getattr(plain, name)
    assert added == pytest.approx(factor * expected, rel=1e-6)
    rates = [evaluate(s.record(), state, inputs, 1.2)[0] for s in (ship, frigate)]
    turned = rates[0].pitch_ratio - rates[1].pitch_ratio
    assert turned == pytest.approx(expected if acts_on == "pitch_rate" else 0.0, rel=1e-9)


def test_rates_follow_from_the_loads(busy: Any) -> None:
    inputs = Inputs(22.0, 1.4, 0.3, 0.02, 20.0, 1.0, 0.0, -1.5, 1.1, 7.0)
    acting = loads(busy, STATE, inputs, 1.2)
    rate, out = evaluate(busy, STATE, inputs, 0.7)  # without backlash nothing is remembered
    turning = (acting.drive_torque - acting.load_torque) / (TOTAL + 8e3)
    assert rate.pitch_ratio == pytest.approx(0.1)
    assert rate.shaft_speed == pytest.approx(turning, rel=1e-12)
    assert rate.ship_speed == pytest.approx((acting.push - acting.resistance) / MASS, rel=1e-12)
    assert rate.position == 8.0
    assert (rate.brake_torque, rate.inflow) == (acting.mover.brake_torque_rate, acting.inflow_rate)
    relative, suction = 2.5 / 2.1, suction_head(busy, acting.thrust_coefficient, 10.0)
    assert rate.ventilation == ventilation_rate(busy, 0.3, relative, suction)
    assert rate.motor_current == 0.0
    assert out.pitch_ratio == 1.2
    assert out.shaft_torque == pytest.approx(acting.drive_torque - LEFT * turning, rel=1e-12)
    assert out.motor_current == acting.mover.current
    for name in (
        "advance_velocity",
        "thrust",
        "propeller_torque",
        "brake_torque",
        "resistance",
        "thrust_coefficient",
        "submergence",
    ):
        assert getattr(out, name) == getattr(acting, name), name


def test_backlash_holds_the_blade_back_from_its_actuator(busy: Any) -> None:
    busy["pitch_backlash"] = 0.04
    _, out = evaluate(busy, STATE, Inputs(22.0, 1.4), 1.1)
    assert out.pitch_ratio == pytest.approx(1.18)
    assert out.thrust == pytest.approx(loads(busy, STATE, Inputs(22.0, 1.4), 1.18).thrust)


def test_fixed_hull_does_not_accelerate(plant: Any) -> None:
    plant["hull_fixed"] = 1
    rate, out = evaluate(plant, STATE, Inputs(22.0, 1.4), 1.2)
    assert rate.ship_speed == 0.0
    assert out.thrust != 0.0


def test_motor_sees_its_shaft_through_the_gear() -> None:
    plant = load_ship("tito-neri-sine").record()
    state = State(1.0, 60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8)
    rate, out = evaluate(plant, state, Inputs(5.0, 1.0), 1.0)
    assert rate.motor_current == pytest.approx((5.0 - 0.0183 * 180.0 - 1.51 * 0.8) / 0.000603)
    assert out.brake_torque == pytest.approx(0.0183 * 0.8)
    assert out.motor_current == 0.8
    assert rate.shaft_speed == pytest.approx(
        (0.0183 * 0.8 * 3.0 - 0.051 - out.propeller_torque) / 0.0002862
    )


def test_settled_state_has_no_lag_left(busy: Any) -> None:
    inputs = Inputs(22.0, 1.4, 0.3, 0.02, 20.0, 1.0, 0.0, -1.5, 1.1, 7.0)
    found = settle_lags(busy, STATE, inputs)
    rate, _ = evaluate(busy, found, inputs, found.pitch_ratio)
    for name in LAGS:
        assert getattr(rate, name) == pytest.approx(0.0, abs=1e-9), name
    assert found[:4] == STATE[:4]
    assert rate.ventilation == pytest.approx(0.0, abs=1e-9)
    mapped = -45.5 * GEAR * 10.0 + 1428.6 * 22.0 - 7381.0
    assert found.brake_torque == pytest.approx(mapped, rel=1e-14)
    assert found.motor_current == STATE.motor_current  # there is none


def test_settled_motor_has_its_steady_current() -> None:
    plant = load_ship("tito-neri-sine").record()
    found = settle_lags(plant, State(1.0, 60.0, 0.0), Inputs(5.0, 1.0))
    assert found.motor_current == pytest.approx((5.0 - 0.0183 * 180.0) / 1.51, rel=1e-12)


def test_settled_ship_without_lags_is_as_it_was(plant: Any) -> None:
    assert settle_lags(plant, STATE, Inputs(22.0, 1.4)) == STATE


def test_inflow_lag_is_first_order(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"hull.mass_kg": 1e9, "propeller.inflow_lag_s": 2.0})
    before = 0.95 * design_point.state.ship_speed
    gust = Schedule(22.0, 1.4, inflow=0.7)
    s = simulate(ship, gust, 10.0, initial=design_point.state._replace(inflow=before))
    rise = s["advance_velocity"] - before
    np.testing.assert_allclose(rise, 0.7 * (1.0 - np.exp(-s["time"] / 2.0)), atol=1e-3)
