"""Recordings: reading, checking, and driving a ship open loop with one's inputs."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .dynamics import State
from .hull import wake_inflow, water_speed
from .ship import Ship
from .ship_sections import DcMotor, TorqueSource
from .signals import SIGNALS
from .simulation import Schedule, simulate
from .steady_state import equilibrium, steady_inputs, with_lags_settled

TIME = "time_s"
_MEASURED = {
    "pitch_ratio": "measured_pitch_ratio",
    "shaft_speed_rad_s": "shaft_speed",
    "shaft_torque_N_m": "measured_shaft_torque",
    "ship_speed_m_s": "measured_ship_speed",
}
_OPTIONAL = {"thrust_N": "thrust", "motor_current_A": "motor_current"}
BOUNDS = {
    **{signal.column: (signal.low, signal.high, signal.unit) for signal in SIGNALS},
    "motor_voltage_V": (-1e5, 1e5, "V"),
    "motor_torque_N_m": (-1e8, 1e8, "N m"),
    "fuel_flow_kg_s": (0.0, 100.0, "kg/s"),
    "inflow_velocity_m_s": (-40.0, 40.0, "m/s"),
}
"""Lowest and highest value and unit of each column that is understood."""

COLUMNS = (
    TIME, "fuel_rack_mm", "motor_voltage_V", "motor_torque_N_m", "pitch_ratio_command",
    "pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s", "thrust_N",
    "fuel_flow_kg_s", "propeller_submergence_m", "motor_current_A", "inflow_velocity_m_s",
)  # fmt: skip
"""Canonical columns of a recording; demands first, then what was measured."""


class RecordingError(ValueError):
    """A recording that cannot be used; the message names file, column, row and what is wrong."""


def drive_column(ship: Ship) -> str:
    """Column that holds the demand on the ship's prime mover."""
    if isinstance(ship.prime_mover, DcMotor):
        return "motor_voltage_V"
    return "motor_torque_N_m" if isinstance(ship.prime_mover, TorqueSource) else "fuel_rack_mm"


def input_columns(ship: Ship) -> list[str]:
    """Columns that a recording must have to drive the ship."""
    fixed_pitch = ship.propeller.pitch_ratio_min == ship.propeller.pitch_ratio_max
    return [TIME, drive_column(ship)] + ([] if fixed_pitch else ["pitch_ratio_command"])


def read_recording(path: str | Path, required: list[str]) -> pd.DataFrame:
    """Read and check a recording.

    Args:
        path: CSV or Parquet file with a header of canonical columns (name and unit, such as
            ``fuel_rack_mm``).
        required: columns that must be there.

    Returns:
        The table as floats; columns that are not canonical are kept untouched.

    Raises:
        RecordingError: unreadable, a column missing, a value that is no finite number or outside
            its signal's bounds, or a time that does not rise evenly. Rows count from 1 below the
            header.
    """
    path = Path(path)
    table = as_numbers(path, read_table(path), required)
    check_bounds(path, table)
    _check_time(path, table[TIME].to_numpy())
    return table


def read_table(path: Path) -> pd.DataFrame:
    """The raw table of a CSV or Parquet file.

    Raises:
        RecordingError: the file cannot be read, or Parquet's reader (pyarrow) is not installed.
    """
    parquet = path.suffix.lower() in (".parquet", ".pq")
    try:
        return pd.read_parquet(path) if parquet else pd.read_csv(path)
    except ImportError:
        raise RecordingError(
            f"{path}: Parquet needs pyarrow: pip install 'shaftline[parquet]'"
        ) from None
    except (OSError, ValueError) as error:  # pandas' and pyarrow's own are ValueErrors
        kind = "Parquet" if parquet else "CSV"
        raise RecordingError(f"{path}: cannot be read as {kind}: {error}") from None


def as_numbers(path: Path, table: pd.DataFrame, required: list[str]) -> pd.DataFrame:
    """A copy whose understood columns are finite floats.

    Raises:
        RecordingError: a required column missing, fewer than two rows, or a value that is no
            finite number.
    """
    missing = [column for column in required if column not in table.columns]
    if missing:
        raise RecordingError(
            f"{path}: column {missing[0]!r} is missing; needed: {', '.join(required)}; "
            f"found: {', '.join(map(str, table.columns))}"
        )
    if len(table) < 2:
        raise RecordingError(f"{path}: {len(table)} row(s); at least 2 are needed")
    table = table.copy()
    for column in (c for c in table.columns if c in BOUNDS):
        numbers = pd.to_numeric(table[column], errors="coerce").astype(float)
        bad = ~np.isfinite(numbers.to_numpy())
        if bad.any():
            row = int(np.argmax(bad))
            given = table[column].iloc[row]
            raise RecordingError(
                f"{path}: {column}, row {row + 1}: {repr(given) if isinstance(given, str) else given} "
                f"is not a finite number ({bad.sum()} of {len(table)} rows; unit {BOUNDS[column][2]})"
            )
        table[column] = numbers
    return table


def check_bounds(path: Path, table: pd.DataFrame) -> None:
    """Refuse values that no ship reaches.

    Raises:
        RecordingError: a value outside its column's :data:`BOUNDS`.
    """
    for column in (c for c in table.columns if c in BOUNDS):
        low, high, unit = BOUNDS[column]
        outside = ~table[column].between(low, high).to_numpy()
        if outside.any():
            row = int(np.argmax(outside))
            raise RecordingError(
                f"{path}: {column}, row {row + 1}: {table[column].iloc[row]:g} {unit} lies outside "
                f"{low:g} to {high:g} {unit}"
            )


def _check_time(path: Path, time: np.ndarray[Any, Any]) -> None:
    steps = np.diff(time)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 2
        raise RecordingError(f"{path}: {TIME}, row {row}: time does not rise")
    usual = float(np.median(steps))
    uneven = np.abs(steps - usual) > 0.01 * usual
    if uneven.any():
        row = int(np.argmax(uneven)) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: a step of {steps[row - 2]:g} s where {usual:g} s is usual; "
            "resample the recording to an even time base"
        )


def simulate_recording(ship: Ship, recording: pd.DataFrame, sea: Any = None) -> pd.DataFrame:
    """Drive a ship open loop with a recording's inputs.

    The demands are held between rows. The simulation starts from the first row's pitch ratio, shaft
    speed and ship speed where all three are known (a fixed pitch and a fixed hull's speed are), else
    from the steady state at the first row's demands.

    Args:
        ship: the ship.
        recording: from :func:`read_recording`. Its ``propeller_submergence_m`` and
            ``inflow_velocity_m_s`` (measured advance velocity) act where it has them, linear
            between rows, on top of ``sea``.
        sea: SEA record from :func:`shaftline.plant.realise`, or None for calm water.

    Returns:
        The same time base and canonical columns: the inputs as given, everything else simulated.
        Thrust and motor current are there where the recording has them.

    Raises:
        RecordingError: the ship has no steady state at the first row's demands, or a measured
            inflow at a hull that moves has no ship speed beside it.
    """
    time = recording[TIME].to_numpy()
    period = float(np.median(np.diff(time)))
    per_row = max(1, math.ceil(period / ship.time_step_s - 1e-9))
    drive = recording[drive_column(ship)].to_numpy()
    pitch = (
        recording["pitch_ratio_command"].to_numpy()
        if "pitch_ratio_command" in recording
        else np.full(len(time), ship.propeller.pitch_ratio_max)
    )
    rows = len(time) - 1
    plant, even = ship.record(), period * np.arange(len(time))
    initial = _initial_state(ship, recording, float(drive[0]), float(pitch[0]))
    schedule = Schedule(np.repeat(drive[:-1], per_row), np.repeat(pitch[:-1], per_row))
    if "propeller_submergence_m" in recording:
        elevation = recording["propeller_submergence_m"].to_numpy() - float(plant["depth"])
        schedule = replace(schedule, elevation=lambda t: np.interp(t, even, elevation))
    if "inflow_velocity_m_s" in recording:
        met = recording["inflow_velocity_m_s"].to_numpy()
        if not ship.hull.fixed and "ship_speed_m_s" not in recording:
            raise RecordingError("inflow_velocity_m_s asks for ship_speed_m_s beside it")
        speed = 0.0 * met if ship.hull.fixed else recording["ship_speed_m_s"].to_numpy()
        inflow = met - np.array([wake_inflow(plant, water_speed(plant, v)) for v in speed])
        schedule = replace(schedule, inflow=lambda t: np.interp(t, even, inflow))
        if plant["inflow_lag"] > 0.0:
            initial = initial._replace(inflow=float(met[0]))
    samples = simulate(
        ship,
        schedule,
        rows * period,
        initial=initial,
        sea=sea,
        dt=period / per_row,
    )[::per_row]
    given = [*input_columns(ship), "propeller_submergence_m", "inflow_velocity_m_s"]
    columns: dict[str, Any] = {c: recording[c] for c in given if c in recording}
    columns |= {c: samples[name] for c, name in _MEASURED.items()}
    columns |= {c: samples[name] for c, name in _OPTIONAL.items() if c in recording}
    return pd.DataFrame(columns)


def _initial_state(ship: Ship, recording: pd.DataFrame, drive: float, pitch: float) -> State:
    measured = ("pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s")
    known = {column: float(recording[column].iloc[0]) for column in measured if column in recording}
    if ship.propeller.pitch_ratio_min == ship.propeller.pitch_ratio_max:
        known["pitch_ratio"] = ship.propeller.pitch_ratio_max
    if ship.hull.fixed:
        known["ship_speed_m_s"] = 0.0
    if len(known) == len(measured):
        first = (known[column] for column in measured)
        bare = State(*first, *(0.0,) * (len(State._fields) - len(measured)))
        return with_lags_settled(ship.record(), bare, steady_inputs(drive, pitch))
    try:
        return equilibrium(ship, drive, pitch).state
    except ValueError as error:
        raise RecordingError(
            f"the recording has no {', '.join(measured)} to start from, and {error}"
        ) from None
