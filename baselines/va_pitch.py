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

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..observers.torque_curve import model_torque
from ..plant.cavitation import effective_attack
from ..plant.hull import wake_inflow
from ..plant.ship import Ship
from .controller import PREVIEW_S, Measurements
from .speed_pilot import NO_WAVE_RESPONSE, PILOT_COLUMNS, SpeedPilot

MEAN_S = 20.0
"""Time constant of the means [s]: two or three wave periods."""

SLOPE_S = 0.5
"""Time constant of the slope of the estimate [s]."""

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
    plant: Record,
    cavitation: bool,
    velocity: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    pitch: NDArray[np.float64],
) -> NDArray[np.float64]:
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
def command_pitches(
    plant: Record,
    cavitation: bool,
    ahead_s: float,
    interval_s: float,
    velocity: NDArray[np.float64],
    change: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    base: NDArray[np.float64],
    share: float,
    memory: NDArray[np.float64],
    pitch: NDArray[np.float64],
) -> None:
    """Fill the pitches for the advance velocity ahead, ship by ship; the memory changes in place.

    Args:
        plant: ship record.
        cavitation: whether the angle of attack is held instead of the torque.
        ahead_s: time of the extrapolation by the slope [s].
        interval_s: control interval [s].
        velocity: present advance velocity [m/s], shape (n,).
        change: known change of the advance velocity until it acts [m/s], shape (n,).
        shaft_speed: [rad/s], shape (n,).
        base: p_0 [-], shape (n,).
        share: g [-].
        memory: controller state, shape (n, 7), changed in place.
        pitch: filled, shape (n,).
    """
    keep, slow = np.exp(-interval_s / SLOPE_S), np.exp(-interval_s / MEAN_S)
    for i in range(len(velocity)):
        row = memory[i]
        rate = (velocity[i] - row[VELOCITY]) / interval_s
        row[SLOPE] = keep * row[SLOPE] + (1.0 - keep) * rate
        row[VELOCITY] = velocity[i]
        now = blade_load(plant, cavitation, velocity[i], shaft_speed[i], base[i])
        row[LOAD_MEAN] = slow * row[LOAD_MEAN] + (1.0 - slow) * now
        ahead = velocity[i] + ahead_s * row[SLOPE] + change[i]
        wanted = pitch_at_load(plant, cavitation, ahead, shaft_speed[i], row[LOAD_MEAN])
        pitch[i] = base[i] + share * (wanted - base[i])


def _interpolate_preview(wave_inflow: NDArray[np.float64], ahead_s: float) -> NDArray[np.float64]:
    """Return the inflow [m/s] at a time ahead, shape (n,), interpolated in :data:`PREVIEW_S`."""
    weights = [np.interp(ahead_s, PREVIEW_S, row) for row in np.eye(len(PREVIEW_S))]
    return np.asarray(wave_inflow @ np.array(weights))


class VaPitch(SpeedPilot):
    """Hold blade torque or angle of attack in waves by the pitch, from the estimated advance velocity.

    Args:
        ship: ship with a diesel and a controllable pitch, or its name.
        interval_s: control interval of the environment [s].
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
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "va-pitch-silent": {"cavitation": True}, "va-pitch-preview": {"preview": True},
    }  # fmt: skip
    base_settings = NO_WAVE_RESPONSE
    needs_variable_pitch = True
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        **SpeedPilot.tunable, "share": (0.0, 1.0), "ahead_s": (0.0, 2.0),
    }  # fmt: skip

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

    def velocity(self, signals: Measurements) -> NDArray[np.float64]:
        """Return the estimated advance velocity [m/s]; without a valid one that of the wake fraction.

        With a preview it is that of the wake fraction plus the inflow of the waves.
        """
        from_log = wake_inflow(self.plant, signals.ship_speed)
        if signals.wave_inflow is not None:
            return np.asarray(from_log + signals.wave_inflow[:, 0])
        valid = (signals.estimate_valid > 0.5) & np.isfinite(signals.advance_velocity)
        return np.where(valid, signals.advance_velocity, from_log)

    def initial_state(self, signals: Measurements) -> NDArray[np.float64]:
        """Return the initial state of the speed pilot, with the present blade load as the mean."""
        velocity = self.velocity(signals)
        base = np.interp(signals.speed_order, self._speeds, self._pitch)
        load = blade_loads(self.plant, self.cavitation, velocity, signals.shaft_speed, base)
        return np.column_stack(
            [super().initial_state(signals), velocity, np.zeros_like(velocity), load]
        )

    def act(
        self, signals: Measurements, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the pitch by the equations of the module and the fuel rack of the speed pilot."""
        base, rack = super().act(signals, memory[:, :PILOT_COLUMNS])
        target, change, ahead_s = np.empty(len(base)), np.zeros(len(base)), self.ahead_s
        if signals.wave_inflow is not None:
            change = _interpolate_preview(signals.wave_inflow, ahead_s) - signals.wave_inflow[:, 0]
            ahead_s = 0.0
        command_pitches(
            self.plant, self.cavitation, ahead_s, self.interval_s, self.velocity(signals), change,
            signals.shaft_speed, base, self.share, memory, target,
        )  # fmt: skip
        pitch = signals.pitch_ratio + (target - signals.pitch_ratio) / self._arrives
        return pitch, rack
