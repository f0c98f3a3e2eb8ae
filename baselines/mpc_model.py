"""Model, forecast of the waves and quadratic programme of the model-predictive controller."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..observers.torque_curve import highest_velocity, model_torque
from ..plant.drives.diesel import rack_torque
from ..plant.propeller_curves import FOUR_QUADRANT
from ..plant.shaft import drive_torque, load_torque, shaft_inertia

SLOWEST, FASTEST = 0.25, 1.5
"""Shaft speeds of the model over the lowest and the highest of the ship [-]."""

_STEP = 1e-4  # of the finite differences, in rad/s, P/D and mm
_SOLVER = "daqp"  # qrqp fails where the pitch is at two limits at once


@compiled
def torques(
    plant: Record, velocity: float, shaft_speed: float, pitch: float, rack: float
) -> tuple[float, float, float]:
    """Return the torques that drive and load the shaft and the brake torque of the engine, each [N m].

    Args:
        plant: ship record.
        velocity: advance velocity [m/s].
        shaft_speed: [rad/s].
        pitch: P/D [-].
        rack: fuel rack [mm].
    """
    brake = float(rack_torque(plant, plant.gear_ratio * shaft_speed, rack))
    load = model_torque(plant, velocity, shaft_speed, pitch)
    return (
        float(drive_torque(plant, brake, shaft_speed)),
        float(load_torque(plant, load, shaft_speed)),
        brake,
    )


@compiled
def predict_shaft(
    plant: Record,
    interval_s: float,
    disturbance: float,
    velocity: NDArray[np.float64],
    pitch: NDArray[np.float64],
    rack: NDArray[np.float64],
    speeds: NDArray[np.float64],
    shaft: NDArray[np.float64],
    engine: NDArray[np.float64],
    shaft_slopes: NDArray[np.float64],
    engine_slopes: NDArray[np.float64],
) -> None:
    """Predict shaft speed and torques along a plan, with their derivatives to the plan.

    The derivatives belong to the pitches at the ends of the N intervals and then to the N racks.

    Args:
        plant: ship record.
        interval_s: length of an interval [s].
        disturbance: torque on the shaft that the model leaves out [N m].
        velocity: advance velocity in the middle of each interval [m/s], shape (N,).
        pitch: P/D now and at the end of each interval [-], shape (N + 1,).
        rack: fuel rack in each interval [mm], shape (N,).
        speeds: shaft speed now and at the end of each interval [rad/s], shape (N + 1,); the first is
            given, the others are filled.
        shaft: mean shaft torque of each interval [N m], shape (N,), filled.
        engine: mean brake torque of each interval [N m], shape (N,), filled.
        shaft_slopes: derivatives of the shaft torque, shape (N, 2 N), filled.
        engine_slopes: derivatives of the brake torque, shape (N, 2 N), filled.
    """
    n = len(rack)
    inertia = float(shaft_inertia(plant))
    behind = plant.inertia_engine_side / inertia
    slowest = SLOWEST * plant.engine_speed_min / plant.gear_ratio
    fastest = FASTEST * plant.engine_speed_max / plant.gear_ratio
    before = np.zeros(2 * n)
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
        shaft_slopes[k] = by_speed * middle
        shaft_slopes[k, k] -= behind * by_pitch
        if k > 0:
            shaft_slopes[k, k - 1] -= behind * by_pitch
        shaft_slopes[k, n + k] += (1.0 - behind) * drive_by_rack
        engine_slopes[k] = brake_by_speed * middle
        engine_slopes[k, n + k] += brake_by_rack
        before = after


def forecast(
    inflow: NDArray[np.float64],
    slope: NDArray[np.float64],
    frequency: NDArray[np.float64],
    memory_s: float,
    ahead_s: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the inflow of the waves ahead [m/s] as a decaying oscillation, shape (n, m).

    Args:
        inflow: present e [m/s], shape (n,).
        slope: present e' [m/s2], shape (n,).
        frequency: f [rad/s], shape (n,).
        memory_s: T_e [s].
        ahead_s: times ahead [s], shape (m,).
    """
    phase = frequency[:, None] * ahead_s
    wave = inflow[:, None] * np.cos(phase) + (slope / frequency)[:, None] * np.sin(phase)
    return np.asarray(wave * np.exp(-ahead_s / memory_s))


@functools.cache
def quadratic_programme(intervals: int, keep: float) -> tuple[Any, Any]:
    """Return the solver of a quadratic programme in 2 N variables, and its constraint matrix.

    Rows 0 to N - 1 are the changes of the pitch, rows N to 2 N - 1 what the pitch command adds.

    Args:
        intervals: N.
        keep: share of a pitch error that an interval leaves [-].

    Raises:
        ValueError: casadi is not installed.
    """
    try:
        import casadi
    except ImportError:
        raise ValueError("the controller mpc needs casadi: pip install 'shaftline[mpc]'") from None
    one, before = np.eye(intervals), np.eye(intervals, k=-1)
    rows = np.zeros((2 * intervals, 2 * intervals))
    rows[:intervals, :intervals] = one - before
    rows[intervals:, :intervals] = one - keep * before
    matrix = casadi.sparsify(casadi.DM(rows))
    dense = casadi.Sparsity.dense(2 * intervals, 2 * intervals)
    shapes, options = {"h": dense, "a": matrix.sparsity()}, {"error_on_fail": False}
    return casadi.conic("mpc", _SOLVER, shapes, options), matrix
