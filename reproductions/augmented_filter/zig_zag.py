"""A ship in a zig-zag, her noisy readings, and the steering coefficients that a filter tells of them.

Taylor (2000, Tables 2.3 and 4.1) seeks four numbers of sway and yaw without dimension, all positive:

    Y = -(-Y_v) v - (m - Y_r) r,   N = -(-N_v) v - (m x_G - N_r) r

by forces rho L^2 U^2 / 2, lengths L and speeds U, with the surge's added mass in his Y_r (eq. 4.1 prints
the other sign of the first term). Here they are the keys of a ship's file, the plant is the model, and
the filter is that of any ship (:class:`shaftline.observers.ShipFilter`). Noises are given without
dimension too: of speeds by U, of the rate of turn by U / L, of revolutions by those of the approach; and
densities by ship length sailed.
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
"""Of the plant in truth and filter; the helmsman acts at its ends."""

STATE_SPREAD = 1e-3
"""Standard deviation of each state at the start: the straight course is known."""

READ = {
    "ship_speed_m_s": "ship_speed",
    SWAY_SPEED: "sway_speed",
    YAW_RATE: "yaw_rate",
    SHAFT_SPEED: "shaft_speed",
}
"""What is measured, and the state that it reads."""


def _offsets(ship: Ship) -> Floats:
    """The coefficients of a hull whose derivatives are all 0: (0, m + m_x, 0, m x_G)."""
    record, own = ship.record(), ship.manoeuvring
    scale = 0.5 * ship.water.density_kg_m3 * float(hull_area(record)) * own.length_m
    moment = own.displacement_kg * own.centre_of_gravity_m / own.length_m
    return np.array([0.0, ship.hull.mass_kg, 0.0, moment]) / scale


def coefficients(ship: Ship) -> Floats:
    """The thesis's four numbers of a ship, shape (4,)."""
    return _offsets(ship) - [ship.number(key).value for key in KEYS]


def with_coefficients(ship: Ship, theta: Floats) -> Ship:
    """The ship with these four numbers."""
    values = _offsets(ship) - theta
    return ship.with_values(dict(zip(KEYS, map(float, values), strict=True)))


class Truth(NamedTuple):
    """A ship that has sailed a zig-zag."""

    ship: Ship
    point: Equilibrium  # her straight course
    units: dict[str, float]  # of each state, in its SI unit
    length_s: float  # time in which she sails her length [s]
    track: (
        pd.DataFrame
    )  # by time step: ship_speed, sway_speed, yaw_rate, shaft_speed, heading, rudder


def sailed(ship: Ship, speed_m_s: float, seconds: float, executes: int) -> Truth:
    """The 10/10 zig-zag from a straight course.

    Args:
        ship: that turns.
        speed_m_s: of the approach [m/s].
        seconds: of it that are kept.
        executes: of the rudder, enough for as long.
    """
    own = ship.with_values({"integration.time_step_s": STEP_S})
    point = approach(own, speed_m_s)
    whole = zig_zag(own, point, TEN, TEN, executes=executes).track
    if whole["time_s"].iloc[-1] < seconds:
        raise ValueError(
            f"{executes} executes take {whole['time_s'].iloc[-1]:g} s, not {seconds:g}"
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


def recorded(truth: Truth, noise: float, seed: int, every: int = 1) -> pd.DataFrame:
    """What the instruments make of it; the first row, the straight course, is known.

    Revolutions that are held are told as they are ordered: what an instrument reads of them says
    nothing of the ship.

    Args:
        truth: the voyage.
        noise: rms of each reading, without dimension.
        seed: of the noise.
        every: time steps from one reading to the next.
    """
    track, ship = truth.track, truth.ship
    rng = np.random.default_rng(seed)
    errors = noise * rng.standard_normal((len(track), len(READ)))
    errors[0] = 0.0
    columns: dict[str, Any] = {"time_s": track["time_s"]}
    for k, (column, state) in enumerate(READ.items()):
        read = (track[state] + truth.units[state] * errors[:, k]).to_numpy(copy=True)
        read[np.arange(len(read)) % every > 0] = np.nan
        columns[column] = read
    columns[drive_column(ship)] = truth.point.inputs.drive
    helm = RUDDER if ship.rudder.time_constant_s > 0.0 else RUDDER_COMMAND
    return pd.DataFrame(columns | {helm: track["rudder"]})


class Tuning(NamedTuple):
    """What the filter believes, without dimension (Table 4.1)."""

    variance: float  # R, of every reading
    states: float = 0.0  # Q, density of the noise that drives the states, per ship length
    numbers: float = 0.0  # FQ, the "fake noise": of that which drives the coefficients, likewise


class Identified(NamedTuple):
    """What the filter makes of a recording of n rows."""

    ratios: Floats  # coefficients over the truth after each row, shape (n, 4)
    errors: Floats  # their standard deviations as the filter has them, over the truth, likewise
    states: pd.DataFrame  # estimates by name, in SI units


def identified(truth: Truth, model: Ship, table: pd.DataFrame, tuning: Tuning) -> Identified:
    """The four coefficients along a zig-zag, from half the truth, as unsure as they are large.

    Args:
        truth: the voyage.
        model: ship that the filter believes in but for the four coefficients.
        table: of :func:`recorded`.
        tuning: of the filter.
    """
    theta, units = coefficients(truth.ship), truth.units
    begins = with_coefficients(model, 0.5 * theta)
    begins = begins.with_values({"integration.time_step_s": STEP_S})
    read = {c: s for c, s in READ.items() if c != drive_column(begins)}
    drift, wander = (math.sqrt(q / truth.length_s) for q in tuning[1:])
    own = ShipFilter(
        begins, KEYS,
        number_spread=dict(zip(KEYS, theta, strict=True)),
        noise={c: math.sqrt(tuning.variance) * units[s] for c, s in read.items()},
        state_spread={name: STATE_SPREAD * unit for name, unit in units.items()},
        state_walk={state: drift * units[state] for state in read.values()},
        number_walk=dict.fromkeys(KEYS, wander),
    )  # fmt: skip
    found = own.follow(Replay(begins, table))
    at = len(own.states) + 1
    return Identified(
        (_offsets(begins) - found.estimates[:, at:]) / theta,
        found.standard_errors[:, at:] / theta,
        pd.DataFrame(found.estimates[:, : at - 1], columns=list(own.states)),
    )


class Turn(NamedTuple):
    """A steady turn with 10 degrees of rudder."""

    diameter: float  # in lengths
    speed_ratio: float  # over that of the approach
    shaft_speed_ratio: float  # likewise
    track: pd.DataFrame  # of :func:`shaftline.plant.turning_circle`


def steady_turn(ship: Ship, speed_m_s: float) -> Turn:
    """The turn of a ship from an approach [m/s].

    Raises:
        ShipError: a ship that does not turn so.
    """
    own = turning_circle(ship, approach(ship, speed_m_s), TEN)
    return Turn(own.steady_diameter, own.speed_ratio, own.shaft_speed_ratio, own.track)
