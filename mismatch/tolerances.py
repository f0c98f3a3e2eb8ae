"""How far a ship's nominal numbers may be off before it is called missing physics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..plant.ship_sections import Diesel
from .replay import Replay

RELATIVE = {
    "resistance_coefficient": 0.008,
    "mass": 0.01,
    "inertia": 0.01,
    "torque_per_rack": 0.003,
    "thrust_curve": 0.004,
    "torque_curve": 0.004,
    "pitch_time_constant": 0.02,
    "motor_constant": 0.004,
    "armature_resistance": 0.005,
}
"""Standard deviation of each nominal number, as a share of it: a ship's file that was made with care."""

TORQUE_OFFSET = 0.002
"""Standard deviation of the engine map's constant term, as a share of the highest torque shown."""

WAKE_FRACTION = 0.003
"""Standard deviation of the wake fraction [-]."""

START = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]."""


UNMOVED = (0.0, 0.0, 0.0)


def tolerance_records(
    replay: Replay, scale: float = 1.0
) -> Iterator[tuple[Any, tuple[float, float, float]]]:
    """The nominal ship with each number one standard deviation off: record, and shift of the start.

    Args:
        replay: of the recording; only numbers that act in it are yielded.
        scale: factor on all tolerances.
    """
    ship = replay.ship
    diesel = isinstance(ship.prime_mover, Diesel)

    def changed(**factors: float) -> Any:
        record = ship.record()
        for name, share in factors.items():
            record[name] = record[name] * (1.0 + scale * share)
        return record

    if not ship.hull.fixed:
        yield changed(resistance_coefficient=RELATIVE["resistance_coefficient"]), UNMOVED
        yield changed(mass=RELATIVE["mass"]), UNMOVED
        record = ship.record()
        record["wake_fraction"] += scale * WAKE_FRACTION
        yield record, UNMOVED
        yield changed(kt=RELATIVE["thrust_curve"]), UNMOVED
    inertia = RELATIVE["inertia"]
    yield changed(inertia_engine_side=inertia, inertia_propeller_side=inertia), UNMOVED
    yield changed(relative_rotative_efficiency=-RELATIVE["torque_curve"]), UNMOVED
    if diesel:
        yield changed(torque_per_rack=RELATIVE["torque_per_rack"]), UNMOVED
        record = ship.record()
        limit = float(min(record["torque_limit"], record["torque_per_rack"] * record["drive_max"]))
        record["torque_offset"] += scale * TORQUE_OFFSET * limit
        yield record, UNMOVED
    elif ship.prime_mover.type == "dc-motor":
        yield changed(motor_constant=RELATIVE["motor_constant"]), UNMOVED
        yield changed(armature_resistance=RELATIVE["armature_resistance"]), UNMOVED
    if replay.controllable:
        yield changed(pitch_time_constant=RELATIVE["pitch_time_constant"]), UNMOVED
    shaft = max(abs(replay.start[1]), 1.0)
    yield ship.record(), (0.0, scale * START["shaft_speed"] * shaft, 0.0)
    if replay.controllable:
        yield ship.record(), (scale * START["pitch_ratio"], 0.0, 0.0)
    if not ship.hull.fixed:
        yield ship.record(), (0.0, 0.0, scale * START["ship_speed"])
