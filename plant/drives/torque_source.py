"""Drive that delivers the commanded torque."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from ...core.compiled import Real, Record, compiled
from ..keys import parameter
from ..signals import Signal
from ..validity import Validity
from .prime_mover import (
    PrimeMover,
    add_torque_offset,
    command_delay,
    command_lag,
    drive_efficiency,
    end_stops,
    fill_symmetric_limits,
    idle_power,
    torque_offset,
)


class TorqueSource(PrimeMover):
    """Drive that delivers the commanded torque."""

    type: Literal["torque-command"] = Field(description="kind of drive")

    code: ClassVar[int] = 2
    balance: ClassVar[str] = "motor"
    gives_torque: ClassVar[bool] = True
    electric: ClassVar[bool] = True
    demand: ClassVar[Signal] = Signal(
        "motor_torque_demand", "M_d", "N m", -1e8, 1e8, "demand", "motor_torque_N_m",
        "torque command to the drive",
    )  # fmt: skip
    validity: ClassVar[tuple[Validity, ...]] = (end_stops("motor torque command", "N m"),)
    steady_keys: ClassVar[tuple[str, ...]] = (
        "transmission.coulomb_friction_engine_side_N_m",
        "transmission.viscous_friction_engine_side_N_m_s_rad",
        "propeller.torque_coefficient",
    )
    response_keys: ClassVar[tuple[str, ...]] = (
        *steady_keys, "transmission.inertia_engine_side_kg_m2",
    )  # fmt: skip

    torque_max_N_m: float = parameter("torque limit", "N m", record="drive_max", gt=0, le=1e8)
    torque_offset_N_m: float = torque_offset()
    drive_efficiency: float = drive_efficiency()
    idle_power_W: float = idle_power()
    command_delay_s: float = command_delay()
    command_lag_s: float = command_lag()

    @property
    def delays(self) -> dict[str, float]:
        """Dead time of the command [s], by its key."""
        return {"prime_mover.command_delay_s": self.command_delay_s}

    def fill(self, record: Any) -> None:
        """Write the parameters; commands go in both directions, without a rack."""
        super().fill(record)
        fill_symmetric_limits(record)


@compiled
def source_torque(plant: Record, demand: Real) -> Real:
    """Return the torque [N m] for a command [N m] inside the limits."""
    return add_torque_offset(plant, demand)
