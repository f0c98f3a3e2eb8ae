"""Speed pilot: holds the ship's speed by the fuel rack and takes the waves' swing out of the torque.

    aim   = v_order + v_offset, within the curve's speeds
    rack  = X(aim) + k_v e + I + k_M (M_s - M) + k_w (w_s - w),     X_min(w) to X_max(w)
    pitch = P(aim) + P_offset + k_P (M_s - M)
    I'    = g k_v e / T,   e = aim - v

X and P are rack and pitch of the combinator's curve in calm water; v is the speed log over 2 s; M and w
are torque and speed of the shaft, M_s and w_s their means over 8 s; X_max is the governor's torque
limiter, which falls beyond the highest shaft speed; X_min rises below the lowest, so that the engine
keeps turning. A combinator holds the shaft's speed instead: the ship then sails at another speed than
ordered wherever the resistance is not that of calm water. T is the ship's own time constant m / (2 c
v), so that the integral cancels it (as in lambda tuning, Astrom & Hagglund 2006, section 6.5). The
integral stands still while the error is large, as after a new order, or the rack at a limit towards
which the error pushes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from .combinator import combinator_curve
from .controller import Controller, Readings
from .governor import rack_limits
from .steady_points import steady_point

ERROR_S, MEAN_S = 2.0, 8.0
"""Time constants of the slowed speed error and of the means [s]: within a wave, and as long as one."""

_FAR = 0.5  # speed error beyond which the integral stands still [m/s]
_LIMITER_GAIN = 0.8  # as the shaft gain, beyond the shaft speeds allowed
_LIMITER_POINTS = 101


class PilotSettings(NamedTuple):
    """What may be set, one number for all ships of a batch or shape (n,) each.

    Gains are shares of what the ship has, so that they mean the same on any.
    """

    speed_offset: Any = 0.0  # added to the order [m/s]
    pitch_offset: Any = 0.0  # added to the curve's P/D [-]
    torque_gain: Any = 1.0  # share of a torque's deviation that the rack takes back [-]
    shaft_gain: Any = 0.15  # share of a shaft speed's, within a control interval [-]
    pitch_gain: Any = 0.7  # k_P over range of pitch by highest shaft torque [-]


class Slowed(NamedTuple):
    """What a pilot remembers, each of shape (n,)."""

    error: NDArray[np.float64]  # speed order minus log over ERROR_S [m/s]
    shaft_speed: NDArray[np.float64]  # over MEAN_S [rad/s]
    shaft_torque: NDArray[np.float64]  # over MEAN_S [N m]
    integral: NDArray[np.float64]  # [mm]


class SpeedPilot(Controller):
    """Holds the ordered ship speed; see the module.

    Args:
        ship: a ship with a diesel, or its name.
        interval_s: control interval of the environment [s].
        speed_gain: k_v over the mean slope of the curve's rack over ship speed [-].
        integral_gain: g, above 1 for a speed that is back sooner [-].
        settings: fields of :class:`PilotSettings`.

    State: :class:`Slowed` by columns, shape (n, 4).

    Raises:
        ShipError: the ship has no diesel or cannot move.
        TypeError: an unknown setting.
    """

    name = "speed-pilot"
    source = "shaftline's own"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "speed_gain": (0.25, 16.0), "integral_gain": (0.25, 4.0), "speed_offset": (-0.3, 0.3),
        "pitch_offset": (-0.3, 0.15), "torque_gain": (0.0, 1.2), "shaft_gain": (0.0, 0.6),
        "pitch_gain": (0.0, 1.4),
    }  # fmt: skip

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        speed_gain: float = 2.0,
        integral_gain: float = 1.0,
        **settings: float,
    ) -> None:
        super().__init__(ship, interval_s)
        self.settings = PilotSettings(**settings)
        curve = combinator_curve(self.ship)
        self._speeds, self._pitch = curve.ship_speed, curve.pitch_ratio
        points = [
            steady_point(self.ship, float(n), float(p))
            for n, p in zip(curve.shaft_speed, curve.pitch_ratio, strict=True)
        ]
        self._rack = np.array([point.fuel_rack for point in points])
        slope = (self._rack[-1] - self._rack[0]) / (self._speeds[-1] - self._speeds[0])
        self._speed_gain = speed_gain * float(slope)  # [mm s/m]
        hull = self.ship.hull
        slope_at = hull.resistance_slope(float(np.mean(self._speeds)))
        self._reset_s = hull.mass_kg / slope_at / integral_gain
        self._units()
        self._limiters()

    def limits(self, shaft_speed: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest rack [mm] that the pilot commands at shaft speeds [rad/s]."""
        return (
            np.interp(shaft_speed, self._speed_grid, self._least),
            np.interp(shaft_speed, self._speed_grid, self._most),
        )

    def _limiters(self) -> None:
        plant, (low, high) = self.plant, self.ship.shaft_speeds
        self._speed_grid = speeds = np.linspace(0.5 * low, 1.2 * high, _LIMITER_POINTS)
        slope = _LIMITER_GAIN * self._shaft_unit
        limits = [rack_limits(plant, float(speed), slope) for speed in speeds]
        self._least, self._most = np.array(limits).T

    def _units(self) -> None:
        """What gains of one come to on this ship."""
        plant, mover = self.plant, self.ship.diesel
        down = float(plant["gear_ratio"]) * self.ship.transmission.efficiency
        torque = mover.torque_limit_N_m * down
        pitches = float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
        self._torque_unit = 1.0 / (mover.torque_per_rack_N_m_mm * down)  # [mm/(N m)]
        self._shaft_unit = shaft_inertia(plant) / self.interval_s * self._torque_unit  # [mm s/rad]
        self._pitch_unit = pitches / torque  # [1/(N m)]

    def command(
        self,
        order: Any,
        shaft_speed: Any,
        shaft_torque: Any,
        slowed: Slowed,
        settings: PilotSettings,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Pitch [-], rack [mm] and new integral [mm], each of shape (n,); arguments stay untouched.

        Args:
            order: ordered ship speed [m/s], shape (n,).
            shaft_speed: measured [rad/s].
            shaft_torque: measured [N m].
            slowed: with these readings taken in.
            settings: in place of the pilot's own.
        """
        aim = np.clip(order + settings.speed_offset, self._speeds[0], self._speeds[-1])
        error = slowed.error + aim - order
        light = slowed.shaft_torque - shaft_torque
        steady = (
            np.interp(aim, self._speeds, self._rack)
            + self._speed_gain * error
            + settings.torque_gain * self._torque_unit * light
            + settings.shaft_gain * self._shaft_unit * (slowed.shaft_speed - shaft_speed)
        )
        lowest, highest = self.limits(shaft_speed)
        rack = steady + slowed.integral
        held = (
            (np.abs(error) > _FAR)
            | ((rack > highest) & (error > 0.0))
            | ((rack < lowest) & (error < 0.0))
        )
        rise = self._speed_gain * self.interval_s / self._reset_s * error
        integral = slowed.integral + np.where(held, 0.0, rise)
        pitch = (
            np.interp(aim, self._speeds, self._pitch)
            + settings.pitch_offset
            + settings.pitch_gain * self._pitch_unit * light
        )
        return pitch, np.clip(rack, lowest, highest), integral

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """The readings as if they had stood for ever, and the integral that the rack's load has taken.

        That is what the rack stands above the curve's at the ship's speed: a takeover without a bump.
        """
        load = seen.fuel_rack - np.interp(seen.ship_speed, self._speeds, self._rack)
        return np.column_stack([_slowed(seen), load])

    def act(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The module's equations with the pilot's own settings."""
        now = _slowed(seen)
        now = np.where(np.isfinite(now), now, memory[:, :3])  # a reading that fails moves nothing
        keep = np.exp(-self.interval_s / np.array([ERROR_S, MEAN_S, MEAN_S]))
        memory[:, :3] = keep * memory[:, :3] + (1.0 - keep) * now
        pitch, rack, memory[:, 3] = self.command(
            seen.speed_order, now[:, 1], now[:, 2], Slowed(*memory.T), self.settings
        )
        return pitch, rack


def _slowed(seen: Readings) -> NDArray[np.float64]:
    """What is to be slowed down, as it is now: the first columns of :class:`Slowed`, shape (n, 3)."""
    error = seen.speed_order - seen.ship_speed
    return np.column_stack([error, seen.shaft_speed, seen.shaft_torque])
