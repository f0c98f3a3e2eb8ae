"""Perturb the parameters of a ship by their tolerances, and recognise parameters of transients.

A difference that the uncertainty of the nominal parameters explains is no missing effect. The table
``[tolerances]`` of the ship file gives the standard deviation of each parameter.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...plant.ship import Ship
from ...plant.tolerances import TOLERANCE_OF_KEY
from .joint_replay import NO_SHIFT as NO_SHIFT
from .joint_replay import JointReplay

START_DEVIATIONS = {"pitch_ratio": 0.005, "shaft_speed": 0.02, "ship_speed": 0.05}
"""Standard deviation of the first state: P/D [-], share of the shaft speed, ship speed [m/s]. The sway
speed has that of the ship speed, and the yaw rate gives the same speed at bow and stern."""

TURNING = tuple(
    key for key, of in TOLERANCE_OF_KEY.items() if of in ("hull_derivatives", "rudder_force")
)
"""Keys of the manoeuvring parameters that a general tolerance covers."""

LARGEST_STEP = 0.05
"""Largest change of a parameter, as a share of it, by which its influence is computed."""


class Perturbation(NamedTuple):
    """Nominal ship with one parameter, or several correlated ones, changed by one standard deviation."""

    record: Any
    start: tuple[float, ...]  # shift of the first state, as in JointReplay.simulate
    numbers: Mapping[str, float] = {}  # change of each parameter of the ship file, by dotted key
    share: float = 1.0  # share of the standard deviation that is applied in the record


def tolerance_records(
    replay: JointReplay, scale: float = 1.0, free: Collection[str] = ()
) -> Iterator[tuple[Any, tuple[float, ...]]]:
    """Yield the ship record and the shift of the first state for each perturbed parameter.

    Parameters with correlated errors are changed together, along the principal axes of their covariance.

    Args:
        replay: recordings; parameters that do not act in them or are known exactly are left out.
        scale: factor on all tolerances.
        free: dotted keys of parameters that are left out because they are fitted.
    """
    for one in tolerance_perturbations(replay, scale, free):
        yield one.record, one.start


def tolerance_perturbations(
    replay: JointReplay,
    scale: float = 1.0,
    free: Collection[str] = (),
    near: float = float("inf"),
) -> Iterator[Perturbation]:
    """Yield the ship with each parameter changed by one standard deviation, and its change.

    Args:
        replay: recordings; parameters that do not act in them or are known exactly are left out.
        scale: factor on all tolerances.
        free: dotted keys of parameters that are left out because they are fitted.
        near: largest change as a share of the parameter; a smaller change than the standard deviation
            has its ``share`` in the result.
    """
    ship = replay.ship
    known = ship.tolerances
    excluded = {*free, *known.numbers}  # General tolerances do not apply to these parameters.

    def scaled(key: str, power: float = 1.0, field: str = "") -> Iterator[Perturbation]:
        """Change a parameter by a share of itself; a power of -1 changes its reciprocal."""
        tolerance = scale * getattr(known, TOLERANCE_OF_KEY[key])
        if (
            tolerance != 0.0
            and key not in excluded
            and not (replay.steady and is_transient(ship, key))
        ):
            record, name = ship.record(), field or ship.parameter(key).field
            record[name] = record[name] * (1.0 + tolerance) ** power
            own = (1.0 + tolerance) ** power - 1.0
            in_file = ship.has_key(key)
            yield Perturbation(
                record, NO_SHIFT, {key: own * ship.parameter(key).value} if in_file else {}
            )

    def shifted(key: str, unit: float) -> Iterator[Perturbation]:
        """Change a parameter by a share of another quantity."""
        tolerance = scale * getattr(known, TOLERANCE_OF_KEY[key])
        if tolerance != 0.0 and key not in excluded:
            yield _perturb(ship, {key: tolerance * unit})

    if ship.moves:
        yield from scaled("hull.resistance_coefficient_N_s2_m2")
        yield from scaled("hull.mass_kg")
    if ship.moves and ship.has_propeller:
        yield from shifted("hull.wake_fraction", 1.0)
        for moved in scaled("propeller.thrust_coefficient", field="kt"):
            factor = 1.0 + scale * known.thrust_curve
            moved.record["four_quadrant"][..., :2] *= factor  # harmonics of the thrust coefficient
            moved.record["table_kt"] *= factor
            yield moved
    for side in ("engine", "propeller") if ship.turns_freely else ("propeller",):
        yield from scaled(f"transmission.inertia_{side}_side_kg_m2")
    if ship.has_key("propeller.torque_coefficient"):
        yield from scaled("propeller.torque_coefficient")
    elif ship.has_propeller:
        yield from scaled("propeller.relative_rotative_efficiency", power=-1.0)
    if ship.has_diesel:
        yield from scaled("prime_mover.torque_per_rack_N_m_mm")
        plant = ship.record()
        highest = float(min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"]))
        yield from shifted("prime_mover.torque_offset_N_m", highest)
    elif ship.has_voltage:
        yield from scaled("prime_mover.motor_constant_V_s_rad")
        yield from scaled("prime_mover.armature_resistance_ohm")
    if replay.controllable:
        yield from scaled("pitch_actuator.time_constant_s")
    if ship.moves and ship.turns and not replay.steady:
        for key in TURNING:
            if ship.has_key(key) and ship.parameter(key).value != 0.0:
                yield from scaled(key)
    individual = [
        k for k, one in known.numbers.items()
        if k not in free and scale * one > 0.0 and not (replay.steady and is_transient(ship, k))
    ]  # fmt: skip
    for numbers in _deviations(ship, individual, scale):
        yield _perturb(ship, numbers, near)
    deviations = first_state_deviations(replay)
    for k in (1, 0, *range(2, len(deviations))):
        if deviations[k] > 0.0:
            shift = [0.0] * max(k + 1, len(NO_SHIFT))
            shift[k] = scale * deviations[k]
            yield Perturbation(ship.record(), tuple(shift))


def first_state_deviations(replay: JointReplay) -> list[float]:
    """Return the standard deviation of each state of the first row, by :data:`START_DEVIATIONS`.

    Args:
        replay: the recordings.

    Returns:
        Standard deviations of pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and for a ship
        that turns of sway speed [m/s] and yaw rate [rad/s]; 0 for a state that is known.
    """
    ship = replay.ship
    shaft = max(abs(replay.start[1]), 1.0)
    found = [
        START_DEVIATIONS["pitch_ratio"] if replay.controllable else 0.0,
        START_DEVIATIONS["shaft_speed"] * shaft if ship.turns_freely else 0.0,
        START_DEVIATIONS["ship_speed"] if ship.moves else 0.0,
    ]
    if ship.moves and ship.turns:
        across = START_DEVIATIONS["ship_speed"]
        found += [across, 2.0 * across / ship.manoeuvring.length_m]
    # An equilibrium does not depend on the first state.
    return [0.0] * len(found) if replay.steady else found


def _deviations(ship: Ship, keys: list[str], scale: float) -> Iterator[dict[str, float]]:
    """Yield one standard deviation of each parameter, or along each axis of correlated parameters."""
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
            if size > 0.0:  # Rounded correlations may give an eigenvalue below 0.
                yield dict(zip(together, np.sqrt(size) * deviations * axis, strict=True))


def _perturb(ship: Ship, numbers: Mapping[str, float], near: float = float("inf")) -> Perturbation:
    """Return the ship with changed parameters; each changes by at most ``near`` times its value."""
    own = {key: ship.parameter(key) for key in numbers}
    shares = [
        near * abs(own[key].value / change)
        for key, change in numbers.items()
        if change != 0.0 and own[key].value != 0.0
    ]
    share = min(1.0, *shares) if shares else 1.0
    record = ship.record()
    for key, change in numbers.items():
        own[key].write(record, own[key].value + share * change)
    return Perturbation(record, NO_SHIFT, numbers, share)


_WORDS = ("inertia_", "mass_kg", "rate_limit", "dead_band", "backlash", "added_mass")


def is_transient(ship: Ship, key: str) -> bool:
    """Return whether a parameter acts in transients only, or depends on earlier states.

    Time constants, delays, inertias and rate limits act in transients; backlash and dead band of the
    pitch actuator depend on its earlier positions.

    Args:
        ship: ship with the parameter.
        key: dotted key of the parameter.
    """
    name = key.rpartition(".")[2]
    if any(word in name for word in _WORDS):
        return True
    timed = not key.startswith("term.") and ship.has_key(key)
    return timed and ship.parameter(key).info.unit == "s"
