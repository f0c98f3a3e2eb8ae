from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from shaftline.plant import Equilibrium, Schedule, Ship, simulate
from shaftline.plant.dynamics import evaluate
from shaftline.plant.open_water import PITCH_POWERS, b_series
from shaftline.plant.state import Inputs, State
from shaftline.plant.waves import field


def test_waves_and_moving_pitch_agree_with_scipy(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    plant = frigate.record()
    initial = design_point.state._replace(pitch_ratio=1.2)

    def rate(t: float, y: NDArray[np.float64]) -> tuple[float, ...]:
        inflow, elevation = field(thesis_sea, t, y[3])
        inputs = Inputs(22.0, 1.4, inflow, 0.0, 0.0, elevation, 1.0, t)
        state = State(y[0], y[1], y[2], y[3], 0.0, 0.0, 0.0, 0.0)
        return evaluate(plant, state, inputs, y[0], False)[0][:4]

    samples = simulate(frigate, Schedule(22.0, 1.4), 300.0, initial=initial, sea=thesis_sea)
    exact = solve_ivp(
        rate, (0.0, 300.0), initial[:4], "DOP853", samples["time"], rtol=1e-10, atol=1e-12
    )
    assert np.ptp(exact.y[1]) > 1.0  # the shaft speed does move
    for name, expected in zip(("pitch_ratio", "shaft_speed", "ship_speed"), exact.y, strict=False):
        worst = np.max(np.abs(samples[name] / expected - 1.0))
        assert worst < 1e-7, name  # measured: 7e-9


def test_error_falls_with_the_fourth_power_of_the_step(
    frigate: Ship, design_point: Equilibrium
) -> None:
    schedule = Schedule(22.0, 1.4, lambda t: np.sin(0.8 * t), lambda t: 1.0 + 0.3 * np.sin(0.3 * t))
    initial = design_point.state._replace(pitch_ratio=1.2)

    def final_speed(dt: float) -> float:
        return float(simulate(frigate, schedule, 40.0, initial=initial, dt=dt)["shaft_speed"][-1])

    exact = final_speed(0.01)
    coarse, fine = (abs(final_speed(dt) - exact) for dt in (0.2, 0.1))
    assert coarse / fine == pytest.approx(16.0, rel=0.25)


# The thesis's plant in plain Python, from the numbers of its Table B-1.
_KT, _KQ = b_series("KT", 0.9, 5), b_series("KQ", 0.9, 5)


def _coefficient(matrix: NDArray[np.float64], j: float, pitch: float) -> float:
    return float(pitch ** np.array(PITCH_POWERS) @ matrix @ j ** np.arange(4))


def _thesis_rate(
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


def test_nominal_ship_is_the_thesis_model(frigate: Ship, design_point: Equilibrium) -> None:
    dt, steps = 0.05, 2400
    grid = np.arange(steps) * dt
    rack = np.where(grid < 30.0, 22.0, np.where(grid < 70.0, 27.5, 18.0))
    command = np.where(grid < 50.0, 1.4, np.where(grid < 90.0, 1.0, 1.25))

    def inflow(t: Any) -> Any:
        return 0.7 * np.sin(0.9 * t)

    def factor(t: Any) -> Any:
        return 1.0 + 0.4 * t / 120.0

    x = np.array(design_point.state[:3])
    expected = [x]
    for k in range(steps):
        u = [inflow((k + part) * dt) for part in (0.0, 0.5, 1.0)]
        d = [factor((k + part) * dt) for part in (0.0, 0.5, 1.0)]
        f = functools.partial(_thesis_rate, rack=rack[k], command=command[k])
        k1 = f(x, inflow=u[0], factor=d[0])
        k2 = f(x + 0.5 * dt * k1, inflow=u[1], factor=d[1])
        k3 = f(x + 0.5 * dt * k2, inflow=u[1], factor=d[1])
        k4 = f(x + dt * k3, inflow=u[2], factor=d[2])
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        expected.append(x)

    schedule = Schedule(lambda _: rack, lambda _: command, inflow, factor)
    samples = simulate(frigate, schedule, steps * dt, initial=design_point.state)
    names = ("pitch_ratio", "shaft_speed", "ship_speed")
    for name, column in zip(names, np.transpose(expected), strict=True):
        np.testing.assert_allclose(samples[name], column, rtol=1e-12, err_msg=name)


def test_gauge_reads_the_thesis_torque(frigate: Ship, design_point: Equilibrium) -> None:
    # thesis eq. 2-19: no acceleration in it
    s = simulate(frigate, Schedule(27.5, 1.1), 20.0, initial=design_point.state)
    engine = (-45.5 * 7.38 * s["shaft_speed"] + 1428.6 * 27.5 - 7381.0) * 7.38 * 0.95
    total = 53697.0 + 14411.0
    expected = 14411.0 / total * engine + 53697.0 / total * s["propeller_torque"]
    np.testing.assert_allclose(s["shaft_torque"], expected, rtol=1e-12)
