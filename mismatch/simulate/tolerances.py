"""How far a ship's nominal numbers may be off before it is called missing physics.

How well the numbers are known stands in the ship's file, under ``[tolerances]``.

Parameters of a ship that act while it changes its state, and not at an equilibrium.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...plant.ship import Ship
from ...plant.tolerances import TOLERATED
from .joint_replay import UNMOVED as UNMOVED
from .joint_replay import JointReplay

START = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]; that of
sway is the ship speed's, of the rate of turn what gives as much at bow and stern."""

TURNING = tuple(key for key, of in TOLERATED.items() if of in ("hull_derivatives", "rudder_force"))
"""Keys of the numbers of a ship that turns of which a tolerance speaks."""

NEAR = 0.05
"""Share of a number over which the simulation is felt where its tolerance is wider."""


class Moved(NamedTuple):
    """The nominal ship with a number one standard deviation off, or several that go together."""

    record: Any
    start: tuple[float, ...]  # shift of the first state, as of JointReplay.simulate
    numbers: Mapping[str, float] = {}  # change of each number of the ship's file, by dotted key
    share: float = 1.0  # of the deviation that stands in the record


def tolerance_records(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = ()
) -> Iterator[tuple[Any, tuple[float, ...]]]:
    """The nominal ship with each number one standard deviation off: record, and shift of the start.

    Numbers of which the file knows how their errors go together are moved together, along the axes of
    their joint uncertainty.

    Args:
        replay: of the recording; numbers that do not act in it, or are known exactly, are left out.
        scale: factor on all tolerances.
        free: dotted keys of numbers that are left out too, being fitted themselves.
    """
    for moved in tolerance_moves(replay, scale, free):
        yield moved.record, moved.start


def tolerance_moves(
    replay: JointReplay,
    scale: float = 1.0,
    free: Collection[str] = (),
    near: float = float("inf"),
) -> Iterator[Moved]:
    """The same with what is moved.

    Args:
        replay: of the recording; numbers that do not act in it, or are known exactly, are left out.
        scale: factor on all tolerances.
        free: dotted keys of numbers that are left out too, being fitted themselves.
        near: share of a number that it is moved by at most; the rest of its standard deviation is in
            the ``share`` of what is found.
    """
    ship = replay.ship
    known = ship.tolerances
    told = {*free, *known.numbers}  # no general tolerance speaks of these

    def off(key: str, power: float = 1.0, field: str = "") -> Iterator[Moved]:
        """A field of the record off by a share of itself, or of what it divides (power -1)."""
        tolerance = scale * getattr(known, TOLERATED[key])
        if tolerance != 0.0 and key not in told and not (replay.steady and is_transient(ship, key)):
            record, name = ship.record(), field or ship.number(key).field
            record[name] = record[name] * (1.0 + tolerance) ** power
            own = (1.0 + tolerance) ** power - 1.0
            in_file = ship.has_key(key)
            yield Moved(record, UNMOVED, {key: own * ship.number(key).value} if in_file else {})

    def shifted(key: str, unit: float) -> Iterator[Moved]:
        """A number off by a share of something else."""
        tolerance = scale * getattr(known, TOLERATED[key])
        if tolerance != 0.0 and key not in told:
            yield _moved(ship, {key: tolerance * unit})

    if ship.moves:
        yield from off("hull.resistance_coefficient_N_s2_m2")
        yield from off("hull.mass_kg")
    if ship.moves and ship.has_propeller:
        yield from shifted("hull.wake_fraction", 1.0)
        for moved in off("propeller.thrust_coefficient", field="kt"):
            factor = 1.0 + scale * known.thrust_curve
            moved.record["four_quadrant"][..., :2] *= factor  # CT's harmonics
            moved.record["table_kt"] *= factor
            yield moved
    for side in ("engine", "propeller") if ship.turns_freely else ("propeller",):
        yield from off(f"transmission.inertia_{side}_side_kg_m2")
    if ship.has_key("propeller.torque_coefficient"):
        yield from off("propeller.torque_coefficient")
    elif ship.has_propeller:
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
    if ship.moves and ship.turns and not replay.steady:
        for key in TURNING:
            if ship.has_key(key) and ship.number(key).value != 0.0:
                yield from off(key)
    told_by_file = [
        k for k, one in known.numbers.items()
        if k not in free and scale * one > 0.0 and not (replay.steady and is_transient(ship, k))
    ]  # fmt: skip
    for numbers in _joint(ship, told_by_file, scale):
        yield _moved(ship, numbers, near)
    deviations = first_state_deviations(replay)
    for k in (1, 0, *range(2, len(deviations))):
        if deviations[k] > 0.0:
            shift = [0.0] * max(k + 1, len(UNMOVED))
            shift[k] = scale * deviations[k]
            yield Moved(ship.record(), tuple(shift))


def first_state_deviations(replay: JointReplay) -> list[float]:
    """Return the standard deviation of each state of a recording's first row, by :data:`START`.

    Args:
        replay: of the recordings.

    Returns:
        Of pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and of a ship that turns sway speed
        [m/s] and yaw rate [rad/s]; 0 of a state that is known.
    """
    ship = replay.ship
    shaft = max(abs(replay.start[1]), 1.0)
    found = [
        START["pitch_ratio"] if replay.controllable else 0.0,
        START["shaft_speed"] * shaft if ship.turns_freely else 0.0,
        START["ship_speed"] if ship.moves else 0.0,
    ]
    if ship.moves and ship.turns:
        across = START["ship_speed"]
        found += [across, 2.0 * across / ship.manoeuvring.length_m]
    # an equilibrium depends on no first state
    return [0.0] * len(found) if replay.steady else found


def _joint(ship: Ship, keys: list[str], scale: float) -> Iterator[dict[str, float]]:
    """One standard deviation of each number, or along each axis of several that go together."""
    known = ship.tolerances
    together = [k for k in keys if any(known.correlation(k, other) for other in keys if other != k)]
    for key in keys:
        if key not in together:
            yield {key: scale * known.numbers[key]}
    if together:
        correlation = np.array([[known.correlation(a, b) for b in together] for a in together])
        sizes, axes = np.linalg.eigh(correlation)
        deviations = scale * np.array([known.numbers[key] for key in together])
        for size, axis in zip(sizes, axes.T, strict=True):
            if size > 0.0:  # rounded correlations may leave less than nothing
                yield dict(zip(together, np.sqrt(size) * deviations * axis, strict=True))


def _moved(ship: Ship, numbers: Mapping[str, float], near: float = float("inf")) -> Moved:
    """The ship with some numbers changed, or with a part of that where it is far."""
    own = {key: ship.number(key) for key in numbers}
    shares = [
        near * abs(own[key].value / change)
        for key, change in numbers.items()
        if change != 0.0 and own[key].value != 0.0
    ]
    share = min(1.0, *shares) if shares else 1.0
    record = ship.record()
    for key, change in numbers.items():
        own[key].write(record, own[key].value + share * change)
    return Moved(record, UNMOVED, numbers, share)


_WORDS = ("inertia_", "mass_kg", "rate_limit", "dead_band", "backlash", "added_mass")


def is_transient(ship: Ship, key: str) -> bool:
    """Return whether a parameter acts in transients only, or through the history of the ship.

    Time constants, delays, inertias and rate limits do; so do play and dead band of the pitch actuator,
    which depend on the way by which it has come.

    Args:
        ship: that has the parameter.
        key: dotted key.
    """
    name = key.rpartition(".")[2]
    if any(word in name for word in _WORDS):
        return True
    timed = not key.startswith("term.") and ship.has_key(key)
    return timed and ship.number(key).info.unit == "s"
