"""Model-predictive control of pitch and fuel rack: holds shaft and engine torque in waves.

Every control interval h a quadratic programme chooses the pitch p and the fuel rack X of the next N
intervals. It minimises the sum over the intervals of

    q_M ((M - M*) / M_max)^2          shaft torque about its 20 s mean
    q_E ((M_b - M_b*) / M_b,max)^2    engine torque about its 20 s mean
    q_p ((p - p_0) / range of p)^2  + r_p (change of p / range of p)^2
    q_X ((X - X_0) / X_max)^2       + r_X (change of X / X_max)^2

with the model

    I w' = eta i M_b(i w, X) - M_p(v, w, p) + d          ship speed constant over the horizon
    M    = eta i M_b - I_L w'                            shaft torque between I_L and I_R

and the constraints

    |p[k+1] - p[k]| <= h times the rate limit of the pitch
    p[k+1] - exp(-h / tau_p) p[k]  within  (1 - exp(-h / tau_p)) times the range of p
    p within its range, X within the rack limits of the speed pilot at the shaft speed ahead

p_0 and X_0 are the commands of the speed pilot without its response to waves, so the ship speed is held
slowly. The means are taken of the torques that the model gives at p_0 and X_0. The model is linearised
about the plan of the previous interval, one Gauss-Newton step per interval (real-time iteration, Diehl
et al. 2005). The torque d is estimated from the error of the last predicted shaft speed; it removes a
steady error of the model.

The advance velocity ahead is u + e: u is the ship speed less the wake, e the inflow of the waves. With
a preview e is the inflow that the sensor at the bow measures. Without one the present e = v - u and its
slope e' are continued as a decaying oscillation,

    e(t) = exp(-t / T_e) (e cos(f t) + e' / f sin(f t)),     f^2 = mean of e'^2 / mean of e^2

with the means over 60 s. Without a valid estimate e = 0.
"""

from __future__ import annotations

import functools
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..observers.torque_curve import highest_velocity, model_torque
from ..plant.drives.diesel import rack_torque
from ..plant.hull import wake_inflow
from ..plant.propeller import FOUR_QUADRANT
from ..plant.shaft import drive_torque, load_torque, shaft_inertia
from ..plant.ship import Ship
from .controller import OBSERVED, PREVIEW_S, Commands, Measurements, Ranges, Variants
from .speed_pilot import NO_WAVE_RESPONSE, PILOT_COLUMNS, SpeedPilot

SLOWEST, FASTEST = (
    0.25,
    1.5,
)  # shaft speeds of the model over the lowest and highest of the ship [-]
_STEP = 1e-4  # of the finite differences, in rad/s, P/D and mm
_SOLVER = "daqp"  # qrqp fails where the pitch is at two limits at once


@compiled
def torques(
    plant: Record, velocity: float, shaft_speed: float, pitch: float, rack: float
) -> tuple[float, float, float]:
    """Return the torques that drive and load the shaft and the brake torque of the engine [N m].

    They hold at an advance velocity [m/s], a shaft speed [rad/s], a P/D [-] and a fuel rack [mm].
    """
    brake = float(rack_torque(plant, plant.gear_ratio * shaft_speed, rack))
    load = float(load_torque(plant, model_torque(plant, velocity, shaft_speed, pitch), shaft_speed))
    return float(drive_torque(plant, brake, shaft_speed)), load, brake


class Prediction(NamedTuple):
    """Shaft speed and mean torques along a plan of N intervals, with their derivatives by the plan.

    The derivatives belong to the pitches at the ends of the intervals and then to the racks.
    """

    speeds: Floats  # shaft speed now and at the end of each interval [rad/s], shape (N + 1,)
    shaft: Floats  # mean shaft torque of each interval [N m], shape (N,)
    engine: Floats  # mean brake torque of each interval [N m], shape (N,)
    slopes: Floats  # derivatives of the shaft torques, then of the brake torques, shape (2 N, 2 N)


@compiled
def predict_shaft(
    plant: Record,
    interval_s: float,
    disturbance: float,
    velocity: Floats,
    pitch: Floats,
    rack: Floats,
    shaft_speed: float,
) -> Prediction:
    """Predict shaft speed and torques along a plan.

    Args:
        plant: ship record.
        interval_s: length of an interval [s].
        disturbance: torque on the shaft that is not in the model [N m].
        velocity: advance velocity in the middle of each interval [m/s], shape (N,).
        pitch: P/D now and at the end of each interval [-], shape (N + 1,).
        rack: fuel rack in each interval [mm], shape (N,).
        shaft_speed: present shaft speed [rad/s].
    """
    n = len(rack)
    inertia = float(shaft_inertia(plant))
    behind = plant.inertia_engine_side / inertia
    slowest = SLOWEST * plant.engine_speed_min / plant.gear_ratio
    fastest = FASTEST * plant.engine_speed_max / plant.gear_ratio
    speeds, shaft, engine = np.full(n + 1, shaft_speed), np.empty(n), np.empty(n)
    slopes, before = np.empty((2 * n, 2 * n)), np.zeros(2 * n)
    for k in range(n):
        w, x = speeds[k], rack[k]
        v = velocity[k]
        if plant.propeller_model != FOUR_QUADRANT:
            v = min(v, highest_velocity(plant, w))
        p = 0.5 * (pitch[k] + pitch[k + 1])
        drive, load, brake = torques(plant, v, w, p, x)
        faster, slower = torques(plant, v, w + _STEP, p, x), torques(plant, v, w - _STEP, p, x)
        coarser, finer = torques(plant, v, w, p + _STEP, x), torques(plant, v, w, p - _STEP, x)
        richer = torques(plant, v, w, p, x + _STEP)
        drive_by_speed = (faster[0] - slower[0]) / (2.0 * _STEP)
        load_by_speed = (faster[1] - slower[1]) / (2.0 * _STEP)
        brake_by_speed = (faster[2] - slower[2]) / (2.0 * _STEP)
        load_by_pitch = (coarser[1] - finer[1]) / (2.0 * _STEP)
        drive_by_rack = (richer[0] - drive) / _STEP
        brake_by_rack = (richer[2] - brake) / _STEP

        decay = min((drive_by_speed - load_by_speed) / inertia, -1e-6)
        growth = math.exp(decay * interval_s)
        reach = (growth - 1.0) / decay
        acceleration = (drive - load + disturbance) / inertia
        speeds[k + 1] = min(max(w + reach * acceleration, slowest), fastest)
        after = growth * before
        by_pitch = -0.5 * load_by_pitch
        after[k] += reach * by_pitch / inertia
        if k > 0:
            after[k - 1] += reach * by_pitch / inertia
        after[n + k] += reach * drive_by_rack / inertia

        # Mean torques are those at the mean shaft speed; shaft = (1 - behind) drive + behind load.
        middle = 0.5 * (before + after)
        change = 0.5 * (speeds[k + 1] - w)
        by_speed = (1.0 - behind) * drive_by_speed + behind * load_by_speed
        shaft[k] = drive - behind * inertia * acceleration + by_speed * change
        engine[k] = brake + brake_by_speed * change
        slopes[k] = by_speed * middle
        slopes[k, k] -= behind * by_pitch
        if k > 0:
            slopes[k, k - 1] -= behind * by_pitch
        slopes[k, n + k] += (1.0 - behind) * drive_by_rack
        slopes[n + k] = brake_by_speed * middle
        slopes[n + k, n + k] += brake_by_rack
        before = after
    return Prediction(speeds, shaft, engine, slopes)


def forecast(
    inflow: Floats, slope: Floats, frequency: Floats, memory_s: float, ahead_s: Floats
) -> Floats:
    """Return the inflow of the waves ahead [m/s] as a decaying oscillation, shape (n, m).

    e [m/s], e' [m/s2] and f [rad/s] have the shape (n,), the times ahead [s] (m,); T_e is in s.
    """
    phase = frequency[:, None] * ahead_s
    wave = inflow[:, None] * np.cos(phase) + (slope / frequency)[:, None] * np.sin(phase)
    return np.asarray(wave * np.exp(-ahead_s / memory_s))


@functools.cache
def quadratic_programme(intervals: int, keep: float) -> tuple[Any, Any]:
    """Return the solver of a quadratic programme in 2 N variables, and its constraint matrix.

    Rows 0 to N - 1 are the changes of the pitch, rows N to 2 N - 1 the parts from the pitch command.

    ``keep`` is the share of a pitch error that remains after an interval [-].

    Raises:
        ValueError: casadi is not installed.
    """
    try:
        import casadi
    except ImportError:
        raise ValueError(
            "the controller mpc needs casadi; install it with: pip install 'shaftline[mpc]'"
        ) from None
    one, before = np.eye(intervals), np.eye(intervals, k=-1)
    rows = np.zeros((2 * intervals, 2 * intervals))
    rows[:intervals, :intervals] = one - before
    rows[intervals:, :intervals] = one - keep * before
    matrix = casadi.sparsify(casadi.DM(rows))
    dense = casadi.Sparsity.dense(2 * intervals, 2 * intervals)
    shapes, options = {"h": dense, "a": matrix.sparsity()}, {"error_on_fail": False}
    return casadi.conic("mpc", _SOLVER, shapes, options), matrix


MEAN_S = 20.0  # time constant of the mean torques [s]
SLOPE_S = 0.5  # time constant of the slope of the inflow [s]
SPECTRUM_S = 60.0  # time constant of the mean squares of the inflow and its slope [s]
DISTURBANCE_S = 8.0  # time constant of the estimated disturbance torque [s]
PERIODS_S = (4.0, 20.0)  # shortest and longest wave period that the forecast assumes [s]
MOST_INTERVALS = 60  # highest number of control intervals in the horizon
_LARGEST_DISTURBANCE = 0.3  # share of the highest shaft torque
_LEAST_SQUARE = 1e-6  # of the inflow in m2/s2 and of its slope in m2/s4
_MEASURED = Measurements._fields[: len(OBSERVED)]
_MEASUREMENTS = len(_MEASURED)

(
    INFLOW,
    SLOPE,
    INFLOW_SQUARE,
    SLOPE_SQUARE,
    SHAFT_MEAN,
    ENGINE_MEAN,
    BASE_PITCH,
    BASE_RACK,
    AHEAD,
    DISTURBANCE,
) = range(PILOT_COLUMNS, PILOT_COLUMNS + 10)
"""Columns of the controller state.

e [m/s], e' [m/s2], their mean squares, M* [N m], M_b* [N m], p_0 [-] and X_0 [mm] of the last call, the
shaft speed predicted for this call [rad/s], d [N m]. The last finite measurements and the plan follow.
"""
_HELD = slice(PILOT_COLUMNS + 10, PILOT_COLUMNS + 10 + _MEASUREMENTS)
_PLAN = PILOT_COLUMNS + 10 + _MEASUREMENTS


class ModelPredictive(SpeedPilot):
    """Hold shaft and engine torque in waves by pitch and fuel rack with a model-predictive controller.

    A weight is the cost of a deviation by the whole range of the signal.

    Args:
        ship: ship with a diesel and a controllable pitch, or its name.

        horizon_s: N h, the time that the plan covers [s].
        shaft_weight: q_M [-].
        engine_weight: q_E [-].
        pitch_weight: q_p [-].
        rack_weight: q_X [-].
        pitch_change_weight: r_p [-].
        rack_change_weight: r_X [-].
        wave_memory_s: T_e, time constant with which the forecast of the waves decays [s].
        preview: use the inflow of the waves ahead from a sensor at the bow, in place of the forecast.
        settings: settings of :class:`SpeedPilot`; its gains on torque and shaft speed are 0 by default.

    State: columns of the speed pilot, then :data:`INFLOW` to :data:`DISTURBANCE`, the last finite
    measurements and the plan; shape (n, 22 + 2 N).

    Raises:
        ShipError: the ship has no diesel or cannot move.
        TypeError: a setting is unknown.
        ValueError: the pitch is fixed, an option is out of range, or casadi is not installed.
    """

    name = "mpc"
    source = "shaftline's own"
    variants: ClassVar[Variants] = {"mpc-preview": {"preview": True}}
    base_settings = NO_WAVE_RESPONSE
    needs_variable_pitch = True
    tunable: ClassVar[Ranges] = {
        **SpeedPilot.tunable,
        "shaft_weight": (0.0, 10.0),
        "engine_weight": (0.0, 100.0),
        "pitch_weight": (0.0, 1.0),
        "rack_weight": (0.0, 1.0),
        "pitch_change_weight": (0.0, 10.0),
        "rack_change_weight": (0.0, 10.0),
        "wave_memory_s": (0.5, 10.0),
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        *,
        horizon_s: float = 6.0,
        shaft_weight: float = 1.0,
        engine_weight: float = 10.0,
        pitch_weight: float = 0.05,
        rack_weight: float = 0.01,
        pitch_change_weight: float = 0.01,
        rack_change_weight: float = 0.1,
        wave_memory_s: float = 2.0,
        preview: bool = False,
        **settings: float,
    ) -> None:
        super().__init__(ship, interval_s, **settings)
        weights = {
            "shaft_weight": shaft_weight,
            "engine_weight": engine_weight,
            "pitch_weight": pitch_weight,
            "rack_weight": rack_weight,
            "pitch_change_weight": pitch_change_weight,
            "rack_change_weight": rack_change_weight,
        }
        for key, value in weights.items():
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"mpc: {key} = {value!r}: must be 0 or more")
        if not (math.isfinite(wave_memory_s) and wave_memory_s > 0.0):
            raise ValueError(f"mpc: wave_memory_s = {wave_memory_s!r} s: must be positive")
        if not interval_s <= horizon_s <= MOST_INTERVALS * interval_s:
            raise ValueError(
                f"mpc: horizon_s = {horizon_s!r} s: must be 1 to {MOST_INTERVALS} control intervals "
                f"of {interval_s:g} s"
            )
        self.wave_memory_s, self.preview = wave_memory_s, bool(preview)
        self.intervals = round(horizon_s / interval_s)
        plant = self.plant
        lag, self._rate = self.ship.pitch_actuator.time_constant_s, float(plant["pitch_rate_limit"])
        self._keep = math.exp(-interval_s / lag)
        self._pitches = float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])
        most = float(rack_torque(plant, plant["engine_speed_max"], plant["drive_max"]))
        self._engine_most = min(self.ship.diesel.torque_limit_N_m, most)
        self._shaft_most = self._engine_most * float(plant["gear_ratio"])
        self._inertia = float(shaft_inertia(plant))
        pitches, racks = self._pitches[1] - self._pitches[0], float(plant["drive_max"])
        units = (self._shaft_most, self._engine_most, pitches, racks, pitches, racks)
        self._scale = np.repeat(np.sqrt([*weights.values()]) / units, self.intervals)
        self._units_of_plan = np.repeat([pitches, racks], self.intervals)
        # Derivatives of the residuals of pitch and rack to the plan, shape (4 N, 2 N).
        change = np.eye(self.intervals) - np.eye(self.intervals, k=-1)
        self._fixed = np.vstack([np.eye(2 * self.intervals), np.kron(np.eye(2), change)])
        self._travel()
        quadratic_programme(self.intervals, self._keep)

    def _travel(self) -> None:
        """Tabulate the travel of the pitch in an interval over the error of its command."""
        lag, h = self.ship.pitch_actuator.time_constant_s, self.interval_s
        if math.isinf(self._rate):
            most = 2.0 * (self._pitches[1] - self._pitches[0])
            self._errors = np.array([0.0, most])
            self._travels = (1.0 - self._keep) * self._errors
            return
        limited = np.linspace(0.0, h, 50)  # time for which the rate limit holds
        errors = self._rate * (lag + limited)
        travels = self._rate * (limited + lag * (1.0 - np.exp(-(h - limited) / lag)))
        self._errors, self._travels = np.append(0.0, errors), np.append(0.0, travels)

    def _finite(self, signals: Measurements, held: Floats) -> Measurements:
        """Return the measurements; the last finite ones, ``held``, replace others and are updated."""
        now = np.column_stack([getattr(signals, name) for name in _MEASURED])
        estimate = np.isfinite(now[:, 6])
        held[:] = np.where(np.isfinite(now), now, held)
        held[:, 7] = np.where(estimate & (now[:, 7] > 0.5), 1.0, 0.0)
        low, high = self.ship.shaft_speeds
        held[:, 1] = np.clip(held[:, 1], SLOWEST * low, FASTEST * high)
        held[:, 3] = np.clip(held[:, 3], *self._pitches)
        held[:, 4] = np.clip(held[:, 4], self.plant["drive_min"], self.plant["drive_max"])
        inflow = signals.wave_inflow
        if inflow is not None:
            inflow = np.where(np.isfinite(inflow), inflow, 0.0)
        return Measurements(**dict(zip(_MEASURED, held.T.copy(), strict=True)), wave_inflow=inflow)

    def _usual(self, signals: Measurements) -> Floats:
        """Return measurements of the middle of the combinator's curve, shape (n, 8)."""
        middle = len(self._speeds) // 2
        speed, shaft = float(self._speeds[middle]), float(np.mean(self.ship.shaft_speeds))
        pitch, rack = float(self._pitch[middle]), float(self._rack[middle])
        row = [speed, shaft, 0.0, pitch, rack, speed, speed, 0.0]
        return np.tile(row, (len(signals.speed_order), 1))

    def inflow(self, signals: Measurements) -> Floats:
        """Return the present inflow of the waves e [m/s], shape (n,); 0 without a valid estimate."""
        if signals.wave_inflow is not None:
            return np.array(signals.wave_inflow[:, 0])
        deviation = signals.advance_velocity - wake_inflow(self.plant, signals.ship_speed)
        return np.where(signals.estimate_valid > 0.5, deviation, 0.0)

    def velocities(self, signals: Measurements, memory: Floats) -> Floats:
        """Return the advance velocity in the middle of each interval ahead [m/s], shape (n, N).

        Args:
            signals: finite measurements of n ships.
            memory: controller state, with this inflow already in it.
        """
        ahead_s = self.interval_s * (np.arange(self.intervals, dtype=np.float64) + 0.5)
        if signals.wave_inflow is not None:
            waves = np.array([np.interp(ahead_s, PREVIEW_S, row) for row in signals.wave_inflow])
        else:
            slowest, fastest = (2.0 * math.pi / period for period in reversed(PERIODS_S))
            squares = np.maximum(memory[:, [INFLOW_SQUARE, SLOPE_SQUARE]], _LEAST_SQUARE)
            ratio = squares[:, 1] / squares[:, 0]
            frequency = np.clip(np.sqrt(ratio), slowest, fastest)
            inflow, slope = memory[:, INFLOW], memory[:, SLOPE]
            waves = forecast(inflow, slope, frequency, self.wave_memory_s, ahead_s)
        return np.asarray(wake_inflow(self.plant, signals.ship_speed)[:, None] + waves)

    def initial_state(self, signals: Measurements) -> Floats:
        """Return the state of a controller that takes over a ship in steady motion.

        The plan is the base command, and the disturbance balances the shaft as measured.
        """
        held = self._usual(signals)
        signals = self._finite(signals, held)
        n, base = self.intervals, np.interp(signals.speed_order, self._speeds, self._pitch)
        inflow = self.inflow(signals)
        velocity = wake_inflow(self.plant, signals.ship_speed) + inflow
        memory = np.zeros((len(base), _PLAN + 2 * n))
        memory[:, :PILOT_COLUMNS] = super().initial_state(signals)
        memory[:, INFLOW] = inflow
        memory[:, _HELD] = held
        memory[:, BASE_PITCH], memory[:, BASE_RACK] = base, signals.fuel_rack
        memory[:, AHEAD] = signals.shaft_speed
        memory[:, _PLAN : _PLAN + n] = base[:, None]
        memory[:, _PLAN + n :] = signals.fuel_rack[:, None]
        most = _LARGEST_DISTURBANCE * self._shaft_most
        columns = (velocity, signals.shaft_speed, signals.pitch_ratio, signals.fuel_rack, base)
        for row, v, w, p, x, b in zip(memory, *columns, strict=True):
            drive, load, row[ENGINE_MEAN] = torques(self.plant, v, w, p, x)
            row[DISTURBANCE] = min(max(load - drive, -most), most)
            row[SHAFT_MEAN] = self._shaft(v, w, b, x, row[DISTURBANCE])
        return memory

    def _shaft(self, v: float, w: float, p: float, x: float, disturbance: float) -> float:
        """Return the shaft torque of the model [N m]."""
        drive, load, _ = torques(self.plant, v, w, p, x)
        share = float(self.plant["inertia_engine_side"]) / self._inertia
        return drive - share * (drive - load + disturbance)

    def _remember(self, row: Floats, v: float, w: float, base: tuple[float, float]) -> None:
        """Update disturbance and mean torques of one ship in place; ``base`` is p_0 [-] and X_0 [mm]."""
        h, most = self.interval_s, _LARGEST_DISTURBANCE * self._shaft_most
        missed = (w - row[AHEAD]) * self._inertia / h
        disturbance = row[DISTURBANCE] + (1.0 - math.exp(-h / DISTURBANCE_S)) * missed
        row[DISTURBANCE] = min(max(disturbance, -most), most)
        keep = math.exp(-h / MEAN_S)
        now = self._shaft(v, w, *base, row[DISTURBANCE])
        engine = torques(self.plant, v, w, *base)[2]
        # The means follow a change of the base command, as after a new order, at once.
        old = float(row[BASE_PITCH]), float(row[BASE_RACK])
        row[SHAFT_MEAN] += now - self._shaft(v, w, *old, row[DISTURBANCE])
        row[ENGINE_MEAN] += engine - torques(self.plant, v, w, *old)[2]
        row[SHAFT_MEAN] = keep * row[SHAFT_MEAN] + (1.0 - keep) * now
        row[ENGINE_MEAN] = keep * row[ENGINE_MEAN] + (1.0 - keep) * engine
        row[BASE_PITCH], row[BASE_RACK] = base

    def plan(
        self, row: Floats, velocity: Floats, shaft_speed: float, pitch: float, rack: float
    ) -> Floats | None:
        """Return the N pitches [-] and N racks [mm] of one ship, shape (2 N,); None without a solution.

        Args:
            row: controller state of the ship, shape (22 + 2 N,).
            velocity: advance velocity ahead [m/s], shape (N,).
            shaft_speed: measured [rad/s].
            pitch: measured P/D [-].
            rack: present fuel rack [mm].
        """
        n = self.intervals
        last = row[_PLAN:]  # without its first interval, which has passed
        pitches, racks = np.append(last[1:n], last[n - 1]), np.append(last[n + 1 :], last[-1])
        nominal, path = np.append(pitches, racks), np.append(pitch, pitches)
        h, added = self.interval_s, np.diff(path)
        found = predict_shaft(self.plant, h, row[DISTURBANCE], velocity, path, racks, shaft_speed)
        slopes = np.vstack([found.slopes, self._fixed])
        residuals = np.concatenate(
            [
                found.shaft - row[SHAFT_MEAN],
                found.engine - row[ENGINE_MEAN],
                pitches - row[BASE_PITCH],
                racks - row[BASE_RACK],
                added,
                np.diff(racks, prepend=rack),
            ]
        )
        slopes *= self._scale[:, None]
        slopes *= self._units_of_plan
        hessian = slopes.T @ slopes + 1e-9 * np.eye(2 * n)
        gradient = slopes.T @ (self._scale * residuals)
        least, most = self.limits(found.speeds[:-1])
        if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
            return None
        solve, matrix = quadratic_programme(n, self._keep)
        low, high = self._pitches
        reach = 0.999 * self._rate * h
        reached = pitches - self._keep * path[:-1]
        share, units = 1.0 - self._keep, self._units_of_plan
        best = solve(
            h=hessian,
            g=gradient,
            a=matrix,
            lbx=np.concatenate([low - pitches, least - racks]) / units,
            ubx=np.concatenate([high - pitches, most - racks]) / units,
            lba=np.concatenate([-reach - added, share * low - reached]) / units[0],
            uba=np.concatenate([reach - added, share * high - reached]) / units[0],
        )
        plan = nominal + units * np.asarray(best["x"]).ravel()
        if not solve.stats()["success"] or not np.isfinite(plan).all():
            return None
        return np.asarray(plan)

    def act(self, signals: Measurements, memory: Floats) -> Commands:
        """Return the first commands of the plan, or those of the speed pilot without a solution."""
        signals = self._finite(signals, memory[:, _HELD])
        pitches, racks = super().act(signals, memory[:, :PILOT_COLUMNS])
        inflow = self.inflow(signals)
        fast, slow = (math.exp(-self.interval_s / time) for time in (SLOPE_S, SPECTRUM_S))
        rate = (inflow - memory[:, INFLOW]) / self.interval_s
        memory[:, SLOPE] = fast * memory[:, SLOPE] + (1.0 - fast) * rate
        memory[:, INFLOW] = inflow
        for column, value in ((INFLOW_SQUARE, inflow), (SLOPE_SQUARE, memory[:, SLOPE])):
            memory[:, column] = slow * memory[:, column] + (1.0 - slow) * value**2
        ahead = self.velocities(signals, memory)
        now = wake_inflow(self.plant, signals.ship_speed) + inflow
        for i, row in enumerate(memory):
            w, p = float(signals.shaft_speed[i]), float(signals.pitch_ratio[i])
            self._remember(row, float(now[i]), w, (float(pitches[i]), float(racks[i])))
            plan = self.plan(row, ahead[i], w, p, float(signals.fuel_rack[i]))
            n = self.intervals
            if plan is None:
                row[_PLAN : _PLAN + n], row[_PLAN + n :] = pitches[i], racks[i]
            else:
                row[_PLAN:] = plan
                pitches[i], racks[i] = p + self._error(plan[0] - p), plan[n]
            row[AHEAD] = self._next_speed(row, float(ahead[i, 0]), w, p, float(racks[i]))
        return np.clip(pitches, *self._pitches), racks

    def _error(self, travel: float) -> float:
        """Return the pitch command less the present pitch [-] that gives a travel in an interval [-]."""
        return math.copysign(float(np.interp(abs(travel), self._travels, self._errors)), travel)

    def _next_speed(self, row: Floats, v: float, w: float, p: float, x: float) -> float:
        """Return the shaft speed [rad/s] that the model predicts for the end of the interval."""
        middle = 0.5 * (p + row[_PLAN])
        now = np.array([v]), np.array([p, 2.0 * middle - p]), np.array([x]), w
        return float(predict_shaft(self.plant, self.interval_s, row[DISTURBANCE], *now).speeds[1])
