"""Recognise unit and sign errors of a column, commands out of range, and channels without their sign."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, RUDDER, RUDDER_COMMAND, SHAFT_SPEED, YAW_RATE, drive_column
from ...plant.ship import Ship
from ...plant.surroundings import KNOT
from .columns import PERCENT_OF_RANGE, PITCHES
from .excitation import helm_column

Array = NDArray[np.float64]

_BEYOND = 1.25  # multiple of its end stop that no command exceeds
_RPM = math.pi / 30.0
HELMS = (RUDDER, RUDDER_COMMAND)
"""Columns of the rudder angle, either of which may be the rudder command."""
_SIGNED = ("shaft_torque_N_m", "thrust_N", "ship_speed_m_s", "motor_current_A", SHAFT_SPEED)
_BOTH_WAYS = 0.1  # share of its size that a reversing signal reaches with either sign
_NEVER = 0.02  # share of its size by which a magnitude may lie below zero
_NOISES = 4.0  # multiple of its noise by which a magnitude may lie below zero
_RECTIFIED = 0.6  # least correlation with the magnitude
_CLEARLY = 0.2  # least excess of that correlation over the correlation with the signed signal


def rectified_remark(
    table: pd.DataFrame, simulated: pd.DataFrame | None, column: str, drive: str, noise: float
) -> str:
    """Return a remark on a channel that holds the magnitude of a signal that reverses; else "".

    Args:
        table: canonical columns.
        simulated: simulation of the nominal ship; if None, the drive command is compared.
        column: measured channel.
        drive: column of the drive command.
        noise: rms of the white noise of the channel.
    """
    if column not in _SIGNED:
        return ""
    source = f"simulated {column}"
    if simulated is not None and column in simulated:
        expected = simulated[column].to_numpy(dtype=float)
    else:
        source, expected = drive, table[drive].to_numpy(dtype=float)
    values = table[column].to_numpy(dtype=float)[: len(expected)]
    size, reach = float(np.abs(values).max()), float(np.abs(expected).max())
    if min(-expected.min(), expected.max()) < _BOTH_WAYS * reach or not size > 0.0:
        return ""
    if values.min() < -max(_NEVER * size, _NOISES * noise):
        return ""
    signed, magnitude = _correlation(values, expected), _correlation(values, np.abs(expected))
    if magnitude < max(_RECTIFIED, signed + _CLEARLY):
        return ""
    return (
        f"{column} looks rectified: it is never below {values.min():.3g} {BOUNDS[column][2]}, "
        f"although the {source} reverses ({np.mean(expected < 0.0):.0%} of the rows below zero); "
        f"its correlation with the magnitude is {magnitude:.2f}, with the signed values {signed:.2f}. "
        f"A column map cannot restore the sign: give the column the sign of {drive} (numpy.copysign) "
        "with the change at the minimum of the channel, or leave out the rows around reversals"
    )


def _correlation(a: NDArray[Any], b: NDArray[Any]) -> float:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


class UnitError(NamedTuple):
    """Likely unit or sign error: its description, its factor, and the keys that correct it."""

    looks_like: str
    factor: float
    advice: str

    def convert(self, values: Array) -> Array:
        """Return the values of a channel with this error in the canonical unit."""
        if self.looks_like.startswith("a blade angle"):
            return np.asarray(0.7 * math.pi * np.tan(np.radians(np.clip(values, -60.0, 60.0))))
        return values * self.factor


def _unit(name: str, factor: float) -> UnitError:
    return UnitError(
        f"{name} (a factor {max(factor, 1.0 / factor):.4g})", factor, f'unit = "{name}"'
    )


def power_of_ten_error(factor: float, unit: str) -> UnitError:
    """Return the error of a channel whose values must be multiplied by about a power of ten."""
    power = 10.0 ** round(math.log10(factor))
    size = "small" if power > 1.0 else "large"
    looks = f"values that are {max(power, 1.0 / power):g} times too {size} for {unit}"
    return UnitError(looks, power, f"their unit, or scale = {power:g},")


def likely_unit_errors(column: str, ship: Ship) -> list[UnitError]:
    """Return the units in which a channel is likely to be recorded by mistake, each with either sign.

    Example:
        >>> from shaftline.plant import load_ship
        >>> [error.advice for error in likely_unit_errors("ship_speed_m_s", load_ship("frigate"))[:2]]
        ['unit = "knot"', 'unit = "km/h"']

    Args:
        column: canonical column.
        ship: the nominal ship; its ranges and its gear ratio give further errors.
    """
    gear = ship.transmission.gear_ratio
    by_unit = {
        "rad/s": [_unit("rpm", _RPM), _unit("rps", 2.0 * math.pi)],
        "rad/s of a turn": [_unit("deg/s", math.pi / 180.0), _unit("deg/min", math.pi / 10800.0)],
        "rad": [_unit("deg", math.pi / 180.0), _unit("turn", 2.0 * math.pi)],
        "N m": [
            _unit("kN m", 1e3),
            _unit("MN m", 1e6),
            _unit("tf m", 9806.65),
            _unit("kgf m", 9.80665),
        ],
        "m/s": [_unit("knot", KNOT), _unit("km/h", 1.0 / 3.6)],
        "N": [_unit("kN", 1e3), _unit("MN", 1e6), _unit("tf", 9806.65), _unit("kgf", 9.80665)],
        "V": [_unit("mV", 1e-3), _unit("kV", 1e3)],
        "A": [_unit("mA", 1e-3)],
        "W": [_unit("kW", 1e3), _unit("MW", 1e6), _unit("mW", 1e-3)],
        "mm": [_unit("m", 1e3), _unit("cm", 10.0)],
        "-": [UnitError("a blade angle in degrees", 0.04, 'unit = "deg"')],
    }
    unit = BOUNDS[column][2]
    errors = list(by_unit.get(f"{unit} of a turn" if column == YAW_RATE else unit, []))
    if column in (ranges := command_ranges(ship)):
        high = ranges[column][1]
        looks = f"percent of its range to {high:.3g} {unit}"
        errors.append(UnitError(looks, high / 100.0, f'unit = "{PERCENT_OF_RANGE}"'))
    if unit == "-":
        errors.append(_unit("percent", 0.01))
    if column == SHAFT_SPEED and gear != 1.0:
        scale = f"scale = {1 / gear:.6g}"
        rpm, factor = f'unit = "rpm", {scale}', gear / _RPM
        errors += [
            UnitError(f"the engine speed (a factor {gear:.4g})", 1.0 / gear, scale),
            UnitError(f"the engine speed in rpm (a factor {factor:.4g})", _RPM / gear, rpm),
        ]
    if column == "shaft_torque_N_m" and gear != 1.0:
        looks = f"the engine torque (a factor {gear:.4g})"
        errors.append(UnitError(looks, gear, f"scale = {gear:g}"))
    opposite = [
        UnitError(f"{e.looks_like} with the opposite sign", -e.factor, f"{e.advice}, sign = -1")
        for e in errors
        if not e.looks_like.startswith("a blade angle")
    ]
    return [*errors, UnitError("itself with the opposite sign", -1.0, "sign = -1"), *opposite]


def command_columns(ship: Ship, table: pd.DataFrame) -> list[str]:
    """Return the columns of a recording that are commands and no measurements."""
    helm = helm_column(ship, table)
    pitch = ["pitch_ratio_command"] if ship.has_variable_pitch else []
    commands = [c for c in (drive_column(ship), *pitch) if c in table]
    return commands if helm is None else [*commands, helm]


def describe_unit_errors(column: str, errors: list[UnitError], median: float, expected: str) -> str:
    """Return a sentence with the likely errors of a column and the keys that correct them.

    The verb phrase ``expected`` has the value of the ship, such as "takes 0 to 40 mm".
    """
    return (
        f"{column} looks like {' or '.join(e.looks_like for e in errors)}: its median is {median:.4g} "
        f"where this ship {expected}; set {' or '.join(e.advice for e in errors)} in the column map, or "
        "correct the ship file if the column map is right"
    )


def top_speed(ship: Ship) -> float:
    """Return a shaft speed [rad/s] far above every operating state, three times the highest speed."""
    plant, gear = ship.record(), ship.transmission.gear_ratio
    if ship.has_diesel:
        return 3.0 * float(plant["engine_speed_max"]) / gear
    if ship.has_voltage:
        return 3.0 * float(plant["drive_max"] / plant["motor_constant"]) / gear
    if not ship.turns_freely:
        return 3.0 * float(plant["drive_max"])
    return BOUNDS[SHAFT_SPEED][1]


def command_ranges(ship: Ship) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value of each command and of the pitch and rudder positions.

    Example:
        >>> from shaftline.plant import load_ship
        >>> command_ranges(load_ship("frigate"))["fuel_rack_mm"]
        (0.0, 40.0)
    """
    plant = ship.record()
    ranges = {drive_column(ship): (float(plant["drive_min"]), float(plant["drive_max"]))}
    if ship.has_variable_pitch:
        pitch = float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])
        ranges |= dict.fromkeys(PITCHES, pitch)
    if ship.turns:
        ranges |= dict.fromkeys(HELMS, (-float(plant["rudder_max"]), float(plant["rudder_max"])))
    return ranges


def range_text(column: str, ship: Ship) -> str:
    """Return the range of a command, or of the shaft speed, as text with its unit."""
    if column == SHAFT_SPEED and ship.turns_freely:
        plant, top = ship.record(), top_speed(ship) / 3.0
        slow = float(plant["engine_speed_min"] / plant["gear_ratio"])
        low, high = (slow if ship.has_diesel else -top), top
    else:
        low, high = command_ranges(ship)[column]
    return f"{low:.3g} to {high:.3g} {BOUNDS[column][2]}"


def impossible_commands(table: pd.DataFrame, ship: Ship) -> Iterator[str]:
    """Yield errors on commands outside the range of the ship, with the unit errors that explain them."""
    for column in command_columns(ship, table):
        values = table[column].to_numpy()
        low, high = command_ranges(ship)[column]
        if column == "pitch_ratio_command":
            low, high = min(0.0, low), max(abs(low), abs(high)) + 0.3
        else:
            low, high = (_BEYOND * low if column in HELMS else low), _BEYOND * high
        if _possible(values, low, high):
            continue
        likely = likely_unit_errors(column, ship)
        errors = [e for e in likely if _possible(e.convert(values), low, high, 0.1)]
        takes = f"takes {range_text(column, ship)}"
        if errors:
            yield describe_unit_errors(column, errors[:2], float(np.median(values)), takes)
        else:
            above = np.abs(values) > high
            row = int(np.argmax(above if above.any() else values < low))
            yield (
                f"{column}, row {row + 1}: {values[row]:g} {BOUNDS[column][2]} where this ship "
                f"{takes}; check the ship file and the unit in the column map"
            )


def _possible(values: Array, low: float, high: float, least: float = 0.0) -> bool:
    """Return whether nearly all of a command lies within limits and it reaches a share of them."""
    reach = float(np.percentile(np.abs(values), 95))
    return least * high <= reach <= high and float(np.percentile(values, 95)) >= low
