"""The eight load cases of van der Kroft's thesis (section 4-1), scaled to any ship.

The thesis gives the cases for a frigate. For another ship, the commands are scaled by the range of its
drive and by its highest pitch ratio, and the amplitude of the inflow is scaled by n D.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .seas import get_sea
from .ship import Ship
from .ship_files import load_ship
from .simulation import Schedule, simulate
from .steady_state import equilibrium
from .waves import realise

RACK, PITCH = 22.0, 1.4
"""Constant commands [mm], [-] of the cases that do not change them (section 4-1)."""

NOISE_SNR_DB = 40.0
"""Signal-to-noise ratio of the measurements in the noisy case by default; the thesis's study varies it
from 0 to 100 dB."""

STEP_AT = 10.0
RACK_STEP_DURATION, PITCH_STEP_DURATION = 50.0, 76.0
"""Durations of the step cases [s].

The scores depend on the length of the record, which the thesis does not state. 50 s reproduce its
rack-step column; 76 s reproduce the pitch-step scores of the two kinds of observers that use no inverse
table (I&I low 99.94, random-walk Kalman 74.18).
"""


@dataclass(frozen=True)
class LoadCase:
    """One load case: its schedule, its initial steady state and its duration."""

    name: str
    description: str
    schedule: Schedule
    duration_s: float
    start: tuple[float, float] = (RACK, PITCH)  # rack [mm] and P/D of the initial steady state
    sea: str | None = None
    noisy: bool = False

    def run(
        self, ship: Ship, *, seed: int = 0, dt: float | None = None, sea: str | None = None
    ) -> NDArray[Any]:
        """Simulate the case and return a SAMPLE array of shape (steps + 1,).

        The seed is that of the case's sea, which ``sea`` replaces, as in
        :func:`shaftline.plant.get_sea`. The time step [s] is by default that of the ship. A case without
        effect on the ship, or without an initial steady state, raises a ValueError.
        """
        drive, pitch, inflow = self._scales(ship)
        start = equilibrium(ship, drive * self.start[0], pitch * self.start[1]).state
        waves = get_sea(sea or self.sea or "calm")
        field = realise(waves, ship.propeller.depth_m, seed) if waves else None
        schedule = replace(
            self.schedule,
            drive=_times(self.schedule.drive, drive),
            pitch_command=_times(self.schedule.pitch_command, pitch),
            inflow=_times(self.schedule.inflow, inflow),
        )
        return simulate(ship, schedule, self.duration_s, initial=start, sea=field, dt=dt)

    def _scales(self, ship: Ship) -> tuple[float, float, float]:
        """Return the factors on the frigate's rack, pitch and inflow."""
        needs, name = f"load case {self.name!r} needs", ship.name
        if not ship.has_propeller:
            raise ValueError(f"{needs} a propeller; {name} has none")
        if callable(self.schedule.pitch_command) and not ship.has_variable_pitch:
            raise ValueError(f"{needs} a variable pitch; {name} has a fixed pitch")
        if callable(self.schedule.resistance_factor) and not ship.moves:
            raise ValueError(f"{needs} a hull that moves; {name}'s is fixed")
        frigate = load_ship("frigate")
        drive = float(ship.record()["drive_max"] / frigate.record()["drive_max"])
        pitch = ship.propeller.pitch_ratio_max / frigate.propeller.pitch_ratio_max
        return drive, pitch, _tip_velocity(ship, drive, pitch) / _tip_velocity(frigate, 1.0, 1.0)


def _tip_velocity(ship: Ship, drive: float, pitch: float) -> float:
    """Return n D [m/s] of a ship in the steady state of the cases."""
    steady = equilibrium(ship, drive * RACK, pitch * PITCH)
    return float(steady.state.shaft_speed / (2.0 * math.pi) * ship.propeller.diameter_m)


def _times(value: Any, factor: float) -> Any:
    if callable(value):
        return lambda t: factor * value(t)
    return factor * value


def _step(before: float, after: float) -> Callable[[NDArray[Any]], NDArray[Any]]:
    return lambda t: np.where(t < STEP_AT - 1e-9, before, after)


def _sine(amplitude: float, frequency: float, mean: float = 0.0) -> Any:
    return lambda t: mean + amplitude * np.sin(frequency * t)


def _periods(count: int, frequency: float) -> float:
    return count * 2.0 * math.pi / frequency


_FAST = Schedule(RACK, PITCH, inflow=_sine(1.0, 4.0))
_RAMP = Schedule(RACK, PITCH, resistance_factor=lambda t: 1.0 + 0.75 * np.clip(t / 180.0, 0, 1))
_SWELL = Schedule(RACK, PITCH, resistance_factor=_sine(0.25, 0.0785, mean=1.0))

CASES = {
    case.name: case
    for case in (
        LoadCase("rack_step", "fuel rack from 20 to 27.5 mm", Schedule(_step(20.0, 27.5), PITCH),
                 RACK_STEP_DURATION, start=(20.0, PITCH)),
        LoadCase("pitch_step", "pitch ratio from 1.25 to 1.0", Schedule(RACK, _step(1.25, 1.0)),
                 PITCH_STEP_DURATION, start=(RACK, 1.25)),
        LoadCase("inflow_sine_low", "inflow 1 m/s at 0.15 rad/s",
                 Schedule(RACK, PITCH, inflow=_sine(1.0, 0.15)), _periods(4, 0.15)),
        LoadCase("inflow_sine_high", "inflow 1 m/s at 4 rad/s", _FAST, _periods(20, 4.0)),
        LoadCase("resistance_ramp", "resistance factor from 1 to 1.75 in 180 s", _RAMP, 300.0),
        LoadCase("resistance_sine",
                 "resistance factor 1 +- 0.25 at 0.0785 rad/s (amplitude assumed)",
                 _SWELL, _periods(4, 0.0785)),
        LoadCase("jonswap", "head seas, Hs 2.9 m, Tp 9.3 s, propeller 4 m deep",
                 Schedule(RACK, PITCH), 300.0, sea="thesis"),
        LoadCase("measurement_noise",
                 "inflow 1 m/s at 4 rad/s with white noise on every measurement",
                 _FAST, _periods(20, 4.0), noisy=True),
    )
}  # fmt: skip


def get_case(name: str) -> LoadCase:
    """Return a load case by name; an unknown name raises a ValueError with the known ones.

    >>> from shaftline.plant.load_cases import get_case
    >>> get_case("rack_step").description
    'fuel rack from 20 to 27.5 mm'
    """
    if name not in CASES:
        raise ValueError(f"unknown load case {name!r}; known: {', '.join(CASES)}")
    return CASES[name]
