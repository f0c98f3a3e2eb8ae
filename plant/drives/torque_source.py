"""Drive that delivers the commanded torque."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..keys import parameter
from ..signals import Signal
from .prime_mover import (
    COMMAND_DELAY,
    COMMAND_LAG,
    DRIVE_EFFICIENCY,
    IDLE_POWER,
    TORQUE_OFFSET,
    PrimeMover,
    end_stops,
)


class TorqueSource(PrimeMover):
    """Drive that delivers the commanded torque."""

    type: Literal["torque-command"] = Field(description="kind of drive")

    code, balance, gives_torque, electric = 2, "motor", True, True
    demand = Signal(
        "motor_torque_demand",
        "M_d",
        "N m",
        -1e8,
        1e8,
        "demand",
        "motor_torque_N_m",
        "torque command to the drive",
    )
    validity = (end_stops("motor torque command", "N m"),)
    steady_keys = (
        "transmission.coulomb_friction_engine_side_N_m",
        "transmission.viscous_friction_engine_side_N_m_s_rad",
        "propeller.torque_coefficient",
    )
    response_keys = (*steady_keys, "transmission.inertia_engine_side_kg_m2")

    torque_max_N_m: float = parameter("torque limit", "N m", record="drive_max", gt=0, le=1e8)
    torque_offset_N_m: float = TORQUE_OFFSET
    drive_efficiency: float = DRIVE_EFFICIENCY
    idle_power_W: float = IDLE_POWER
    command_delay_s: float = COMMAND_DELAY
    command_lag_s: float = COMMAND_LAG
