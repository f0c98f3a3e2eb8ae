from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from shaftline.baselines.ventilation import (
    TORQUE_LOSS,
    TorqueLossObserver,
    bollard_gain,
    estimated_propeller_torque,
    observer_weights,
    shaft_load,
    update_torque_loss,
    update_torque_losses,
)
from shaftline.plant import Equilibrium, Schedule, Ship, load_ship, simulate
from shaftline.plant.open_water import open_water

INERTIA = 14411.0  # kg m2


def satisfies_a2(a11: float, a22: float, l1: float, l2: float, tau: float, viscous: float) -> bool:
    """Return whether condition A2 holds, as printed."""
    return bool(
        abs(a11 / INERTIA + a22 * l2) < 2.0 * np.sqrt(a11 * a22 * (viscous + l1) / (tau * INERTIA))
    )


def test_a1_is_named() -> None:
    with pytest.raises(ValueError, match="A1"):
        observer_weights(-3.0, -1.0, 10.0, INERTIA, viscous=2.0)
    observer_weights(-1.0, -1.0, 10.0, INERTIA, viscous=2.0)


def test_a2_is_named() -> None:
    with pytest.raises(ValueError, match="A2"):
        observer_weights(10.0, 1.2, 10.0, INERTIA, viscous=2.0)
    observer_weights(10.0, 1.19, 10.0, INERTIA, viscous=2.0)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_gains_must_be_numbers(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        observer_weights(bad, -1.0, 10.0, INERTIA, viscous=0.0)


@pytest.mark.parametrize(
    "tuning",
    [
        TorqueLossObserver(time_constant_s=0.0),
        TorqueLossObserver(speed_rate=-1.0),
        TorqueLossObserver(loss_rate=1.0),
    ],
)
def test_bad_tuning_is_refused(frigate: Ship, tuning: TorqueLossObserver) -> None:
    with pytest.raises(ValueError, match="torque-loss observer"):
        tuning.discretise(frigate, 0.5)


@given(
    l1=st.floats(1e-2, 1e6),
    share=st.floats(-50.0, 1.9),
    tau=st.floats(0.1, 1e3),
    viscous=st.floats(0.0, 1e4),
)
def test_weights_are_returned_if_and_only_if_they_exist(
    l1: float, share: float, tau: float, viscous: float
) -> None:
    bound = (l1 + viscous) / tau
    l2 = share * bound
    # a11 / (J a22) over twelve decades about the bound.
    found = any(
        satisfies_a2(INERTIA * r, 1.0, l1, l2, tau, viscous)
        for r in bound * np.logspace(-6, 6, 1201)
    )
    if share < 0.999:
        a11, a22 = observer_weights(l1, l2, tau, INERTIA, viscous)
        assert a11 > 0.0
        assert a22 > 0.0
        assert satisfies_a2(a11, a22, l1, l2, tau, viscous)
    elif share > 1.001:
        assert not found
        with pytest.raises(ValueError, match="A2"):
            observer_weights(l1, l2, tau, INERTIA, viscous)


def follow(ship: Ship, run: Any, every: int, first_loss: float = 0.0) -> tuple[Any, Any]:
    """Return estimated and true propeller torque [N m] and loss of a simulation."""
    dt = ship.time_step_s * every
    observer = TorqueLossObserver().discretise(ship, dt)
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    rows: list[tuple[float, float, float]] = []
    for sample in run[::every]:
        update_torque_loss(
            observer,
            estimate,
            sample["shaft_speed"],
            sample["measured_shaft_torque"],
            sample["measured_pitch_ratio"],
        )
        if not rows:
            estimate["torque_loss"] += first_loss
        gain = bollard_gain(observer["ship"], float(sample["pitch_ratio"]))
        loss = sample["propeller_torque"] - gain * sample["shaft_speed"] ** 2
        rows.append(
            (estimate["torque_loss"], loss, estimated_propeller_torque(observer["ship"], estimate))
        )
    return np.array(rows).T, run[::every]


ROUGH = load_ship("frigate").with_values(
    {
        "transmission.coulomb_friction_propeller_side_N_m": 5000.0,
        "transmission.viscous_friction_propeller_side_N_m_s_rad": 400.0,
        "propeller.entrained_inertia_kg_m2": 1600.0,
        "propeller.relative_rotative_efficiency": 0.98,
    }
)


def test_gains_scale_with_the_inertia_behind_the_torque_meter() -> None:
    record = TorqueLossObserver(10.0, -20.0, 300.0).discretise(ROUGH, 0.25)
    names = ("dt", "inertia", "speed_gain", "loss_gain", "time_constant")
    inertia = 14411.0 + 1600.0
    assert [record[name] for name in names] == [0.25, inertia, 10 * inertia, -20 * inertia, 300.0]
    assert record["ship"] == ROUGH.record()
    assert TorqueLossObserver() == TorqueLossObserver(12.0, -32.0, 500.0)
    for dt in (0.0, -0.5, float("nan")):
        with pytest.raises(ValueError, match="time step"):
            TorqueLossObserver().discretise(ROUGH, dt)


def test_bollard_torque_and_load_by_hand() -> None:
    plant, observer = ROUGH.record(), TorqueLossObserver().discretise(ROUGH, 0.25)
    gain = open_water(plant["kq"], 0.0, 1.2) * 1025.0 * 4.2**5 / 0.98 / (2.0 * np.pi) ** 2
    assert bollard_gain(plant, 1.2) == pytest.approx(gain)
    for omega in (9.0, -9.0):
        sign = np.sign(omega)
        assert shaft_load(observer, 1.2, omega) == pytest.approx(sign * (gain * 81.0 + 5000.0))
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    estimate["shaft_speed"], estimate["torque_loss"], estimate["measured_pitch"] = -3.0, 1e4, 1.2
    assert estimated_propeller_torque(plant, estimate) == pytest.approx(1e4 - gain * 9.0)


def test_first_sample_is_taken_as_steady() -> None:
    observer = TorqueLossObserver().discretise(ROUGH, 0.25)
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    update_torque_loss(observer, estimate, 9.0, 1.5e5, 1.2)
    loss = 1.5e5 - shaft_load(observer, 1.2, 9.0) - 400.0 * 9.0
    assert estimate["shaft_speed"] == 9.0
    assert estimate["torque_loss"] == pytest.approx(loss)
    names = ("started", "measured_speed", "measured_torque", "measured_pitch")
    assert [estimate[name] for name in names] == [1, 9.0, 1.5e5, 1.2]


def test_estimates_follow_the_papers_equations() -> None:
    """Eqs. 8 and 9 with linear interpolation; the error falls with the square of the step."""
    plant, tuning = ROUGH.record(), TorqueLossObserver(12.0, -32.0, 50.0)
    inertia = 14411.0 + 1600.0

    def measurements(t: Any) -> Any:
        return (
            9.0 + 0.5 * np.sin(1.3 * t),
            1.5e5 + 3e4 * np.sin(1.7 * t),
            1.2 + 0.1 * np.sin(0.9 * t),
        )

    def rate(t: float, x: Any) -> Any:
        omega, torque, pitch = measurements(t)
        error = omega - x[0]
        load = (
            bollard_gain(plant, pitch) * abs(x[0]) * x[0] + 5000.0 * np.sign(omega) + 400.0 * x[0]
        )
        speed = (torque - load - x[1]) / inertia + 12.0 * error
        return [speed, -x[1] / 50.0 - 32.0 * inertia * error]

    errors = []
    for dt in (0.02, 0.01):
        t = np.arange(0.0, 4.0, dt)
        observer, estimate = tuning.discretise(ROUGH, dt), np.zeros(1, TORQUE_LOSS)[0]
        found = []
        for row in zip(*measurements(t), strict=True):
            update_torque_loss(observer, estimate, *row)
            found.append((estimate["shaft_speed"], estimate["torque_loss"]))
        exact = solve_ivp(rate, (0.0, t[-1]), found[0], "Radau", t_eval=t, rtol=1e-9, atol=1e-6).y.T
        assert np.ptp(exact, axis=0) == pytest.approx([0.9, 9e4], rel=0.5)
        errors.append(np.abs(np.array(found) - exact).max(axis=0) / np.ptp(exact, axis=0))
    assert np.all(errors[1] < 1e-3)
    assert np.all(errors[1] < 0.3 * errors[0])


@pytest.mark.parametrize("every", [1, 10])
def test_loss_in_calm_water_is_estimated_from_any_start(
    frigate: Ship, design_point: Equilibrium, every: int
) -> None:
    run = simulate(frigate, Schedule(22.0, 1.4), 60.0, initial=design_point.state)
    (estimated, true, torque), kept = follow(frigate, run, every, first_loss=2e5)
    assert abs(estimated[0] / true[0] - 1.0) > 0.3
    assert estimated[-1] == pytest.approx(true[-1], rel=0.005)
    assert torque[-1] == pytest.approx(kept["propeller_torque"][-1], rel=0.005)


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("change", [-1.0, 1.0])
def test_steady_change_of_inflow_is_followed(
    frigate: Ship, design_point: Equilibrium, every: int, change: float
) -> None:
    schedule = Schedule(22.0, 1.4, inflow=lambda t: np.where(t >= 20.0, change, 0.0))
    run = simulate(frigate, schedule, 60.0, initial=design_point.state)
    (estimated, true, torque), kept = follow(frigate, run, every)
    assert abs(true[-1] / true[0] - 1.0) > 0.03
    assert estimated[-1] == pytest.approx(true[-1], rel=0.005)
    # The torque is a small difference of large numbers, within 2 % from 3 s on.
    settled = kept["time"] >= 23.0
    np.testing.assert_allclose(torque[settled], kept["propeller_torque"][settled], rtol=0.02)


def test_friction_is_not_taken_for_a_loss(frigate: Ship) -> None:
    rough = frigate.with_values(
        {
            "transmission.coulomb_friction_propeller_side_N_m": 5000.0,
            "transmission.viscous_friction_propeller_side_N_m_s_rad": 400.0,
        }
    )
    plant = rough.record()
    omega, pitch, loss = 9.0, 1.3, -2.5e5
    observer = TorqueLossObserver().discretise(rough, 0.5)
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    at_gauge = shaft_load(observer, pitch, omega) + 400.0 * omega + loss
    assert at_gauge == pytest.approx(
        bollard_gain(plant, pitch) * omega**2 + 5000.0 + 400.0 * omega + loss
    )
    for _ in range(200):
        update_torque_loss(observer, estimate, omega, at_gauge, pitch)
    assert estimate["torque_loss"] == pytest.approx(loss, rel=0.005)


@pytest.mark.parametrize("dt", [0.05, 0.5])
@pytest.mark.parametrize("rates", [(12.0, -32.0), (1e3, -1e5), (1e-3, -1e-3)])
def test_no_gain_is_too_high_for_the_step(
    frigate: Ship, dt: float, rates: tuple[float, float]
) -> None:
    observer = TorqueLossObserver(*rates).discretise(frigate, dt)
    rng = np.random.default_rng(1)
    measurements = np.column_stack(
        [rng.uniform(4.0, 14.0, 2000), rng.uniform(0.0, 3e5, 2000), rng.uniform(0.6, 1.4, 2000)]
    )
    measurements[-400:] = (10.0, 1.3e5, 1.4)  # then steady
    estimate = np.zeros(1, TORQUE_LOSS)[0]
    for measurement in measurements:
        update_torque_loss(observer, estimate, *measurement)
        assert abs(estimate["shaft_speed"]) < 100.0
    if rates[0] == 12.0:
        assert estimate["shaft_speed"] == pytest.approx(10.0, abs=0.05)


def test_a_batch_equals_single_ships(frigate: Ship) -> None:
    observer = TorqueLossObserver().discretise(frigate, 0.5)
    rng = np.random.default_rng(2)
    fleet = np.zeros(5, TORQUE_LOSS)
    alone = np.zeros(5, TORQUE_LOSS)
    for _ in range(50):
        measurements = rng.uniform([4.0, 0.0, 0.6], [14.0, 3e5, 1.4], (5, 3))
        update_torque_losses(observer, fleet, *np.ascontiguousarray(measurements.T))
        for i in range(5):
            update_torque_loss(observer, alone[i], *measurements[i])
    np.testing.assert_array_equal(fleet, alone)
