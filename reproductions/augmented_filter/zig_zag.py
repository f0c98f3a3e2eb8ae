"""Estimate four steering coefficients of a ship from a zig-zag with an augmented Kalman filter.

Taylor (2000, Tables 2.3 and 4.1) has four non-dimensional coefficients of sway and yaw, all positive:

    Y = -(-Y_v) v - (m - Y_r) r,   N = -(-N_v) v - (m x_G - N_r) r

by forces rho L^2 U^2 / 2, lengths L and speeds U. His Y_r contains the added mass of surge, and eq. 4.1
prints the other sign of the first term. Here they are keys of a ship file, the plant is the model, and
the filter is :class:`shaftline.observers.ShipFilter`. Noises are non-dimensional: speeds by U, the rate
of turn by U / L, the shaft speed by that of the approach, and densities per ship length.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.observers import ShipFilter
from shaftline.plant import Equilibrium, Ship, approach, turning_circle, zig_zag
from shaftline.plant.columns import (
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_SPEED,
    SWAY_SPEED,
    YAW_RATE,
    drive_column,
)
from shaftline.plant.manoeuvring import hull_area
from shaftline.plant.replay import Replay

Floats = NDArray[np.float64]

KEYS = ("manoeuvring.Y_v", "manoeuvring.Y_r", "manoeuvring.N_v", "manoeuvring.N_r")
COEFFICIENTS = ("-Yv", "m-Yr", "-Nv", "m xg-Nr")

TEN = math.radians(10.0)
"""Rudder and heading of the zig-zag, and rudder of the turn."""

STEP_S = 0.5
"""Time step of plant and filter."""

STATE_SPMEASURED = 1e-3
"""Standard deviation of each state at the start [-]: the straight course is known."""

MEASURED = {
    "ship_speed_m_s": "ship_speed",
    SWAY_SPEED: "sway_speed",
    YAW_RATE: "yaw_rate",
    SHAFT_SPEED: "shaft_speed",
}
"""Measured columns, and the states that they measure."""


def _offsets(ship: Ship) -> Floats:
    """Return the coefficients of a hull whose derivatives are all 0: (0, m + m_x, 0, m x_G)."""
    record, own = ship.record(), ship.manoeuvring
    scale = 0.5 * ship.water.density_kg_m3 * float(hull_area(record)) * own.length_m
    moment = own.displacement_kg * own.centre_of_gravity_m / own.length_m
    return np.array([0.0, ship.hull.mass_kg, 0.0, moment]) / scale


def coefficients(ship: Ship) -> Floats:
    """Return the four coefficients of a ship, shape (4,)."""
    return _offsets(ship) - [ship.parameter(key).value for key in KEYS]


def with_coefficients(ship: Ship, theta: Floats) -> Ship:
    """Return the ship with these four coefficients."""
    values = _offsets(ship) - theta
    return ship.with_values(dict(zip(KEYS, map(float, values), strict=True)))


class Truth(NamedTuple):
    """A simulated zig-zag."""

    ship: Ship
    point: Equilibrium  # of the straight course
    units: dict[str, float]  # of each state [SI]
    length_s: float  # time for one ship length [s]
    track: pd.DataFrame
    """By time step: ship_speed, sway_speed, yaw_rate, shaft_speed, heading, rudder."""


def simulate_zig_zag(ship: Ship, speed_m_s: float, seconds: float, executes: int) -> Truth:
    """Simulate the 10/10 zig-zag from a straight course.

    Args:
        ship: ship with manoeuvring data.
        speed_m_s: speed of the approach [m/s].
        seconds: duration that is returned [s].
        executes: number of rudder executes, enough for this duration.

    Raises:
        ValueError: the executes take less time than asked for.
    """
    own = ship.with_values({"integration.time_step_s": STEP_S})
    point = approach(own, speed_m_s)
    whole = zig_zag(own, point, TEN, TEN, executes=executes).track
    if whole["time_s"].iloc[-1] < seconds:
        raise ValueError(
            f"{executes} executes take {whole['time_s'].iloc[-1]:g} s, less than {seconds:g} s"
        )
    whole = whole[whole["time_s"] < seconds + 0.5 * STEP_S]
    track = pd.DataFrame(
        {
            "time_s": whole["time_s"],
            "ship_speed": whole["speed_m_s"] * np.cos(whole["drift_rad"]),
            "sway_speed": -whole["speed_m_s"] * np.sin(whole["drift_rad"]),
            "yaw_rate": whole["yaw_rate_rad_s"],
            "shaft_speed": whole["shaft_speed_rad_s"],
            "heading": whole["heading_rad"],
            "rudder": whole["rudder_rad"],
        }
    )
    length = ship.manoeuvring.length_m
    shaft = float(point.state.shaft_speed)
    units = dict.fromkeys(("ship_speed", "sway_speed"), speed_m_s)
    units |= {"yaw_rate": speed_m_s / length, "shaft_speed": shaft}
    units |= {"heading": 1.0, "rudder_angle": 1.0}
    return Truth(own, point, units, length / speed_m_s, track)


def make_recording(truth: Truth, noise: float, seed: int, every: int = 1) -> pd.DataFrame:
    """Return a recording with measurement noise; its first row is the exact straight course.

    The shaft speed is held constant, so its command is recorded without noise.

    Args:
        truth: the simulated zig-zag.
        noise: rms of the noise of each measurement [-].
        seed: of the noise.
        every: time steps between two measurements.
    """
    track, ship = truth.track, truth.ship
    rng = np.random.default_rng(seed)
    errors = noise * rng.standard_normal((len(track), len(MEASURED)))
    errors[0] = 0.0
    columns: dict[str, Any] = {"time_s": track["time_s"]}
    for k, (column, state) in enumerate(MEASURED.items()):
        read = (track[state] + truth.units[state] * errors[:, k]).to_numpy(copy=True)
        read[np.arange(len(read)) % every > 0] = np.nan
        columns[column] = read
    columns[drive_column(ship)] = truth.point.inputs.drive
    helm = RUDDER if ship.rudder.time_constant_s > 0.0 else RUDDER_COMMAND
    return pd.DataFrame(columns | {helm: track["rudder"]})


class Tuning(NamedTuple):
    """Noise that the filter assumes, non-dimensional (Table 4.1)."""

    variance: float  # R, of every measurement
    states: float = 0.0  # Q, density of the noise that drives the states, per ship length
    numbers: float = 0.0  # FQ, the "fake noise": density of the noise that drives the coefficients


class FilterRun(NamedTuple):
    """Estimates of the filter along a recording of n rows."""

    ratios: Floats  # estimated over true coefficients, shape (n, 4)
    errors: Floats  # standard deviations of the ratios by the filter, shape (n, 4)
    states: pd.DataFrame  # estimates by name, in SI units


def run_filter(truth: Truth, model: Ship, table: pd.DataFrame, tuning: Tuning) -> FilterRun:
    """Estimate the four coefficients along a zig-zag, starting at half of the truth.

    The initial standard deviation of a coefficient is its true value.

    Args:
        truth: the simulated zig-zag.
        model: ship of the filter, apart from the four coefficients.
        table: from :func:`make_recording`.
        tuning: of the filter.
    """
    theta, units = coefficients(truth.ship), truth.units
    start = with_coefficients(model, 0.5 * theta)
    start = start.with_values({"integration.time_step_s": STEP_S})
    read = {c: s for c, s in MEASURED.items() if c != drive_column(start)}
    drift, wander = (math.sqrt(q / truth.length_s) for q in tuning[1:])
    own = ShipFilter(
        start, KEYS,
        parameter_spread=dict(zip(KEYS, theta, strict=True)),
        noise={c: math.sqrt(tuning.variance) * units[s] for c, s in read.items()},
        state_spread={name: STATE_SPMEASURED * unit for name, unit in units.items()},
        state_walk={state: drift * units[state] for state in read.values()},
        parameter_walk=dict.fromkeys(KEYS, wander),
    )  # fmt: skip
    found = own.follow(Replay(start, table))
    at = len(own.states) + 1
    return FilterRun(
        (_offsets(start) - found.estimates[:, at:]) / theta,
        found.standard_errors[:, at:] / theta,
        pd.DataFrame(found.estimates[:, : at - 1], columns=list(own.states)),
    )


class Turn(NamedTuple):
    """A steady turn with 10 degrees of rudder."""

    diameter: float  # in ship lengths
    speed_ratio: float  # over the speed of the approach
    shaft_speed_ratio: float  # over the shaft speed of the approach
    track: pd.DataFrame  # from :func:`shaftline.plant.turning_circle`


def steady_turn(ship: Ship, speed_m_s: float) -> Turn:
    """Return the steady turn of a ship after an approach at a speed [m/s].

    Raises:
        ShipError: the ship does not turn steadily.
    """
    own = turning_circle(ship, approach(ship, speed_m_s), TEN)
    return Turn(own.steady_diameter, own.speed_ratio, own.shaft_speed_ratio, own.track)
