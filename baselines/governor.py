"""Shaft speed governor: PI controller of the fuel rack with anti-windup and torque limiter.

    X[k] = clip(k_p e[k] + I[k], 0, X_max(omega_e)),   I[k] = I[k-1] + k_i e[k],   e = omega_set - omega

X_max is the fuel rack at the torque limit of the engine, at most the end stop. The integral is held
while the rack is at a limit and the error would move it further (conditional integration, Astrom &
Hagglund 2006, section 3.5).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..plant.drives.diesel import rack_of_torque, torque_limit
from ..plant.linear import matrices
from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from ..plant.steady_state import equilibrium
from .steady_points import steady_point

RESPONSE_S = 2.0  # time constant of the closed loop [s]; at least three control intervals apply
_LIMITER_GAIN = 0.8  # of the rack limits, over the gain that corrects an error in time [-]
_CUT_OFF = 0.1  # share above the highest shaft speed at which the rack limits cut the fuel [-]
_TUNED_AT = 6  # number of shaft speeds over the range of the engine


class Gains(NamedTuple):
    """Gains over shaft speed, for linear interpolation."""

    shaft_speed: Floats  # [rad/s], rising, shape (m,)
    proportional: Floats  # k_p [mm s/rad], shape (m,)
    integral: Floats  # k_i per control interval [mm s/rad], shape (m,)


@compiled
def highest_rack(plant: Record, shaft_speed: float) -> float:
    """Return the fuel rack [mm] at the torque limit of the engine, at most the end stop.

    Example:
        >>> from shaftline.plant import load_ship
        >>> frigate = load_ship("frigate").record()
        >>> highest_rack(frigate, 6.0) < highest_rack(frigate, 10.0)
        True
    """
    engine_speed = plant.gear_ratio * shaft_speed
    rack = rack_of_torque(plant, engine_speed, torque_limit(plant, engine_speed))
    return float(max(plant.drive_min, min(rack, plant.drive_max)))


@compiled
def limiter_slope(plant: Record, response_s: float) -> float:
    """Return the slope of the rack limits over shaft speed [mm s/rad] beyond the allowed speeds.

    The slope corrects a speed error within the response time [s], and it cuts the fuel of the highest
    rack before the shaft speed is :data:`_CUT_OFF` above its highest value.
    """
    down = plant.gear_ratio * plant.transmission_efficiency
    prompt = _LIMITER_GAIN * shaft_inertia(plant) / response_s / (plant.torque_per_rack * down)
    highest = plant.engine_speed_max / plant.gear_ratio
    return float(max(prompt, plant.drive_max / (_CUT_OFF * highest)))


@compiled
def rack_limits(plant: Record, shaft_speed: float, slope: float) -> tuple[float, float]:
    """Return the lowest and highest fuel rack [mm] that protect the engine at a shaft speed [rad/s].

    The lowest rack prevents a stall: below the lowest engine speed it rises from the rack of zero
    torque, by the slope of :func:`limiter_slope`. The highest rack is that of the torque limiter, and
    falls above the highest engine speed.
    """
    low = plant.engine_speed_min / plant.gear_ratio
    high = plant.engine_speed_max / plant.gear_ratio
    unloaded = rack_of_torque(plant, plant.engine_speed_min, 0.0)
    most = max(highest_rack(plant, shaft_speed) - slope * max(shaft_speed - high, 0.0), 0.0)
    return float(min(max(unloaded + slope * (low - shaft_speed), 0.0), most)), float(most)


@compiled
def limit_rack(plant: Record, rack: float, shaft_speed: float, slope: float) -> float:
    """Return a fuel rack command [mm] within :func:`rack_limits`, which need a finite shaft speed."""
    if not math.isfinite(shaft_speed):
        return rack
    least, most = rack_limits(plant, shaft_speed, slope)
    return min(max(rack, least), most)


@compiled
def govern(
    plant: Record, order: float, shaft_speed: float, integral: float, k_p: float, k_i: float
) -> tuple[float, float]:
    """Return the rack [mm] and the new integral [mm] of one governor for one control interval.

    Set-point and measured shaft speed are in rad/s (if one is not finite, only the integral acts), the
    integral I in mm, the gains k_p and k_i in mm s/rad.
    """
    error = order - shaft_speed
    if not math.isfinite(error):
        return min(max(integral, plant.drive_min), plant.drive_max), integral
    highest = highest_rack(plant, shaft_speed)
    following = integral + k_i * error
    asked = k_p * error + following
    if asked > highest:
        return highest, integral if error > 0.0 else following
    if asked < plant.drive_min:
        return plant.drive_min, integral if error < 0.0 else following
    return asked, following


@compiled
def _govern_all(
    plant: Record, order: Floats, shaft_speed: Floats, integral: Floats, k_p: Floats, k_i: Floats
) -> Floats:
    """Return the racks [mm] of n ships, and update their integrals in place."""
    rack = np.empty(len(order))
    for i in range(len(order)):
        rack[i], integral[i] = govern(plant, order[i], shaft_speed[i], integral[i], k_p[i], k_i[i])
    return rack


def tune(
    ship: Ship, interval_s: float, response_s: float = RESPONSE_S, pitch_ratio: float | None = None
) -> Gains:
    """Return the gains from the plant linearised at steady states over the speed range of the engine.

    At each of them the shaft is omega' = a omega + b X at a constant ship speed, which changes an order
    of magnitude more slowly. Sampled with a constant rack over h: pole p = exp(a h), gain
    g = b (p - 1) / a. The zero of the PI controller cancels p and leaves one closed-loop pole
    q = exp(-h / T) (Dahlin's direct synthesis): k_p = p (1 - q) / g, k_i = (1 - p) (1 - q) / g.

    Args:
        ship: ship with a diesel; lag and dead time of its torque lengthen the response.
        interval_s: control interval h [s].
        response_s: time constant T of the closed loop [s].
        pitch_ratio: P/D of the linearisation [-]; the middle of the range by default.

    Raises:
        ShipError: the ship has no diesel.
        ValueError: interval or response is not positive, or there is no steady state inside the torque
            limit.

    Example:
        >>> from shaftline.plant import load_ship
        >>> gains = tune(load_ship("frigate"), interval_s=0.5)
        >>> bool((gains.proportional > 0.0).all())
        True
    """
    if not (interval_s > 0.0 and response_s > 0.0):
        raise ValueError(
            f"governor: interval_s = {interval_s} s, response_s = {response_s} s: both must be positive"
        )
    mover = ship.diesel
    delay = mover.lag_s + mover.dead_time_s
    response = max(response_s, 3.0 * interval_s, 3.0 * delay)
    prompt = ship.with_values({"prime_mover.lag_s": 0.0})
    screw = ship.propeller
    if pitch_ratio is None:
        pitch_ratio = 0.5 * (screw.pitch_ratio_min + screw.pitch_ratio_max)
    rows = []
    for speed in np.linspace(*ship.shaft_speeds, _TUNED_AT):
        rack = steady_point(prompt, float(speed), pitch_ratio).fuel_rack
        try:
            point = equilibrium(prompt, rack, pitch_ratio)
        except ValueError:
            continue  # above the torque limit at this speed and pitch
        states, inputs, model = matrices(prompt, point)
        row = states.index("shaft_speed")
        a = float(model.a[row, row])
        b = float(model.b[row, inputs.index("drive")])
        if b <= 0.0:
            continue  # at the torque limit the rack has no effect
        p = math.exp(a * interval_s)
        gain = b * (p - 1.0) / a
        effort = (1.0 - math.exp(-interval_s / response)) / gain
        rows.append((point.state.shaft_speed, p * effort, (1.0 - p) * effort))
    if not rows:
        raise ValueError(
            f"{ship.name}: no steady state within the torque limit of the engine at P/D {pitch_ratio:g}"
        )
    return Gains(*(np.array(column) for column in zip(*rows, strict=True)))


class Governor:
    """Hold the shaft speed of n equal ships by the fuel rack; the caller stores the n integrals.

    Args:
        ship: ship with a diesel, or its name.
        interval_s: control interval [s].
        response_s: time constant of the closed loop [s].
        pitch_ratio: P/D of the tuning [-]; the middle of the range by default.

    Example:
        >>> governor = Governor("frigate", interval_s=0.5)
        >>> integral = governor.settle([10.0], [20.0], [10.0])
        >>> rack, integral = governor.command([10.0], [10.0], integral)
        >>> rack.tolist()
        [20.0]
    """

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        response_s: float = RESPONSE_S,
        pitch_ratio: float | None = None,
    ) -> None:
        self.ship = load_ship(ship)
        self.gains = tune(self.ship, interval_s, response_s, pitch_ratio)
        self._plant = self.ship.record()
        self._lowest, self._highest = self.ship.shaft_speeds

    def settle(self, shaft_speed: Any, fuel_rack: Any, order: Any) -> Floats:
        """Return the integrals [mm], shape (n,), with which the first command does not move the rack.

        Args:
            shaft_speed: measured shaft speed [rad/s], shape (n,).
            fuel_rack: present fuel rack [mm], shape (n,).
            order: shaft speed set-point [rad/s], shape (n,).
        """
        speed = np.asarray(shaft_speed, dtype=np.float64)
        k_p, k_i = self._gains_at(speed)
        bumpless = np.asarray(fuel_rack) - (k_p + k_i) * (self._limit_order(order) - speed)
        return np.asarray(np.clip(bumpless, self._plant["drive_min"], self._plant["drive_max"]))

    def command(self, order: Any, shaft_speed: Any, integral: Any) -> tuple[Floats, Floats]:
        """Return the rack commands [mm] and the new integrals [mm], each of shape (n,).

        Args:
            order: shaft speed set-points [rad/s], shape (n,); limited to the speeds of the engine.
            shaft_speed: measured shaft speed [rad/s], shape (n,).
            integral: integrals of the last call or :meth:`settle` [mm], shape (n,); not changed.
        """
        speed = np.array(shaft_speed, dtype=np.float64)
        following = np.array(integral, dtype=np.float64)
        order, gains = self._limit_order(order), self._gains_at(speed)
        return _govern_all(self._plant, order, speed, following, *gains), following

    def _limit_order(self, order: Any) -> Floats:
        return np.clip(np.array(order, dtype=np.float64), self._lowest, self._highest)

    def _gains_at(self, speed: Floats) -> tuple[Floats, Floats]:
        known, proportional, integral = self.gains
        return np.interp(speed, known, proportional), np.interp(speed, known, integral)
