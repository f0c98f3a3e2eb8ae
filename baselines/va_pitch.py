"""Pitch control by the estimated advance velocity: holds blade torque or angle of attack in waves.

    v+    = v + T_p v'                       advance velocity ahead, from its present slope
    M*    = mean of M_p(v, w, p_0)           torque mode: mean blade torque
    p+    : M_p(v+, w, p+) = M*              by inverting KQ
    alpha* = mean of alpha(v, w, p_0)        cavitation mode: mean effective angle of attack
    p+    : alpha(v+, w, p+) = alpha*        by inverting its arctangents
    p_d   = p_0 + g (p+ - p_0)
    P_d   = p + (p_d - p) / (1 - exp(-T_c / tau_p))

p_0 and the fuel rack are the commands of the speed pilot without its response to waves, so the rack
holds the ship speed slowly. The means over 20 s are taken at p_0, so the mean pitch is p_0. The last
line inverts the lag of the actuator: the pitch reaches p_d at the next command. T_p compensates the lag
of the actuator, about half a second. g is less than one if the pitch rate is limited: in a steep wave
the pitch then lags behind, and a late correction increases the fluctuation. Without a valid estimate
the advance velocity follows from wake fraction and measured ship speed, and there is no response to
waves.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.records import Floats
from ..observers.torque_curve import model_torque
from ..plant.cavitation import effective_attack
from ..plant.hull import wake_inflow
from ..plant.ship import Ship
from .controller import PREVIEW_S, Commands, Measurements, Ranges, Variants
from .speed_pilot import NO_WAVE_RESPONSE, PILOT_COLUMNS, SpeedPilot

MEAN_S = 20.0  # time constant of the means [s]: two or three wave periods
SLOPE_S = 0.5  # time constant of the slope of the estimate [s]
_HALVINGS = 30
_LIMITED_SHARE = 0.5
VELOCITY, SLOPE, LOAD_MEAN = range(PILOT_COLUMNS, PILOT_COLUMNS + 3)
"""Columns of the controller state: last estimate [m/s], its slope [m/s2], M* [N m] or alpha* [deg]."""


@compiled
def blade_load(
    plant: Record, cavitation: bool, velocity: float, shaft_speed: float, pitch: float
) -> float:
    """Return the blade torque [N m], or the effective angle of attack [deg] in cavitation mode."""
    if cavitation:
        return float(effective_attack(plant, velocity, shaft_speed, pitch))
    return model_torque(plant, velocity, shaft_speed, pitch)


@compiled
def blade_loads(
    plant: Record, cavitation: bool, velocity: Floats, shaft_speed: Floats, pitch: Floats
) -> Floats:
    """Return the blade load of n ships, as :func:`blade_load`; each argument of shape (n,)."""
    found = np.empty(len(velocity))
    for i in range(len(velocity)):
        found[i] = blade_load(plant, cavitation, velocity[i], shaft_speed[i], pitch[i])
    return found


@compiled
def pitch_at_load(
    plant: Record, cavitation: bool, velocity: float, shaft_speed: float, load: float
) -> float:
    """Return the P/D [-] within its range at a blade load, which rises with the pitch."""
    low, high = plant.pitch_ratio_min, plant.pitch_ratio_max
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if blade_load(plant, cavitation, velocity, shaft_speed, middle) < load:
            low = middle
        else:
            high = middle
    return float(0.5 * (low + high))


@compiled
def pitches_at_load(
    plant: Record, cavitation: bool, velocity: Floats, shaft_speed: Floats, load: Floats
) -> Floats:
    """Return the pitches of n ships, as :func:`pitch_at_load`; each argument of shape (n,)."""
    found = np.empty(len(velocity))
    for i in range(len(velocity)):
        found[i] = pitch_at_load(plant, cavitation, velocity[i], shaft_speed[i], load[i])
    return found


def _interpolate_preview(wave_inflow: Floats, ahead_s: float) -> Floats:
    """Return the inflow [m/s] at a time ahead, shape (n,), interpolated in :data:`PREVIEW_S`."""
    weights = [np.interp(ahead_s, PREVIEW_S, row) for row in np.eye(len(PREVIEW_S))]
    return np.asarray(wave_inflow @ np.array(weights))


class VaPitch(SpeedPilot):
    """Hold blade torque or angle of attack in waves by the pitch, from the estimated advance velocity.

    Args:
        ship: ship with a diesel and a controllable pitch, or its name.
        cavitation: hold the angle of attack instead of the torque.
        ahead_s: T_p [s].
        share: g [-], 0 to 1; by default 1, or 0.5 if the pitch rate is limited.
        preview: use the inflow of the waves T_p ahead from a sensor at the bow, in place of the estimate
            and its slope.
        settings: settings of :class:`SpeedPilot`; its gains on torque and shaft speed are 0 by default.

    State: columns of the speed pilot, then :data:`VELOCITY`, :data:`SLOPE` and :data:`LOAD_MEAN`; shape
    (n, 7).

    Raises:
        ShipError: the ship has no diesel or cannot move.
        TypeError: a setting is unknown.
        ValueError: the pitch is fixed, or an option is out of range.
    """

    name = "va-pitch"
    source = "shaftline's own"
    variants: ClassVar[Variants] = {
        "va-pitch-silent": {"cavitation": True},
        "va-pitch-preview": {"preview": True},
    }
    base_settings = NO_WAVE_RESPONSE
    needs_variable_pitch = True
    tunable: ClassVar[Ranges] = {**SpeedPilot.tunable, "share": (0.0, 1.0), "ahead_s": (0.0, 2.0)}

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        *,
        cavitation: bool = False,
        ahead_s: float = 0.5,
        share: float | None = None,
        preview: bool = False,
        **settings: float,
    ) -> None:
        super().__init__(ship, interval_s, **settings)
        if not (np.isfinite(ahead_s) and ahead_s >= 0.0):
            raise ValueError(f"va-pitch: ahead_s = {ahead_s!r} s: must be 0 or more")
        if share is None:
            share = _LIMITED_SHARE if np.isfinite(self.plant["pitch_rate_limit"]) else 1.0
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"va-pitch: share = {share!r}: must be from 0 to 1")
        self.cavitation, self.ahead_s, self.share = bool(cavitation), ahead_s, share
        self.preview = bool(preview)
        lag = self.ship.pitch_actuator.time_constant_s
        self._arrives = 1.0 - float(np.exp(-interval_s / lag))

    def velocity(self, signals: Measurements) -> Floats:
        """Return the estimated advance velocity [m/s]; without a valid one that of the wake fraction.

        With a preview it is that of the wake fraction plus the inflow of the waves.
        """
        from_log = wake_inflow(self.plant, signals.ship_speed)
        if signals.wave_inflow is not None:
            return np.asarray(from_log + signals.wave_inflow[:, 0])
        valid = (signals.estimate_valid > 0.5) & np.isfinite(signals.advance_velocity)
        return np.where(valid, signals.advance_velocity, from_log)

    def initial_state(self, signals: Measurements) -> Floats:
        """Return the initial state of the speed pilot, with the present blade load as the mean."""
        velocity = self.velocity(signals)
        base = np.interp(signals.speed_order, self._speeds, self._pitch)
        load = blade_loads(self.plant, self.cavitation, velocity, signals.shaft_speed, base)
        return np.column_stack(
            [super().initial_state(signals), velocity, np.zeros_like(velocity), load]
        )

    def act(self, signals: Measurements, memory: Floats) -> Commands:
        """Return the pitch by the equations of the module and the fuel rack of the speed pilot."""
        base, rack = super().act(signals, memory[:, :PILOT_COLUMNS])
        last, slope, mean = memory[:, [VELOCITY, SLOPE, LOAD_MEAN]].T
        velocity, speed = self.velocity(signals), signals.shaft_speed
        keep, slow = (math.exp(-self.interval_s / time) for time in (SLOPE_S, MEAN_S))
        slope = keep * slope + (1.0 - keep) * ((velocity - last) / self.interval_s)
        now = blade_loads(self.plant, self.cavitation, velocity, speed, base)
        mean = slow * mean + (1.0 - slow) * now
        memory[:, PILOT_COLUMNS:] = np.column_stack([velocity, slope, mean])
        change = self.ahead_s * slope
        if (waves := signals.wave_inflow) is not None:
            change = _interpolate_preview(waves, self.ahead_s) - waves[:, 0]
        wanted = pitches_at_load(self.plant, self.cavitation, velocity + change, speed, mean)
        target = base + self.share * (wanted - base)
        pitch = signals.pitch_ratio + (target - signals.pitch_ratio) / self._arrives
        return pitch, rack
