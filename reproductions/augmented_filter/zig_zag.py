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
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.display.figures import PALETTE, TRUTH
from shaftline.observers import ShipFilter
from shaftline.plant import Equilibrium, Ship, approach, columns, nomoto, turning_circle, zig_zag
from shaftline.plant.manoeuvres import TurningCircle
from shaftline.plant.manoeuvring import hull_area
from shaftline.plant.replay import Replay

from ..writing import Line, Panel

Floats = NDArray[np.float64]

KEYS = ("manoeuvring.Y_v", "manoeuvring.Y_r", "manoeuvring.N_v", "manoeuvring.N_r")
COEFFICIENTS = ("-Yv", "m-Yr", "-Nv", "m xg-Nr")

TEN = math.radians(10.0)  # rudder and heading of the zig-zag, and rudder of the turn
STEP_S = 0.5  # time step of plant and filter
STATE_SPMEASURED = 1e-3
"""Standard deviation of each state at the start [-]: the straight course is known."""

MEASURED = {
    "ship_speed_m_s": "ship_speed",
    columns.SWAY_SPEED: "sway_speed",
    columns.YAW_RATE: "yaw_rate",
    columns.SHAFT_SPEED: "shaft_speed",
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


def identified_ship(ship: Ship, ratios: Any) -> Ship:
    """Return the ship with its coefficients multiplied by ratios, shape (4,).

    Raises:
        ShipError: a coefficient is outside the range of a ship file.
    """
    return with_coefficients(ship, np.asarray(ratios) * coefficients(ship))


class Truth(NamedTuple):
    """A simulated zig-zag."""

    ship: Ship
    point: Equilibrium  # of the straight course
    units: dict[str, float]  # of each state [SI]
    length_s: float  # time for one ship length [s]
    track: pd.DataFrame
    """By time step: ship_speed, sway_speed, yaw_rate, shaft_speed, heading, rudder."""


def zig_zag_track(ship: Ship, speed_m_s: float, executes: int) -> pd.DataFrame:
    """Return the track of the 10/10 zig-zag from a straight course at a speed [m/s]."""
    return zig_zag(ship, approach(ship, speed_m_s), TEN, TEN, executes=executes).track


def simulate_zig_zag(ship: Ship, speed_m_s: float, seconds: float, executes: int) -> Truth:
    """Simulate the 10/10 zig-zag from a straight course at a speed for some seconds.

    Raises:
        ValueError: the executes take less time than asked for.
    """
    own = ship.with_values({"integration.time_step_s": STEP_S})
    whole = zig_zag_track(own, speed_m_s, executes)
    if (end := whole["time_s"].iloc[-1]) < seconds:
        raise ValueError(f"{executes} executes take {end:g} s, less than {seconds:g} s")
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
    point, length = approach(own, speed_m_s), ship.manoeuvring.length_m
    units = dict.fromkeys(("ship_speed", "sway_speed"), speed_m_s)
    units |= {"yaw_rate": speed_m_s / length, "shaft_speed": float(point.state.shaft_speed)}
    units |= {"heading": 1.0, "rudder_angle": 1.0}
    return Truth(own, point, units, length / speed_m_s, track)


def make_recording(truth: Truth, noise: float, seed: int, every: int = 1) -> pd.DataFrame:
    """Return a recording with an rms noise [-]; its first row is the exact straight course.

    The shaft speed is held constant, so its command has no noise. ``every`` is the number of time steps
    between two measurements.
    """
    track, ship = truth.track, truth.ship
    rng = np.random.default_rng(seed)
    errors = noise * rng.standard_normal((len(track), len(MEASURED)))
    errors[0] = 0.0
    table: dict[str, Any] = {"time_s": track["time_s"]}
    for k, (column, state) in enumerate(MEASURED.items()):
        read = (track[state] + truth.units[state] * errors[:, k]).to_numpy(copy=True)
        read[np.arange(len(read)) % every > 0] = np.nan
        table[column] = read
    table[columns.drive_column(ship)] = truth.point.inputs.drive
    lags = ship.rudder.time_constant_s > 0.0
    helm = columns.RUDDER if lags else columns.RUDDER_COMMAND
    return pd.DataFrame(table | {helm: track["rudder"]})


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
    """Estimate the four coefficients along a zig-zag by a model, starting at half of the truth.

    The initial standard deviation of a coefficient is its true value.
    """
    theta, units = coefficients(truth.ship), truth.units
    start = with_coefficients(model, 0.5 * theta)
    start = start.with_values({"integration.time_step_s": STEP_S})
    read = {c: s for c, s in MEASURED.items() if c != columns.drive_column(start)}
    drift, wander = (math.sqrt(q / truth.length_s) for q in tuning[1:])
    own = ShipFilter(
        start,
        KEYS,
        parameter_spread=dict(zip(KEYS, theta, strict=True)),
        noise={c: math.sqrt(tuning.variance) * units[s] for c, s in read.items()},
        state_spread={name: STATE_SPMEASURED * unit for name, unit in units.items()},
        state_walk={state: drift * units[state] for state in read.values()},
        parameter_walk=dict.fromkeys(KEYS, wander),
    )
    found = own.follow(Replay(start, table))
    at = len(own.states) + 1
    return FilterRun(
        (_offsets(start) - found.estimates[:, at:]) / theta,
        found.standard_errors[:, at:] / theta,
        pd.DataFrame(found.estimates[:, : at - 1], columns=list(own.states)),
    )


def steady_turn(ship: Ship, speed_m_s: float) -> TurningCircle:
    """Return the turn with 10 degrees of rudder after an approach at a speed [m/s].

    Raises:
        ShipError: the ship does not turn steadily.
    """
    return turning_circle(ship, approach(ship, speed_m_s), TEN)


def slowest_pole(ship: Ship, speed_m_s: float) -> float:
    """Return the largest real part of the poles of sway and yaw at a speed [1/L]."""
    return max(pole.real for pole in nomoto(ship, approach(ship, speed_m_s)).poles)


def ratio_panel(x: Any, run: FilterRun, title: str, **settings: Any) -> Panel:
    """Return the panel of the estimated over the true coefficients of a run."""
    lines = [
        Line(x, own, name, colour, width=1.1)
        for colour, name, own in zip(PALETTE, COEFFICIENTS, run.ratios.T, strict=False)
    ]
    one = Line((x[0], x[-1]), (1.0, 1.0), color=TRUTH, style=":", width=0.8)
    return Panel([*lines, one], {"title": f"estimate over truth, {title}"} | settings)


def turn_panel(turns: Mapping[str, TurningCircle], length_m: float) -> Panel:
    """Return the panel of some turns by label, the first of which is the truth."""
    lines = [
        Line(
            turn.track["cross_track_m"] / length_m,
            turn.track["position_m"] / length_m,
            label,
            colour,
            "-" if colour == TRUTH else "--",
            1.1,
        )
        for colour, (label, turn) in zip((TRUTH, *PALETTE), turns.items(), strict=False)
    ]
    settings = {
        "title": "turn with 10 degrees of rudder",
        "xlabel": "to starboard [L]",
        "ylabel": "advance [L]",
        "aspect": "equal",
        "adjustable": "datalim",
    }
    return Panel(lines, settings, 1)
