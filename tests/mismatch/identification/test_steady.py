"""Least squares on steady states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from shaftline.mismatch.identification.drive_train import (
    CONSTANT,
    FRICTION,
    LOAD,
    RESISTANCE,
    drive_train,
)
from shaftline.mismatch.identification.steady import balances, steady
from shaftline.plant import Ship, equilibrium, load_ship

from .benches import shares_off, staircase, tug

TABLE_4 = pd.DataFrame(
    {
        "motor_voltage_V": [3.91, 4.91, 5.89, 6.88, 7.87],
        "shaft_speed_rad_s": np.array([117.0, 163.0, 215.0, 255.0, 295.0]) / 3.0,
        "motor_current_A": [1.00, 1.13, 1.29, 1.44, 1.62],
    }
)
VISCOUS = "transmission.viscous_friction_engine_side_N_m_s_rad"


def direct(points: pd.DataFrame, density: float) -> Any:
    """Eq. 25 as printed: M_f, K_e, R_a, KQ/eta_R."""
    u, w, i = (
        points["motor_voltage_V"],
        3.0 * points["shaft_speed_rad_s"],
        points["motor_current_A"],
    )
    c = density * w**2 * 0.065**5 / (4.0 * np.pi**2 * 27.0)
    none, one = np.zeros(len(u)), np.ones(len(u))
    a = np.block([[np.c_[one, -i, none, c]], [np.c_[none, w, i, none]]])
    return np.linalg.lstsq(a, np.r_[none, u], rcond=None)[0]


@pytest.mark.parametrize("density", [1000.0, 1025.0])
def test_column_one_of_table_five_from_table_four(density: float) -> None:
    ship = tug("staircase").with_values({"water.density_kg_m3": density})
    found = steady(ship, [TABLE_4])
    friction, *others = found.values
    assert_allclose([friction / 3.0, *others], direct(TABLE_4, density), rtol=1e-9)
    assert found.keys == (FRICTION, CONSTANT, RESISTANCE, LOAD)
    assert_allclose([friction / 3.0, *others[:2]], (0.0123, 0.0137, 2.31), rtol=0.04)
    assert others[2] == pytest.approx(0.102, rel=0.07)


def test_where_the_search_begins_does_not_matter() -> None:
    first, second = (
        steady(tug(name).with_values({"water.density_kg_m3": 1025.0}), [TABLE_4])
        for name in ("sine", "staircase")
    )
    assert first.values == pytest.approx(second.values, rel=1e-9)


def test_standard_errors_are_those_of_repeated_noise() -> None:
    """Noise on the voltages alone, of which the rows' residuals are made."""
    ship, rng = tug("staircase"), np.random.default_rng(2)
    train = drive_train(ship)
    levels = np.linspace(3.5, 8.0, 12)
    points = [train.equilibrium(level) for level in levels]
    exact = pd.DataFrame(
        {
            "motor_voltage_V": levels,
            "shaft_speed_rad_s": [p.motor_speed / 3.0 for p in points],
            "motor_current_A": [p.current for p in points],
        }
    )
    values, errors = [], []
    for _ in range(30):
        noisy = exact.assign(motor_voltage_V=levels + 0.02 * rng.standard_normal(len(levels)))
        found = steady(ship, [noisy], (CONSTANT, RESISTANCE))
        values.append(found.values)
        errors.append(found.standard_errors)
    spread = np.std(values, axis=0)
    assert_allclose(np.sqrt(np.mean(np.square(errors), axis=0)), spread, rtol=0.25)
    assert found.correlation[0, 1] < -0.9  # why two sets 30 % apart behave alike


def test_plateaus_of_a_recording_give_all_four() -> None:
    table = staircase(tug("staircase"), (3.91, 5.0, 5.89, 7.87))
    found = steady(tug().with_values({"water.density_kg_m3": 1025.0}), [table])
    assert max(map(abs, shares_off(tug("staircase"), found).values())) < 1e-4
    assert len(found.tables["steady-states"]) == 4
    assert found.tables["fit"]["balance"].tolist() == ["shaft", "motor"]


def test_balances_say_what_is_left_over() -> None:
    lacking = balances(tug(), TABLE_4.iloc[[2]])
    assert lacking["motor"][0] == pytest.approx(5.89 - 0.0183 * 215.0 - 1.51 * 1.29, abs=1e-9)
    load = drive_train(tug()).load * 215.0**2
    assert lacking["shaft"][0] == pytest.approx(0.0183 * 1.29 - 0.0170 - load, abs=1e-12)


@pytest.mark.parametrize(
    ("free", "values"),
    [
        ((FRICTION, VISCOUS), {FRICTION: 0.03, VISCOUS: 1e-4}),
        (
            ("propeller.relative_rotative_efficiency",),
            {"propeller.relative_rotative_efficiency": 0.9},
        ),
        (("prime_mover.reverse_torque_fraction",), {"prime_mover.reverse_torque_fraction": 0.85}),
    ],
)
def test_other_numbers_of_the_balances(free: tuple[str, ...], values: dict[str, float]) -> None:
    """Both ways, so that what acts astern alone is seen."""
    truth = tug().with_values(values)
    table = staircase(truth, (4.0, 5.5, 8.0, -7.0, -5.0))
    found = steady(tug(), [table], free)
    assert found.values == pytest.approx([values[key] for key in free], rel=2e-3)


def thruster() -> Ship:
    return load_ship("rov-thruster")


def test_a_torque_command_without_any_current() -> None:
    """Steady states of the ROV's thruster: friction and drag from torque and speed."""
    ship = thruster()
    column = ship.prime_mover.demand.column
    key = "transmission.viscous_friction_engine_side_N_m_s_rad"
    truth = ship.with_values({key: 0.004})
    torques = np.linspace(0.3, 1.0, 6) * float(ship.record()["drive_max"])
    speeds = [equilibrium(truth, float(t), 1.0).state.shaft_speed for t in torques]
    points = pd.DataFrame({column: torques, "shaft_speed_rad_s": speeds})
    found = steady(ship, [points], (key,))
    assert found.values[0] == pytest.approx(0.004, rel=1e-6)
    assert list(found.tables["fit"]["balance"]) == ["shaft"]


def test_a_ship_that_moves_has_a_hull_s_balance() -> None:
    ship = load_ship("frigate")
    truth = ship.with_values({"hull.resistance_coefficient_N_s2_m2": 6500.0})
    states = [
        equilibrium(truth, rack, pitch) for rack, pitch in ((16.0, 1.2), (22.0, 1.4), (26.0, 1.3))
    ]
    points = pd.DataFrame(
        [
            {
                "fuel_rack_mm": s.inputs.drive,
                "pitch_ratio": s.state.pitch_ratio,
                "shaft_speed_rad_s": s.state.shaft_speed,
                "ship_speed_m_s": s.state.ship_speed,
            }
            for s in states
        ]
    )
    found = steady(ship, [points], ("hull.resistance_coefficient_N_s2_m2",))
    assert found.values[0] == pytest.approx(6500.0, rel=1e-6)
    with pytest.raises(ValueError, match="frigate needs ship_speed_m_s"):
        steady(ship, [points.drop(columns="ship_speed_m_s")], ("hull.wake_fraction",))


@pytest.mark.parametrize(
    ("points", "free", "message"),
    [
        (TABLE_4.drop(columns="motor_current_A"), None, "resistance_ohm needs motor_current_A"),
        (TABLE_4.drop(columns="shaft_speed_rad_s"), None, "needs shaft_speed_rad_s"),
        (TABLE_4[:2], None, "2 steady state.* 4 equations for 4 parameters"),
        (TABLE_4, (LOAD, "transmission.quadratic_drag_N_m_s2_rad2"), "does not distinguish"),
        (
            TABLE_4,
            (CONSTANT, "transmission.inertia_engine_side_kg_m2"),
            "depends on transmission.ine",
        ),
    ],
)
def test_what_steady_states_cannot_tell(points: Any, free: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        steady(tug(), [points], free)


def test_a_recording_without_rest_is_refused() -> None:
    table = staircase(tug(), (4.0, 6.0), hold_s=0.2)[2500:]
    with pytest.raises(ValueError, match="steady: no steady state"):
        steady(tug(), [table])
