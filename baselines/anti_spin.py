"""Thrust controller of a diesel with torque-loss compensation and anti-spin (Pivano et al. 2008).

The paper, "A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin",
controls an electric motor on a towing carriage. Here the controller drives a diesel and a
controllable-pitch propeller: the engine map converts the commanded torque to a fuel rack.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..observers.records import Floats
from ..plant.drives.diesel import diesel_torque, rack_of_torque, torque_limit
from ..plant.shaft import brake_torque_of, drive_torque, inertia_behind_meter, shaft_inertia
from ..plant.ship import Ship
from ..plant.signals import get_signal
from .combinator import combinator_curve
from .controller import OBSERVED, Commands, Controller, Measurements, Ranges, Variants
from .inflow_schedule import SCHEDULE_COLUMNS, InflowSchedule
from .thrust_control import (
    THRUST_LAW,
    THRUST_LAW_MEMORY,
    Instant,
    ThrustLaw,
    integrate_error,
    torque_demand,
)
from .ventilation import VentilationDetector

ANTI_SPIN = np.dtype(
    [
        ("law", THRUST_LAW),
        ("ventilated_speed", np.float64),  # omega_v,opt over the calm-water speed [-]
        ("least_limit", np.float64),  # lowest omega_v,opt [rad/s]
    ],
    align=True,
)

ANTI_SPIN_MEMORY = np.dtype(
    [
        *THRUST_LAW_MEMORY,
        ("measured", np.float64, (8,)),  # last plausible observation
        ("schedule", np.float64, (SCHEDULE_COLUMNS,)),  # state of the inflow schedule
    ],
    align=True,
)


@compiled
def torque_meter_step(ship: Record, engine_speed: float, rack_before: float, rack: float) -> float:
    """Return the step of the measured shaft torque [N m] when the fuel rack [mm] changes.

    The step is that of the drive torque, times the share of the inertia behind the torque meter. An
    engine with a lag or a dead time, or a slow rack, causes no step.
    """
    if ship.engine_lag > 0.0 or ship.command_dead_time > 0.0 or math.isfinite(ship.rack_rate_limit):
        return 0.0
    before = diesel_torque(ship, engine_speed, rack_before)
    after = diesel_torque(ship, engine_speed, rack)
    shaft_speed = engine_speed / ship.gear_ratio
    rise = drive_torque(ship, after, shaft_speed) - drive_torque(ship, before, shaft_speed)
    return float(rise * inertia_behind_meter(ship) / shaft_inertia(ship))


@compiled
def control(controller: Record, memory: Record, calm_speed: float, thrust: float) -> float:
    """Return the fuel rack command [mm] of one ship at one instant; the memory changes in place.

    It holds the measurements of this instant. The set-points are the shaft speed in calm water at the
    ordered speed [rad/s] and the thrust T_pd of one propeller [N].
    """
    ship, law, seen = controller.law.observer.ship, controller.law, memory.measured  # as OBSERVED
    shaft_speed, shaft_torque, rack_before, ship_speed = seen[1], seen[2], seen[4], seen[5]
    pitch = min(max(seen[3], ship.pitch_ratio_min), ship.pitch_ratio_max)
    in_air = max(controller.ventilated_speed * calm_speed, controller.least_limit)
    now = Instant(thrust, in_air, in_air, shaft_speed, shaft_torque, pitch, ship_speed)
    demand = torque_demand(law, memory, now)

    # Convert the torque to a fuel rack inside the engine envelope.
    brake = brake_torque_of(ship, demand, shaft_speed)
    engine_speed = ship.gear_ratio * shaft_speed
    limit = torque_limit(ship, engine_speed)
    rack = rack_of_torque(ship, engine_speed, min(brake, limit))
    rack = float(clip(rack, ship.drive_min, ship.drive_max))
    starved = brake > limit or rack >= ship.drive_max
    closed = rack <= ship.drive_min
    integrate_error(law, memory, shaft_speed, starved, closed)
    # The torque was measured before this change of fuel, and the observer integrates from after it.
    memory.estimate.measured_torque += torque_meter_step(ship, engine_speed, rack_before, rack)
    return rack


@compiled
def control_all(controller: Record, memories: Any, calm_speed: Any, thrust: Any) -> Floats:
    """Return the fuel rack commands [mm] of n ships; arguments of shape (n,) as of :func:`control`."""
    rack = np.empty(len(memories))
    for i in range(len(memories)):
        rack[i] = control(controller, memories[i], calm_speed[i], thrust[i])
    return rack


BLEND_AT_IDLE = 2.5
"""k omega^p at the idle speed [-]: the blend exp(-2.5) is 0.08 there."""

_BOUNDS = np.array([get_signal(name).high for name in OBSERVED])


@dataclass(frozen=True)
class AntiSpinTuning(ThrustLaw):
    """Parameters of the thrust controller and the limits of the shaft speed of a diesel."""

    ventilated_speed: float = 0.92  # omega_v,opt over the calm-water shaft speed [-]
    top_speed: float = 1.0  # highest desired shaft speed over the engine's highest [-]
    overspeed_only: float = 0.0  # lowest omega_v,opt over sqrt(beta_v,on) of the highest speed [-]

    @classmethod
    def for_ship(cls, ship: Ship) -> Self:
        """Return the tuning of a ship: the detector's blend is 0.08 at the idle speed of its engine.

        Below this speed the torque ratio has no meaning. The frigate idles at 5 rad/s, small ships with
        a geared engine at up to 20 rad/s.

        Example:
            >>> from shaftline.plant import load_ship
            >>> round(AntiSpinTuning.for_ship(load_ship("frigate")).detector.blend_gain, 4)
            0.0204
        """
        detector, plant = VentilationDetector(), ship.record()
        idle = float(plant["engine_speed_min"] / plant["gear_ratio"])
        gain = BLEND_AT_IDLE / idle**detector.blend_power
        return cls(detector=replace(detector, blend_gain=gain))


class AntiSpin(Controller):
    """Hold the thrust of the ordered speed in calm water, and limit the shaft speed in ventilation.

    A measurement that is not finite, or beyond the bounds of the signal registry, is replaced by the
    last plausible one of the same ship, initially by that of the slowest steady state.

    Args:
        ship: ship that moves, with a diesel and a B-series propeller, or its name.
        anti_spin: whether ventilation limits the shaft speed; False for the comparison in the paper.
        tuning: gains and thresholds; :meth:`AntiSpinTuning.for_ship` by default.
        va_weight: weight k of the estimated advance velocity in the nominal torque Q_pn of the detection
            (:mod:`.inflow_schedule`) [-]; 0, as in the paper, for the nominal wake.
        numbers: values of the tuning, its observer or its detector by name, for example
            ``ventilated_speed=0.85, sea_margin=3.0``.

    State: an ANTI_SPIN_MEMORY array of shape (n,), a copy at every call, with the estimates, the
    detection and the references of this instant.

    Raises:
        TypeError: the tuning has no value of that name.
        ValueError: the ship is of another kind, the tuning violates a condition of the paper, or an
            option is out of range.
    """

    name = "anti-spin"
    source = "Pivano et al. 2008"
    variants: ClassVar[Variants] = {
        "no-anti-spin": {"anti_spin": False},
        "anti-spin-overspeed": {"overspeed_only": 1.0},
    }
    tunable: ClassVar[Ranges] = {
        "ventilated_speed": (0.7, 1.0),
        "sea_margin": (0.0, 5.0),
        "proportional_rate": (0.2, 2.0),
        "integral_rate": (0.01, 0.3),
        "cutoff_rad_s": (0.3, 3.0),
        "overspeed_only": (0.0, 1.0),
        "va_weight": (0.0, 1.0),
    }

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        *,
        anti_spin: bool = True,
        tuning: AntiSpinTuning | None = None,
        va_weight: float = 0.0,
        **numbers: float,
    ) -> None:
        super().__init__(ship, interval_s)
        plant = self.plant
        if not self.ship.has_diesel or self.ship.propeller.model != "b-series":
            raise ValueError(
                f"{self.ship.name}: anti-spin needs a diesel and a B-series propeller; for an electric "
                "drive with a torque command use shaftline.baselines.ThrustControl"
            )
        tuning = AntiSpinTuning.for_ship(self.ship) if tuning is None else tuning
        tuning = tuning.with_values(numbers)
        if not (tuning.ventilated_speed > 0.0 and tuning.top_speed > 0.0):
            raise ValueError("anti-spin: ventilated_speed and top_speed must be positive")
        if not 0.0 <= tuning.overspeed_only <= 1.0:
            raise ValueError(
                f"anti-spin: overspeed_only = {tuning.overspeed_only!r}: must be from 0 to 1"
            )
        lowest = plant["engine_speed_min"] / plant["gear_ratio"]
        highest = tuning.top_speed * plant["engine_speed_max"] / plant["gear_ratio"]
        law = tuning.settings(self.ship, interval_s, anti_spin, (lowest, highest))
        # At a constant drive torque a shaft that has lost the share 1 - beta of its load settles at
        # 1 / sqrt(beta) of its speed. Below sqrt(beta_v,on) of the highest speed the loss at which
        # ventilation is detected causes no overspeed, and with overspeed_only = 1 no limit is needed
        # there. A diesel turns ahead only, so the limit is at least its lowest speed.
        least = max(lowest, tuning.overspeed_only * math.sqrt(tuning.detector.on_below) * highest)
        self.settings = np.array((law, tuning.ventilated_speed, least), ANTI_SPIN)[()]
        self.curve = combinator_curve(self.ship)
        self.schedule = InflowSchedule(self.name, plant, interval_s, va_weight)

    def initial_state(self, signals: Measurements) -> NDArray[Any]:
        """Return a zero state with the measurements of the slowest steady state."""
        memory = np.zeros(len(signals.shaft_speed), ANTI_SPIN_MEMORY)
        pitch, speed = self.curve.pitch_ratio[0], self.curve.ship_speed[0]
        memory["measured"] = [speed, self.curve.shaft_speed[0], 0.0, pitch, 0.0, speed, 0.0, 0.0]
        return memory

    def act(self, signals: Measurements, memory: NDArray[Any]) -> Commands:
        """Return the pitch of the combinator curve and the fuel rack of the thrust controller."""
        table = np.column_stack([np.asarray(column) for column in signals[: len(OBSERVED)]])
        memory["measured"] = np.where(np.abs(table) <= _BOUNDS, table, memory["measured"])
        wanted = self.curve.set_points(memory["measured"][:, 0])
        # The nominal inflow at the scaled ship speed is the scheduled one. In ventilation the estimate
        # is wrong, because less torque looks like faster inflow, and the deviation is kept.
        measured = Measurements(*memory["measured"].T)
        updated = self.schedule.update(measured, memory["schedule"])
        ventilating = memory["detection"]["ventilating"][:, None] != 0
        memory["schedule"] = np.where(ventilating, memory["schedule"], updated)
        memory["measured"][:, 5] *= self.schedule.factor(memory["schedule"])
        rack = control_all(self.settings, memory, wanted.shaft_speed, wanted.thrust)
        return wanted.pitch_ratio, rack
