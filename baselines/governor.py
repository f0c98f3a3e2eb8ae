"""Shaft speed governor: PI on the fuel rack with anti-windup and a torque limiter.

    X[k] = clip(k_p e[k] + I[k], 0, X_max(omega_e)),   I[k] = I[k-1] + k_i e[k],   e = omega_set - omega

X_max is the rack at which the rack map reaches the engine's envelope, never more than the end stop.
The integral stands still while the rack is at a limit and the error pushes it further (conditional
integration, Astrom & Hagglund 2006, section 3.5).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.drives.diesel import rack_of_torque, torque_limit
from ..plant.linear import linearise
from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from ..plant.steady_state import equilibrium
from .steady_points import steady_point

RESPONSE_S = 2.0
"""Time constant of the closed loop [s]; never less than three control intervals."""

_LIMITER_GAIN = 0.8
"""Gain of the rack limits, of the one that takes a speed error back within the response time."""

_CUT_OFF = 0.1
"""Share of the highest shaft speed above which the rack limits leave no fuel [-]."""

_TUNED_AT = 6  # shaft speeds over the engine's range


class Gains(NamedTuple):
    """Gains over shaft speed; between the speeds they are interpolated."""

    shaft_speed: NDArray[np.float64]  # [rad/s], rising, shape (m,)
    proportional: NDArray[np.float64]  # k_p [mm s/rad], shape (m,)
    integral: NDArray[np.float64]  # k_i per control interval [mm s/rad], shape (m,)


@compiled
def highest_rack(plant: Record, shaft_speed: float) -> float:
    """Torque limiter: fuel rack [mm] at the engine's envelope, at most the end stop."""
    engine_speed = plant.gear_ratio * shaft_speed
    rack = rack_of_torque(plant, engine_speed, torque_limit(plant, engine_speed))
    return float(max(plant.drive_min, min(rack, plant.drive_max)))


@compiled
def limiter_slope(plant: Record, response_s: float) -> float:
    """Return the slope of the rack limits over shaft speed [mm s/rad] beyond the allowed speeds.

    It takes a speed error back within the response time, and cuts the fuel of the highest rack before
    the shaft is :data:`_CUT_OFF` above its highest speed.

    Args:
        plant: ship record.
        response_s: time in which a rack error of the slope takes back a speed error [s].
    """
    down = plant.gear_ratio * plant.transmission_efficiency
    prompt = _LIMITER_GAIN * shaft_inertia(plant) / response_s / (plant.torque_per_rack * down)
    highest = plant.engine_speed_max / plant.gear_ratio
    return float(max(prompt, plant.drive_max / (_CUT_OFF * highest)))


@compiled
def rack_limits(plant: Record, shaft_speed: float, slope: float) -> tuple[float, float]:
    """Return the lowest and highest fuel rack [mm] that protect the engine at a shaft speed.

    The lowest rack keeps the engine turning: below the lowest engine speed it rises from the rack of
    no torque. The highest is that of the torque limiter, and falls beyond the highest engine speed.

    Args:
        plant: ship record.
        shaft_speed: measured omega [rad/s].
        slope: from :func:`limiter_slope` [mm s/rad].
    """
    low = plant.engine_speed_min / plant.gear_ratio
    high = plant.engine_speed_max / plant.gear_ratio
    unloaded = rack_of_torque(plant, plant.engine_speed_min, 0.0)
    most = max(highest_rack(plant, shaft_speed) - slope * max(shaft_speed - high, 0.0), 0.0)
    return float(min(max(unloaded + slope * (low - shaft_speed), 0.0), most)), float(most)


@compiled
def limited_rack(plant: Record, rack: float, shaft_speed: float, slope: float) -> float:
    """Return a fuel rack command [mm] kept inside :func:`rack_limits`; nan speeds limit nothing."""
    if not math.isfinite(shaft_speed):
        return rack
    least, most = rack_limits(plant, shaft_speed, slope)
    return min(max(rack, least), most)


@compiled
def govern(
    plant: Record,
    order: float,
    shaft_speed: float,
    integral: float,
    proportional: float,
    integral_gain: float,
) -> tuple[float, float]:
    """Rack [mm] and new integral [mm] of one governor over one control interval.

    Args:
        plant: ship record.
        order: shaft speed set-point [rad/s].
        shaft_speed: measured omega [rad/s]; where it is not finite the integral alone acts.
        integral: I [mm].
        proportional: k_p [mm s/rad].
        integral_gain: k_i [mm s/rad].
    """
    error = order - shaft_speed
    if not math.isfinite(error):
        return min(max(integral, plant.drive_min), plant.drive_max), integral
    highest = highest_rack(plant, shaft_speed)
    following = integral + integral_gain * error
    asked = proportional * error + following
    if asked > highest:
        return highest, integral if error > 0.0 else following
    if asked < plant.drive_min:
        return plant.drive_min, integral if error < 0.0 else following
    return asked, following


@compiled
def _govern_all(
    plant: Record,
    order: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    integral: NDArray[np.float64],
    proportional: NDArray[np.float64],
    integral_gain: NDArray[np.float64],
    rack: NDArray[np.float64],
) -> None:
    for i in range(len(order)):
        rack[i], integral[i] = govern(
            plant, order[i], shaft_speed[i], integral[i], proportional[i], integral_gain[i]
        )


def tune(
    ship: Ship, interval_s: float, response_s: float = RESPONSE_S, pitch_ratio: float | None = None
) -> Gains:
    """Gains from the plant linearised at steady states over the engine's speeds.

    About each, the shaft is omega' = a omega + b X with the ship's speed held (it is an order of
    magnitude slower). Sampled with a held rack over h: pole p = exp(a h), gain g = b (p - 1) / a. The
    PI's zero cancels p and leaves one closed-loop pole q = exp(-h / T) (Dahlin's direct synthesis):
    k_p = p (1 - q) / g, k_i = (1 - p) (1 - q) / g.

    Args:
        ship: a ship with a diesel; lag and dead time of its torque lengthen the response.
        interval_s: control interval h [s].
        response_s: time constant T of the closed loop [s].
        pitch_ratio: P/D [-] at which to linearise; the middle of the range by default.

    Raises:
        ShipError: the ship has no diesel.
        ValueError: interval or response is not positive, or no steady state was found.
    """
    if not (interval_s > 0.0 and response_s > 0.0):
        raise ValueError(f"interval and response must be positive: {interval_s}, {response_s} s")
    mover = ship.diesel
    sluggish = mover.lag_s + mover.dead_time_s
    response = max(response_s, 3.0 * interval_s, 3.0 * sluggish)
    prompt = ship.with_values({"prime_mover.lag_s": 0.0})
    screw = ship.propeller
    if pitch_ratio is None:
        pitch_ratio = 0.5 * (screw.pitch_ratio_min + screw.pitch_ratio_max)
    speeds, proportional, integral = [], [], []
    for speed in np.linspace(*ship.shaft_speeds, _TUNED_AT):
        rack = steady_point(prompt, float(speed), pitch_ratio).fuel_rack
        try:
            point = equilibrium(prompt, rack, pitch_ratio)
        except ValueError:
            continue  # beyond the engine's envelope at this speed and pitch
        model = linearise(prompt, point)
        row = list(model.state_labels).index("shaft_speed")
        a = float(model.A[row, row])
        b = float(model.B[row, list(model.input_labels).index("drive")])
        if b <= 0.0:
            continue  # on the envelope the rack moves nothing
        p = math.exp(a * interval_s)
        gain = b * (p - 1.0) / a
        effort = (1.0 - math.exp(-interval_s / response)) / gain
        speeds.append(point.state.shaft_speed)
        proportional.append(p * effort)
        integral.append((1.0 - p) * effort)
    if not speeds:
        raise ValueError(f"{ship.name}: no steady state inside the envelope at P/D {pitch_ratio:g}")
    return Gains(np.array(speeds), np.array(proportional), np.array(integral))


class Governor:
    """A bank of n equal governors, one a ship of the batch; the caller keeps their integrals.

    Args:
        ship: a ship with a diesel, or its name.
        interval_s: control interval [s].
        response_s: time constant of the closed loop [s].
        pitch_ratio: P/D [-] at which it is tuned; the middle of the range by default.
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

    def settle(self, shaft_speed: Any, fuel_rack: Any, order: Any) -> NDArray[np.float64]:
        """Integrals [mm], shape (n,), with which the first command leaves the rack where it is.

        Args:
            shaft_speed: measured [rad/s], shape (n,).
            fuel_rack: its position [mm], shape (n,).
            order: shaft speed set-point [rad/s], shape (n,).
        """
        speed = np.asarray(shaft_speed, dtype=np.float64)
        error = self._within(order) - speed
        bumpless = np.asarray(fuel_rack) - (self._at(1, speed) + self._at(2, speed)) * error
        return np.asarray(np.clip(bumpless, self._plant["drive_min"], self._plant["drive_max"]))

    def command(
        self, order: Any, shaft_speed: Any, integral: Any
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rack commands [mm] and new integrals [mm], each of shape (n,); arguments stay untouched.

        Args:
            order: shaft speed set-points [rad/s], shape (n,); held inside the engine's speeds.
            shaft_speed: measured [rad/s], shape (n,).
            integral: from the last call or :meth:`settle` [mm], shape (n,).
        """
        speed = np.array(shaft_speed, dtype=np.float64)
        following = np.array(integral, dtype=np.float64)
        rack = np.zeros_like(speed)
        proportional, gain = self._at(1, speed), self._at(2, speed)
        _govern_all(self._plant, self._within(order), speed, following, proportional, gain, rack)
        return rack, following

    def _within(self, order: Any) -> NDArray[np.float64]:
        return np.clip(np.array(order, dtype=np.float64), self._lowest, self._highest)

    def _at(self, which: int, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.interp(speed, self.gains.shaft_speed, self.gains[which]))
