from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    linearise,
    linearise_along,
    load_ship,
    simulate,
)
from shaftline.plant.dynamics import evaluate
from shaftline.plant.linear import INPUTS
from shaftline.plant.open_water import PITCH_POWERS, b_series
from shaftline.plant.state import State, active_states

DATA = Path(__file__).parents[2] / "reproductions" / "data"
POINTS = {"A": (7.03, 0.6), "B": (14.2, 0.6), "C": (9.40, 1.4), "D": (34.7, 1.4)}
SOUND = ["pitch_ratio", "shaft_speed", "ship_speed"]
OUTPUTS = [*SOUND, "shaft_torque"]


def printed_gains() -> dict[str, float]:
    """DC gain from fuel rack to shaft speed, thesis Table 2-6."""
    with (DATA / "advance_velocity_thesis_poles_zeros_gains.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["table"] == "2-6"]
    return {row["working_point_or_source"]: float(row["dc_gain"]) for row in rows}


def thesis_model(point: Equilibrium) -> tuple[NDArray[np.float64], ...]:
    """A, B, C, D of thesis eqs. 2-33 to 2-38, with the slip in eq. 2-35 put right.

    Inputs: P/D command, rack, d_c1, u_x.
    """
    pitch, w, v = point.state[:3]
    inertia, left, right, mass = 53697.0 + 14411.0, 53697.0, 14411.0, 3.3e6
    y = 1025.0 * 4.2**5 * w / (4.0 * math.pi**2 * inertia)
    z = 1025.0 * 4.2**4 * 2 * (1.0 - 0.07) * w / (4.0 * math.pi**2 * mass)
    engine = -45.5 * 7.38**2 * 0.95
    fuel = 1428.6 * 7.38 * 0.95
    j = 2.0 * math.pi * 0.95 * v / (w * 4.2)
    j_w, j_v, j_u = -j / w, 2.0 * math.pi * 0.95 / (w * 4.2), 2.0 * math.pi / (w * 4.2)

    def slopes(curve: str) -> tuple[float, float, float]:
        """K, dK/dJ, dK/d(P/D)."""
        matrix = b_series(curve, 0.9, 5)
        powers = np.array(PITCH_POWERS)
        p, s = pitch**powers, j ** np.arange(4)
        dp = powers * pitch ** (powers - 1.0)
        ds = np.arange(4) * j ** (np.arange(4) - 1.0)
        return float(p @ matrix @ s), float(p @ matrix @ ds), float(dp @ matrix @ s)

    kt, kt_j, kt_p = slopes("KT")
    kq, kq_j, kq_p = slopes("KQ")
    a = np.array(
        [
            [-1.0 / 2.0, 0.0, 0.0],
            [-y * w * kq_p, -y * (2 * kq + w * kq_j * j_w) + engine / inertia, -y * w * kq_j * j_v],
            [
                z * w * kt_p,
                z * (2 * kt + w * kt_j * j_w),
                z * w * kt_j * j_v - 2.0 * 3306.2 * v / mass,
            ],
        ]
    )
    b = np.array(
        [
            [1.0 / 2.0, 0.0, 0.0, 0.0],
            [0.0, fuel / inertia, 0.0, -y * w * kq_j * j_u],
            [0.0, 0.0, -3306.2 * v**2 / mass, z * w * kt_j * j_u],
        ]
    )
    # eqs. 2-31 and 2-19: M_m = I_R / I (engine) + I_L / I (propeller)
    gauge = [
        left * y * w * kq_p,
        left * y * (2 * kq + w * kq_j * j_w) + right / inertia * engine,
        left * y * w * kq_j * j_v,
    ]
    c = np.vstack([np.eye(3), gauge])
    d = np.zeros((4, 4))
    d[3] = [0.0, right / inertia * fuel, 0.0, left * y * w * kq_j * j_u]
    return a, b, c, d


def central_differences(ship: Ship, point: Equilibrium) -> tuple[NDArray[np.float64], ...]:
    plant = ship.record()
    states = active_states(plant)

    def values(state: State, inputs: Any) -> NDArray[np.float64]:
        rate, out = evaluate(plant, state, inputs, point.outputs.pitch_ratio)
        everything = {**state._asdict(), **out._asdict()}
        return np.array([getattr(rate, n) for n in states] + [everything[n] for n in OUTPUTS])

    def column(vary_state: bool, name: str) -> NDArray[np.float64]:
        ends = []
        origin = getattr(point.state if vary_state else point.inputs, name)
        h = 1e-5 * max(abs(origin), 1.0)
        for shift in (h, -h):
            state, inputs = point.state, point.inputs
            if vary_state:
                state = state._replace(**{name: origin + shift})
            else:
                inputs = inputs._replace(**{name: origin + shift})
            ends.append(values(state, inputs))
        return np.asarray((ends[0] - ends[1]) / (2.0 * h))

    x = np.array([column(True, name) for name in states]).T
    u = np.array([column(False, name) for name in INPUTS.values()]).T
    n = len(states)
    return x[:n], u[:n], x[n:], u[n:]


@pytest.mark.parametrize("name", POINTS)
def test_frigate_equals_the_thesis_equations(frigate: Ship, name: str) -> None:
    point = equilibrium(frigate, *POINTS[name])
    system = linearise(frigate, point)
    matrices = (system.A, system.B, system.C, system.D)
    for found, expected in zip(matrices, thesis_model(point), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", POINTS)
def test_gain_from_rack_to_shaft_speed_is_the_printed_one(frigate: Ship, name: str) -> None:
    system = linearise(frigate, equilibrium(frigate, *POINTS[name]))
    gain = np.real(system.dcgain())[OUTPUTS.index("shaft_speed"), list(INPUTS).index("drive")]
    assert gain == pytest.approx(printed_gains()[name], rel=0.02)


@pytest.mark.parametrize("name", POINTS)
def test_gain_is_the_slope_between_steady_states(frigate: Ship, name: str) -> None:
    rack, pitch = POINTS[name]
    low, high = (equilibrium(frigate, rack + h, pitch) for h in (-1e-3, 1e-3))
    system = linearise(frigate, equilibrium(frigate, rack, pitch))
    slope = (high.state.shaft_speed - low.state.shaft_speed) / 2e-3
    assert np.real(system.dcgain())[1, 1] == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize(
    ("values", "extra"),
    [
        ({}, []),
        ({"prime_mover.lag_s": 1.5}, ["brake_torque"]),
        ({"propeller.inflow_lag_s": 2.0}, ["inflow"]),
        ({"ventilation.thrust_loss": 0.5}, ["ventilation"]),
        ({"propeller.model": "four-quadrant"}, []),
        ({"transmission.coulomb_friction_engine_side_N_m": 5e3}, []),
        ({"hull.current_m_s": 0.5, "hull.wake_slope_s_m": 0.01}, []),
        ({"prime_mover.torque_curvature_N_m_s2_rad2": -1.0}, []),
        ({"transmission.quadratic_drag_N_m_s2_rad2": 40.0}, []),
    ],
    ids=str,
)
def test_states_and_derivatives_with_effects(
    frigate: Ship, values: dict[str, Any], extra: list[str]
) -> None:
    ship = frigate.with_values(values)
    point = equilibrium(ship, 20.0, 1.1)
    system = linearise(ship, point)
    assert system.state_labels == SOUND + extra
    assert system.input_labels == list(INPUTS)
    assert system.output_labels == OUTPUTS
    matrices = (system.A, system.B, system.C, system.D)
    for found, expected in zip(matrices, central_differences(ship, point), strict=True):
        rounding = 1e-9 * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=rounding)


def test_motor_has_a_current_and_nothing_to_pitch_or_sail() -> None:
    ship = load_ship("tito-neri-sine")
    point = equilibrium(ship, 5.89, 1.0)
    system = linearise(ship, point, ("shaft_speed", "motor_current"))
    assert system.state_labels == ["shaft_speed", "motor_current"]
    electric = system.A[1]
    np.testing.assert_allclose(electric, [-0.0183 * 3.0 / 0.000603, -1.51 / 0.000603], rtol=1e-12)
    assert system.B[1, 1] == pytest.approx(1.0 / 0.000603)


def test_unknown_output_names_the_known_ones(frigate: Ship, design_point: Equilibrium) -> None:
    with pytest.raises(ValueError, match=r"unknown output 'rpm'; known: .*shaft_speed"):
        linearise(frigate, design_point, ("rpm",))


def test_along_a_steady_run_it_is_the_linear_model(frigate: Ship) -> None:
    point = equilibrium(frigate, 22.0, 1.4)
    run = simulate(frigate, Schedule(22.0, 1.4), 1.0, initial=point.state)
    models = linearise_along(frigate, run, 0.5)
    assert [one.time_s for one in models] == pytest.approx([0.0, 0.5, 1.0])
    fixed = linearise(frigate, point)
    for one in models:
        assert one.states == tuple(fixed.state_labels)
        assert one.tangent.a == pytest.approx(fixed.A, rel=1e-6, abs=1e-9)
        assert one.tangent.d == pytest.approx(fixed.D, rel=1e-6, abs=1e-6)
        assert one.predict(10.0) == pytest.approx(one.state, rel=1e-9)


def test_along_a_run_it_tells_what_comes_next(frigate: Ship) -> None:
    """The inflow and the factor on the resistance are read from the run itself."""
    start = equilibrium(frigate, 20.0, 1.3).state
    schedule = Schedule(
        lambda t: 20.0 + 0.5 * t, 1.3, inflow=lambda t: 0.4 + 0.0 * t, resistance_factor=1.2
    )
    run = simulate(frigate, schedule, 10.0, initial=start)
    models = linearise_along(frigate, run, frigate.time_step_s)
    names = models[0].states
    now = np.array([[row[name] for name in names] for row in run])
    ahead = np.array([one.predict(frigate.time_step_s) for one in models[:-1]])
    moved = np.abs(np.diff(now, axis=0)).max(axis=0)
    assert np.all(np.abs(ahead - now[1:]).max(axis=0)[1:] < 2e-3 * moved[1:])


def test_along_refuses_what_samples_do_not_tell(frigate: Ship) -> None:
    run = simulate(frigate, Schedule(22.0, 1.4), 1.0, initial=equilibrium(frigate, 22.0, 1.4).state)
    with pytest.raises(ValueError, match=r"every_s = 0\.07 s must be a multiple of the samples'"):
        linearise_along(frigate, run, 0.07)
    lagging = frigate.with_values({"propeller.inflow_lag_s": 0.5})
    with pytest.raises(ShipError, match="samples do not contain inflow"):
        linearise_along(lagging, run, 0.05)
