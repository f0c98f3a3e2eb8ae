"""Speed pilot: holds the ship speed by the fuel rack and reduces the torque fluctuation in waves.

    v_set = v_order + v_offset, within the speeds of the combinator curve
    rack  = X(v_set) + k_v e + I + k_M (M_s - M) + k_w (w_s - w),     X_min(w) to X_max(w)
    pitch = P(v_set) + P_offset + k_P (M_s - M)
    I'    = g k_v e / T,   e = v_set - v

X and P are rack and pitch of the combinator curve in calm water; v is the measured ship speed, filtered
over 2 s; M and w are torque and speed of the shaft, M_s and w_s their means over 8 s. X_max is the
torque limiter of the governor, which falls above the highest shaft speed; X_min rises below the lowest
shaft speed to prevent a stall. A combinator holds the shaft speed instead, so its ship speed differs
from the order wherever the resistance is not that of calm water. T is the time constant of the ship m /
(2 c v), which the integral cancels (as in lambda tuning, Astrom & Hagglund 2006, section 6.5). The
integral is held while the error is large, as after a new order, or while the error moves the rack
further against a limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..observers.records import Floats
from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from .combinator import combinator_curve
from .controller import Commands, Controller, Measurements, Ranges
from .governor import rack_limits
from .steady_points import steady_point

ERROR_S, MEAN_S = 2.0, 8.0  # filters of speed error and means [s]: below and about a wave period
_FAR = 0.5  # largest speed error that is integrated [m/s]
_LIMITER_GAIN = 0.8  # shaft gain of the rack limits outside the allowed shaft speeds [-]
_LIMITER_POINTS = 101


class PilotSettings(NamedTuple):
    """Settings of the speed pilot, each one number for all ships of a batch or of shape (n,).

    Gains are relative to properties of the ship, so that the same values suit every ship.
    """

    speed_offset: Any = 0.0  # added to the speed order [m/s]
    pitch_offset: Any = 0.0  # added to the P/D of the curve [-]
    torque_gain: Any = 1.0  # share of a torque deviation that the rack corrects [-]
    shaft_gain: Any = 0.15  # share of a speed deviation, corrected in one control interval [-]
    pitch_gain: Any = 0.7  # k_P times highest shaft torque over pitch range [-]


NO_WAVE_RESPONSE = {"torque_gain": 0.0, "shaft_gain": 0.0, "pitch_gain": 0.0}  # settings


class FilteredSignals(NamedTuple):
    """Filtered signals and integral of a speed pilot, each of shape (n,)."""

    error: Floats  # order minus measured ship speed, over ERROR_S [m/s]
    shaft_speed: Floats  # mean over MEAN_S [rad/s]
    shaft_torque: Floats  # mean over MEAN_S [N m]
    integral: Floats  # [mm]


PILOT_COLUMNS = len(FilteredSignals._fields)  # of the controller state of a speed pilot


class SpeedPilot(Controller):
    """Hold the ordered ship speed by the fuel rack and reduce the torque fluctuation in waves.

    Args:
        speed_gain: k_v over the mean slope of the rack of the curve by ship speed [-].
        integral_gain: g; above 1 for a faster correction of the ship speed [-].
        settings: fields of :class:`PilotSettings`.

    State: columns of :class:`FilteredSignals`, shape (n, 4).

    Raises:
        ShipError: the ship has no diesel or cannot move.
        TypeError: a setting is unknown.
        ValueError: the pitch is fixed, and the controller needs a controllable pitch.

    Example:
        >>> pilot = SpeedPilot("frigate", torque_gain=0.5)
        >>> action, state = pilot.predict([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.9, 7.1, 1.0])
        >>> state.shape
        (1, 4)
    """

    name = "speed-pilot"
    source = "shaftline's own"
    base_settings: ClassVar[Mapping[str, float]] = {}  # other defaults of the settings
    needs_variable_pitch: ClassVar[bool] = False  # whether a fixed pitch is refused
    tunable: ClassVar[Ranges] = {
        "speed_gain": (0.25, 16.0),
        "integral_gain": (0.25, 4.0),
        "speed_offset": (-0.3, 0.3),
        "pitch_offset": (-0.3, 0.15),
        "torque_gain": (0.0, 1.2),
        "shaft_gain": (0.0, 0.6),
        "pitch_gain": (0.0, 1.4),
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        speed_gain: float = 2.0,
        integral_gain: float = 1.0,
        **settings: float,
    ) -> None:
        super().__init__(ship, interval_s)
        if self.needs_variable_pitch and not self.ship.has_variable_pitch:
            raise ValueError(
                f"{self.ship.name}: {self.name} needs a controllable pitch, but "
                "propeller.pitch_ratio_min equals pitch_ratio_max"
            )
        self.settings = PilotSettings(**{**self.base_settings, **settings})
        curve = combinator_curve(self.ship)
        self._speeds, self._pitch = curve.ship_speed, curve.pitch_ratio
        points = zip(curve.shaft_speed.tolist(), curve.pitch_ratio.tolist(), strict=True)
        self._rack = np.array([steady_point(self.ship, n, p).fuel_rack for n, p in points])
        slope = (self._rack[-1] - self._rack[0]) / (self._speeds[-1] - self._speeds[0])
        self._speed_gain = speed_gain * float(slope)  # [mm s/m]
        hull = self.ship.hull
        slope_at = hull.resistance_slope(float(np.mean(self._speeds)))
        self._reset_s = hull.mass_kg / slope_at / integral_gain
        # Units of the gains for this ship.
        plant, mover = self.plant, self.ship.diesel
        down = float(plant["gear_ratio"]) * self.ship.transmission.efficiency
        pitches = float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"])
        self._torque_unit = 1.0 / (mover.torque_per_rack_N_m_mm * down)  # [mm/(N m)]
        self._shaft_unit = shaft_inertia(plant) / interval_s * self._torque_unit  # [mm s/rad]
        self._pitch_unit = pitches / (mover.torque_limit_N_m * down)  # [1/(N m)]
        low, high = self.ship.shaft_speeds
        self._speed_grid = np.linspace(0.5 * low, 1.2 * high, _LIMITER_POINTS)
        slope = _LIMITER_GAIN * self._shaft_unit
        limits = [rack_limits(plant, speed, slope) for speed in self._speed_grid.tolist()]
        self._least, self._most = np.array(limits).T

    def limits(self, shaft_speed: Any) -> tuple[Floats, Floats]:
        """Return the lowest and highest fuel rack command [mm] at shaft speeds [rad/s]."""
        least = np.interp(shaft_speed, self._speed_grid, self._least)
        return least, np.interp(shaft_speed, self._speed_grid, self._most)

    def command(
        self,
        order: Any,
        shaft_speed: Any,
        shaft_torque: Any,
        filtered: FilteredSignals,
        settings: PilotSettings,
    ) -> tuple[Floats, Floats, Floats]:
        """Return pitch [-], fuel rack [mm] and new integral [mm], each of shape (n,).

        Args:
            order: ordered ship speed [m/s], shape (n,).
            shaft_speed: measured shaft speed [rad/s].
            shaft_torque: measured shaft torque [N m].
            filtered: filtered signals that include these measurements; not changed.
            settings: settings to use in place of those of the pilot.
        """
        set_point = np.clip(order + settings.speed_offset, self._speeds[0], self._speeds[-1])
        error = filtered.error + set_point - order
        light = filtered.shaft_torque - shaft_torque
        rack = np.interp(set_point, self._speeds, self._rack) + self._speed_gain * error
        rack = rack + settings.torque_gain * self._torque_unit * light
        slow = filtered.shaft_speed - shaft_speed
        rack = rack + settings.shaft_gain * self._shaft_unit * slow + filtered.integral
        lowest, highest = self.limits(shaft_speed)
        blocked = ((rack > highest) & (error > 0.0)) | ((rack < lowest) & (error < 0.0))
        held = (np.abs(error) > _FAR) | blocked
        rise = self._speed_gain * self.interval_s / self._reset_s * error
        integral = filtered.integral + np.where(held, 0.0, rise)
        pitch = np.interp(set_point, self._speeds, self._pitch) + settings.pitch_offset
        pitch = pitch + settings.pitch_gain * self._pitch_unit * light
        return pitch, np.clip(rack, lowest, highest), integral

    def initial_state(self, signals: Measurements) -> Floats:
        """Return filters in steady state at the measurements, and an integral for a bumpless start.

        The integral is the difference of the fuel rack and that of the curve at the present ship speed.
        """
        load = signals.fuel_rack - np.interp(signals.ship_speed, self._speeds, self._rack)
        return np.column_stack([_unfiltered(signals), load])

    def act(self, signals: Measurements, memory: Floats) -> Commands:
        """Return pitch and fuel rack by the equations of the module with the settings of the pilot."""
        now = _unfiltered(signals)
        # The filtered value is kept if a measurement fails.
        now = np.where(np.isfinite(now), now, memory[:, :3])
        keep = np.exp(-self.interval_s / np.array([ERROR_S, MEAN_S, MEAN_S]))
        memory[:, :3] = keep * memory[:, :3] + (1.0 - keep) * now
        pitch, rack, memory[:, 3] = self.command(
            signals.speed_order, now[:, 1], now[:, 2], FilteredSignals(*memory.T), self.settings
        )
        return pitch, rack


def _unfiltered(signals: Measurements) -> Floats:
    """Return the present values of the first columns of :class:`FilteredSignals`, shape (n, 3)."""
    error = signals.speed_order - signals.ship_speed
    return np.column_stack([error, signals.shaft_speed, signals.shaft_torque])
