"""How far a ship's nominal numbers may be off before it is called missing physics.

How well the numbers are known stands in the ship's file, under ``[tolerances]``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .joint_replay import JointReplay

START = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]."""


UNMOVED = (0.0, 0.0, 0.0)

Moved = tuple[Any, tuple[float, float, float]]
"""A record of the ship, and the shift of the first state: P/D, shaft speed, ship speed."""


def tolerance_records(replay: JointReplay, scale: float = 1.0) -> Iterator[Moved]:
    """The nominal ship with each number one standard deviation off: record, and shift of the start.

    Args:
        replay: of the recording; numbers that do not act in it, or are known exactly, are left out.
        scale: factor on all tolerances.
    """
    ship = replay.ship
    known = ship.tolerances

    def off(tolerance: float, field: str, power: float = 1.0) -> Iterator[Moved]:
        """A field of the record off by a share of itself, or of what it divides (power -1)."""
        if scale * tolerance != 0.0:
            record = ship.record()
            record[field] = record[field] * (1.0 + scale * tolerance) ** power
            yield record, UNMOVED

    def shifted(tolerance: float, field: str, unit: float) -> Iterator[Moved]:
        """A field of the record off by a share of something else."""
        if scale * tolerance != 0.0:
            record = ship.record()
            record[field] += scale * tolerance * unit
            yield record, UNMOVED

    if ship.moves:
        yield from off(known.resistance, "resistance_coefficient")
        yield from off(known.mass, "mass")
    if ship.moves and ship.has_propeller:
        yield from shifted(known.wake_fraction, "wake_fraction", 1.0)
        for record, start in off(known.thrust_curve, "kt"):
            record["four_quadrant"][..., :2] *= 1.0 + scale * known.thrust_curve  # CT's harmonics
            record["table_kt"] *= 1.0 + scale * known.thrust_curve
            yield record, start
    sides = ("inertia_engine_side", "inertia_propeller_side")
    for side in sides if ship.turns_freely else sides[1:]:
        yield from off(known.inertia, side)
    if ship.has_propeller:
        yield from off(known.torque_curve, "relative_rotative_efficiency", power=-1.0)
    if ship.has_diesel:
        yield from off(known.torque_per_rack, "torque_per_rack")
        plant = ship.record()
        highest = float(min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"]))
        yield from shifted(known.torque_offset, "torque_offset", highest)
    elif ship.has_voltage:
        yield from off(known.motor_constant, "motor_constant")
        yield from off(known.armature_resistance, "armature_resistance")
    if replay.controllable:
        yield from off(known.pitch_time_constant, "pitch_time_constant")
    if ship.turns_freely:
        shaft = max(abs(replay.start[1]), 1.0)
        yield ship.record(), (0.0, scale * START["shaft_speed"] * shaft, 0.0)
    if replay.controllable:
        yield ship.record(), (scale * START["pitch_ratio"], 0.0, 0.0)
    if ship.moves:
        yield ship.record(), (0.0, 0.0, scale * START["ship_speed"])
