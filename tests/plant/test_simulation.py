"""Whole histories: samples, inputs, balances of power, rest, and a start without a transient."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    equilibrium,
    get_sea,
    load_ship,
    realise,
    simulate,
)
from shaftline.plant.memory import MEMORY
from shaftline.plant.signals import SAMPLE, SIGNALS
from shaftline.plant.simulation import _values_at, simulate_record
from shaftline.plant.state import STATE, get_state
from shaftline.plant.stepping import Disturbance, StepInputs, observe, prepare, step

BUSY = {
    "prime_mover.lag_s": 0.4,
    "prime_mover.dead_time_s": 0.22,
    "propeller.inflow_lag_s": 0.5,
    "propeller.depth_m": 3.0,
    "ventilation.thrust_loss": 0.6,
    "ventilation.onset_submergence": 0.5,
    "pitch_actuator.backlash": 0.02,
    "sensors.torque_delay_s": 0.13,
    "sensors.speed_log_lag_s": 5.0,
}
STEADY = {
    "prime_mover.lag_s": 1.5,
    "prime_mover.dead_time_s": 0.22,
    "propeller.inflow_lag_s": 2.0,
    "pitch_actuator.offset": 0.05,
    "pitch_actuator.backlash": 0.02,
    "sensors.speed_log_lag_s": 5.0,
    "sensors.torque_delay_s": 0.13,
    "sensors.torque_gain": 1.02,
    "hull.current_m_s": 0.5,
    "hull.wake_slope_s_m": 0.004,
}


def test_a_steady_ship_begins_without_a_transient(frigate: Ship) -> None:
    """Every lag, delay, offset and instrument stands where it would have come to stand."""
    ship = frigate.with_values(STEADY)
    start = equilibrium(ship, 22.0, 1.2)
    s = simulate(ship, Schedule(22.0, 1.2), 20.0, initial=start.state)
    for name in s.dtype.names or ():
        if name not in ("time", "position", "shaft_angle", "shaft_acceleration"):
            np.testing.assert_allclose(s[name], s[name][0], rtol=1e-8, err_msg=name)
    assert np.abs(s["shaft_acceleration"]).max() < 1e-8
    assert s["measured_shaft_torque"][0] == pytest.approx(1.02 * s["shaft_torque"][0])
    assert s["pitch_ratio"][0] == pytest.approx(1.25)


def test_samples_are_the_outputs_of_single_steps(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    """Every field of every sample, to the last bit, the last one under the last commands."""
    ship = frigate.with_values(BUSY)
    plant, sea, dt, steps = ship.record(), thesis_sea.copy(), 0.05, 30
    drive, pitch = np.linspace(20.0, 26.0, steps), np.linspace(1.4, 1.2, steps)
    helm = np.linspace(0.1, -0.2, steps)
    half = 0.5 * dt * np.arange(2 * steps + 1)
    acts = [Disturbance(math.sin(t), 0.2 - t, 1.0 + t) for t in half]
    schedule = Schedule(
        drive,
        lambda _: pitch,
        lambda t: [math.sin(x) for x in t],
        lambda t: 1.0 + t,
        lambda t: 0.2 - t,
        rudder_command=helm,
    )
    start = design_point.state._replace(pitch_ratio=1.3, position=12.0)
    found = simulate(ship, schedule, steps * dt, initial=start, sea=thesis_sea)

    state, memory = np.zeros(1, STATE)[0], np.zeros(1, MEMORY)[0]
    for name, value in start._asdict().items():
        state[name] = value
    prepare(plant, state, memory, sea, drive[0], acts[0], dt)
    for k in range(steps + 1):
        now, log = get_state(state), float(memory["speed_log"])
        last = min(k, steps - 1)
        if k < steps:
            acting = StepInputs(drive[k], pitch[k], helm[k], *acts[2 * k : 2 * k + 3])
            out = step(plant, state, memory, sea, acting, dt)
        else:
            out = observe(plant, state, memory, sea, pitch[last], helm[last], acts[-1], dt)
        expected = {
            "time": k * dt,
            "drive": drive[last],
            "pitch_command": pitch[last],
            "rudder_command": helm[last],
            "rudder_angle": helm[last],
            "measured_pitch_ratio": memory["pitch_ratio"],
            "measured_ship_speed": log,
            "measured_shaft_torque": memory["shaft_torque"],
            "shaft_speed": now.shaft_speed,
            "measured_shaft_speed": memory["shaft_speed"],
            "measured_thrust": memory["thrust"],
            "measured_motor_current": memory["motor_current"],
            "ship_speed": now.ship_speed,
            "ventilation": now.ventilation,
            "position": now.position,
            "shaft_angle": now.shaft_angle,
            "sway_speed": 0.0,
            "yaw_rate": 0.0,
            "heading": 0.0,
            "cross_track": 0.0,
            "roll_angle": 0.0,
            "roll_rate": 0.0,
            "nox": 0.0,
            "co2": 0.0,
            "shaft_power": memory["shaft_torque"] * memory["shaft_speed"],
        }
        for name in SAMPLE.names or ():
            value = expected.get(name, getattr(out, name, None))
            assert found[k][name] == value, (k, name)


def test_a_time_step_may_be_asked_for(frigate: Ship, design_point: Equilibrium) -> None:
    found = simulate(frigate, Schedule(22.0, 1.4), 1.0, initial=design_point.state, dt=0.1)
    np.testing.assert_allclose(found["time"], 0.1 * np.arange(11), atol=1e-12)
    own, same = (
        simulate(frigate, Schedule(25.0, 1.2), 1.0, initial=design_point.state, dt=dt).tobytes()
        for dt in (None, 0.05)
    )
    assert own == same


@pytest.mark.parametrize(
    "value",
    [3.0, np.full(4, 3.0), np.full((8,), 3.0)[::2], lambda t: np.broadcast_to(3.0, t.shape)],
)
@pytest.mark.parametrize("count", [1, 4])
def test_inputs_reach_the_kernel_as_one_kind_of_array(value: Any, count: int) -> None:
    """It would be compiled anew for each other kind, which takes half a minute."""
    value = value[:count] if isinstance(value, np.ndarray) else value
    found = _values_at(value, np.arange(float(count)), "drive")
    assert found.tolist() == [3.0] * count
    assert found.flags.c_contiguous
    assert found.flags.writeable
    assert found is not value


def test_disturbances_are_none_unless_given(frigate: Ship, design_point: Equilibrium) -> None:
    plain, given = (
        simulate(frigate, schedule, 1.0, initial=design_point.state).tobytes()
        for schedule in (Schedule(25.0, 1.2), Schedule(25.0, 1.2, 0.0, 1.0, 0.0))
    )
    assert plain == given


def test_same_seed_gives_the_same_voyage(frigate: Ship, design_point: Equilibrium) -> None:
    sea = get_sea("thesis")
    assert sea is not None
    runs = [
        simulate(
            frigate, Schedule(22.0, 1.4), 30.0, initial=design_point.state, sea=realise(sea, 4.0, s)
        ).tobytes()
        for s in (1, 1, 2)
    ]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_simulation_leaves_its_sea_untouched(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    before = thesis_sea.tobytes()
    simulate(frigate, Schedule(22.0, 1.4), 5.0, initial=design_point.state, sea=thesis_sea)
    assert thesis_sea.tobytes() == before


@pytest.mark.parametrize(
    ("duration", "samples"), [(1.0, 21), (1.01, 22), (1e-9, 2), (0.15, 4), (0.3, 7), (0.049, 2)]
)
def test_one_sample_at_every_step_and_one_at_the_end(
    frigate: Ship, design_point: Equilibrium, duration: float, samples: int
) -> None:
    found = simulate(frigate, Schedule(22.0, 1.4), duration, initial=design_point.state)
    np.testing.assert_allclose(found["time"], 0.05 * np.arange(samples), atol=1e-12)


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        (lambda t: 22.0 if t < 60.0 else 0.0, r"np\.where\(t < 60\.0, a, b\)"),
        (lambda t: t[:3], r"an array of shape \(10,\)"),
        ("full", "must be a number"),
        ([1.0, 2.0], r"an array of shape \(10,\)"),
    ],
)
def test_command_that_gives_no_value_for_each_time_is_explained(
    frigate: Ship, design_point: Equilibrium, drive: Any, words: str
) -> None:
    with pytest.raises(ValueError, match=f"drive: .*{words}"):
        simulate(frigate, Schedule(drive, 1.4), 0.5, initial=design_point.state)


def test_elevation_is_added_to_the_seas(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    risen = Schedule(22.0, 1.4, elevation=lambda t: 0.1 * t)
    plain, found = (
        simulate(frigate, s, 20.0, initial=design_point.state, sea=thesis_sea)
        for s in (Schedule(22.0, 1.4), risen)
    )
    np.testing.assert_allclose(
        found["submergence"], plain["submergence"] + 0.1 * plain["time"], rtol=1e-12
    )
    np.testing.assert_array_equal(found["shaft_speed"], plain["shaft_speed"])


def test_elevation_lets_a_propeller_ventilate(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values(BUSY)
    trough = Schedule(22.0, 1.4, elevation=lambda t: np.where(t > 5.0, -2.0, 0.0))
    found = simulate(ship, trough, 10.0, initial=equilibrium(ship, 22.0, 1.4).state)
    assert np.all(found["ventilation"][found["time"] < 5.0] < 1e-4)
    assert found["ventilation"][-1] > 0.9


def test_trajectory_of_records_is_the_simulation_of_ships(
    frigate: Ship, design_point: Equilibrium, thesis_sea: Any
) -> None:
    keys = {"propeller.inflow_lag_s": 0.8, "hull.fouling_fraction": 0.2}
    steps, dt = 200, frigate.time_step_s
    half = np.arange(2 * steps + 1) * 0.5 * dt
    expected = simulate(
        frigate.with_values(keys),
        Schedule(24.0, 1.3, np.sin, 1.1, np.cos),
        steps * dt,
        initial=design_point.state,
        sea=thesis_sea,
    )
    plant = frigate.record()
    for key, value in keys.items():
        frigate.parameter(key).write(plant, value)
    commands = np.full(steps, 24.0), np.full(steps, 1.3), np.zeros(steps)
    surroundings = np.sin(half), np.cos(half), np.full(half.shape, 1.1), np.zeros((1, 6))

    def kept(*of_signals: Any) -> Any:
        state = np.zeros(1, STATE)
        state[0] = tuple(design_point.state)
        sea = thesis_sea.copy()
        return simulate_record(plant, state[0], sea, commands, surroundings, dt, *of_signals)

    assert kept().tobytes() == expected.tobytes()
    some = kept(50, ("time", "shaft_speed"))  # every 50 steps
    np.testing.assert_allclose(some[:, 0], [0.0, 2.5, 5.0, 7.5, 10.0], rtol=1e-12)
    assert some[:, 1].tolist() == expected["shaft_speed"][::50].tolist()
    assert len(kept(60)) == 4  # the last sample would be that of a fraction of 60 steps


def test_equilibrium_stays(frigate: Ship, design_point: Equilibrium) -> None:
    samples = simulate(frigate, Schedule(22.0, 1.4), 100.0, initial=design_point.state)
    for name in ("shaft_speed", "ship_speed", "shaft_torque"):
        np.testing.assert_allclose(samples[name], samples[name][0], rtol=1e-8)


def test_tug_spins_up_to_its_steady_state() -> None:
    ship = load_ship("tito-neri-staircase")
    start, end = (equilibrium(ship, voltage, 1.0) for voltage in (3.91, 5.89))
    samples = simulate(ship, Schedule(5.89, 1.0), 4.0, initial=start.state)
    assert samples["shaft_speed"][-1] == pytest.approx(end.state.shaft_speed, rel=1e-6)
    assert samples["motor_current"][-1] == pytest.approx(end.state.motor_current, rel=1e-6)


@pytest.mark.parametrize(
    "name", ["drive", "pitch_command", "inflow", "elevation", "resistance_factor"]
)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_input_that_is_no_number_is_named(
    frigate: Ship, design_point: Equilibrium, name: str, value: float
) -> None:
    inputs: dict[str, Any] = {
        "drive": 22.0,
        "pitch_command": 1.4,
        name: lambda t: np.where(t > 0.5, value, 1.0),
    }
    with pytest.raises(ValueError, match="contains a value that is not finite"):
        simulate(frigate, Schedule(**inputs), 1.0, initial=design_point.state)


def test_delay_that_does_not_fit_the_time_step_is_refused(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values({"sensors.torque_delay_s": 3.0})
    with pytest.raises(ShipError, match=r"sensors\.torque_delay_s = 3\.0 s exceeds 2\.55 s"):
        simulate(ship, Schedule(22.0, 1.4), 2.0, initial=design_point.state, dt=0.005)


@pytest.fixture(scope="module", params=[{}, BUSY], ids=["nominal", "busy"])
def rough_voyage(request: Any, frigate: Ship, thesis_sea: Any) -> NDArray[Any]:
    ship = frigate.with_values(request.param)
    start = equilibrium(ship, 22.0, 1.4)
    schedule = Schedule(lambda t: np.where(t < 30.0, 22.0, 28.0), 1.2)
    return simulate(ship, schedule, 60.0, initial=start.state, sea=thesis_sea)


def test_power_is_balanced(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage
    stored = (53697.0 + 14411.0) * s["shaft_speed"] * s["shaft_acceleration"]
    drive = s["brake_torque"] * 7.38 * 0.95 * s["shaft_speed"]
    taken = s["propeller_torque"] * s["shaft_speed"]
    np.testing.assert_allclose(stored, drive - taken, atol=1e-12 * drive.max())


def test_gauge_is_the_cut_seen_from_either_side(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage
    engine = s["brake_torque"] * 7.38 * 0.95 - 53697.0 * s["shaft_acceleration"]
    propeller = s["propeller_torque"] + 14411.0 * s["shaft_acceleration"]
    np.testing.assert_allclose(s["shaft_torque"], engine, rtol=1e-11)
    np.testing.assert_allclose(s["shaft_torque"], propeller, rtol=1e-11)


def test_samples_stay_within_the_registrys_bounds(rough_voyage: NDArray[Any]) -> None:
    for signal in SIGNALS:
        values = rough_voyage[signal.name]
        assert np.all((signal.low <= values) & (values <= signal.high)), signal.name


def test_acceleration_is_the_slope_of_the_speed(rough_voyage: NDArray[Any]) -> None:
    s = rough_voyage[100:500]  # no step of a command in here
    slope = (s["shaft_speed"][2:] - s["shaft_speed"][:-2]) / 0.1
    np.testing.assert_allclose(slope, s["shaft_acceleration"][1:-1], atol=0.01)


@settings(max_examples=15)
@given(
    rack=st.floats(10.0, 34.0),
    pitch=st.floats(0.6, 1.4),
    shaft=st.floats(0.85, 1.1),
    hull=st.floats(0.8, 1.1),
)
def test_constant_commands_lead_to_the_equilibrium(
    frigate: Ship, rack: float, pitch: float, shaft: float, hull: float
) -> None:
    rest = equilibrium(frigate, rack, pitch)
    assume(350.0 < 7.38 * rest.state.shaft_speed * 30.0 / math.pi < 1000.0)
    initial = rest.state._replace(
        shaft_speed=shaft * rest.state.shaft_speed, ship_speed=hull * rest.state.ship_speed
    )
    end = simulate(frigate, Schedule(rack, pitch), 1500.0, initial=initial)[-1]
    assert end["shaft_speed"] == pytest.approx(rest.state.shaft_speed, rel=1e-4)
    assert end["ship_speed"] == pytest.approx(rest.state.ship_speed, rel=1e-4)
