"""One step in time: its weights, what acts where in it, its order, and the true solution."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    equilibrium,
    get_sea,
    load_ship,
    realise,
    simulate,
)
from shaftline.plant.dynamics import evaluate
from shaftline.plant.memory import MEMORY
from shaftline.plant.seas import Sea
from shaftline.plant.state import STATE, Inputs, State, active_states, get_state
from shaftline.plant.stepping import (
    UNDISTURBED,
    Disturbance,
    StepInputs,
    observe,
    prepare,
    runge_kutta,
    step,
)
from shaftline.plant.terms import Term, add_term
from shaftline.plant.waves import SYNC_STEPS, calm_sea, wave_field

DT = 0.05
MASS = 1e9  # so that the speed is all but constant
DRAG = 3306.2


class Run:
    """One ship's record with all that is carried along."""

    def __init__(self, plant: Any, start: State, drive: float = 22.0, sea: Any = None) -> None:
        self.plant = plant
        self.state, self.memory = np.zeros(1, STATE)[0], np.zeros(1, MEMORY)[0]
        self.sea = calm_sea() if sea is None else sea.copy()
        self.state["pitch_ratio"] = 0.0
        for name, value in start._asdict().items():
            self.state[name] = value
        prepare(plant, self.state, self.memory, self.sea, drive, UNDISTURBED, DT)

    def step(self, drive: float, pitch: float, *acting: Disturbance, dt: float = DT) -> Any:
        inputs = StepInputs(drive, pitch, 0.0, *(acting or [UNDISTURBED] * 3))
        return step(self.plant, self.state, self.memory, self.sea, inputs, dt)

    def observe(self, pitch: float, acting: Disturbance = UNDISTURBED) -> Any:
        return observe(self.plant, self.state, self.memory, self.sea, pitch, 0.0, acting, DT)


@pytest.fixture
def steady(plant: Any, design_point: Equilibrium) -> Run:
    return Run(plant, design_point.state)


@pytest.fixture
def massive(plant: Any, design_point: Equilibrium) -> Run:
    """Inertias so large that speeds stay, and forces show in what little they change."""
    plant["mass"], plant["inertia_engine_side"] = MASS, 1e9
    return Run(plant, design_point.state)


def test_step_has_the_weights_of_the_classic_scheme(steady: Run) -> None:
    """On x' = -x / tau it multiplies by the exponential's series to the fourth power."""
    z = DT / 2.0
    for _ in range(3):
        before = float(steady.state["pitch_ratio"])
        steady.step(22.0, 1.0)
        factor = 1.0 - z + z**2 / 2.0 - z**3 / 6.0 + z**4 / 24.0
        assert steady.state["pitch_ratio"] == pytest.approx(
            1.0 + factor * (before - 1.0), rel=1e-15
        )


def test_stages_are_taken_at_the_start_twice_the_middle_and_the_end(
    plant: Any, design_point: Equilibrium
) -> None:
    """By a plain scheme from the same rate, whose inputs differ at each instant."""
    at = [
        Inputs(24.0, 1.1, u, resistance_factor=d) for u, d in ((0.0, 1.0), (0.3, 1.2), (0.9, 1.6))
    ]
    f = functools.partial(evaluate, plant)
    x = design_point.state._replace(pitch_ratio=1.2)

    def on(k: State, h: float) -> State:
        return State(*(a + h * b for a, b in zip(x, k, strict=True)))

    k1, _ = f(x, at[0], 1.2)
    k2, _ = f(on(k1, 0.1), at[1], 1.2)
    k3, _ = f(on(k2, 0.1), at[1], 1.2)
    k4, _ = f(on(k3, 0.2), at[2], 1.2)
    slopes = zip(k1, k2, k3, k4, strict=True)
    mean = State(*((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in slopes))
    found = runge_kutta(plant, x, k1, at[1], at[2], 1.2, 0.2)
    np.testing.assert_allclose(found, on(mean, 0.2), rtol=1e-14)


def test_disturbances_act_at_their_instants(massive: Run) -> None:
    """A resistance factor of 1, 2, 4 at start, middle, end: by Simpson's rule 13/6 on average."""
    speed = float(massive.state["ship_speed"])
    acting = [Disturbance(0.0, 0.0, factor) for factor in (1.0, 2.0, 4.0)]
    plain = Run(massive.plant, get_state(massive.state))
    massive.step(22.0, 1.4, *acting)
    plain.step(22.0, 1.4)
    slowed = float(plain.state["ship_speed"] - massive.state["ship_speed"])
    assert slowed == pytest.approx(DT * (13.0 / 6.0 - 1.0) * DRAG * speed**2 / MASS, rel=1e-5)


def test_time_passes_within_a_step(massive: Run) -> None:
    """A force that grows with time, integrated over the seventh step."""
    plant = massive.plant
    add_term(plant, Term(id="growing", acts_on="resistance", expression="-1e8 * time"))
    massive.memory["cursor"] = 6
    before = float(massive.state["ship_speed"])
    rate, _ = evaluate(plant, get_state(massive.state), Inputs(22.0, 1.4), 1.4)
    massive.step(22.0, 1.4)
    gained = float(massive.state["ship_speed"]) - before - DT * rate.ship_speed
    assert gained == pytest.approx(DT * 1e8 * (6.5 * DT) / MASS, rel=1e-4)
    assert massive.memory["cursor"] == 7


@pytest.mark.parametrize(("first", "last"), [(0.0, 0.3), (0.29, 0.3), (0.35, 9.0)])
def test_an_episode_acts_over_the_steps_of_its_window(
    massive: Run, first: float, last: float
) -> None:
    plant = massive.plant
    plant["episode_resistance"], plant["episode_start"], plant["episode_end"] = 0.5, first, last
    massive.memory["cursor"] = 6  # from 0.3 to 0.35 s: after, after, before
    assert massive.step(22.0, 1.4).resistance == pytest.approx(
        DRAG * float(massive.state["ship_speed"]) ** 2, rel=1e-4
    )
    plant["episode_start"], plant["episode_end"] = 0.36, 9.0  # of the next step's 0.05 s, 0.04
    out = massive.step(22.0, 1.4)
    speed = float(massive.state["ship_speed"])
    assert out.resistance == pytest.approx(1.4 * DRAG * speed**2, rel=1e-4)
    assert massive.observe(1.4).resistance == pytest.approx(1.5 * DRAG * speed**2, rel=1e-4)


def test_outputs_are_those_of_the_start_under_the_new_commands(steady: Run) -> None:
    before = get_state(steady.state)
    out = steady.step(25.0, 1.2, Disturbance(0.2, -0.5, 1.1), UNDISTURBED, UNDISTURBED)
    inputs = Inputs(25.0, 1.2, 0.2, elevation=-0.5, resistance_factor=1.1)
    _, expected = evaluate(steady.plant, before, inputs, 1.4)
    assert out == expected
    assert steady.memory["shaft_torque"] == expected.shaft_torque
    assert steady.memory["speed_log"] == steady.state["ship_speed"] != before.ship_speed


def test_observed_are_the_outputs_of_now_under_the_last_rack(steady: Run) -> None:
    steady.plant["rack_rate_limit"] = 20.0
    steady.step(25.0, 1.2)
    out = steady.observe(1.3, Disturbance(0.2, -0.5, 1.1))
    inputs = Inputs(23.0, 1.3, 0.2, elevation=-0.5, resistance_factor=1.1)
    _, expected = evaluate(steady.plant, get_state(steady.state), inputs, 1.4)
    assert out == pytest.approx(expected, rel=1e-14)
    assert steady.memory["shaft_torque"] == out.shaft_torque
    assert steady.memory["cursor"] == 1


def test_prepared_ship_has_read_its_instruments(plant: Any, design_point: Equilibrium) -> None:
    plant["pitch_backlash"] = 0.04
    run = Run(plant, design_point.state._replace(pitch_ratio=1.2), drive=25.0)
    inputs = Inputs(25.0, 1.2)
    _, expected = evaluate(plant, get_state(run.state), inputs, 1.2)
    assert (run.memory["rack"], run.memory["cursor"]) == (25.0, 0)
    assert run.memory["blade_pitch"] == run.memory["pitch_ratio"] == 1.2
    assert run.memory["shaft_torque"] == expected.shaft_torque
    assert run.memory["speed_log"] == design_point.state.ship_speed


def test_prepared_ship_has_felt_the_waves_and_what_else_acts(
    plant: Any, design_point: Equilibrium
) -> None:
    sea = realise(Sea(hs_m=3.0, tp_s=9.0), 4.0, 3)
    state = np.zeros(1, STATE)[0]
    for name, value in design_point.state._replace(position=30.0)._asdict().items():
        state[name] = value
    plant["episode_resistance"] = 0.5  # a moving hull's force; the gauge does not feel it
    memory = np.zeros(1, MEMORY)[0]
    prepare(plant, state, memory, sea, 22.0, Disturbance(0.2, 0.0, 1.0), DT)
    inflow, _ = wave_field(sea, 0.0, 30.0)
    inputs = Inputs(22.0, 1.4, 0.2 + inflow)
    _, expected = evaluate(plant, get_state(state), inputs, 1.4)
    assert memory["shaft_torque"] == pytest.approx(expected.shaft_torque, rel=1e-12)


def test_waves_are_felt_at_each_stage_where_the_ship_is(
    plant: Any, design_point: Equilibrium
) -> None:
    """A massive ship feels the field at its place; its inflow at the start of each step tells."""
    sea = realise(Sea(hs_m=3.0, tp_s=9.0), 4.0, 3)
    plant["mass"] = MASS
    run = Run(plant, design_point.state, sea=sea)
    speed = float(run.state["ship_speed"])
    for k in range(2 * SYNC_STEPS + 3):
        out = run.step(22.0, 1.4)
        inflow, surface = wave_field(sea, k * DT, k * DT * speed)
        assert out.advance_velocity - 0.95 * speed == pytest.approx(inflow, abs=1e-4)
        assert out.submergence - 4.0 == pytest.approx(surface, abs=1e-4)


def test_waves_within_a_step_move_the_shaft_as_the_field_does(
    plant: Any, design_point: Equilibrium
) -> None:
    """One step in waves is one with the field's own inflow at its start, middle and end."""
    sea = realise(Sea(hs_m=3.0, tp_s=9.0), 4.0, 3)
    sea["slope"] = 0.0  # the field does not change with the ship's little departure
    in_waves = Run(plant, design_point.state, sea=sea)
    still = Run(plant, design_point.state)
    speed = float(design_point.state.ship_speed)
    acting = [Disturbance(*wave_field(sea, t, t * speed), 1.0) for t in (0.0, 0.5 * DT, DT)]
    in_waves.step(22.0, 1.4)
    still.step(22.0, 1.4, *acting)
    for name in ("shaft_speed", "ship_speed"):
        start = getattr(design_point.state, name)
        change = float(still.state[name]) - start
        assert float(in_waves.state[name]) - start == pytest.approx(change, rel=1e-9), name


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


def test_waves_and_moving_pitch_agree_with_scipy(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    plant = frigate.record()
    initial = design_point.state._replace(pitch_ratio=1.2)

    def rate(t: float, y: NDArray[np.float64]) -> tuple[float, ...]:
        inflow, elevation = wave_field(thesis_sea, t, y[3])
        inputs = Inputs(22.0, 1.4, inflow, elevation=elevation, time=t)
        state = State(y[0], y[1], y[2], y[3])
        return evaluate(plant, state, inputs, y[0])[0][:4]

    samples = simulate(frigate, Schedule(22.0, 1.4), 100.0, initial=initial, sea=thesis_sea)
    exact = solve_ivp(
        rate, (0.0, 100.0), initial[:4], "DOP853", samples["time"], rtol=1e-10, atol=1e-12
    )
    assert np.ptp(exact.y[1]) > 1.0  # the shaft speed does move
    for name, expected in zip(("pitch_ratio", "shaft_speed", "ship_speed"), exact.y, strict=False):
        worst = np.max(np.abs(samples[name] / expected - 1.0))
        assert worst < 1e-7, name  # measured: 7e-9


SMOOTH = {"propeller.depth_m": 3.0}
"""Her propellers near the surface, so that ventilation acts; all her other limits as packaged."""


def worst_errors(ship: Ship, schedule: Schedule, steps: tuple[float, ...], seconds: float) -> Any:
    """Largest errors of the shaft speed [rad/s], once a second, against a step of 0.05 / 64 s."""
    spectrum = get_sea("state-6")
    assert spectrum is not None
    sea = realise(spectrum, ship.propeller.depth_m, 3)
    initial = equilibrium(ship, 20.0, 1.2).state

    def shaft_speed(dt: float) -> Any:
        samples = simulate(ship, schedule, seconds, initial=initial, sea=sea, dt=dt)
        return samples[:: round(1.0 / dt)]

    exact = shaft_speed(0.05 / 64.0)
    errors = [np.abs(shaft_speed(dt)["shaft_speed"] - exact["shaft_speed"]).max() for dt in steps]
    return np.array(errors), exact


def test_a_ship_at_sea_converges_with_the_fourth_order() -> None:
    """Ventilation, the rack's rate limit, the pitch's, and waves on which the ship surges."""
    ship = load_ship("frigate-at-sea").with_values(SMOOTH)
    programme = Schedule(
        lambda t: np.where(t < 20.0, 20.0, 25.0), lambda t: np.where(t < 20.0, 1.2, 1.0)
    )
    steps = (0.1, 0.05, 0.025, 0.0125)
    errors, exact = worst_errors(ship, programme, steps, 60.0)
    assert exact["ventilation"].max() > 0.9  # air came
    assert np.ptp(exact["ventilation"][20:]) > 0.8  # and went
    orders = np.log2(errors[:-1] / errors[1:])
    # the end of a rate-limited travel lies anywhere in a step: the order varies about 4
    assert orders.min() > 3.0
    assert np.log2(errors[0] / errors[-1]) / 3.0 > 3.6
    assert errors[1] < 2e-4  # rad/s at the packaged step


def test_a_rack_with_a_rate_limit_converges(frigate: Ship) -> None:
    """Its travel was once a staircase of steps: order 1."""
    ship = frigate.with_values({"prime_mover.rack_rate_limit_mm_s": 3.7, "prime_mover.lag_s": 0.3})
    programme = Schedule(lambda t: np.where(t < 4.0, 20.0, 27.0), 1.2)
    initial = equilibrium(ship, 20.0, 1.2).state

    def final(dt: float) -> float:
        return float(simulate(ship, programme, 8.0, initial=initial, dt=dt)["shaft_speed"][-1])

    exact = final(0.001)
    errors = np.array([abs(final(dt) - exact) for dt in (0.2, 0.1, 0.05)])
    assert np.all(errors < [1e-4, 1e-5, 1e-6])
    assert np.log2(errors[0] / errors[2]) / 2.0 > 3.0


def test_a_ventilating_ship_at_sea_agrees_with_scipy() -> None:
    """The whole ship in waves, her states by an integrator of order 8 that chooses its step."""
    ship = load_ship("frigate-at-sea").with_values(SMOOTH)
    plant = ship.record()
    sea = realise(Sea(hs_m=6.0, tp_s=12.0), 3.0, 3)
    initial = equilibrium(ship, 20.0, 1.2).state
    names = [*active_states(plant), "position"]
    height = float(sea["head_sea"])

    def rate(t: float, y: NDArray[np.float64]) -> list[float]:
        state = initial._replace(**dict(zip(names, y, strict=True)))
        inflow, elevation = wave_field(sea, t, state.position)
        inputs = Inputs(20.0, 1.2, inflow, elevation=elevation, time=t, head_sea=height)
        found, _ = evaluate(plant, state, inputs, 1.2)
        return [getattr(found, name) for name in names]

    samples = simulate(ship, Schedule(20.0, 1.2), 60.0, initial=initial, sea=sea)
    begin = [getattr(initial, name) for name in names]
    exact = solve_ivp(
        rate, (0.0, 60.0), begin, "DOP853", samples["time"], rtol=1e-9, atol=1e-11, max_step=0.1
    )
    assert np.ptp(samples["ventilation"]) > 0.8
    for name, tolerance in (("shaft_speed", 2e-4), ("ship_speed", 2e-5), ("ventilation", 2e-4)):
        worst = np.abs(samples[name] - exact.y[names.index(name)]).max()
        assert worst < tolerance, (name, worst)
