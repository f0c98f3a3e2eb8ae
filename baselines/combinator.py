"""Combinator: one lever sets pitch and shaft speed together, and a governor holds the shaft speed.

The curve is the usual one of ships with a controllable-pitch propeller. From lever 0 the pitch rises at
the lowest shaft speed; from full pitch on the shaft speed rises to its highest value. A speed order is
converted to a lever position by the steady ship speeds in calm water, so waves, fouling and shallow
water cause a steady speed error. The variant with a trimmed lever removes this error slowly, as the
officer of the watch does, and is therefore comparable with controllers that hold the ship speed.

With the option ``va_weight`` the advance velocity schedules the pitch: it is reduced where the engine
would otherwise need more than its torque at the set-point of the shaft speed.
"""

from __future__ import annotations

import functools
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..observers.torque_curve import model_torque
from ..plant.drives.diesel import torque_limit
from ..plant.shaft import brake_torque_of, load_torque
from ..plant.ship import Ship
from .controller import Commands, Controller, Measurements, Ranges, Variants
from .governor import RESPONSE_S, Governor
from .inflow_schedule import SCHEDULE_COLUMNS, make_schedule
from .steady_points import SteadyPoint, steady_point

FLOOR_SHARE = 0.5  # lowest over highest shaft speed [-], at least the lowest of the engine
FULL_PITCH_LEVER = 0.45  # lever position at which the pitch is full [-]
TORQUE_MARGIN = 0.97  # engine torque over its limit at full pitch and speed in calm water [-]
_NEAR = 0.5  # largest speed error that trims the lever [m/s], as after a new order
_HALVINGS = 30
_POINTS = 41  # number of steady states along the curve


@compiled
def torque_share(plant: Record, velocity: float, shaft_speed: float, pitch: float) -> float:
    """Return the brake torque over its limit [-] at v_a [m/s], omega [rad/s] and P/D [-]."""
    load = load_torque(plant, model_torque(plant, velocity, shaft_speed, pitch), shaft_speed)
    limit = torque_limit(plant, plant.gear_ratio * shaft_speed)
    return float(brake_torque_of(plant, load, shaft_speed) / limit)


@compiled
def pitches_within_torque(
    plant: Record, velocity: Floats, shaft_speed: Floats, pitch: Floats, share: float
) -> Floats:
    """Return the P/D [-] of n ships, reduced until the brake torque is within a share of its limit.

    The torque rises with the pitch. Each argument has the shape (n,); where the advance velocity [m/s]
    is not finite, the pitch is unchanged.
    """
    found = pitch.copy()
    for i in range(len(pitch)):
        v, omega, low, high = velocity[i], shaft_speed[i], plant.pitch_ratio_min, pitch[i]
        if not torque_share(plant, v, omega, high) > share:
            continue
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if torque_share(plant, v, omega, middle) > share:
                high = middle
            else:
                low = middle
        found[i] = low
    return found


class SetPoints(NamedTuple):
    """Set-points of a speed order in calm water, each of shape (n,)."""

    pitch_ratio: Floats  # [-]
    shaft_speed: Floats  # [rad/s]
    thrust: Floats  # of one propeller [N]


class Curve(NamedTuple):
    """Combinator curve with the steady states of the ship, each of shape (m,), at rising lever."""

    lever: Floats  # 0 to 1
    pitch_ratio: Floats  # [-]
    shaft_speed: Floats  # [rad/s]
    ship_speed: Floats  # in calm water [m/s], rising
    thrust: Floats  # of one propeller in calm water [N]

    def set_points(self, speed_order: Any) -> SetPoints:
        """Return the set-points at ordered ship speeds [m/s], shape (n,), limited to the curve."""
        columns = (self.pitch_ratio, self.shaft_speed, self.thrust)
        return SetPoints(*(np.asarray(np.interp(speed_order, self.ship_speed, c)) for c in columns))


def full_speed(ship: Ship, torque_share: float = TORQUE_MARGIN) -> float:
    """Return the highest shaft speed [rad/s] that the engine holds in calm water at the lowest pitch.

    It is the highest speed of the engine if the lowest pitch needs up to ``torque_share`` of the torque
    limit there, and otherwise the speed at which it needs this share. A fixed-pitch propeller that
    absorbs the rated power at the rated speed therefore runs slightly below this speed.

    Raises:
        ValueError: the lowest pitch needs more even at the lowest speed of the engine.
    """
    slowest, top = ship.shaft_speeds
    pitch = _driving_pitch(ship)

    def excess(speed: float) -> float:
        return steady_point(ship, speed, pitch).torque_share - torque_share

    if excess(top) <= 0.0:
        return top
    if excess(slowest) > 0.0:
        point = steady_point(ship, slowest, pitch)
        raise ValueError(
            f"{ship.name}: at P/D {pitch:.3g} (propeller.pitch_ratio_min) and the lowest engine speed "
            f"(prime_mover.speed_min_rpm = {ship.diesel.speed_min_rpm:g}) calm water needs an "
            f"engine torque of {point.brake_torque:.4g} N m, above {torque_share:.0%} of the limit of "
            f"{point.brake_torque / point.torque_share:.4g} N m. Lower propeller.pitch_ratio_min, or "
            "correct resistance, propeller or prime_mover.torque_limit_at_min_speed_N_m"
        )
    return float(scipy.optimize.brentq(excess, slowest, top, xtol=1e-9))


def full_pitch(ship: Ship, torque_share: float = TORQUE_MARGIN) -> float:
    """Return the highest P/D [-] with an engine torque up to a share of its limit at full speed.

    Full speed is that of :func:`full_speed`. Where it is below the highest speed of the engine, or the
    pitch is fixed, the highest P/D is the lowest one.
    """
    top = full_speed(ship, torque_share)
    low, high = _driving_pitch(ship), ship.propeller.pitch_ratio_max
    if top < ship.shaft_speeds[1]:
        return low

    def excess(pitch: float) -> float:
        return steady_point(ship, top, pitch).torque_share - torque_share

    if excess(high) <= 0.0:
        return high
    return float(scipy.optimize.brentq(excess, low, high, xtol=1e-6))


@functools.lru_cache(maxsize=64)
def combinator_curve(
    ship: Ship, floor_share: float = FLOOR_SHARE, full_pitch_lever: float = FULL_PITCH_LEVER
) -> Curve:
    """Return the combinator curve of a ship; with a fixed pitch it sets the shaft speed only.

    It is that of the ship's combinator table, by default the standard curve, which ends at the shaft
    speed of :func:`full_speed`.

    Args:
        ship: ship with a diesel.
        floor_share: lowest over highest shaft speed, at least 0 and below 1 [-].
        full_pitch_lever: lever position at which the pitch becomes full, between 0 and 1 [-].

    Raises:
        ShipError: the ship has no diesel or cannot move.
        ValueError: a share is outside its range.

    Example:
        >>> from shaftline.plant import load_ship
        >>> curve = combinator_curve(load_ship("frigate"))
        >>> round(float(curve.set_points(8.0).pitch_ratio), 2)
        1.39
    """
    if not (0.0 <= floor_share < 1.0 and 0.0 < full_pitch_lever < 1.0):
        raise ValueError(
            f"combinator curve: floor_share = {floor_share:g} (allowed: >= 0 and < 1), "
            f"full_pitch_lever = {full_pitch_lever:g} (allowed: > 0 and < 1)"
        )
    if ship.combinator.present:
        return _tabled_curve(ship)
    lowest, highest = ship.shaft_speeds[0], full_speed(ship)
    floor = max(lowest, floor_share * highest)
    lever = np.linspace(0.0, 1.0, _POINTS)
    full = full_pitch(ship)
    low = min(_driving_pitch(ship), full)
    bends = [0.0, full_pitch_lever if low < full else 0.0, 1.0]
    pitch = np.interp(lever, bends, [low, full, full])
    speed = np.interp(lever, bends, [floor, floor, highest])
    return curve_through(ship, lever, pitch, speed)


def curve_through(ship: Ship, lever: Any, pitch_ratio: Any, shaft_speed: Any) -> Curve:
    """Return a combinator curve through given points, with steady ship speeds and thrusts in calm water.

    Args:
        ship: ship with a diesel.
        lever: lever positions, rising, shape (m,).
        pitch_ratio: P/D [-], shape (m,).
        shaft_speed: shaft speeds [rad/s], shape (m,).

    Raises:
        ValueError: lever position or steady ship speed does not rise from point to point.
    """
    lever, pitch, speed = (np.asarray(x, np.float64) for x in (lever, pitch_ratio, shaft_speed))
    points = [steady_point(ship, float(n), float(p)) for p, n in zip(pitch, speed, strict=True)]
    ship_speed = np.array([point.ship_speed for point in points])
    level = (np.diff(ship_speed) <= 0.0) | (np.diff(lever) <= 0.0)
    if level.any():
        here = int(np.argmax(level)) + 1
        raise ValueError(
            f"{ship.name}: lever position and steady ship speed must rise along the combinator curve, "
            f"but from lever {lever[here - 1]:g} to {lever[here]:g} the speed goes from "
            f"{ship_speed[here - 1]:.3g} to {ship_speed[here]:.3g} m/s"
        )
    return Curve(lever, pitch, speed, ship_speed, np.array([point.thrust for point in points]))


def _tabled_curve(ship: Ship) -> Curve:
    """Return the curve of the ship's combinator table.

    Lever positions are converted to ordered speeds by the steady ship speeds in calm water, in steps
    that are fine enough between the rows. A table by ordered speed holds as it is.
    """
    table = ship.combinator
    rows = np.array(getattr(table, table.key))
    grid = np.union1d(rows, np.linspace(rows[0], rows[-1], _POINTS))
    grid = grid[
        np.append(True, np.diff(grid) > 1e-9)
    ]  # 0.3 is also 12 of 40 steps, but for rounding
    speed = np.clip(
        np.interp(grid, rows, table.shaft_speed_rpm) * math.pi / 30.0, *ship.shaft_speeds
    )
    screw = ship.propeller
    pitch = np.full_like(grid, screw.pitch_ratio_max)
    if table.pitch_ratio:
        pitch = np.interp(grid, rows, table.pitch_ratio)
        pitch = np.clip(pitch, screw.pitch_ratio_min, screw.pitch_ratio_max)
    if table.lever:
        return curve_through(ship, grid, pitch, speed)
    lever = (grid - grid[0]) / (grid[-1] - grid[0])
    thrust = [
        steady_point(ship, float(n), float(p)).thrust for n, p in zip(speed, pitch, strict=True)
    ]
    return Curve(lever, pitch, speed, grid, np.array(thrust))


def _driving_pitch(ship: Ship) -> float:
    """Return the lowest pitch [-] of the range that drives the ship ahead."""
    return min(max(ship.propeller.pitch_ratio_min, 0.1), ship.propeller.pitch_ratio_max)


class Combinator(Controller):
    """Set pitch and shaft speed together from the ordered ship speed, with a shaft speed governor.

    Args:
        curve: combinator curve; :func:`combinator_curve` by default.
        response_s: time constant of the governed shaft speed [s].
        trim_s: time constant [s] with which the lever is trimmed until the measured ship speed equals
            the order, where waves, wind or a fouled hull slow the ship; 0 for no trim.
        va_weight: weight k of the estimated advance velocity (:mod:`.inflow_schedule`) [-], at which the
            pitch is reduced until the engine torque is within its limit; 0 for the nominal wake. By
            default the pitch is that of the curve.

    State: integral of the governor [mm], trim of the speed order [m/s], and state of the inflow
    schedule; shape (n, 4).

    Raises:
        ValueError: ``trim_s`` is negative or not finite, or ``va_weight`` is outside 0 to 1.
    """

    name = "combinator"
    source = "common practice"
    variants: ClassVar[Variants] = {"combinator-trimmed": {"trim_s": 30.0}}
    tunable: ClassVar[Ranges] = {
        "response_s": (1.0, 20.0),
        "trim_s": (5.0, 100.0),
        "va_weight": (0.0, 1.0),
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        curve: Curve | None = None,
        response_s: float = RESPONSE_S,
        trim_s: float = 0.0,
        va_weight: float | None = None,
    ) -> None:
        super().__init__(ship, interval_s)
        if not (np.isfinite(trim_s) and trim_s >= 0.0):
            raise ValueError(f"combinator: trim_s = {trim_s!r} s: must be 0 or more")
        self.trim_s = trim_s
        self.schedule = make_schedule(self.name, self.plant, interval_s, va_weight)
        self.curve = combinator_curve(self.ship) if curve is None else curve
        middle = float(np.interp(0.5, self.curve.lever, self.curve.pitch_ratio))
        self.governor = Governor(self.ship, interval_s, response_s, middle)

    def set_points(self, speed_order: Any) -> tuple[Floats, Floats]:
        """Return pitch [-] and shaft speed [rad/s] at ordered ship speeds [m/s], each of shape (n,)."""
        wanted = self.curve.set_points(speed_order)
        return wanted.pitch_ratio, wanted.shaft_speed

    def steady_point(self, speed_order: float, resistance_factor: float = 1.0) -> SteadyPoint:
        """Return the steady state of the ship in calm water.

        Args:
            speed_order: ordered ship speed [m/s].
            resistance_factor: factor on the resistance d_c1 [-].
        """
        pitch, speed = self.set_points(speed_order)
        return steady_point(self.ship, float(speed), float(pitch), resistance_factor)

    def initial_state(self, signals: Measurements) -> Floats:
        """Return the integral that keeps the fuel rack at its position, and no trim."""
        _, speed = self.set_points(signals.speed_order)
        integral = self.governor.settle(signals.shaft_speed, signals.fuel_rack, speed)
        return np.column_stack([integral, np.zeros((len(integral), 1 + SCHEDULE_COLUMNS))])

    def act(self, signals: Measurements, memory: Floats) -> Commands:
        """Return the pitch of the curve, within the torque limit, and the rack of the governor."""
        if self.trim_s > 0.0:
            error = np.clip(signals.speed_order - signals.ship_speed, -_NEAR, _NEAR)
            memory[:, 1] += self.interval_s / self.trim_s * error
        order = signals.speed_order + memory[:, 1]
        pitch, speed = self.set_points(order)
        if self.schedule is not None:
            memory[:, 2:] = self.schedule.update(signals, memory[:, 2:])
            velocity = self.schedule.velocity(signals, memory[:, 2:])
            pitch = pitches_within_torque(self.plant, velocity, speed, pitch, TORQUE_MARGIN)
        rack, memory[:, 0] = self.governor.command(speed, signals.shaft_speed, memory[:, 0])
        return pitch, rack
