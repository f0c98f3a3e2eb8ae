"""Drive that holds the shaft speed at its command, as on a test rig or with a measured speed."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from ...core.compiled import Real, Record, compiled
from ..keys import parameter
from ..shaft import shaft_inertia
from ..signals import Signal
from .prime_mover import DRIVE_EFFICIENCY, IDLE_POWER, PrimeMover


class SpeedSource(PrimeMover):
    """Drive that holds the speed of the propeller shaft at its command; its torque is not modelled."""

    type: Literal["speed-command"] = Field(description="kind of drive")

    code, balance, holds_speed, electric = 3, "", True, True
    demand = Signal(
        "shaft_speed",
        "omega",
        "rad/s",
        -1e4,
        1e4,
        "demand",
        "shaft_speed_rad_s",
        "speed at which the propeller shaft is held",
    )
    derived = (("speed_held", np.int64),)

    speed_max_rad_s: float = parameter(
        "highest speed of the propeller shaft, in either direction",
        "rad/s",
        record="drive_max",
        gt=0,
        le=1e4,
    )
    drive_efficiency: float = DRIVE_EFFICIENCY
    idle_power_W: float = IDLE_POWER

    def fill(self, record: Any) -> None:
        """Write the parameters, and that the speed is held."""
        super().fill(record)
        record["speed_held"] = 1


def held_speed_source(most: float) -> SpeedSource:
    """Return a drive that holds the shaft at up to some speed [rad/s], in either direction."""
    return SpeedSource(type="speed-command", speed_max_rad_s=most)


@compiled
def holding_torque(plant: Record, load_torque: Real, shaft_acceleration: Real) -> Real:
    """Return the torque [N m] that carries a load [N m] and gives a shaft acceleration [rad/s2]."""
    return load_torque + shaft_inertia(plant) * shaft_acceleration
