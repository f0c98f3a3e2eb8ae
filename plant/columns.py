"""Columns of a recording: which are known, which drive a ship, and which a simulation gives."""

from __future__ import annotations

from .drives import DRIVES
from .ship import Ship
from .signals import LOG_SIGNALS, RECORDED_SIGNALS, SIGNALS

TIME = "time_s"
SHAFT_SPEED, SHAFT_ANGLE = "shaft_speed_rad_s", "shaft_angle_rad"
SHAFT_POWER, ELECTRIC_POWER = "shaft_power_W", "electric_power_W"
RUDDER_COMMAND, RUDDER = "rudder_command_rad", "rudder_rad"
SWAY_SPEED, YAW_RATE, HEADING = "sway_speed_m_s", "yaw_rate_rad_s", "heading_rad"
ROLL, ROLL_RATE = "roll_rad", "roll_rate_rad_s"
SHIP_SPEED, OVER_GROUND = "ship_speed_m_s", "speed_over_ground_m_s"
COURSE = "course_over_ground_rad"
NOX, CO2 = "nox_g_s", "co2_kg_s"

DEMANDS = tuple(drive.demand for drive in DRIVES)
"""Command signal of each kind of prime mover."""

BOUNDS = {
    signal.column: (signal.low, signal.high, signal.unit)
    for signal in (*SIGNALS, *DEMANDS, *RECORDED_SIGNALS)
}
"""Lowest value, highest value and unit of each known column."""

LOG_COLUMNS = tuple(signal.column for signal in LOG_SIGNALS)
"""Columns of ships' logs that no simulation gives."""

_DEMANDS = tuple(demand.column for demand in DEMANDS if demand.column != SHAFT_SPEED)
COLUMNS = (
    TIME, *_DEMANDS, "pitch_ratio_command", "pitch_ratio",
    SHAFT_SPEED, SHAFT_ANGLE, "shaft_torque_N_m", "ship_speed_m_s", "thrust_N",
    "propeller_submergence_m", "motor_current_A", SHAFT_POWER, ELECTRIC_POWER,
    "inflow_velocity_m_s",
    RUDDER_COMMAND, RUDDER, SWAY_SPEED, YAW_RATE, HEADING, ROLL, ROLL_RATE, *LOG_COLUMNS,
)  # fmt: skip
"""Canonical columns of a recording: commands first, then measurements."""

MEASURED = {
    "pitch_ratio": "measured_pitch_ratio",
    SHAFT_SPEED: "measured_shaft_speed",
    "shaft_torque_N_m": "measured_shaft_torque",
    "ship_speed_m_s": "measured_ship_speed",
    "thrust_N": "measured_thrust",
    "motor_current_A": "measured_motor_current",
    SHAFT_POWER: "shaft_power",
    ELECTRIC_POWER: "electric_power",
    SHAFT_ANGLE: "shaft_angle",
    SWAY_SPEED: "sway_speed",
    YAW_RATE: "yaw_rate",
    HEADING: "heading",
    RUDDER: "rudder_angle",
}
"""Measured columns, each with the simulated signal that corresponds to it."""

TURNING_COLUMNS = (SWAY_SPEED, YAW_RATE, HEADING, RUDDER)
"""Columns that only a ship with sway and yaw has."""

ROLLING_COLUMNS = {ROLL: "roll_angle", ROLL_RATE: "roll_rate"}
"""Columns that only a ship with roll has, each with its signal; a simulation is not fitted to them."""

ALWAYS_SIMULATED = tuple(MEASURED)[:4]
"""Columns that a simulation always returns; it returns the others only if the recording has them."""


def drive_column(ship: Ship) -> str:
    """Return the column of the command to the ship's prime mover."""
    return ship.prime_mover.demand.column


def signal_columns(ship: Ship) -> dict[str, str]:
    """Return the signals of a ship by their columns in a recording, canonical columns first.

    The signal ``drive`` has the column of the ship's own prime mover. Columns that do not apply are
    absent: the pitch command of a fixed pitch, sway and yaw of a straight course, the current without an
    armature.
    """
    names = {s.column: s.name for s in SIGNALS if s.name != "drive"}
    names = {drive_column(ship): "drive"} | names  # if the drive holds the speed: the speed reached
    absent = absent_columns(ship) | (set() if ship.has_variable_pitch else {"pitch_ratio_command"})
    ordered = dict.fromkeys((*(c for c in COLUMNS if c in names), *names))
    return {column: names[column] for column in ordered if column not in absent}


def simulated_columns(ship: Ship) -> list[str]:
    """Return the measured columns that a simulation of the ship gives."""
    none = set() if ship.has_propeller else {"thrust_N"}
    none |= set() if ship.turns_freely else {SHAFT_SPEED, SHAFT_ANGLE}
    none |= set() if ship.turns else set(TURNING_COLUMNS)
    none |= set() if ship.prime_mover.electric else {ELECTRIC_POWER}
    return [column for column in MEASURED if column not in none]


def absent_columns(ship: Ship) -> set[str]:
    """Return the columns of what the ship lacks: armature, electric drive, emissions, rudder, roll."""
    absent = set() if ship.has_voltage else {"motor_current_A", "true_motor_current_A"}
    absent |= set() if ship.prime_mover.electric else {ELECTRIC_POWER}
    absent |= set() if ship.emissions.nox_base_g_kWh > 0.0 else {NOX}
    absent |= set() if ship.emissions.co2_factor > 0.0 else {CO2}
    absent |= set() if ship.rolls else set(ROLLING_COLUMNS)
    return absent if ship.turns else {*absent, *TURNING_COLUMNS, RUDDER_COMMAND}


def input_columns(ship: Ship) -> list[str]:
    """Return the columns that a recording must have in order to drive the ship."""
    command = ["pitch_ratio_command"] if ship.has_variable_pitch else []
    return [TIME, drive_column(ship), *command]
