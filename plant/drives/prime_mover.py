"""Base class of the prime movers, and the parameters and equations that electric drives share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ...core.compiled import Real, Record, compiled
from ..keys import INF, Section, effect, parameter
from ..signals import Signal
from ..validity import Validity


class PrimeMover(Section):
    """Prime mover: section of a ship file."""

    code: ClassVar[int]
    """Code in ``plant.prime_mover``."""
    balance: ClassVar[str]
    """Balance of its effects: ``engine`` or ``motor``; empty if the drive holds the speed."""
    holds_speed: ClassVar[bool] = False
    """Whether the shaft speed is its command; the balance of the shaft is then not simulated."""
    gives_torque: ClassVar[bool] = False
    """Whether its command is a torque."""
    electric: ClassVar[bool] = False
    """Whether it takes electric power, which a recording may contain."""
    demand: ClassVar[Signal]
    """Command signal."""
    steady_keys: ClassVar[tuple[str, ...]] = ()
    """Dotted keys that steady states identify by default."""
    response_keys: ClassVar[tuple[str, ...]] = ()
    """Dotted keys that a frequency response identifies by default."""

    @property
    def delays(self) -> dict[str, float]:
        """Dead times [s] by dotted key; each needs a delay line."""
        keys = [key for key in ("dead_time_s", "command_delay_s") if key in type(self).model_fields]
        return {f"prime_mover.{key}": float(getattr(self, key)) for key in keys}

    @property
    def damping(self) -> float:
        """Slope of the torque that opposes rotation at any speed [N m s/rad]."""
        return 0.0

    @property
    def idle_speed_rad_s(self) -> float:
        """Speed without load at the highest command [rad/s]; 1 if it is unbounded."""
        return 1.0

    @property
    def least_running_speed_rad_s(self) -> float:
        """Lowest sustained speed [rad/s], below which the drive may stop; 0 if it starts by itself."""
        return 0.0

    def resolved_ranges(self, step_s: float) -> Mapping[str, tuple[float, float, float]]:
        """Return the ranges of keys that together determine a time constant that a step [s] resolves.

        By key: lowest and highest value, and the upper end of the gap above 0 (:class:`..keys.KeyInfo`).
        """
        return {}

    def fill(self, record: Any) -> None:
        """Write the parameters; commands to an electric drive go in both directions, without a rack."""
        super().fill(record)
        if self.electric:
            record["drive_min"] = -record["drive_max"]
            record["rack_rate_limit"] = INF


def end_stops(quantity: str, unit: str) -> Validity:
    """Return the range of validity of a drive command (a noun phrase): its end stops."""
    return Validity(
        quantity,
        unit,
        lambda _, samples: samples["drive"],
        lambda plant: (float(plant["drive_min"]), float(plant["drive_max"])),
        "outside it the drive stays at its end stop",
    )


# Parameters that electric drives share.
# fmt: off
TORQUE_OFFSET = effect(0.0,
    "constant torque of the motor in addition to its command; positive drives ahead", "N m",
    record="torque_offset", ge=-1e8, le=1e8)
COMMAND_DELAY = effect(0.0, "dead time between the command and the motor", "s",
    record="command_dead_time", ge=0, le=6)
COMMAND_LAG = effect(0.0, "first-order lag of the command: speed controller, power stage, ramp", "s",
    record="command_lag", ge=0, le=60)
DRIVE_EFFICIENCY = parameter("mechanical power of the drive / electric power without idle power; while "
    "the drive brakes, electric / mechanical", record="drive_efficiency", gt=0, le=1, default=1.0)
IDLE_POWER = parameter("electric power that the drive takes at no load and at standstill", "W",
    record="idle_power", ge=0, le=1e8, default=0.0)
# fmt: on


@compiled
def supplied_power(plant: Record, mechanical: Real) -> Real:
    """Return the electric power [W] of a drive that delivers mechanical power P [W]: P / eta + P_0.

    A braking drive (P below 0) returns eta P.
    """
    if mechanical.real >= 0.0:
        return mechanical / plant.drive_efficiency + plant.idle_power
    return mechanical * plant.drive_efficiency + plant.idle_power


@compiled
def delivered_power(plant: Record, electric: Real) -> Real:
    """Return the mechanical power [W] for an electric power [W]: inverse of :func:`supplied_power`."""
    net = electric - plant.idle_power
    if net.real >= 0.0:
        return net * plant.drive_efficiency
    return net / plant.drive_efficiency


@compiled
def add_torque_offset(plant: Record, torque: Real) -> Real:
    """Return a motor torque [N m] plus its constant offset, as from an amplifier with a zero error."""
    if plant.torque_offset != 0.0:
        torque = torque + plant.torque_offset
    return torque
