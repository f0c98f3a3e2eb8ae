"""The anti-spin controller of a diesel, compiled: from the law's torque to a fuel rack.

Thrust controller with torque-loss compensation and anti-spin (Pivano et al. 2008, section 4).

"A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin", brought
from an electric motor on a towing carriage to a diesel engine and a controllable-pitch propeller: the
motor torque that the law asks for is turned into a fuel rack by the engine's own map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.drives.diesel import diesel_torque, rack_of_torque, torque_limit
from ..plant.shaft import brake_torque_of, drive_torque, inertia_behind_gauge, shaft_inertia
from ..plant.ship import Ship
from ..plant.signals import get_signal
from .combinator import combinator_curve
from .controller import OBSERVED, Controller, Readings
from .thrust_control import (
    THRUST_LAW,
    THRUST_LAW_MEMORY,
    ThrustLaw,
    integrate_error,
    torque_demand,
)

ANTI_SPIN = np.dtype(
    [
        ("law", THRUST_LAW),
        ("ventilated_speed", np.float64),  # omega_v,opt over the calm-water speed [-]
    ],
    align=True,
)

ANTI_SPIN_MEMORY = np.dtype(
    [*THRUST_LAW_MEMORY, ("reading", np.float64, (8,))],  # the last good observation
    align=True,
)


@compiled
def gauge_jump(ship: Record, engine_speed: float, rack_before: float, rack: float) -> float:
    """Step of the gauge's torque [N m] as the fuel changes between two racks [mm].

    The inertia behind the gauge takes its share of the drive torque's step. An engine with a lag or a
    dead time, or a slow rack, makes no step.
    """
    if ship.engine_lag > 0.0 or ship.command_dead_time > 0.0 or math.isfinite(ship.rack_rate_limit):
        return 0.0
    before = diesel_torque(ship, engine_speed, rack_before)
    after = diesel_torque(ship, engine_speed, rack)
    shaft_speed = engine_speed / ship.gear_ratio
    rise = drive_torque(ship, after, shaft_speed) - drive_torque(ship, before, shaft_speed)
    return float(rise * inertia_behind_gauge(ship) / shaft_inertia(ship))


@compiled
def control(
    controller: Record,
    memory: Record,
    calm_speed: float,
    thrust: float,
    shaft_speed: float,
    shaft_torque: float,
    pitch: float,
    ship_speed: float,
    rack_before: float,
) -> float:
    """Fuel rack [mm] for one ship at one instant; the memory changes in place.

    Args:
        controller: ANTI_SPIN record.
        memory: ANTI_SPIN_MEMORY record, all zeros but the reading at the first instant.
        calm_speed: shaft speed of the order in calm water [rad/s].
        thrust: T_pd, of one propeller in calm water [N].
        shaft_speed: omega, measured [rad/s].
        shaft_torque: M_m at the gauge, measured [N m].
        pitch: P/D, measured [-].
        ship_speed: v_s, measured [m/s].
        rack_before: fuel rack in force until now [mm].
    """
    ship = controller.law.observer.ship
    pitch = min(max(pitch, ship.pitch_ratio_min), ship.pitch_ratio_max)
    # an engine turns ahead: a shaft in air is held at the least it can do
    in_air = max(controller.ventilated_speed * calm_speed, controller.law.speed_min)
    demand = torque_demand(
        controller.law, memory, thrust, in_air, in_air, shaft_speed, shaft_torque, pitch, ship_speed
    )

    # through the gearbox to the engine, inside its envelope
    brake = brake_torque_of(ship, demand, shaft_speed)
    engine_speed = ship.gear_ratio * shaft_speed
    limit = torque_limit(ship, engine_speed)
    rack = rack_of_torque(ship, engine_speed, min(brake, limit))
    rack = float(clip(rack, ship.drive_min, ship.drive_max))
    starved = brake > limit or rack >= ship.drive_max
    closed = rack <= ship.drive_min
    integrate_error(controller.law, memory, shaft_speed, starved, closed)
    # the gauge was read before this fuel; what the observer integrates from here on begins after it
    memory.estimate.torque_reading += gauge_jump(ship, engine_speed, rack_before, rack)
    return rack


@compiled
def control_all(
    controller: Record,
    memories: Any,
    calm_speed: Any,
    thrust: Any,
    shaft_speed: Any,
    shaft_torque: Any,
    pitch: Any,
    ship_speed: Any,
    rack_before: Any,
    rack: Any,
) -> None:
    """The same for n ships: memories and every reading of shape (n,); racks go into ``rack`` [mm]."""
    for i in range(len(memories)):
        rack[i] = control(
            controller,
            memories[i],
            calm_speed[i],
            thrust[i],
            shaft_speed[i],
            shaft_torque[i],
            pitch[i],
            ship_speed[i],
            rack_before[i],
        )


_BOUNDS = np.array([get_signal(name).high for name in OBSERVED])


@dataclass(frozen=True)
class AntiSpinTuning(ThrustLaw):
    """The law's numbers and the limits of a diesel's shaft speed."""

    ventilated_speed: float = 0.92  # omega_v,opt over the order's calm-water shaft speed [-]
    top_speed: float = 1.0  # highest desired shaft speed over the engine's highest [-]


class AntiSpin(Controller):
    """Holds the thrust that the order takes in calm water, and the shaft speed where air comes in.

    A reading that is not finite, or beyond the bounds of the signal registry, is replaced by the last
    good one of that ship, at first by that of its slowest steady state.

    Args:
        ship: a moving ship with a diesel engine and a B-series propeller, or its name.
        interval_s: control interval of the environment [s].
        anti_spin: whether ventilation limits the shaft speed; False is the paper's comparison.
        tuning: gains and thresholds.
        numbers: single numbers of the tuning, its observer or its detector by name, for example
            ``ventilated_speed=0.85, sea_margin=3.0``.

    State: an ANTI_SPIN_MEMORY array of shape (n,), new at every call, with the estimates, the detection
    and the references of this instant.

    Raises:
        TypeError: a number that the tuning does not have.
        ValueError: another kind of ship, or tuning that violates a condition of the paper.
    """

    name = "anti-spin"
    source = "Pivano et al. 2008"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"no-anti-spin": {"anti_spin": False}}

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        *,
        anti_spin: bool = True,
        tuning: AntiSpinTuning | None = None,
        **numbers: float,
    ) -> None:
        super().__init__(ship, interval_s)
        tuning = (AntiSpinTuning() if tuning is None else tuning).tuned(numbers)
        plant = self.plant
        if not self.ship.has_diesel or self.ship.propeller.model != "b-series":
            raise ValueError(
                f"{self.ship.name}: anti-spin needs a diesel and a B-series propeller; an electric "
                "drive by torque command takes shaftline.baselines.ThrustControl"
            )
        if not (tuning.ventilated_speed > 0.0 and tuning.top_speed > 0.0):
            raise ValueError("anti-spin: ventilated_speed and top_speed must be positive")
        lowest = plant["engine_speed_min"] / plant["gear_ratio"]
        highest = tuning.top_speed * plant["engine_speed_max"] / plant["gear_ratio"]
        settings = np.zeros(1, ANTI_SPIN)[0]
        settings["law"] = tuning.settings(self.ship, interval_s, anti_spin, (lowest, highest))
        settings["ventilated_speed"] = tuning.ventilated_speed
        self.curve = combinator_curve(self.ship)
        self.settings = settings

    def fresh(self, seen: Readings) -> NDArray[Any]:
        """Nothing but the readings of a slow ship."""
        memory = np.zeros(len(seen.shaft_speed), ANTI_SPIN_MEMORY)
        memory["reading"] = self._slowest()
        return memory

    def act(
        self, seen: Readings, memory: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch of the order, and the rack of the paper's law."""
        table = np.column_stack([np.asarray(column) for column in seen[: len(OBSERVED)]])
        memory["reading"] = np.where(np.abs(table) <= _BOUNDS, table, memory["reading"])
        now = Readings(*memory["reading"].T)
        wanted = self.curve.at(now.speed_order)
        rack = np.empty(len(table))
        control_all(
            self.settings,
            memory,
            wanted.shaft_speed,
            wanted.thrust,
            now.shaft_speed,
            now.shaft_torque,
            now.pitch_ratio,
            now.ship_speed,
            now.fuel_rack,
            rack,
        )
        return wanted.pitch_ratio, rack

    def _slowest(self) -> NDArray[np.float64]:
        """Readings of the slowest steady state, for instruments that have said nothing yet."""
        slowest = float(self.curve.ship_speed[0])
        values = dict.fromkeys(OBSERVED, 0.0)
        values["speed_order"] = values["measured_ship_speed"] = slowest
        values["shaft_speed"] = float(self.curve.shaft_speed[0])
        values["measured_pitch_ratio"] = float(self.curve.pitch_ratio[0])
        return np.array(list(values.values()))
