"""Manoeuvres within the limits of a trial: what may be ordered, and what a simulation may reach."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from ...core.compiled import Record, compiled
from ...core.models import FileModel, Range
from ...plant.columns import RUDDER_COMMAND, TIME, drive_column
from ...plant.drives.diesel import torque_limit
from ...plant.ship import Ship
from ..simulate.joint_replay import JointReplay

Floats = NDArray[np.float64]

INTERVAL_S = 1.0
"""Interval of the rows of a programme."""


RECIPROCAL = "reciprocal courses"
"""Kind of a manoeuvre that ends on the opposite course, where a current has the opposite sign."""

FIRST_PART = 0.35
"""Share of such a manoeuvre before the turn."""

OPPOSITE = math.radians(20.0)
"""Largest difference of a course from the opposite one."""

TURNS_TRIED = 4
"""Number of simulated turns, each with the rudder amidships nearer to the right time."""


class PlanError(ValueError):
    """A trial cannot be planned; the message says why and what can be done."""


class Limits(FileModel):
    """Limits of a trial, with the keys of a limits file.

    Examples:
        >>> Limits(drive=(10.0, 24.0), rudder_deg=10.0).rudder_deg
        10.0
    """

    drive: Range | None = Field(
        default=None,
        description="command of the prime mover, in the unit of the ship's demand column",
    )
    pitch_ratio: Range | None = Field(default=None, description="commanded P/D")
    rudder_deg: float = Field(
        default=0.0, ge=0.0, le=40.0, description="largest rudder angle; 0: none"
    )
    shaft_speed_rad_s: Range | None = Field(default=None, description="shaft speed reached")
    ship_speed_m_s: Range | None = Field(default=None, description="ship speed reached")
    sea_room_m: float | None = Field(
        default=None,
        gt=0.0,
        description="longest distance run through the water in the whole trial",
    )
    shortest_hold_s: float = Field(
        default=20.0, gt=0.0, description="shortest time between two orders"
    )


class Manoeuvre(NamedTuple):
    """Commands of one manoeuvre, each of shape (rows,)."""

    text: str
    drive: Floats
    pitch: Floats
    rudder: Floats


def _levels(rng: np.random.Generator, rows: int, hold: int, low: float, high: float) -> Floats:
    """Return a staircase of random levels, each held for the same time of at least ``hold`` rows."""
    count = int(rng.integers(2, max(3, min(8, rows // hold) + 1)))
    steps = rng.uniform(low, high, count)
    return np.asarray(steps[np.minimum(np.arange(rows) * count // rows, count - 1)])


def _switching(rng: np.random.Generator, rows: int, hold: int, low: float, high: float) -> Floats:
    """Return a pseudo-random binary signal between two levels."""
    ends = np.sort(rng.uniform(low, high, 2))
    bits = rng.integers(0, 2, -(-rows // hold))
    return ends[np.repeat(bits, hold)[:rows]]


def random_manoeuvre(
    ship: Ship, limits: Limits, rows: int, generator: np.random.Generator
) -> Manoeuvre:
    """Return a random manoeuvre of one of the usual kinds within the limits."""
    drive, pitch = command_ranges(ship, limits)
    helm = math.radians(limits.rudder_deg)
    hold = max(1, round(limits.shortest_hold_s / INTERVAL_S))
    kinds = ["steps of the drive", "ramp of the drive", "drive at random between two levels"]
    kinds += ["coast-down"]
    if pitch[0] < pitch[1]:
        kinds += ["steps of the pitch at constant drive", "steps of drive and pitch"]
    if helm > 0.0:
        kinds += ["zig-zag", RECIPROCAL]
    kind = str(generator.choice(kinds))
    flat = np.ones(rows)
    level, blades = generator.uniform(*drive) * flat, generator.uniform(*pitch) * flat
    rudder = 0.0 * flat
    if kind in ("steps of the drive", "steps of drive and pitch"):
        level = _levels(generator, rows, hold, *drive)
    if kind in ("steps of the pitch at constant drive", "steps of drive and pitch"):
        blades = _levels(generator, rows, hold, *pitch)
    if kind == "ramp of the drive":
        begin, end = generator.uniform(*drive, 2)
        level = np.linspace(begin, end, rows)
    if kind == "drive at random between two levels":
        level = _switching(generator, rows, hold, *drive)
    if kind == "coast-down":
        level = np.where(np.arange(rows) < rows // 4, drive[1], drive[0])
    if kind == "zig-zag":
        half = int(generator.integers(hold, max(hold + 1, rows // 4)))
        sign = np.where(np.arange(rows) // half % 2, -1.0, 1.0)
        rudder = sign * generator.uniform(0.3, 1.0) * helm
        rudder[: rows // 8] = 0.0
    if kind == RECIPROCAL:
        helm = float(generator.choice([-1.0, 1.0])) * generator.uniform(0.5, 1.0) * helm
        rudder, opposite = _turn_round(ship, Manoeuvre(kind, level, blades, rudder), helm)
        kind = kind if opposite else "turn"
    return Manoeuvre(kind, level, blades, rudder)


def _turn_round(ship: Ship, straight: Manoeuvre, helm: float) -> tuple[Floats, bool]:
    """Return rudder angles [rad] of a turn to the opposite course, and whether the ship reaches it.

    The turn begins after :data:`FIRST_PART` of the manoeuvre. The rudder returns amidships before the
    opposite course, because the ship turns on for a while. A slow ship turns less in the time, and one
    that is unstable on a straight course more.

    Args:
        ship: ship that turns.
        straight: manoeuvre with the rudder amidships.
        helm: rudder angle of the turn [rad].
    """
    rows = len(straight.drive)
    begin = round(FIRST_PART * rows)

    def turn_until(end: int) -> tuple[Floats, Floats]:
        rudder = np.zeros(rows)
        rudder[begin:end] = helm
        table = table_of(ship, [straight._replace(rudder=rudder)])
        heading = JointReplay(ship, table).simulate(ship.record())["heading"]
        return rudder, np.abs(heading - heading[0])

    _, turning = turn_until(rows)
    amidships_at, turns = math.pi, []
    for _ in range(TURNS_TRIED):
        rudder, change = turn_until(max(begin + 1, int(np.searchsorted(turning, amidships_at))))
        error = float(change[-1]) - math.pi
        turns.append((abs(error), rudder))
        amidships_at -= error
    error, rudder = min(turns, key=lambda turn: turn[0])
    return rudder, error <= OPPOSITE


def command_ranges(ship: Ship, limits: Limits) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of drive command and pitch.

    Raises:
        PlanError: a limit lies outside what the ship can do.
    """
    plant, column = ship.record(), drive_column(ship)
    own = float(plant["drive_min"]), float(plant["drive_max"])
    drive = limits.drive or (0.3 * own[1], 0.8 * own[1])
    pitch = (ship.propeller.pitch_ratio_max,) * 2
    if ship.has_variable_pitch:
        most = float(ship.propeller.pitch_ratio_max)
        pitch = limits.pitch_ratio or (0.6 * most, most)
    for name, ends, (low, high) in (
        ("drive", drive, own),
        ("pitch_ratio", pitch, (float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"]))),
    ):
        if ends[0] < low - 1e-9 or ends[1] > high + 1e-9:
            raise PlanError(
                f"limits: {name} = {list(ends)} leaves what {ship.name} can do, {low:g} to {high:g}"
                + (f" ({column})" if name == "drive" else "")
            )
    if limits.rudder_deg > 0.0 and not ship.turns:
        raise PlanError(f"limits: rudder_deg is above 0, but {ship.name} has no rudder")
    return drive, pitch


def hold_commands(levels: Floats, edges: Sequence[int]) -> list[Manoeuvre]:
    """Return manoeuvres with constant commands, one for each run of intervals with the same.

    Args:
        levels: drive and pitch, shape (2, intervals).
        edges: first row of each interval, and the row after the last, shape (intervals + 1,).
    """
    starts = [0, *(np.flatnonzero(np.diff(levels, axis=1).any(axis=0)) + 1).tolist()]
    held = []
    for first, end in itertools.pairwise([*starts, levels.shape[1]]):
        flat = np.ones(edges[end] - edges[first])
        drive, pitch = levels[:, first]
        held.append(Manoeuvre("held commands", drive * flat, pitch * flat, 0.0 * flat))
    return held


def table_of(ship: Ship, manoeuvres: Sequence[Manoeuvre]) -> pd.DataFrame:
    """Return manoeuvres one after the other as a table that ``shaftline simulate --inputs`` takes."""
    parts = [np.concatenate(column) for column in zip(*(m[1:] for m in manoeuvres), strict=True)]
    table = pd.DataFrame(
        {TIME: INTERVAL_S * np.arange(len(parts[0])), drive_column(ship): parts[0]}
    )
    if ship.has_variable_pitch:
        table["pitch_ratio_command"] = parts[1]
    if ship.turns:
        table[RUDDER_COMMAND] = parts[2]
    return table


def is_inside(ship: Ship, samples: Any, limits: Limits, room_m: float = math.inf) -> bool:
    """Return whether a simulation stays finite, within the limits and within the engine's envelope.

    Args:
        ship: ship.
        samples: simulation with a row every :data:`INTERVAL_S`.
        limits: limits of the trial.
        room_m: longest distance of this simulation [m].
    """
    for signal, ends in (
        ("shaft_speed", limits.shaft_speed_rad_s),
        ("ship_speed", limits.ship_speed_m_s),
    ):
        values = samples[signal]
        if not np.isfinite(values).all():
            return False
        if ends is not None and not (ends[0] <= values.min() and values.max() <= ends[1]):
            return False
    if float(np.abs(samples["ship_speed"]).sum()) * INTERVAL_S > room_m:
        return False
    if not ship.has_diesel:
        return True
    plant = ship.record()
    speeds = float(plant["gear_ratio"]) * np.ascontiguousarray(samples["shaft_speed"])
    torques = np.ascontiguousarray(samples["brake_torque"])
    return bool(_is_in_envelope(plant, speeds, torques))


@compiled
def _is_in_envelope(plant: Record, speeds: Floats, torques: Floats) -> bool:
    """Return whether engine speeds [rad/s] and brake torques [N m] of n rows are allowed."""
    for i in range(len(speeds)):
        most = 1.001 * torque_limit(plant, speeds[i])
        if not (speeds[i] <= plant.engine_speed_max and torques[i] <= most):
            return False
    return True


def steps_of(ship: Ship, chosen: Sequence[Manoeuvre]) -> pd.DataFrame:
    """Return a row for each manoeuvre in words."""
    rows, start = [], 0.0
    for m in chosen:
        end = start + len(m.drive) * INTERVAL_S / 60.0
        row = {
            "from_min": start,
            "to_min": end,
            "manoeuvre": m.text,
            drive_column(ship): _span(m.drive),
        }
        if ship.has_variable_pitch:
            row["pitch_ratio_command"] = _span(m.pitch)
        if ship.turns:
            row["rudder_deg"] = _span(np.degrees(m.rudder))
        rows.append(row)
        start = end
    return pd.DataFrame(rows)


def _span(values: Floats) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
