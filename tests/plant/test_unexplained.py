"""A torque, force or rate of unknown origin along one signal."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest

from shaftline.core.numeric import piecewise_linear
from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    linearise,
    load_ship,
    simulate,
)
from shaftline.plant.dynamics import evaluate
from shaftline.plant.unexplained import BALANCES, FOLLOWED, MAX_KNOTS, Unexplained

GEAR, EFFICIENCY = 7.38, 0.95


def with_shape(ship: Ship, balance: str, signal: str, knots: Any, values: Any) -> Ship:
    keys = {"balance": balance, "signal": signal, "knots": knots, "values": values}
    return ship.with_values({f"unexplained.{key}": value for key, value in keys.items()})


def test_every_balance_and_signal_has_a_code() -> None:
    fields = Unexplained.model_fields
    assert get_args(fields["balance"].annotation) == BALANCES
    assert get_args(fields["signal"].annotation) == FOLLOWED


def test_shape_is_linear_between_knots_and_held_outside() -> None:
    knots, values = np.zeros(MAX_KNOTS), np.zeros(MAX_KNOTS)
    knots[:3], values[:3] = (1.0, 2.0, 4.0), (5.0, -1.0, 3.0)
    x = np.array([-9.0, 1.0, 1.25, 2.0, 3.0, 4.0, 99.0])
    found = [piecewise_linear(knots, values, 3, one) for one in x]
    np.testing.assert_allclose(found, np.interp(x, knots[:3], values[:3]), rtol=1e-15)
    slopes = [complex(piecewise_linear(knots, values, 3, one + 1e-30j)).imag / 1e-30 for one in x]
    assert slopes == pytest.approx([0.0, -6.0, -6.0, 2.0, 2.0, 0.0, 0.0])


@pytest.mark.parametrize("signal", FOLLOWED)
@pytest.mark.parametrize("balance", BALANCES)
def test_it_is_added_to_its_balance_at_its_signal(
    frigate: Ship, design_point: Equilibrium, balance: str, signal: str
) -> None:
    state = design_point.state
    inputs = design_point.inputs._replace(time=33.0)
    at = {"shaft_speed": state.shaft_speed, "ship_speed": state.ship_speed, "pitch_ratio": 1.4,
          "drive": 22.0, "time": 33.0}[signal]  # fmt: skip
    ship = with_shape(frigate, balance, signal, (at - 1.0, at + 1.0), (0.0, 2.0))
    (plain, before), (rate, after) = (
        evaluate(s.record(), state, inputs, 1.4, False) for s in (frigate, ship)
    )
    inertia = 53697.0 + 14411.0
    added = {
        "shaft_speed": (rate.shaft_speed - plain.shaft_speed) * inertia,
        "ship_speed": (rate.ship_speed - plain.ship_speed) * 3.3e6,
        "pitch_ratio": rate.pitch_ratio - plain.pitch_ratio,
    }
    name = {"engine": "shaft_speed", "propeller": "shaft_speed", "hull": "ship_speed"}
    expected = dict.fromkeys(added, 0.0) | {name.get(balance, "pitch_ratio"): 1.0}
    assert added == pytest.approx(expected, rel=1e-6, abs=1e-6)
    # the gauge sees a torque before it less what accelerates I_L, one behind it by that alone
    share = {"engine": 14411.0 / inertia, "propeller": -53697.0 / inertia}.get(balance, 0.0)
    assert after.shaft_torque - before.shaft_torque == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize("values", [(0.0, 0.0), (3e3, 3e3)])
def test_zero_shape_is_no_shape(
    frigate: Ship, design_point: Equilibrium, values: tuple[float, float]
) -> None:
    ship = with_shape(frigate, "engine", "time", (10.0, 20.0), values)
    found, nominal = (
        simulate(s, Schedule(24.0, 1.3), 40.0, initial=design_point.state) for s in (ship, frigate)
    )
    assert (found.tobytes() == nominal.tobytes()) == (values[0] == 0.0)


def test_constant_torque_is_negative_friction(frigate: Ship, design_point: Equilibrium) -> None:
    shape = with_shape(frigate, "propeller", "shaft_speed", (1.0, 20.0), (-4e3, -4e3))
    friction = {"transmission.coulomb_friction_propeller_side_N_m": 4e3}
    found, expected = (
        simulate(s, Schedule(26.0, 1.2), 60.0, initial=design_point.state)
        for s in (shape, frigate.with_values(friction))
    )
    np.testing.assert_allclose(found["shaft_speed"], expected["shaft_speed"], rtol=1e-12)
    np.testing.assert_allclose(found["shaft_torque"], expected["shaft_torque"], rtol=1e-12)


@pytest.mark.parametrize("signal", ["shaft_speed", "ship_speed", "pitch_ratio", "drive"])
@pytest.mark.parametrize("balance", BALANCES)
def test_linear_model_has_its_slope(
    frigate: Ship, design_point: Equilibrium, balance: str, signal: str
) -> None:
    at = {"shaft_speed": 10.5, "ship_speed": 8.7, "pitch_ratio": 1.4, "drive": 22.0}[signal]
    ship = with_shape(frigate, balance, signal, (at - 1.0, at + 1.0), (-7.0, 7.0))
    found, plain = (linearise(s, design_point) for s in (ship, frigate))
    row = {"hull": 2, "pitch-actuator": 0}.get(balance, 1)
    inertia = {0: 1.0, 1: 53697.0 + 14411.0, 2: 3.3e6}[row]
    if signal == "drive":
        change = (found.B - plain.B)[row, 1]
    else:
        column = {"pitch_ratio": 0, "shaft_speed": 1, "ship_speed": 2}[signal]
        change = (found.A - plain.A)[row, column]
    assert change == pytest.approx(7.0 / inertia, rel=1e-6)


def test_motor_takes_it_as_an_engine_does() -> None:
    tug = load_ship("tito-neri-sine")
    ship = with_shape(tug, "engine", "drive", (0.0, 12.0), (-0.01, -0.01))
    friction = {"transmission.coulomb_friction_engine_side_N_m": 0.051 + 0.01}
    found, expected = (equilibrium(s, 5.0, 1.0) for s in (ship, tug.with_values(friction)))
    assert found.state.shaft_speed == pytest.approx(expected.state.shaft_speed, rel=1e-9)


GOOD = {"balance": "hull", "signal": "time", "knots": (0.0, 1.0), "values": (1.0, 2.0)}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"balance": "rudder"}, r"unexplained\.balance = 'rudder'.*'pitch-actuator'"),
        ({"signal": "shaft_torque"}, r"unexplained\.signal = 'shaft_torque'"),
        ({"knots": (0.0,)}, r"unexplained\.knots.*at least 2"),
        ({"knots": tuple(range(13))}, r"unexplained\.knots.*at most 12"),
        ({"knots": (1.0, 1.0)}, "knots must rise"),
        ({"knots": (0.0, 1.0, 2.0)}, "they are 3 and 2"),
        ({"values": (0.0, math.nan)}, r"unexplained\.values\.1 = nan"),
        ({"values": (0.0, math.inf)}, r"unexplained\.values\.1 = inf"),
        ({"values": (0.0, "1")}, r"unexplained\.values\.1 = '1'"),
    ],
    ids=str,
)
def test_mistake_is_named(frigate: Ship, change: dict[str, Any], words: str) -> None:
    values = {f"unexplained.{key}": value for key, value in (GOOD | change).items()}
    with pytest.raises(ShipError, match=words):
        frigate.with_values(values)


@pytest.mark.parametrize(
    ("balance", "words"), [("hull", "hull that is not fixed"), ("pitch-actuator", "variable pitch")]
)
def test_balance_that_the_ship_lacks_is_refused(balance: str, words: str) -> None:
    with pytest.raises(ShipError, match=words):
        with_shape(load_ship("tito-neri-sine"), balance, "time", (0.0, 1.0), (1.0, 1.0))


def test_left_out_again(frigate: Ship) -> None:
    ship = with_shape(frigate, "hull", "time", (0.0, 1.0), (1.0, 1.0))
    assert ship.with_values({"unexplained": None}).record() == frigate.record()
