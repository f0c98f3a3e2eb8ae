"""The columns that a recording may have: the signals' own, and the demands on the prime movers."""

from __future__ import annotations

from .drives import DRIVES
from .ship import Ship
from .signals import RECORDED_SIGNALS, SIGNALS

TIME = "time_s"
SHAFT_SPEED, SHAFT_ANGLE = "shaft_speed_rad_s", "shaft_angle_rad"
SHAFT_POWER, ELECTRIC_POWER = "shaft_power_W", "electric_power_W"
RUDDER_COMMAND, RUDDER = "rudder_command_rad", "rudder_rad"
SWAY_SPEED, YAW_RATE, HEADING = "sway_speed_m_s", "yaw_rate_rad_s", "heading_rad"

DEMANDS = tuple(drive.demand for drive in DRIVES)
"""Signal by which each kind of prime mover is driven."""

BOUNDS = {
    signal.column: (signal.low, signal.high, signal.unit)
    for signal in (*SIGNALS, *DEMANDS, *RECORDED_SIGNALS)
}
"""Lowest and highest value and unit of each column that is understood."""

_DEMANDS = tuple(demand.column for demand in DEMANDS if demand.column != SHAFT_SPEED)
COLUMNS = (
    TIME, *_DEMANDS, "pitch_ratio_command", "pitch_ratio",
    SHAFT_SPEED, SHAFT_ANGLE, "shaft_torque_N_m", "ship_speed_m_s", "thrust_N",
    "fuel_flow_kg_s", "propeller_submergence_m", "motor_current_A", SHAFT_POWER, ELECTRIC_POWER,
    "inflow_velocity_m_s",
    RUDDER_COMMAND, RUDDER, SWAY_SPEED, YAW_RATE, HEADING,
)  # fmt: skip
"""Canonical columns of a recording; demands first, then what was measured."""

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
"""Measured columns and the simulated signal that answers each."""

IN_A_TURN = (SWAY_SPEED, YAW_RATE, HEADING, RUDDER)
"""Columns that a ship has that turns."""

ON_ANY_SHIP = tuple(MEASURED)[:4]
"""Columns that a simulation always has; the rest where the recording has them."""


def drive_column(ship: Ship) -> str:
    """Column that holds the demand on the ship's prime mover."""
    return ship.prime_mover.demand.column


def signal_columns(ship: Ship) -> dict[str, str]:
    """Signals that a ship has, by the column that each has in her recordings; canonical ones first.

    The demand stands under the name of her prime mover's, and what she does not have is left out: of a
    fixed pitch the order, of a straight course the turn, the current without an armature.
    """
    found = {s.column: s.name for s in SIGNALS if s.name != "drive"}
    found = {drive_column(ship): "drive"} | found  # of a shaft that is led, the speed reached
    absent = foreign_columns(ship) | (set() if ship.has_variable_pitch else {"pitch_ratio_command"})
    ordered = dict.fromkeys((*(c for c in COLUMNS if c in found), *found))
    return {column: found[column] for column in ordered if column not in absent}


def answered_columns(ship: Ship) -> list[str]:
    """Measured columns that a simulation of the ship answers."""
    none = set() if ship.has_propeller else {"thrust_N"}
    none |= set() if ship.turns_freely else {SHAFT_SPEED, SHAFT_ANGLE}
    none |= set() if ship.turns else set(IN_A_TURN)
    none |= set() if ship.prime_mover.electric else {ELECTRIC_POWER}
    return [column for column in MEASURED if column not in none]


def foreign_columns(ship: Ship) -> set[str]:
    """Columns of what the ship does not have: an armature, an electric drive, a rudder."""
    absent = set() if ship.has_voltage else {"motor_current_A", "true_motor_current_A"}
    absent |= set() if ship.prime_mover.electric else {ELECTRIC_POWER}
    return absent if ship.turns else {*absent, *IN_A_TURN, RUDDER_COMMAND}


def input_columns(ship: Ship) -> list[str]:
    """Columns that a recording must have to drive the ship."""
    command = ["pitch_ratio_command"] if ship.has_variable_pitch else []
    return [TIME, drive_column(ship), *command]
