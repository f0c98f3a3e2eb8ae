"""Estimate parameters by least squares on steady states (Vrijdag & Martelli 2021, method 1, part 1).

Steady states are the plateaus of recordings, or the rows of a table without time. In a steady state all
rates of the plant's equations are 0. The balances at the measured speeds and currents are linear in
frictions, constants and coefficients (eqs. 22 to 28). The equations are those of the plant, so that the
method serves every rig whose states are measured:

    shaft    drive torque less load torque           [N m], unless the drive prescribes the speed
    motor    U - K_e omega - R_a i                   [V], if the current i is measured
    hull     thrust less resistance                  [N], if the hull moves

Without the motor's current, torque is identifiable in units of K_e / R_a only.
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
from ...plant.dynamics import evaluate, settle_lags
from ...plant.hull import wake_inflow, water_speed
from ...plant.recording import WATER, RecordingError, check_bounds, convert_numbers
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship
from ...plant.state import Inputs, State
from ...plant.steady_state import Equilibrium
from ..estimate import Tick, ignore_progress
from ..judge.held_out import ROUNDING
from ..recordings.joint import Recorded
from ..recordings.load import TABLE, Recording, read_canonical
from ..recordings.noise import white_rms
from .drive_train import CONSTANT, RESISTANCE, torque_factor
from .free_parameters import Free, UnidentifiableError, parse_free, refuse_indistinct, usual_keys
from .parameters import MethodResult

Array = NDArray[np.float64]

METHOD = "steady"
CURRENT, SPEED = "motor_current_A", "ship_speed_m_s"
_TURN = (RUDDER, SWAY_SPEED, YAW_RATE)
CHANNELS = ("pitch_ratio", SHAFT_SPEED, SPEED, CURRENT, *_TURN, *WATER)
"""Measured columns that must be steady, if the recording has them."""
_OPTIONAL = (CURRENT, "pitch_ratio", "pitch_ratio_command", RUDDER_COMMAND, *_TURN, *WATER)
"""Optional columns of a table of steady states."""

ROUNDS = 20
HELD = 0.003  # largest change of a constant command, as a share of its range, besides its noise
SETTLED = 0.0005  # largest change of a steady channel, likewise, besides the noise of its means
BLOCKS = 20  # number of blocks of a plateau whose means are compared
FEWEST = 2 * BLOCKS  # smallest number of rows of a plateau


def steady(
    ship: Ship,
    tables: Iterable[pd.DataFrame],
    free: Sequence[str] | None = None,
    tick: Tick = ignore_progress,
) -> MethodResult:
    """Estimate parameters of a ship by least squares on its steady states.

    Args:
        ship: ship with the start of the search and the parameters that are not free.
        tables: recordings in canonical columns at an even interval, whose plateaus are used; or tables
            of steady states without ``time_s``, one in each row. Needed: the drive command,
            ``shaft_speed_rad_s``, and ``ship_speed_m_s`` if the hull moves; ``motor_current_A`` of a
            motor gives the second balance.
        free: dotted keys; by default those of :func:`.free_parameters.usual_keys`, the paper's M_f, K_e,
            R_a and KQ for a direct-current motor at bollard pull.
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        Estimates with the covariance from the residuals: each balance has its own variance, the sum of
        its squared residuals over its remaining degrees of freedom. Tables: ``steady-states`` with the
        residuals of the balances, ``fit`` with their rms.

    Raises:
        ValueError: a missing column, no or too few steady states, or parameters that the states do not
            distinguish.
    """
    chosen = parse_free(ship, free, usual_keys(ship))
    points = steady_states(ship, tables)
    tick(METHOD, 1, 2)
    currentless = [key for key in (RESISTANCE, CONSTANT) if key in chosen]
    if currentless and CURRENT not in points:
        raise UnidentifiableError(
            f"{METHOD}: {currentless[0]} needs {CURRENT}; without it torque is identifiable in units of "
            "K_e / R_a only, and both must be known",
            currentless[:1],
            chosen.keys,
        )
    values, covariance = solve(chosen, points)
    tick(METHOD, 2, 2)
    left = pd.DataFrame(balances(chosen.on(values), points))
    shown = pd.concat([points.reset_index(drop=True), left], axis=1)
    fit = pd.DataFrame({"balance": left.columns, "rms": np.sqrt((left**2).mean()).to_numpy()})
    remark = (
        f"{len(points)} steady states, {left.size} equations for {len(values)} parameters; standard "
        "errors from the residuals of the balances"
    )
    return MethodResult(
        chosen.keys,
        tuple(map(float, values)),
        covariance,
        {"steady-states": shown, "fit": fit},
        (remark,),
    )


def steady_states(ship: Ship, tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Return the steady states of recordings (plateaus) or tables (rows) as one table.

    Raises:
        ValueError: a ship without a balance to compare, a missing column, or no steady state.
    """
    if not (ship.turns_freely or ship.moves):
        raise ValueError(
            f"{METHOD}: {ship.name} has no balance to compare: its drive prescribes the shaft speed and "
            "its hull is fixed"
        )
    needed = dict.fromkeys([drive_column(ship), SHAFT_SPEED, *([SPEED] if ship.moves else [])])
    rows: list[dict[str, Any]] = []
    for table in tables:
        lacking = [column for column in needed if column not in table]
        if ship.has_variable_pitch and blade_column(ship, table) is None:
            lacking.append("pitch_ratio")
        if lacking:
            raise ValueError(f"{METHOD}: {ship.name} needs {lacking[0]}, which a recording lacks")
        if TIME in table:
            rows += [plateau.means for plateau in plateaus(ship, table)]
        else:
            known = [c for c in (*needed, *_OPTIONAL) if c in table]
            rows += table[known].to_dict("records")
    if not rows:
        raise ValueError(
            f"{METHOD}: no steady state; the commands must be constant until the shaft speed is steady"
        )
    points = pd.DataFrame(rows)
    if len(some := points.columns[points.isna().any()]):
        raise ValueError(f"{METHOD}: {some[0]} is in some of the recordings and not in others")
    return points


def blade_column(ship: Ship, table: pd.DataFrame) -> str | None:
    """Return the column of the pitch ratio; None for a fixed pitch or without such a column."""
    columns = ("pitch_ratio", "pitch_ratio_command") if ship.has_variable_pitch else ()
    return next((column for column in columns if column in table), None)


def point_at(ship: Ship, plant: Any, values: Mapping[Any, float]) -> tuple[Equilibrium, State]:
    """Return the plant at a measured point, and the rates of its states there.

    Args:
        ship: the ship.
        plant: its record.
        values: command and measured states by column; states that were not measured are steady or 0.
    """
    speed = float(values.get(SPEED, 0.0))
    commanded = values.get("pitch_ratio_command", ship.propeller.pitch_ratio_max)
    blade = ship.propeller.pitch_ratio_max
    if ship.has_variable_pitch:
        blade = float(values.get("pitch_ratio", commanded))
    inflow, depth = (values.get(column) for column in WATER[::-1])
    inputs = Inputs(
        float(values[drive_column(ship)]),
        blade,
        inflow=0.0 if inflow is None else inflow - wake_inflow(plant, water_speed(plant, speed)),
        elevation=0.0 if depth is None else depth - ship.propeller.depth_m,
        rudder_command=float(values.get(RUDDER_COMMAND, values.get(RUDDER, 0.0))),
    )
    bare = State(
        blade,
        float(values[SHAFT_SPEED]),
        speed,
        sway_speed=float(values.get(SWAY_SPEED, 0.0)),
        yaw_rate=float(values.get(YAW_RATE, 0.0)),
    )
    state = settle_lags(plant, bare, inputs)
    if ship.has_voltage and CURRENT in values:
        state = state._replace(motor_current=float(values[CURRENT]))
    rate, outputs = evaluate(plant, state, inputs, blade)
    return Equilibrium(state, outputs, inputs), rate


def balances(ship: Ship, points: pd.DataFrame) -> dict[str, Array]:
    """Return the residual of each balance of the plant at measured points, each of shape (points,).

    Returns:
        ``shaft`` [N m] at the prime mover unless it prescribes the speed, ``motor`` [V] if the current
        is measured, ``hull`` [N] if the hull moves. A positive residual is a surplus.
    """
    plant = ship.record()
    wired = ship.has_voltage and CURRENT in points
    if wired:
        plant["armature_inductance"] = 1.0  # so that the current's rate [A/s] is a voltage [V]
    rates = [point_at(ship, plant, point)[1] for point in points.to_dict("records")]
    lacking: dict[str, Array] = {}
    if ship.turns_freely:
        turned = float(shaft_inertia(plant)) / torque_factor(ship)
        lacking["shaft"] = np.array([float(rate.shaft_speed) * turned for rate in rates])
    if wired:
        lacking["motor"] = np.array([float(rate.motor_current) for rate in rates])
    if ship.moves:
        lacking["hull"] = np.array([float(rate.ship_speed * plant["mass"]) for rate in rates])
    return lacking


def solve(chosen: Free, points: pd.DataFrame) -> tuple[Array, Array]:
    """Return estimates and covariance by unweighted least squares over all balances.

    Gauss-Newton steps with central differences; one step if the balances are linear in the parameters.

    Raises:
        ValueError: no more equations than parameters, or parameters that the states do not distinguish.
    """

    def residual(values: Any) -> Array:
        return np.concatenate(list(balances(chosen.on(values), points).values()))

    values = chosen.start.copy()
    low, high = np.array([(number.info.low, number.info.high) for number in chosen.numbers]).T
    lowest = np.where(low == 0.0, 1e-12, low)  # a value that a ship file allows
    rows = residual(values)
    if len(rows) <= len(values):
        raise ValueError(
            f"{METHOD}: {len(points)} steady state(s) give {len(rows)} equations for {len(values)} "
            "parameters; record more constant commands"
        )
    for _ in range(ROUNDS):
        slopes = _jacobian(residual, values, chosen.scale, low, high)
        refuse_indistinct(chosen.keys, slopes * chosen.scale, METHOD)
        step, *_ = np.linalg.lstsq(slopes * chosen.scale, -rows, rcond=None)
        following = np.clip(values + step * chosen.scale, lowest, high)
        done = np.max(np.abs(following - values) / chosen.scale) < 1e-10
        values, rows = following, residual(following)
        if done:
            break
    return values, _covariance(slopes, rows, len(points))


def _jacobian(function: Any, values: Array, scale: Array, low: Array, high: Array) -> Array:
    """Return central differences inside the bounds, shape (rows, n)."""
    columns = []
    for i in range(len(values)):
        up, down = values.copy(), values.copy()
        up[i] = min(values[i] + 1e-3 * scale[i], high[i])
        down[i] = max(values[i] - 1e-3 * scale[i], low[i])
        columns.append((function(up) - function(down)) / (up[i] - down[i]))
    return np.column_stack(columns)


def _covariance(slopes: Array, rows: Array, points: int) -> Array:
    """Return the sandwich covariance of unweighted least squares with one variance for each balance."""
    scale = np.linalg.norm(slopes, axis=0)
    inverse = np.linalg.inv(slopes.T @ slopes / np.outer(scale, scale)) / np.outer(scale, scale)
    spend = 1.0 - slopes.shape[1] / len(rows)  # share of the equations that is left for the noise
    variance = np.repeat(np.mean(rows.reshape(-1, points) ** 2, axis=1) / spend, points)
    return np.asarray(inverse @ (slopes.T * variance) @ slopes @ inverse)


@dataclass(frozen=True)
class Plateau:
    """Steady state in a recording.

    Args:
        begin: first row with the constant command.
        settled: first row of the steady state.
        end: one past the last row.
        means: means of command and measured channels over the steady state, by column.
    """

    begin: int
    settled: int
    end: int
    means: dict[str, float]


def plateaus(ship: Ship, table: pd.DataFrame) -> list[Plateau]:
    """Return the steady states of a recording in their order.

    Args:
        ship: nominal ship, which determines the column of the drive command.
        table: recording in canonical columns at an even interval, all values finite.

    Raises:
        ValueError: the recording has no column of the drive command.
    """
    column = drive_column(ship)
    if column not in table:
        raise ValueError(f"{ship.name}: the recording has no {column}")
    channels = {c: table[c].to_numpy(dtype=np.float64) for c in CHANNELS if c in table}
    demands = [column, "pitch_ratio_command"] if ship.has_variable_pitch else [column]
    if ship.turns:
        demands.append(RUDDER_COMMAND)
    held = {c: table[c].to_numpy(dtype=np.float64) for c in demands if c in table}
    moved = np.zeros(len(table) - 1, dtype=bool)  # whether a command changes behind the row
    for values in held.values():
        noise = max(8.0 * white_rms(values), HELD * float(np.ptp(values)), 1e-12)
        moved |= np.abs(np.diff(values)) > noise
    edges = [0, *(int(row) + 1 for row in np.flatnonzero(moved)), len(table)]
    found = []
    for begin, end in itertools.pairwise(edges):
        if end - begin < FEWEST or not _is_held(held, begin, end):
            continue
        settled = _settled(channels, begin, end)
        if settled is not None:
            means = {c: float(v[settled:end].mean()) for c, v in (held | channels).items()}
            found.append(Plateau(begin, settled, end, means))
    return found


def _is_held(held: dict[str, Array], begin: int, end: int) -> bool:
    """Return whether the commands are constant, without a drift."""
    for values in held.values():
        parts = [part.mean() for part in np.array_split(values[begin:end], BLOCKS)]
        if np.ptp(parts) > 2.0 * HELD * max(float(np.ptp(values)), 1e-12):
            return False
    return True


def _settled(channels: dict[str, Array], begin: int, end: int) -> int | None:
    """Return the row from which all channels are steady; None unless that is a quarter of the time."""
    rows = np.array_split(np.arange(begin, end), BLOCKS)
    first = 0
    for values in channels.values():
        spread = float(np.ptp(values))
        if spread <= ROUNDING * np.abs(values).max():
            continue  # a constant channel; its means differ by rounding
        means = np.array([values[part].mean() for part in rows])
        last, late = means[-BLOCKS // 3 :], means[BLOCKS // 2 :]
        place = np.arange(len(late))
        left = late - np.polyval(np.polyfit(place, late, 1), place)
        white = white_rms(values[begin:end]) / np.sqrt(len(rows[0]))
        noise = max(float(np.std(left, ddof=2)), white)
        off = np.abs(means - last.mean()) > max(SETTLED * spread, 5.0 * noise)
        first = max(first, int(np.flatnonzero(off)[-1]) + 2 if off.any() else 1)
        # A channel that drifts is not steady, even if its blocks have a large noise.
        rest = means[first:]
        if len(rest) >= BLOCKS // 4:
            drift = np.polyfit(np.arange(len(rest)), rest, 1)[0] * len(rest)
            if abs(drift) > max(2.0 * SETTLED * spread, 6.0 * noise):
                return None
    return int(rows[first][0]) if first <= BLOCKS - BLOCKS // 4 else None


def points_of(
    ship: Ship, sources: Sequence[Recorded], columns: str | Path | None = None
) -> list[pd.DataFrame] | None:
    """Return tables of steady states, if the sources are such tables.

    Returns:
        Tables in canonical columns, one steady state in each row; None if all sources have a time.

    Raises:
        RecordingError: a file cannot be used; names file, column and row.
        ValueError: tables of steady states together with recordings.
    """
    tables = [_table(ship, source, columns) for source in sources]
    timeless = [TIME not in table for table in tables]
    if not any(timeless):
        return None
    if not all(timeless):
        raise ValueError(
            f"tables of steady states (without {TIME}) and recordings cannot be combined; give only one "
            "kind"
        )
    return tables


def _table(ship: Ship, source: Recorded, columns: str | Path | None) -> pd.DataFrame:
    if isinstance(source, Recording):
        return source.table
    path = Path(TABLE) if isinstance(source, pd.DataFrame) else Path(source)
    raw, _ = read_canonical(source, ship, columns)
    if TIME in raw:
        return raw
    known = [c for c in COLUMNS if c in raw]
    if not known:  # not a table of steady states either
        found = ", ".join(map(str, raw))
        raise RecordingError(f"{path}: column {TIME!r} is missing; found: {found}")
    table = convert_numbers(path, raw, [drive_column(ship), SHAFT_SPEED])[known]
    check_bounds(path, table)
    return table
