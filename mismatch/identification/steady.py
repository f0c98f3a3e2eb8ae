"""Steady states in a recording: where the demand is held and nothing measured moves any more.

Steady states given as a table of points: a row each, without a time.

Least squares on steady states (Vrijdag & Martelli 2021, method 1, part 1; eqs. 22 to 28).

In a steady state every rate of the plant's equations is 0. What is left of them at the measured
speeds and currents is linear in frictions, constants and coefficients, and least squares over several
states finds those. The equations are the plant's own, so the method serves every rig whose states are
measured:

    shaft    torque of the drive less that of the load       [N m], where no speed is held
    motor    U - K_e omega - R_a i, where i is measured      [V]
    hull     thrust less resistance, where the hull moves    [N]

Without the motor's current its voltage tells torque in units of K_e / R_a only.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    COLUMNS,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_SPEED,
    SWAY_SPEED,
    TIME,
    YAW_RATE,
    drive_column,
)
from ...plant.dynamics import evaluate, settled
from ...plant.hull import wake_inflow, water_speed
from ...plant.recording import WATER, RecordingError, as_numbers, check_bounds
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship
from ...plant.state import Inputs, State
from ...plant.steady_state import Equilibrium
from ..estimate import Tick, silent
from ..judge.held_out import ROUNDING
from ..recordings.joint import Recorded
from ..recordings.load import TABLE, Recording, read_mapped
from ..recordings.noise import white_rms
from .drive_train import CONSTANT, RESISTANCE, torque_factor
from .free_parameters import Free, UntoldError, freed, refuse_indistinct, usual_keys
from .results import Found

CHANNELS = (
    "pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s", "motor_current_A", RUDDER, SWAY_SPEED,
    YAW_RATE, *WATER,
)  # fmt: skip
"""Measured columns that must be steady, where the recording has them."""

HELD = 0.003
"""Share of the demand's range by which a held demand may move, besides its noise."""

SETTLED = 0.0005
"""Share of a channel's spread within which it has come to rest, besides the noise of its means."""

BLOCKS = 20
"""Parts into which a held demand is divided to see what moves."""

FEWEST = 2 * BLOCKS
"""Rows below which nothing is seen."""


@dataclass(frozen=True)
class Plateau:
    """A steady state in a recording.

    Args:
        begin: row from which the demand is held.
        settled: row from which nothing moves.
        end: row behind the last one.
        means: of demand and measured channels over the settled rows, by column.
    """

    begin: int
    settled: int
    end: int
    means: dict[str, float]


def plateaus(ship: Ship, table: pd.DataFrame) -> list[Plateau]:
    """Every steady state of a recording, in their order.

    Args:
        ship: its prime mover says which column is the demand.
        table: canonical columns at an even interval, all finite.

    Raises:
        ValueError: the recording has no column of the demand.
    """
    column = drive_column(ship)
    if column not in table:
        raise ValueError(f"{ship.name}: the recording has no {column}")
    channels = {c: table[c].to_numpy(dtype=np.float64) for c in CHANNELS if c in table}
    demands = [column, "pitch_ratio_command"] if ship.has_variable_pitch else [column]
    if ship.turns:
        demands.append(RUDDER_COMMAND)
    held = {c: table[c].to_numpy(dtype=np.float64) for c in demands if c in table}
    edges = [0, *_moves(held), len(table)]
    spread = {c: float(np.ptp(values)) for c, values in channels.items()}
    found = []
    for begin, end in itertools.pairwise(edges):
        if end - begin < FEWEST or not _is_held(held, begin, end):
            continue
        settled = _settled(channels, spread, begin, end)
        if settled is not None:
            means = {c: float(v[settled:end].mean()) for c, v in (held | channels).items()}
            found.append(Plateau(begin, settled, end, means))
    return found


def _tolerance(values: NDArray[np.float64]) -> float:
    return max(8.0 * white_rms(values), HELD * float(np.ptp(values)), 1e-12)


def _moves(held: dict[str, NDArray[np.float64]]) -> list[int]:
    """Rows at which a demand takes a new value."""
    moved = np.zeros(len(next(iter(held.values()))) - 1, dtype=bool)
    for values in held.values():
        moved |= np.abs(np.diff(values)) > _tolerance(values)
    return [int(row) + 1 for row in np.flatnonzero(moved)]


def _is_held(held: dict[str, NDArray[np.float64]], begin: int, end: int) -> bool:
    """Whether the demands stay where they are: they may drift between two moves."""
    for values in held.values():
        parts = [part.mean() for part in np.array_split(values[begin:end], BLOCKS)]
        if np.ptp(parts) > 2.0 * HELD * max(float(np.ptp(values)), 1e-12):
            return False
    return True


def _straightened(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values without their mean and trend."""
    place = np.arange(len(values))
    return np.asarray(values - np.polyval(np.polyfit(place, values, 1), place))


def _settled(
    channels: dict[str, NDArray[np.float64]], spread: dict[str, float], begin: int, end: int
) -> int | None:
    """Row from which no channel moves; None where one never rests for a quarter of the time."""
    rows = np.array_split(np.arange(begin, end), BLOCKS)
    first = 0
    for column, values in channels.items():
        if spread[column] <= ROUNDING * np.abs(values).max():
            continue  # constant: means of equal numbers differ by their rounding
        means = np.array([values[part].mean() for part in rows])
        last = means[-BLOCKS // 3 :]
        white = white_rms(values[begin:end]) / np.sqrt(len(rows[0]))
        noise = max(float(np.std(_straightened(means[BLOCKS // 2 :]), ddof=2)), white)
        off = np.abs(means - last.mean()) > max(SETTLED * spread[column], 5.0 * noise)
        first = max(first, int(np.flatnonzero(off)[-1]) + 2 if off.any() else 1)
        # what still drifts is no rest, however large the noise of its blocks
        rest = means[first:]
        if len(rest) >= BLOCKS // 4:
            drift = np.polyfit(np.arange(len(rest)), rest, 1)[0] * len(rest)
            if abs(drift) > max(2.0 * SETTLED * spread[column], 6.0 * noise):
                return None
    return int(rows[first][0]) if first <= BLOCKS - BLOCKS // 4 else None


def points_of(
    ship: Ship, sources: Sequence[Recorded], columns: str | Path | None = None
) -> list[pd.DataFrame] | None:
    """Tables of points, where that is what was given.

    Args:
        ship: that was measured.
        sources: files or tables.
        columns: column map of the files, or none.

    Returns:
        Canonical columns, a row each steady state; None where every source has a time.

    Raises:
        RecordingError: a file that cannot be used; names file, column and row.
        ValueError: points beside recordings.
    """
    tables = [_table(ship, source, columns) for source in sources]
    timeless = [TIME not in table for table in tables]
    if not any(timeless):
        return None
    if not all(timeless):
        raise ValueError(
            f"tables of points (without {TIME}) and recordings do not go together; "
            "give one kind or the other"
        )
    return tables


def _table(ship: Ship, source: Recorded, columns: str | Path | None) -> pd.DataFrame:
    if isinstance(source, Recording):
        return source.table
    path = Path(TABLE) if isinstance(source, pd.DataFrame) else Path(source)
    raw, _ = read_mapped(source, ship, columns)
    if TIME in raw:
        return raw
    if not set(raw) & set(COLUMNS):  # then it is no table of points either
        raise RecordingError(
            f"{path}: column {TIME!r} is missing; found: {', '.join(map(str, raw))}"
        )
    table = as_numbers(path, raw, [drive_column(ship), SHAFT_SPEED])[
        [c for c in COLUMNS if c in raw]
    ]
    check_bounds(path, table)
    return table


METHOD = "steady"
CURRENT = "motor_current_A"
_BESIDE = (
    CURRENT, "pitch_ratio", "pitch_ratio_command", RUDDER_COMMAND, RUDDER, SWAY_SPEED, YAW_RATE, *WATER,
)  # fmt: skip
"""Columns of a table of points that act where the table has them."""
ROUNDS = 20


def steady(
    ship: Ship, tables: Iterable[pd.DataFrame], free: Sequence[str] | None = None,
    tick: Tick = silent,
) -> Found:  # fmt: skip
    """Numbers of a ship by least squares on its steady states.

    Args:
        ship: start of the search, and the numbers that are not free.
        tables: recordings in canonical columns at an even interval, whose plateaus are found; or tables
            of points, a row each, without ``time_s``. Needed: the demand on the drive,
            ``shaft_speed_rad_s``, and ``ship_speed_m_s`` where the hull moves; a motor's
            ``motor_current_A`` gives the second balance.
        free: dotted keys; those of :func:`.free.usual_keys` by default, which are the paper's M_f, K_e,
            R_a and KQ on a direct-current motor at bollard pull.
        tick: told how far it is.

    Returns:
        Values with the covariance that the residuals show: each balance has a variance of its own,
        which is that of its residuals over what is left of its equations when the numbers are found.
        Tables: ``steady-states`` with what each balance lacks, ``fit`` with its rms.

    Raises:
        ValueError: a column is missing, no steady states or too few, or numbers that they do not tell
            apart.
    """
    chosen = freed(ship, free, usual_keys(ship))
    points = steady_states(ship, tables)
    tick(METHOD, 1, 2)
    _refuse_currentless(chosen, points)
    values, covariance = solve(chosen, points)
    tick(METHOD, 2, 2)
    found = chosen.on(values)
    left = pd.DataFrame(balances(found, points))
    shown = pd.concat([points.reset_index(drop=True), left], axis=1)
    fit = pd.DataFrame({"balance": left.columns, "rms": np.sqrt((left**2).mean()).to_numpy()})
    remark = (
        f"{len(points)} steady states, {left.size} equations for {len(values)} numbers; standard errors "
        "from what the balances lack"
    )
    return Found(
        chosen.keys, tuple(map(float, values)), covariance,
        {"steady-states": shown, "fit": fit}, (remark,),
    )  # fmt: skip


def steady_states(ship: Ship, tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Steady states as a table of points: the plateaus of recordings, the rows of tables of points.

    Raises:
        ValueError: no balance to compare, a column that is missing, or no steady state.
    """
    if not (ship.turns_freely or ship.moves):
        raise ValueError(
            f"{METHOD}: {ship.name} has no balance to compare: its drive holds the shaft's speed and "
            "its hull is fixed"
        )
    needed = list(dict.fromkeys([drive_column(ship), SHAFT_SPEED]))
    if ship.moves:
        needed.append("ship_speed_m_s")
    rows: list[dict[str, Any]] = []
    for table in tables:
        lacking = [column for column in needed if column not in table]
        if ship.has_variable_pitch and blade_column(ship, table) is None:
            lacking.append("pitch_ratio")
        if lacking:
            raise ValueError(f"{METHOD}: {ship.name} needs {lacking[0]}, which a recording lacks")
        known = [c for c in (*needed, *_BESIDE) if c in table]
        if TIME in table:
            rows += [plateau.means for plateau in plateaus(ship, table)]
        else:
            rows += table[known].to_dict("records")
    if not rows:
        raise ValueError(
            f"{METHOD}: no steady state; it needs demands that are held until the shaft has settled "
            "at its speed"
        )
    points = pd.DataFrame(rows)
    if points.isna().to_numpy().any():
        column = points.columns[points.isna().to_numpy().any(axis=0)][0]
        raise ValueError(f"{METHOD}: {column} is in some of the recordings and not in others")
    return points


def blade_column(ship: Ship, table: pd.DataFrame) -> str | None:
    """Return the column that tells where the blades stand; None of a fixed pitch, or without any."""
    columns = ("pitch_ratio", "pitch_ratio_command") if ship.has_variable_pitch else ()
    return next((column for column in columns if column in table), None)


def point_at(
    ship: Ship, plant: Any, values: Mapping[Any, float]
) -> tuple[Equilibrium, State]:  # fmt: skip
    """Return the plant at a measured point, and the rates of its states there.

    Args:
        ship: the ship.
        plant: its record.
        values: demand and measured states, by column; states that were not measured are those to which
            the plant settles, or 0.
    """
    speed = float(values.get("ship_speed_m_s", 0.0))
    commanded = values.get("pitch_ratio_command", ship.propeller.pitch_ratio_max)
    blade = ship.propeller.pitch_ratio_max
    if ship.has_variable_pitch:
        blade = float(values.get("pitch_ratio", commanded))
    inflow, depth = (values.get(column) for column in WATER[::-1])
    inputs = Inputs(
        float(values[drive_column(ship)]), blade,
        inflow=0.0 if inflow is None else inflow - wake_inflow(plant, water_speed(plant, speed)),
        elevation=0.0 if depth is None else depth - ship.propeller.depth_m,
        rudder_command=float(values.get(RUDDER_COMMAND, values.get(RUDDER, 0.0))),
    )  # fmt: skip
    bare = State(
        blade, float(values[SHAFT_SPEED]), speed, sway_speed=float(values.get(SWAY_SPEED, 0.0)),
        yaw_rate=float(values.get(YAW_RATE, 0.0)),
    )  # fmt: skip
    state = settled(plant, bare, inputs)
    if ship.has_voltage and CURRENT in values:
        state = state._replace(motor_current=float(values[CURRENT]))
    rate, outputs = evaluate(plant, state, inputs, blade)
    return Equilibrium(state, outputs, inputs), rate


def balances(ship: Ship, points: pd.DataFrame) -> dict[str, NDArray[np.float64]]:
    """What each balance lacks at measured points, by the plant's equations; each of shape (points,).

    Args:
        ship: the ship.
        points: demand and states, of :func:`steady_states`.

    Returns:
        ``shaft`` [N m] at the prime mover where it turns freely, ``motor`` [V] where the current is
        measured, ``hull`` [N] where the hull moves. Positive: torque, voltage or force is left over.
    """
    plant = ship.record()
    wired = ship.has_voltage and CURRENT in points
    if wired:
        plant["armature_inductance"] = 1.0  # so that the current's rate [A/s] is a voltage [V]
    rates = [point_at(ship, plant, point)[1] for point in points.to_dict("records")]
    lacking: dict[str, NDArray[np.float64]] = {}
    if ship.turns_freely:
        turned = float(shaft_inertia(plant)) / torque_factor(ship)
        lacking["shaft"] = np.array([float(rate.shaft_speed) * turned for rate in rates])
    if wired:
        lacking["motor"] = np.array([float(rate.motor_current) for rate in rates])
    if ship.moves:
        lacking["hull"] = np.array([float(rate.ship_speed * plant["mass"]) for rate in rates])
    return lacking


def solve(chosen: Free, points: pd.DataFrame) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unweighted least squares over all balances: values and their covariance.

    Gauss-Newton with differences; one round where the balances are linear in the numbers.

    Raises:
        ValueError: fewer equations than numbers and one more, or numbers that the states do not tell
            apart.
    """

    def residual(values: Any) -> NDArray[np.float64]:
        return np.concatenate(list(balances(chosen.on(values), points).values()))

    values = chosen.start.copy()
    low, high = (
        np.array([getattr(number.info, end) for number in chosen.numbers])
        for end in ("low", "high")
    )
    rows = residual(values)
    if len(rows) <= len(values):
        raise ValueError(
            f"{METHOD}: {len(points)} steady state(s) give {len(rows)} equations for {len(values)} "
            "numbers; more demands must be held"
        )
    for _ in range(ROUNDS):
        slopes = jacobian(residual, values, chosen.scale, low, high)
        refuse_indistinct(chosen.keys, slopes * chosen.scale, METHOD)
        step, *_ = np.linalg.lstsq(slopes * chosen.scale, -rows, rcond=None)
        following = np.clip(values + step * chosen.scale, *_inside(low, high))
        done = np.max(np.abs(following - values) / chosen.scale) < 1e-10
        values, rows = following, residual(following)
        if done:
            break
    names = balances(chosen.on(values), points)
    return values, _covariance(slopes, rows, [len(part) for part in names.values()])


def jacobian(
    function: Any, values: NDArray[np.float64], scale: Any, low: Any, high: Any
) -> NDArray[np.float64]:
    """Central differences, within bounds; shape (rows, n)."""
    columns = []
    for i in range(len(values)):
        up, down = values.copy(), values.copy()
        up[i] = min(values[i] + 1e-3 * scale[i], high[i])
        down[i] = max(values[i] - 1e-3 * scale[i], low[i])
        columns.append((function(up) - function(down)) / (up[i] - down[i]))
    return np.column_stack(columns)


def _inside(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[Any, Any]:
    """Bounds that are themselves allowed, whichever kind they are."""
    return np.where(low == 0.0, 1e-12, low), high


def _covariance(
    slopes: NDArray[np.float64], rows: NDArray[np.float64], lengths: list[int]
) -> NDArray[np.float64]:
    """Of unweighted least squares whose balances have variances of their own (a sandwich)."""
    scale = np.linalg.norm(slopes, axis=0)
    inverse = np.linalg.inv(slopes.T @ slopes / np.outer(scale, scale)) / np.outer(scale, scale)
    spend = 1.0 - slopes.shape[1] / len(rows)  # share of the equations that is left for the noise
    ends = np.cumsum(lengths)
    variance = np.concatenate(
        [
            np.full(n, np.mean(rows[e - n : e] ** 2) / spend)
            for n, e in zip(lengths, ends, strict=True)
        ]
    )
    return np.asarray(inverse @ (slopes.T * variance) @ slopes @ inverse)


def _refuse_currentless(chosen: Free, points: pd.DataFrame) -> None:
    if CURRENT in points:
        return
    if named := [key for key in (RESISTANCE, CONSTANT) if key in chosen]:
        raise UntoldError(
            f"{METHOD}: {named[0]} needs {CURRENT}; without it a voltage tells torque in units of "
            "K_e / R_a only, and both must be known", named[:1], chosen.keys,
        )  # fmt: skip
