"""Simulate the anti-spin controller in storms: the frigate light, its propellers near the surface.

The plant is stepped as the environment steps it: commands held over a control interval, instruments
sampled at its end. The tests use true values, which the controller never has.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftline.baselines.anti_spin import AntiSpin
from shaftline.baselines.controller import OBSERVED, decode
from shaftline.baselines.ventilation import estimated_propeller_torque
from shaftline.core.compiled import Record, compiled
from shaftline.core.rows import true_runs
from shaftline.envs.tasks import get_task
from shaftline.plant import Ship, equilibrium, get_sea, load_ship, realise
from shaftline.plant.expressions import NO_SIGNALS
from shaftline.plant.memory import MEMORY
from shaftline.plant.state import STATE
from shaftline.plant.stepping import Disturbance, constant_inputs, observe, prepare, step
from shaftline.plant.waves import SEA

INTERVAL_STEPS = 10
ORDER_M_S = 8.0
RESISTANCE_FACTOR = 1.6
"""Resistance over that in calm water; assumed, because the plant has no added resistance of waves."""

READING = np.dtype([(name, np.float64) for name in OBSERVED])  # measurements of the controller


class Storm(NamedTuple):
    """The simulation of n ships: columns of shape (n, intervals)."""

    thrust: NDArray[np.float64]  # mean of the interval [N]
    thrust_power: NDArray[np.float64]  # mean of T v_a [W]
    power: NDArray[np.float64]  # mean of the engine's power [W]
    peak_power: NDArray[np.float64]
    shaft_speed: NDArray[np.float64]  # mean [rad/s]
    peak_speed: NDArray[np.float64]
    ship_speed: NDArray[np.float64]  # at the end [m/s]
    ventilation: NDArray[np.float64]  # at the end [-]
    propeller_torque: NDArray[np.float64]  # at the end [N m]
    rack: NDArray[np.float64]  # commanded [mm]
    detected: NDArray[np.bool_]  # at the start, like the next two
    torque_estimate: NDArray[np.float64]  # Q_p-hat [N m]
    torque_ratio: NDArray[np.float64]  # beta_Q-hat [-]


STORM = np.dtype([(name, np.float64) for name in Storm._fields[:10]])
"""True values of a control interval."""


def storm_frigate(**values: Any) -> Ship:
    """Return the frigate as in the environment's storm task, with some of its parameters changed."""
    return load_ship("frigate").with_values(dict(get_task("storm").ship) | values)


@compiled
def _interval(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    rack: float,
    pitch: float,
    resistance_factor: float,
    truth: Record,
    reading: Record,
    dt: float,
) -> None:
    steady = Disturbance(0.0, 0.0, resistance_factor, NO_SIGNALS)
    acting = constant_inputs(rack, pitch, 0.0, steady)
    for _ in range(INTERVAL_STEPS):
        speed = state.shaft_speed
        outputs = step(plant, state, memory, sea, acting, dt)
        power = outputs.brake_torque * plant.gear_ratio * speed
        truth.thrust += outputs.thrust / INTERVAL_STEPS
        truth.thrust_power += outputs.thrust * outputs.advance_velocity / INTERVAL_STEPS
        truth.power += power / INTERVAL_STEPS
        truth.peak_power = max(truth.peak_power, power)
        truth.shaft_speed += speed / INTERVAL_STEPS
        truth.peak_speed = max(truth.peak_speed, speed)
    outputs = observe(plant, state, memory, sea, pitch, 0.0, steady, dt)
    truth.ship_speed = state.ship_speed
    truth.ventilation = state.ventilation
    truth.propeller_torque = outputs.propeller_torque
    truth.rack = rack
    _read(memory, outputs.advance_velocity, reading)


@compiled
def _read(memory: Record, advance_velocity: float, reading: Record) -> None:
    reading.shaft_speed = memory.shaft_speed
    reading.measured_shaft_torque = memory.shaft_torque
    reading.measured_pitch_ratio = memory.pitch_ratio
    reading.fuel_rack = memory.rack
    reading.measured_ship_speed = memory.speed_log
    reading.estimated_advance_velocity = advance_velocity
    reading.estimate_valid = 1.0


def simulate_storm(
    ship: Ship,
    controller: AntiSpin,
    *,
    order_m_s: float = ORDER_M_S,
    start_m_s: float | None = None,
    sea: str = "calm",
    seeds: range = range(1),
    duration_s: float = 300.0,
    resistance_factor: float = 1.0,
) -> Storm:
    """Simulate one ship for each seed, all under one controller, without the first 30 s.

    Args:
        ship: a ship with a diesel.
        controller: of all ships.
        order_m_s: set-point of the ship speed [m/s].
        start_m_s: initial ship speed [m/s]; the set-point by default.
        sea: name of a preset, head seas.
        seeds: of the sea, one for each ship.
        duration_s: including the first 30 s [s].
        resistance_factor: over calm water's [-].
    """
    n, dt, plant, spectrum = len(seeds), ship.time_step_s, ship.record(), get_sea(sea)
    seas, states, memories = np.zeros(n, SEA), np.zeros(n, STATE), np.zeros(n, MEMORY)
    row = controller.curve.set_points(np.array([order_m_s]))
    start = equilibrium(ship, 20.0, float(row.pitch_ratio[0]))
    speeds = {"shaft_speed": float(row.shaft_speed[0]), "ship_speed": start_m_s or order_m_s}
    readings = np.zeros(n, READING)
    for i, seed in enumerate(seeds):
        if spectrum is not None:
            seas[i] = realise(spectrum, float(plant["depth"]), seed)
        states[i] = tuple(float(value) for value in start.state._replace(**speeds))
        begin = Disturbance(0.0, 0.0, resistance_factor)
        prepare(plant, states[i], memories[i], seas[i], float(start.inputs.drive), begin, dt)
        _read(memories[i], 0.0, readings[i])
    readings["speed_order"] = order_m_s
    intervals = round(duration_s / (INTERVAL_STEPS * dt))
    truths, detected = np.zeros((intervals, n), STORM), np.zeros((intervals, n), bool)
    torque, ratio = np.zeros((2, intervals, n))
    memory: Any = None
    for k in range(intervals):
        seen = readings.view(np.float64).reshape(n, -1)
        action, memory = controller.predict(seen, memory)
        detected[k] = memory["detection"]["ventilating"] != 0
        ratio[k] = memory["detection"]["torque_ratio"]
        torque[k] = [estimated_propeller_torque(plant, one) for one in memory["estimate"]]
        for i, (turned, moved) in enumerate(action.tolist()):
            pitch = decode(turned, plant["pitch_ratio_min"], plant["pitch_ratio_max"])
            fuel = decode(moved, plant["drive_min"], plant["drive_max"])
            _interval(
                plant,
                states[i],
                memories[i],
                seas[i],
                fuel,
                pitch,
                resistance_factor,
                truths[k, i],
                readings[i],
                dt,
            )
    columns = [truths[name] for name in STORM.names or ()]
    kept = slice(round(30.0 / (INTERVAL_STEPS * dt)), None)
    return Storm(*(values[kept].T for values in (*columns, detected, torque, ratio)))


def truth_and_detection(storm: Storm) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return whether the propeller was more than half ventilated, and whether this was detected."""
    return storm.ventilation[:, :-1] > 0.5, storm.detected[:, 1:]


def event_counts(truth: NDArray[np.bool_], detected: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return right detections, detections, detected events and events of each ship, shape (n, 4).

    Events are runs of samples; a right detection overlaps one or comes up to two samples late.
    """
    rows = []
    for happened, called in zip(truth, detected, strict=True):
        real, found = true_runs(happened), true_runs(called)
        hits = [a < end + 2 and b > start for start, end in real for a, b in found]
        table = np.array(hits, dtype=bool).reshape(len(real), len(found))
        rows.append((table.any(axis=0).sum(), len(found), table.any(axis=1).sum(), len(real)))
    return np.array(rows, dtype=np.float64)


def sample_scores(
    truth: NDArray[np.bool_], detected: NDArray[np.bool_], late: int = 0
) -> tuple[float, float]:
    """Return precision and recall by samples, with the truth shifted ``late`` samples later."""
    happened = truth[:, : truth.shape[1] - late]
    called = detected[:, late:]
    both = float(np.sum(happened & called))
    return both / max(float(called.sum()), 1.0), both / max(float(happened.sum()), 1.0)


def key_numbers(storm: Storm) -> dict[str, NDArray[np.float64]]:
    """Return the quantities of the paper's Table 1 and Figure 6, one value for each seed."""
    power = storm.power.mean(axis=1)
    return {
        "mean thrust [kN]": storm.thrust.mean(axis=1) / 1e3,
        "mean power [kW]": power / 1e3,
        "highest power [kW]": storm.peak_power.max(axis=1) / 1e3,
        "energy efficiency (27) [-]": storm.thrust_power.mean(axis=1) / power,
        "thrust per power [N/kW]": storm.thrust.mean(axis=1) / power * 1e3,
        "mean shaft speed [rad/s]": storm.shaft_speed.mean(axis=1),
        "highest shaft speed [rad/s]": storm.peak_speed.max(axis=1),
        "ship speed [m/s]": storm.ship_speed.mean(axis=1),
    }
