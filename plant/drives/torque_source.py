"""Drive that delivers the torque that it is told."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from ...core.compiled import Real, Record, compiled
from ..keys import number
from ..signals import Signal
from ..validity import Validity
from .prime_mover import (
    PrimeMover,
    command_delay,
    command_lag,
    drive_efficiency,
    end_stops,
    fill_two_way,
    idle_power,
    torque_offset,
    with_offset,
)


class TorqueSource(PrimeMover):
    """Drive that delivers the torque that it is told."""

    type: Literal["torque-command"] = Field(description="kind of drive")

    code: ClassVar[int] = 2
    balance: ClassVar[str] = "motor"
    gives_torque: ClassVar[bool] = True
    electric: ClassVar[bool] = True
    demand: ClassVar[Signal] = Signal(
        "motor_torque_demand", "M_d", "N m", -1e8, 1e8, "demand", "motor_torque_N_m",
        "torque demanded of the drive",
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

    torque_max_N_m: float = number("torque limit", "N m", record="drive_max", gt=0, le=1e8)
    torque_offset_N_m: float = torque_offset()
    drive_efficiency: float = drive_efficiency()
    idle_power_W: float = idle_power()
    command_delay_s: float = command_delay()
    command_lag_s: float = command_lag()

    @property
    def delays(self) -> dict[str, float]:
        """Return the dead time of the command [s], by its key."""
        return {"prime_mover.command_delay_s": self.command_delay_s}

    def fill(self, record: Any) -> None:
        """Its numbers; demands go either way, and have no rack."""
        super().fill(record)
        fill_two_way(record)


@compiled
def source_torque(plant: Record, demand: Real) -> Real:
    """Torque [N m] that is delivered for a demand [N m] inside the limits."""
    return with_offset(plant, demand)
