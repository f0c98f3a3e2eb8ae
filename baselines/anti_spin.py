"""Thrust controller with torque-loss compensation and anti-spin (Pivano et al. 2008, section 4).

"A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin", brought
from an electric motor on a towing carriage to a diesel engine and a controllable-pitch propeller: the
motor torque that the law asks for is turned into a fuel rack by the engine's own map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from ..plant.signals import get_signal
from .anti_spin_kernel import ANTI_SPIN, ANTI_SPIN_MEMORY, control_all
from .combinator import combinator_curve
from .controller import OBSERVED, Controller, Readings
from .thrust_law import ThrustLaw

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
