"""Channels that are magnitudes, although what they measure reverses.

Slips that a recording's columns are likely to have, and the demands that a ship can be given.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, RUDDER, RUDDER_COMMAND, SHAFT_SPEED, YAW_RATE, drive_column
from ...plant.ship import Ship
from .columns import PERCENT_OF_RANGE, PITCHES
from .excitation import helm_column

_SIGNED = ("shaft_torque_N_m", "thrust_N", "ship_speed_m_s", "motor_current_A", SHAFT_SPEED)
_BOTH_WAYS = 0.1  # share of a signal's size that it must reach either way to reverse
_NEVER = 0.02  # share of a channel's size, and
_NOISES = 4.0  # multiple of its noise, by which a magnitude may lie below zero
_RECTIFIED = 0.6  # correlation with the magnitude, and
_CLEARLY = 0.2  # how much larger than that with the signed signal it must be


def rectified_remark(
    table: pd.DataFrame, simulated: pd.DataFrame | None, column: str, drive: str, noise: float
) -> str:
    """Return a remark on a channel that is a magnitude, though what it measures reverses; else "".

    Args:
        table: canonical columns.
        simulated: the nominal ship with the same commands; None where it cannot be simulated, and the
            drive's command stands for it.
        column: measured channel.
        drive: column of the drive's command.
        noise: rms of the channel's white noise.
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
        f"A column map cannot restore the sign: give the column that of {drive} (numpy.copysign), "
        "turned where the channel passes its minimum, or leave out the rows around reversals"
    )


def _correlation(a: NDArray[Any], b: NDArray[Any]) -> float:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


Array = NDArray[np.float64]

_BEYOND = 1.25  # share of a demand's end stop that no ship's demand exceeds
_RPM = math.pi / 30.0
HELMS = (RUDDER, RUDDER_COMMAND)
"""Columns of the rudder's angle, either of which may order it."""


class Slip(NamedTuple):
    """A likely mistake: what the channel looks like, how it is read then, and how to say so."""

    looks_like: str
    factor: float
    advice: str

    def read(self, values: Array) -> Array:
        """The channel's values in the canonical unit if this is the slip."""
        if self.looks_like.startswith("a blade angle"):
            return np.asarray(0.7 * math.pi * np.tan(np.radians(np.clip(values, -60.0, 60.0))))
        return values * self.factor


def _unit(name: str, factor: float) -> Slip:
    return Slip(f"{name} (a factor {max(factor, 1.0 / factor):.4g})", factor, f'unit = "{name}"')


def by_a_factor(factor: float, unit: str) -> Slip:
    """Return the slip of a channel whose values are a number of times too small or too large.

    Args:
        factor: by which the values must be multiplied; its power of ten is named.
        unit: of the channel.
    """
    power = 10.0 ** round(math.log10(factor))
    size = "small" if power > 1.0 else "large"
    looks = f"values that are {max(power, 1.0 / power):g} times too {size} for {unit}"
    return Slip(looks, power, f"their unit, or else scale = {power:g},")


def slips_of(column: str, ship: Ship) -> list[Slip]:
    """Other units that a channel is likely to come in, each with either sign."""
    gear = ship.transmission.gear_ratio
    by_unit = {
        "rad/s": [_unit("rpm", _RPM), _unit("rps", 2.0 * math.pi)],
        "rad/s of a turn": [_unit("deg/s", math.pi / 180.0), _unit("deg/min", math.pi / 10800.0)],
        "rad": [_unit("deg", math.pi / 180.0), _unit("turn", 2.0 * math.pi)],
        "N m": [_unit("kN m", 1e3), _unit("MN m", 1e6), _unit("tf m", 9806.65),
                _unit("kgf m", 9.80665)],
        "m/s": [_unit("knot", 1852.0 / 3600.0), _unit("km/h", 1.0 / 3.6)],
        "N": [_unit("kN", 1e3), _unit("MN", 1e6), _unit("tf", 9806.65), _unit("kgf", 9.80665)],
        "V": [_unit("mV", 1e-3), _unit("kV", 1e3)],
        "A": [_unit("mA", 1e-3)],
        "W": [_unit("kW", 1e3), _unit("MW", 1e6), _unit("mW", 1e-3)],
        "mm": [_unit("m", 1e3), _unit("cm", 10.0)],
        "-": [Slip("a blade angle in degrees", 0.04, 'unit = "deg"')],
    }  # fmt: skip
    unit = BOUNDS[column][2]
    found = list(by_unit.get(f"{unit} of a turn" if column == YAW_RATE else unit, []))
    if column in (ranges := ranges_of(ship)):
        high = ranges[column][1]
        found.append(Slip(f"percent of its range to {high:.3g} {unit}", high / 100.0,
                          f'unit = "{PERCENT_OF_RANGE}"'))  # fmt: skip
    if unit == "-":
        found.append(_unit("percent", 0.01))
    if column == SHAFT_SPEED and gear != 1.0:
        found += [
            Slip(f"the engine's speed (a factor {gear:.4g})", 1.0 / gear, f"scale = {1 / gear:.6g}"),
            Slip(f"the engine's speed in rpm (a factor {gear / _RPM:.4g})", _RPM / gear,
                 f'unit = "rpm", scale = {1 / gear:.6g}'),
        ]  # fmt: skip
    if column == "shaft_torque_N_m" and gear != 1.0:
        found.append(Slip(f"the engine's torque (a factor {gear:.4g})", gear, f"scale = {gear:g}"))
    turned = [Slip(f"{s.looks_like} with the sign turned", -s.factor, f"{s.advice}, sign = -1")
              for s in found if not s.looks_like.startswith("a blade angle")]  # fmt: skip
    return [*found, Slip("itself with the sign turned", -1.0, "sign = -1"), *turned]


def demands(ship: Ship, table: pd.DataFrame) -> list[str]:
    """Columns of a recording that are orders, not measurements."""
    helm = helm_column(ship, table)
    pitch = ["pitch_ratio_command"] if ship.has_variable_pitch else []
    found = [c for c in (drive_column(ship), *pitch) if c in table]
    return found if helm is None else [*found, helm]


def looks_like(column: str, slips: list[Slip], median: float, expected: str) -> str:
    """A sentence that names the likely slips of a column, and what to say in the column map."""
    return (
        f"{column} looks like {' or '.join(s.looks_like for s in slips)}: median {median:.4g} where "
        f"this ship {expected}; say {' or '.join(s.advice for s in slips)} in the column map"
    )


def top_speed(ship: Ship) -> float:
    """Shaft speed [rad/s] that no state of the ship comes near."""
    plant, gear = ship.record(), ship.transmission.gear_ratio
    if ship.has_diesel:
        return 3.0 * float(plant["engine_speed_max"]) / gear
    if ship.has_voltage:
        return 3.0 * float(plant["drive_max"] / plant["motor_constant"]) / gear
    if not ship.turns_freely:
        return 3.0 * float(plant["drive_max"])
    return BOUNDS[SHAFT_SPEED][1]


def ranges_of(ship: Ship) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each order, and of the positions that follow them."""
    plant = ship.record()
    found = {drive_column(ship): (float(plant["drive_min"]), float(plant["drive_max"]))}
    if ship.has_variable_pitch:
        pitch = float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])
        found |= dict.fromkeys(PITCHES, pitch)
    if ship.turns:
        found |= dict.fromkeys(HELMS, (-float(plant["rudder_max"]), float(plant["rudder_max"])))
    return found


def range_of(column: str, ship: Ship) -> str:
    """Range of a demand, or of the shaft's speed, in words."""
    if column == SHAFT_SPEED and ship.turns_freely:
        plant, top = ship.record(), top_speed(ship) / 3.0
        slow = float(plant["engine_speed_min"] / plant["gear_ratio"])
        low, high = (slow if ship.has_diesel else -top), top
    else:
        low, high = ranges_of(ship)[column]
    return f"{low:.3g} to {high:.3g} {BOUNDS[column][2]}"


def impossible_demands(table: pd.DataFrame, ship: Ship) -> Iterator[str]:
    """Sentences on demands that this ship cannot be given."""
    plant = ship.record()
    for column in demands(ship, table):
        values = table[column].to_numpy()
        if column == "pitch_ratio_command":
            high = max(abs(plant["pitch_ratio_min"]), abs(plant["pitch_ratio_max"])) + 0.3
            low = min(0.0, plant["pitch_ratio_min"])
        elif column in HELMS:
            high = _BEYOND * plant["rudder_max"]
            low = -high
        else:
            high, low = _BEYOND * plant["drive_max"], plant["drive_min"]
        if _possible(values, low, high):
            continue
        found = [s for s in slips_of(column, ship) if _possible(s.read(values), low, high, 0.1)]
        takes = f"takes {range_of(column, ship)}"
        if found:
            yield looks_like(column, found[:2], float(np.median(values)), takes)
        else:
            row = int(np.argmax(np.abs(values) > high if (np.abs(values) > high).any()
                                else values < low))  # fmt: skip
            yield (
                f"{column}, row {row + 1}: {values[row]:g} {BOUNDS[column][2]} where this ship "
                f"{takes}; is it another ship, or another unit?"
            )


def _possible(values: Array, low: float, high: float, least: float = 0.0) -> bool:
    """Whether nearly all of a demand lies within limits, and reaches a share of them."""
    reach = float(np.percentile(np.abs(values), 95))
    return least * high <= reach <= high and float(np.percentile(values, 95)) >= low
