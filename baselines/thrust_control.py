"""Four-quadrant thrust controller of an electric drive (Pivano et al. 2008, section 4).

"A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin", as it was
written: the drive gives the torque that it is told, the pitch is fixed, the shaft turns either way.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from .thrust_law import ThrustLaw
from .thrust_law_kernel import THRUST_LAW, THRUST_LAW_MEMORY, integrate_error, torque_demand
from .torque_loss import TorqueLossObserver
from .ventilation_detection import VentilationDetector

THRUST_CONTROL = np.dtype(
    [
        ("law", THRUST_LAW),
        ("ventilated_ahead", np.float64),  # omega_v,opt [rad/s]
        ("ventilated_astern", np.float64),  # of a shaft that turns astern, positive [rad/s]
        ("pitch_ratio", np.float64),  # [-]
    ],
    align=True,
)

THRUST_CONTROL_MEMORY = np.dtype(
    [
        *THRUST_LAW_MEMORY,
        ("command", np.float64),  # torque of the drive until now [N m]
        ("shaft_speed", np.float64),  # last good readings [rad/s]
        ("water_speed", np.float64),  # [m/s]
    ],
    align=True,
)


@dataclass(frozen=True)
class ThrustControlTuning(ThrustLaw):
    """The law's numbers for a rig with a propeller of 0.25 m, and the limits of its shaft speed.

    The limits are the paper's; it prints nothing else.
    """

    gamma: float = 0.5
    proportional_rate: float = 10.0
    integral_rate: float = 10.0
    cutoff_rad_s: float = 20.0
    observer: TorqueLossObserver = field(
        default_factory=lambda: TorqueLossObserver(40.0, -400.0, 10.0)
    )
    detector: VentilationDetector = field(
        default_factory=lambda: VentilationDetector(0.02, 1.5, 0.6, 0.8, 0.8)
    )
    ventilated_ahead_rad_s: float = 45.0  # omega_v,opt; printed
    ventilated_astern_rad_s: float = 54.0  # printed
    top_speed_rad_s: float = 75.0  # highest desired shaft speed, either way; printed


@compiled
def command_torque(
    controller: Record, memory: Record, thrust: float, shaft_speed: float, water_speed: float
) -> float:
    """Torque [N m] to tell the drive of one propeller at one instant; the memory changes in place.

    Args:
        controller: THRUST_CONTROL record.
        memory: THRUST_CONTROL_MEMORY record, all zeros at the first instant.
        thrust: T_pd [N], negative astern.
        shaft_speed: omega, measured [rad/s].
        water_speed: of ship or carriage through the water [m/s].
    """
    law = controller.law
    ship = law.observer.ship
    if np.isfinite(shaft_speed):
        memory.shaft_speed = shaft_speed
    if np.isfinite(water_speed):
        memory.water_speed = water_speed
    shaft_speed = memory.shaft_speed
    through = ship.gear_ratio * ship.transmission_efficiency
    demand = torque_demand(
        law,
        memory,
        thrust,
        controller.ventilated_ahead,
        controller.ventilated_astern,
        shaft_speed,
        through * memory.command,
        controller.pitch_ratio,
        memory.water_speed,
    )
    command = float(clip(demand / through, ship.drive_min, ship.drive_max))
    integrate_error(law, memory, shaft_speed, command >= ship.drive_max, command <= ship.drive_min)
    memory.command = command
    # the drive obeys at once: what the observer integrates from here on begins with this torque
    memory.estimate.torque_reading = through * command
    return command


@compiled
def _command_all(
    controller: Record, memories: Any, thrust: Any, shaft_speed: Any, water_speed: Any, found: Any
) -> None:
    for i in range(len(memories)):
        found[i] = command_torque(
            controller, memories[i], thrust[i], shaft_speed[i], water_speed[i]
        )


class ThrustControl:
    """Holds an ordered thrust, ahead or astern, and the shaft speed where air comes in.

    It needs the shaft speed and the speed through the water; the torque is the one it has told. A
    reading that is not finite is replaced by the last good one.

    Args:
        ship: with a drive that gives the torque that it is told, or its name. With four-quadrant curves
            the shaft turns either way, with others ahead only.
        interval_s: control interval [s]; the ship's time step by default.
        anti_spin: whether ventilation limits the shaft speed; False is the paper's comparison.
        tuning: gains and thresholds.
        numbers: single numbers of the tuning, its observer or its detector by name, for example
            ``ventilated_ahead_rad_s=40.0``.

    Raises:
        TypeError: a number that the tuning does not have.
        ValueError: another drive, a pitch that can be controlled, or tuning that violates a condition of
            the paper.
    """

    source = "Pivano et al. 2008"

    def __init__(
        self,
        ship: str | Ship = "towing-tank",
        interval_s: float | None = None,
        *,
        anti_spin: bool = True,
        tuning: ThrustControlTuning | None = None,
        **numbers: float,
    ) -> None:
        self.ship = load_ship(ship)
        self.interval_s = self.ship.time_step_s if interval_s is None else interval_s
        tuning = (ThrustControlTuning() if tuning is None else tuning).tuned(numbers)
        propeller = self.ship.propeller
        if not (self.ship.prime_mover.gives_torque and self.ship.has_propeller):
            raise ValueError(
                f"{self.ship.name}: thrust control needs a propeller and a drive that gives the torque "
                f"that it is told, not {self.ship.prime_mover.type!r}"
            )
        if propeller.pitch_ratio_min != propeller.pitch_ratio_max:
            raise ValueError(
                f"{self.ship.name}: thrust control needs a fixed pitch, propeller.pitch_ratio_min = "
                "pitch_ratio_max"
            )
        limits = (
            tuning.ventilated_ahead_rad_s,
            tuning.ventilated_astern_rad_s,
            tuning.top_speed_rad_s,
        )
        if not min(limits) > 0.0:
            raise ValueError(
                "thrust control: ventilated_ahead_rad_s, ventilated_astern_rad_s and top_speed_rad_s "
                "must be positive"
            )
        lowest = -tuning.top_speed_rad_s if propeller.model == "four-quadrant" else 0.0
        settings = np.zeros(1, THRUST_CONTROL)[0]
        settings["law"] = tuning.settings(
            self.ship, self.interval_s, anti_spin, (lowest, tuning.top_speed_rad_s)
        )
        settings["ventilated_ahead"] = tuning.ventilated_ahead_rad_s
        settings["ventilated_astern"] = tuning.ventilated_astern_rad_s
        settings["pitch_ratio"] = propeller.pitch_ratio_max
        self.tuning = tuning
        self.settings = settings

    def fresh(self, ships: int = 1) -> NDArray[Any]:
        """Memory of so many propellers that have seen nothing, shape (ships,)."""
        return np.zeros(ships, THRUST_CONTROL_MEMORY)

    def act(
        self,
        thrust: ArrayLike,
        shaft_speed: ArrayLike,
        water_speed: ArrayLike,
        memory: NDArray[Any],
    ) -> NDArray[np.float64]:
        """Torques to tell the drives [N m], shape (n,).

        Args:
            thrust: ordered [N], shape (n,) or one for all.
            shaft_speed: omega, measured [rad/s], likewise.
            water_speed: of ship or carriage through the water [m/s], likewise.
            memory: of :meth:`fresh`, shape (n,); changed in place.

        Raises:
            ValueError: an order that is not finite.
        """
        order, turned, water = (
            np.array(np.broadcast_to(np.asarray(x, np.float64), memory.shape), order="C")
            for x in (thrust, shaft_speed, water_speed)
        )
        if not np.all(np.isfinite(order)):
            raise ValueError("thrust control: the ordered thrust [N] must be finite")
        found = np.empty(len(memory))
        _command_all(self.settings, memory, order, turned, water, found)
        return found
