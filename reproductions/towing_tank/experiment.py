"""Simulate the rig under the thrust controller, in calm water and with motion near the surface.

Pivano et al. 2008, section 5. The paper prints neither the programme of thrust, carriage and motion nor
the ventilation of its propeller; the assumptions are :class:`Programme` and :class:`Air`.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftline.baselines.thrust_control import ThrustControl, command_torque
from shaftline.baselines.ventilation import estimated_propeller_torque
from shaftline.core.compiled import Record, compiled
from shaftline.plant import Ship, State
from shaftline.plant.expressions import NO_SIGNALS
from shaftline.plant.memory import MEMORY
from shaftline.plant.signals import SAMPLE
from shaftline.plant.simulation import write_sample
from shaftline.plant.state import STATE, get_state
from shaftline.plant.stepping import Disturbance, StepInputs, prepare, step
from shaftline.plant.waves import calm_sea

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Programme:
    """Programme of a test: thrust and carriage ahead, then astern, the propeller moved up and down."""

    thrust_N: float = 134.3  # T_pd, either way; calibrated
    carriage_m_s: float = 0.5849  # either way; calibrated
    half_s: float = 30.0  # ahead, and the same astern
    thrust_ramp_s: float = 2.0
    carriage_ramp_s: float = 4.0  # longer: the shaft turns against the inflow meanwhile
    mean_submergence: float = 1.25  # h/R [-]
    motion: float = 1.25  # amplitude of h/R [-]; 0 in calm water
    motion_period_s: float = 6.0
    phase: float = 0.0  # of the motion at first [rad]

    @property
    def duration_s(self) -> float:
        """Return the duration of both halves [s]."""
        return 2.0 * self.half_s

    def thrust(self, times: Floats) -> Any:
        """Return T_pd [N]: from rest, reversed at half time."""
        return self.thrust_N * self._turned(times, self.thrust_ramp_s)

    def carriage(self, times: Floats) -> Any:
        """Return the speed of the carriage [m/s]; it starts with the thrust, and takes longer."""
        return self.carriage_m_s * self._turned(times, self.carriage_ramp_s)

    def submergence(self, times: Floats) -> Any:
        """Return h/R of the propeller's centre [-]."""
        swing = np.sin(2.0 * np.pi * times / self.motion_period_s + self.phase)
        return self.mean_submergence + self.motion * swing

    def _turned(self, times: Floats, ramp: float) -> Any:
        corners = [0.0, 0.5 * ramp, self.half_s, self.half_s + ramp]
        return np.interp(times, corners, [0.0, 1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Air:
    """Ventilation of the propeller; see :mod:`shaftline.plant.ventilation`.

    The losses are those of the theory. Onset, gain and hysteresis are the plant's defaults, assumed; the
    times are its defaults for a propeller of 4.2 m, scaled by Froude with the square root of the size.
    """

    thrust_loss: float = 0.75
    torque_loss: float = 0.68
    surface_loss: float = 1.0
    onset_submergence: float = 0.0
    suction_gain: float = 0.5
    hysteresis: float = 0.3  # h/R between onset and recovery
    growth_s: float = 0.12
    washout_s: float = 0.37

    def ship(self, rig: Ship) -> Ship:
        """Return the rig with this ventilation."""
        values = asdict(self).items()
        return rig.with_values({f"ventilation.{re.sub('_s$', '_time_s', k)}": v for k, v in values})


@dataclass(frozen=True)
class Instruments:
    """Errors of the instruments, or perfect detection."""

    shaft_speed: float = 0.0  # white noise, standard deviation [rad/s]
    torque_gain: float = 1.0  # torque of the motor over its command
    seed: int = 1
    tell_air: bool = False  # nu is the truth, for a bound


class TankRun(NamedTuple):
    """The samples of a test at every time step."""

    samples: NDArray[Any]  # SAMPLE, shape (n,)
    thrust_order: Floats  # T_pd [N]
    reference: Floats  # omega_d [rad/s]
    torque_estimate: Floats  # Q_p-hat [N m]
    torque_ratio: Floats  # beta_Q-hat [-]
    detected: NDArray[np.bool_]  # nu
    motor_power: Floats  # [W]

    @property
    def times(self) -> Floats:
        """Return the times [s]."""
        return np.asarray(self.samples["time"])


_SEEN = np.dtype([(n, float) for n in ("reference", "torque_estimate", "torque_ratio", "detected")])


@compiled
def _at(carriage: Floats, elevation: Floats, half_step: int) -> Disturbance:
    return Disturbance(carriage[half_step], elevation[half_step], 1.0, NO_SIGNALS)


@compiled
def _run(plant: Record, controller: Record, state: Record, memory: Record, held: Record, sea: Record,
         thrust: Floats, carriage: Floats, elevation: Floats, speed_noise: Floats, torque_gain: float,
         tell_air: bool, dt: float, samples: Any, seen: Any) -> None:  # fmt: skip
    pitch = controller.pitch_ratio
    prepare(plant, state, memory, sea, 0.0, _at(carriage, elevation, 0), dt)
    for k in range(len(samples)):
        measured = state.shaft_speed + speed_noise[k]
        if tell_air:
            held.detection.ventilating = 1 if state.ventilation > 0.5 else 0
        torque = command_torque(controller, held, thrust[k], measured, carriage[2 * k])
        now, log = get_state(state), memory.speed_log
        drive = torque_gain * torque
        begin, middle = _at(carriage, elevation, 2 * k), _at(carriage, elevation, 2 * k + 1)
        end = _at(carriage, elevation, 2 * k + 2)
        acting = StepInputs(drive, pitch, 0.0, begin, middle, end)
        outputs = step(plant, state, memory, sea, acting, dt)
        write_sample(plant, samples[k], k * dt, acting, now, memory, log, outputs)
        seen[k].reference = held.reference
        seen[k].torque_estimate = estimated_propeller_torque(plant, held.estimate)
        seen[k].torque_ratio = held.detection.torque_ratio
        seen[k].detected = held.detection.ventilating


def simulate_test(
    ship: Ship,
    controller: ThrustControl,
    programme: Programme,
    instruments: Instruments | None = None,
) -> TankRun:
    """Simulate one test from rest, with the controller called at every time step.

    Raises:
        ValueError: the controller's interval is not the ship's time step.
    """
    dt = ship.time_step_s
    if controller.interval_s != dt:
        raise ValueError(f"the controller's interval must be the time step, {dt:g} s")
    instruments = Instruments() if instruments is None else instruments
    if instruments.tell_air:  # a detector that never switches by itself
        controller = ThrustControl(ship, on_below=1e-9, off_above=1e-8, hold_s=1e9)
    steps = round(programme.duration_s / dt)
    times = np.arange(steps, dtype=np.float64) * dt
    halves = np.arange(2 * steps + 1, dtype=np.float64) * (0.5 * dt)
    plant, thrust = ship.record(), programme.thrust(times)
    elevation = 0.5 * ship.propeller.diameter_m * programme.submergence(halves) - float(
        plant["depth"]
    )
    state, memory, held = np.zeros(1, STATE), np.zeros(1, MEMORY), controller.initial_state()
    state[0] = tuple(State(ship.propeller.pitch_ratio_max, 0.0, 0.0))
    noise = instruments.shaft_speed * np.random.default_rng(instruments.seed).standard_normal(steps)
    samples, seen = np.zeros(steps, SAMPLE), np.zeros(steps, _SEEN)
    _run(plant, controller.settings, state[0], memory[0], held[0], calm_sea(), thrust,
         programme.carriage(halves), elevation, noise, instruments.torque_gain, instruments.tell_air,
         dt, samples, seen)  # fmt: skip
    power = samples["brake_torque"] * (samples["shaft_speed"] * ship.transmission.gear_ratio)
    reference, torque, ratio = (seen[n] for n in ("reference", "torque_estimate", "torque_ratio"))
    return TankRun(samples, thrust, reference, torque, ratio, seen["detected"] != 0.0, power)
