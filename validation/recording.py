"""A case made real: the recording, its truth, and what an oracle would know."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from .cases import Case, Concealed, truth_of
from .equivalents import equivalent
from .reality.numbers import Numbers
from .scenario import Scenario, with_effect
from .variants import healthy_of

LEAST = (
    0.15  # strength below which another programme is drawn, since this one does not show the effect
)
ATTEMPTS = 4
OPTIONAL = ("thrust_N", "propeller_submergence_m")
_DIGITS = {"time_s": 4, "fuel_rack_mm": 4, "pitch_ratio_command": 5, "pitch_ratio": 5,
           "shaft_speed_rad_s": 5, "shaft_torque_N_m": 1, "ship_speed_m_s": 5, "thrust_N": 3,
           "propeller_submergence_m": 3, "motor_voltage_V": 4, "motor_current_A": 5}  # fmt: skip


@dataclass(frozen=True)
class Reality:
    """A recording and its truth."""

    recording: pd.DataFrame
    truth: Any
    without: pd.DataFrame  # the true ship without its effects, calm, perfect instruments
    concealed: pd.DataFrame  # with them, calm, as faulty instruments read it without noise
    healthy: pd.DataFrame | None = None  # a recording of the same ship without effects


@dataclass
class _Found:
    """Effects with their sizes; strengths beyond tolerances, raw strengths, channels."""

    scenario: Scenario
    sailed: pd.DataFrame
    numbers: Numbers
    sizes: dict[str, float]
    beyond: dict[str, float]
    ratios: dict[str, float]
    channels: dict[str, str]


def make(case: Case) -> Reality:
    """Simulate a case.

    An effect's strength is the rms of its change of the most affected reading, less what numbers
    within their tolerances can imitate of it, over the rms of (recording without effects - file's ship
    in calm water), on this very programme and sea. Where a programme cannot show an effect, another is
    drawn. The truth also holds the strength without regard to tolerances (``ratios``).
    """
    for attempt in range(ATTEMPTS):
        found = _conceal(
            Scenario(replace(case, programme_seed=case.programme_seed + 7919 * attempt))
        )
        if all(strength >= LEAST for strength in found.beyond.values()):
            break
    return _recorded(found)


def make_sized(case: Case, sizes: Mapping[str, float]) -> Reality:
    """Simulate a case whose effects have given sizes, whatever strength that is.

    Args:
        case: as drawn.
        sizes: by key of the effect, positive, in the unit of its number.

    Raises:
        StalledError: the engine stops.
    """
    scenario = Scenario(case)
    numbers = scenario.true
    for one in case.effects:
        numbers = with_effect(numbers, one, sizes[one.key])
    signed = {one.key: one.sign * sizes[one.key] for one in case.effects}
    sailed = scenario.sail(numbers, waves=True)
    return _recorded(_Found(scenario, sailed, numbers, signed, {}, {}, {}))


def _conceal(scenario: Scenario) -> _Found:
    found = _Found(scenario, scenario.base, scenario.true, {}, {}, {}, {})
    for one in scenario.case.effects:
        size, beyond, raw, channel = scenario.find_size(one)
        found.numbers = with_effect(found.numbers, one, size)
        found.sizes[one.key] = one.sign * size
        found.beyond[one.key], found.ratios[one.key] = beyond, raw
        found.channels[one.key] = channel
    if scenario.case.effects:
        found.sailed = scenario.sail(found.numbers, waves=True)
    return found


def _recorded(found: _Found) -> Reality:
    scenario, case, sailed = found.scenario, found.scenario.case, found.sailed
    notes = {
        "channels": found.channels,
        "beyond_tolerances": found.beyond,
        "windows": {c.key: _window(case, found.numbers, c) for c in case.effects},
        "equivalents": {c.key: equivalent(c.effect, found.numbers, sailed) for c in case.effects},
        "residual_rms": scenario.residual_rms,
    }
    aboard, readings = scenario.logged(found.numbers, sailed)
    without, concealed = scenario.calm_run, sailed
    if aboard is not scenario:
        without = aboard.sail(scenario.true, waves=False)
    if aboard is not scenario or case.wave_height > 0.0:
        concealed = aboard.sail(found.numbers, waves=False)
    rows = aboard.kept_rows
    healthy = healthy_of(case)
    return Reality(
        _file(case, readings[rows]),
        truth_of(case, found.sizes, found.ratios, notes),
        without=without[rows].reset_index(drop=True),
        concealed=concealed[rows].reset_index(drop=True),
        healthy=None if healthy is None else _healthy(healthy),
    )


def _healthy(case: Case) -> pd.DataFrame:
    """A recording without effects."""
    scenario = Scenario(case)
    return _file(case, scenario.noisy(scenario.base))


def _file(case: Case, readings: pd.DataFrame) -> pd.DataFrame:
    """What stands in a recording's file: its columns, in the digits of a logger."""
    kept = [c for c in readings if c not in OPTIONAL or c in case.columns]
    return readings[kept].round({c: _DIGITS[c] for c in kept}).reset_index(drop=True)


def _window(case: Case, numbers: Numbers, concealed: Concealed) -> list[float] | None:
    window = concealed.effect.window
    return [numbers[name] * case.seconds for name in window] if window else None
