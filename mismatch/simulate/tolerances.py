"""How far a ship's nominal numbers may be off before it is called missing physics.

How well the numbers are known stands in the ship's file, under ``[tolerances]``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from ...plant.tolerances import TOLERATED
from .joint_replay import JointReplay

START = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]."""


UNMOVED = (0.0, 0.0, 0.0)

Moved = tuple[Any, tuple[float, float, float]]
"""A record of the ship, and the shift of the first state: P/D, shaft speed, ship speed."""


def tolerance_records(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = ()
) -> Iterator[Moved]:
    """The nominal ship with each number one standard deviation off: record, and shift of the start.

    Args:
        replay: of the recording; numbers that do not act in it, or are known exactly, are left out.
        scale: factor on all tolerances.
        free: dotted keys of numbers that are left out too, being fitted themselves.
    """
    ship = replay.ship
    known = ship.tolerances
    told = {*free, *known.numbers}  # no general tolerance speaks of these

    def off(key: str, power: float = 1.0, field: str = "") -> Iterator[Moved]:
        """A field of the record off by a share of itself, or of what it divides (power -1)."""
        tolerance = scale * getattr(known, TOLERATED[key])
        if tolerance != 0.0 and key not in told:
            record, name = ship.record(), field or ship.number(key).field
            record[name] = record[name] * (1.0 + tolerance) ** power
            yield record, UNMOVED

    def shifted(key: str, unit: float) -> Iterator[Moved]:
        """A number off by a share of something else."""
        tolerance = scale * getattr(known, TOLERATED[key])
        if tolerance != 0.0 and key not in told:
            yield _with(ship.record(), ship.number(key), tolerance * unit), UNMOVED

    if ship.moves:
        yield from off("hull.resistance_coefficient_N_s2_m2")
        yield from off("hull.mass_kg")
    if ship.moves and ship.has_propeller:
        yield from shifted("hull.wake_fraction", 1.0)
        for record, start in off("propeller.thrust_coefficient", field="kt"):
            record["four_quadrant"][..., :2] *= 1.0 + scale * known.thrust_curve  # CT's harmonics
            record["table_kt"] *= 1.0 + scale * known.thrust_curve
            yield record, start
    for side in ("engine", "propeller") if ship.turns_freely else ("propeller",):
        yield from off(f"transmission.inertia_{side}_side_kg_m2")
    if ship.has_propeller and "propeller.torque_coefficient" not in told:
        yield from off("propeller.relative_rotative_efficiency", power=-1.0)
    if ship.has_diesel:
        yield from off("prime_mover.torque_per_rack_N_m_mm")
        plant = ship.record()
        highest = float(min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"]))
        yield from shifted("prime_mover.torque_offset_N_m", highest)
    elif ship.has_voltage:
        yield from off("prime_mover.motor_constant_V_s_rad")
        yield from off("prime_mover.armature_resistance_ohm")
    if replay.controllable:
        yield from off("pitch_actuator.time_constant_s")
    for key, deviation in known.numbers.items():
        if key not in free and scale * deviation > 0.0:
            yield _with(ship.record(), ship.number(key), scale * deviation), UNMOVED
    if ship.turns_freely:
        shaft = max(abs(replay.start[1]), 1.0)
        yield ship.record(), (0.0, scale * START["shaft_speed"] * shaft, 0.0)
    if replay.controllable:
        yield ship.record(), (scale * START["pitch_ratio"], 0.0, 0.0)
    if ship.moves:
        yield ship.record(), (0.0, 0.0, scale * START["ship_speed"])


def _with(record: Any, number: Any, more: float) -> Any:
    """A record in which one number is larger."""
    number.write(record, number.value + more)
    return record
