"""Drive whose speed a rig holds, or that was measured: the shaft turns as told, whatever that takes."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...core.compiled import Real, Record, compiled
from ..keys import number
from ..shaft import shaft_inertia
from ..signals import Signal
from .prime_mover import PrimeMover, drive_efficiency, fill_two_way, idle_power


class SpeedSource(PrimeMover):
    """Drive that holds the propeller shaft at the speed that it is told; its torque is not modelled."""

    type: Literal["speed-command"] = Field(description="kind of drive")

    code: ClassVar[int] = 3
    balance: ClassVar[str] = ""
    holds_speed: ClassVar[bool] = True
    electric: ClassVar[bool] = True
    demand: ClassVar[Signal] = Signal(
        "shaft_speed", "omega", "rad/s", -1e4, 1e4, "demand", "shaft_speed_rad_s",
        "speed at which the propeller shaft is held",
    )  # fmt: skip
    derived: ClassVar[tuple[tuple[Any, ...], ...]] = (("speed_held", np.int64),)

    speed_max_rad_s: float = number(
        "highest speed of the propeller shaft, either way", "rad/s", record="drive_max",
        gt=0, le=1e4,
    )  # fmt: skip
    drive_efficiency: float = drive_efficiency()
    idle_power_W: float = idle_power()

    def fill(self, record: Any) -> None:
        """Its numbers; speeds go either way, and have no rack."""
        super().fill(record)
        fill_two_way(record)
        record["speed_held"] = 1


def speed_held(most: float) -> SpeedSource:
    """Return a drive that holds the shaft at up to some speed [rad/s], either way."""
    return SpeedSource(type="speed-command", speed_max_rad_s=most)


@compiled
def holding_torque(plant: Record, load_torque: Real, shaft_acceleration: Real) -> Real:
    """Torque [N m] on the shaft that carries its load [N m] and accelerates it as told [rad/s2]."""
    return load_torque + shaft_inertia(plant) * shaft_acceleration
