"""Pitch placed for the advance velocity that is about to come: what an observer of it is worth.

    v+    = v + T_p v'                       the estimate, carried on by its own slope
    M*    = mean of M_p(v, w, p_0)            torque mode: what the blades take on average
    p+    : M_p(v+, w, p+) = M*               by inverting KQ
    alpha* = mean of alpha(v, w, p_0)          cavitation mode: their effective angle of attack
    p+    : alpha(v+, w, p+) = alpha*          by inverting its arctangents
    p_d   = p_0 + g (p+ - p_0)
    P_d   = p + (p_d - p) / (1 - exp(-T_c / tau_p))

p_0 is the pitch and the rack is the command of the speed pilot, here without its own answer to waves: so
the rack holds the ship's speed slowly. The means over 20 s are taken at p_0, and there the mean pitch
stays. The last line inverts the actuator's lag: the pitch has arrived when the next command comes. T_p
makes up for the actuator, half a second ahead. g is less than one because the blades cannot follow the
whole of a steep wave: where their rate binds they come late, and what comes late does harm. Without a
valid estimate the wake's share of the log's speed stands in, and the law answers to nothing but the
ship's own speed.
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
from .controller import PREVIEW_S, Readings
from .speed_pilot import SpeedPilot

MEAN_S = 20.0
"""Over which the means are taken [s]: two or three waves."""

SLOPE_S = 0.5
"""Time constant of the estimate's slope [s]."""

_HALVINGS = 30
_LIMITED_SHARE = 0.5
_OWN = 4  # the pilot's columns of the memory, before these
VELOCITY, SLOPE, AIM = range(_OWN, _OWN + 3)
"""Columns of the memory: last estimate [m/s], its slope [m/s2], M* [N m] or alpha* [deg]."""


@compiled
def load_of(
    plant: Record, cavitation: bool, velocity: float, shaft_speed: float, pitch: float
) -> float:
    """What is held: torque of the blades [N m], or their effective angle of attack [deg]."""
    if cavitation:
        return float(effective_attack(plant, velocity, shaft_speed, pitch))
    return model_torque(plant, velocity, shaft_speed, pitch)


@compiled
def loads_of(
    plant: Record,
    cavitation: bool,
    velocity: NDArray[np.float64],
    shaft_speed: NDArray[np.float64],
    pitch: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The same of many ships, each of shape (n,)."""
    found = np.empty(len(velocity))
    for i in range(len(velocity)):
        found[i] = load_of(plant, cavitation, velocity[i], shaft_speed[i], pitch[i])
    return found


@compiled
def pitch_of(
    plant: Record, cavitation: bool, velocity: float, shaft_speed: float, aim: float
) -> float:
    """P/D [-] within its range at which the load is as aimed at; both rise with the pitch."""
    low, high = plant.pitch_ratio_min, plant.pitch_ratio_max
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if load_of(plant, cavitation, velocity, shaft_speed, middle) < aim:
            low = middle
        else:
            high = middle
    return float(0.5 * (low + high))


@compiled
def place_all(
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
    """Pitch for the advance velocity ahead, one ship after the other; memory and pitch are filled.

    Args:
        plant: ship record.
        cavitation: as of :func:`load_of`.
        ahead_s: time by which the slope of the velocity carries it on [s].
        interval_s: control interval [s].
        velocity: now [m/s], shape (n,).
        change: of the velocity until it counts that is known besides [m/s], shape (n,).
        shaft_speed: [rad/s], shape (n,).
        base: P/D of the pilot [-], shape (n,).
        share: g [-].
        memory: shape (n, 7), changed in place.
        pitch: filled, shape (n,).
    """
    keep, slow = np.exp(-interval_s / SLOPE_S), np.exp(-interval_s / MEAN_S)
    for i in range(len(velocity)):
        row = memory[i]
        rate = (velocity[i] - row[VELOCITY]) / interval_s
        row[SLOPE] = keep * row[SLOPE] + (1.0 - keep) * rate
        row[VELOCITY] = velocity[i]
        now = load_of(plant, cavitation, velocity[i], shaft_speed[i], base[i])
        row[AIM] = slow * row[AIM] + (1.0 - slow) * now
        ahead = velocity[i] + ahead_s * row[SLOPE] + change[i]
        wanted = pitch_of(plant, cavitation, ahead, shaft_speed[i], row[AIM])
        pitch[i] = base[i] + share * (wanted - base[i])


def _at(wave_inflow: NDArray[np.float64], ahead_s: float) -> NDArray[np.float64]:
    """Return the inflow [m/s] at a time ahead, shape (n,), between those of :data:`PREVIEW_S`."""
    weights = [np.interp(ahead_s, PREVIEW_S, row) for row in np.eye(len(PREVIEW_S))]
    return np.asarray(wave_inflow @ np.array(weights))


class VaPitch(SpeedPilot):
    """Holds the blades' torque, or their angle of attack, in waves by the pitch; see the module.

    Args:
        ship: a ship with a diesel and a controllable pitch, or its name.
        interval_s: control interval of the environment [s].
        cavitation: hold the angle of attack instead of the torque.
        ahead_s: T_p [s].
        share: g [-], 0 to 1; by default 1, or 0.5 where the blades' rate is limited.
        preview: take the inflow of the waves T_p ahead from a sensor at the bow, in place of the
            estimate and its slope.
        settings: as of :class:`SpeedPilot`, whose gains on torque and shaft speed are 0 here by default.

    State: that of the pilot, and the columns :data:`VELOCITY`, :data:`SLOPE` and :data:`AIM`; shape
    (n, 7).

    Raises:
        ShipError: the ship has no diesel or cannot move.
        TypeError: an unknown setting.
        ValueError: the ship's pitch is fixed, ``ahead_s`` is no time from 0 s on, or ``share`` no share.
    """

    name = "va-pitch"
    source = "shaftline's own"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "va-pitch-silent": {"cavitation": True}, "va-pitch-preview": {"preview": True},
    }  # fmt: skip
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
        calm = {"torque_gain": 0.0, "shaft_gain": 0.0, "pitch_gain": 0.0}
        super().__init__(ship, interval_s, **calm | settings)
        if not self.ship.has_variable_pitch:
            raise ValueError(f"{self.ship.name}: va-pitch needs a controllable pitch")
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

    def velocity(self, seen: Readings) -> NDArray[np.float64]:
        """The estimate [m/s] where it is valid, else what the wake leaves of the log's speed.

        With a preview: the latter, and the inflow of the waves.
        """
        from_log = wake_inflow(self.plant, seen.ship_speed)
        if seen.wave_inflow is not None:
            return np.asarray(from_log + seen.wave_inflow[:, 0])
        valid = (seen.estimate_valid > 0.5) & np.isfinite(seen.advance_velocity)
        return np.where(valid, seen.advance_velocity, from_log)

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """The pilot's memory, and the load of the present as the mean."""
        velocity = self.velocity(seen)
        base = np.interp(seen.speed_order, self._speeds, self._pitch)
        aim = loads_of(self.plant, self.cavitation, velocity, seen.shaft_speed, base)
        return np.column_stack([super().fresh(seen), velocity, np.zeros_like(velocity), aim])

    def act(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The pilot's rack, and the pitch of the module's equations."""
        base, rack = super().act(seen, memory[:, :_OWN])
        target, change, ahead_s = np.empty(len(base)), np.zeros(len(base)), self.ahead_s
        if seen.wave_inflow is not None:
            change = _at(seen.wave_inflow, ahead_s) - seen.wave_inflow[:, 0]
            ahead_s = 0.0
        place_all(
            self.plant, self.cavitation, ahead_s, self.interval_s, self.velocity(seen), change,
            seen.shaft_speed, base, self.share, memory, target,
        )  # fmt: skip
        pitch = seen.pitch_ratio + (target - seen.pitch_ratio) / self._arrives
        return pitch, rack
