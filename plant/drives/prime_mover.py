"""What every prime mover says of itself, and what those have in common whose demand goes either way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ...core.compiled import Real, Record, compiled
from ..keys import INF, Section, effect, number
from ..signals import Signal
from ..validity import Validity


class PrimeMover(Section):
    """Section of a prime mover in a ship's file."""

    code: ClassVar[int]
    """Its number in ``plant.prime_mover``."""
    balance: ClassVar[str]
    """Balance in which its own effects act: ``engine`` or ``motor``; none where its speed is held."""
    holds_speed: ClassVar[bool] = False
    """Whether the shaft's speed is its demand; the shaft's balance is then not simulated."""
    gives_torque: ClassVar[bool] = False
    """Whether it gives the torque that it is told."""
    electric: ClassVar[bool] = False
    """Whether it takes electric power, which a recording may have."""
    demand: ClassVar[Signal]
    """What commands it."""
    steady_keys: ClassVar[tuple[str, ...]] = ()
    """Dotted keys of a ship file that steady states identify where the user names none."""
    response_keys: ClassVar[tuple[str, ...]] = ()
    """Dotted keys that a frequency response identifies where the user names none."""

    @property
    def delays(self) -> dict[str, float]:
        """Dead times [s] by key, each a history that the plant keeps."""
        return {}

    @property
    def damping(self) -> float:
        """Slope of the torque that opposes its speed, whatever the speed [N m s/rad]."""
        return 0.0

    @property
    def idle_speed_rad_s(self) -> float:
        """Speed that it reaches without a load at its highest demand; 1 where nothing bounds it."""
        return 1.0

    @property
    def least_running_speed_rad_s(self) -> float:
        """Its speed below which it may stop under any demand; 0 of a drive that starts by itself."""
        return 0.0

    def resolved(self, step_s: float) -> Mapping[str, tuple[float, float, float]]:
        """Return what a time step allows of the keys that set a time constant together.

        Args:
            step_s: time step of the integration [s].

        Returns:
            Lowest and highest value by key, and the end of the gap above 0 (:class:`..keys.KeyInfo`).
        """
        return {}


def end_stops(quantity: str, unit: str) -> Validity:
    """Return the range of a drive's command: what its end stops let through.

    Args:
        quantity: the command, as a noun phrase.
        unit: SI.
    """
    return Validity(
        quantity,
        unit,
        lambda _, samples: samples["drive"],
        lambda plant: (float(plant["drive_min"]), float(plant["drive_max"])),
        "beyond it the drive stays at its end stop",
    )


def torque_offset() -> Any:
    """The key of a motor's constant torque, which :func:`with_offset` adds."""
    return effect(
        0.0, "torque that the motor has beside what is demanded of it; positive drives ahead", "N m",
        record="torque_offset", ge=-1e8, le=1e8,
    )  # fmt: skip


def drive_efficiency() -> Any:
    """The key of the efficiency with which a drive turns electric power into mechanical power."""
    return number(
        "mechanical power of the drive / electric power, idle power apart; while the drive brakes, "
        "electric / mechanical", record="drive_efficiency", gt=0, le=1, default=1.0,
    )  # fmt: skip


def idle_power() -> Any:
    """The key of the electric power that a drive takes whatever it does."""
    return number(
        "electric power that the drive takes at no load and at standstill", "W",
        record="idle_power", ge=0, le=1e8, default=0.0,
    )  # fmt: skip


@compiled
def supplied_power(plant: Record, mechanical: Real) -> Real:
    """Electric power [W] of a drive that gives mechanical power [W]: P / eta + P_0.

    A drive that brakes (P below 0) gives eta P back.
    """
    if mechanical.real >= 0.0:
        return mechanical / plant.drive_efficiency + plant.idle_power
    return mechanical * plant.drive_efficiency + plant.idle_power


@compiled
def delivered_power(plant: Record, electric: Real) -> Real:
    """Mechanical power [W] of a drive that takes electric power [W]: :func:`supplied_power` inverted."""
    net = electric - plant.idle_power
    if net.real >= 0.0:
        return net * plant.drive_efficiency
    return net / plant.drive_efficiency


def command_delay() -> Any:
    """Return the key of the dead time between an electric drive's command and the motor."""
    return effect(
        0.0, "dead time between the command and the motor", "s", record="command_dead_time",
        ge=0, le=6,
    )  # fmt: skip


def command_lag() -> Any:
    """Return the key of the first-order lag between an electric drive's command and the motor."""
    return effect(
        0.0, "first-order lag of the command: speed controller, power stage, ramp", "s",
        record="command_lag", ge=0, le=60,
    )  # fmt: skip


@compiled
def with_offset(plant: Record, torque: Real) -> Real:
    """Torque [N m] of a motor with its constant offset, as of an amplifier whose zero is off."""
    if plant.torque_offset != 0.0:
        torque = torque + plant.torque_offset
    return torque


def fill_two_way(record: Any) -> None:
    """End stops alike in both directions, and no rack that travels."""
    record["drive_min"] = -record["drive_max"]
    record["rack_rate_limit"] = INF
