"""Continuous states, inputs and outputs of the plant, and kernels over all fields of a state.

A new state is a field of :class:`State` and its rate in :mod:`.dynamics`. The record, its copies, the
initial state and the linear model follow from the declaration.
"""

from __future__ import annotations

import collections
from collections.abc import Callable, Iterable
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from ..core.compiled import Real, Record, compiled, generate_kernel, generate_tuple_kernel
from ..core.lanes import of_kind  # noqa: F401, for a generated kernel
from .expressions import NO_SIGNALS
from .ventilation import can_ventilate


class PresentIf(NamedTuple):
    """Mark of a state that exists if a condition on the ship record holds."""

    exists: Callable[[Record], bool]


TURNS = PresentIf(lambda plant: plant["turns"] != 0)
ROLLS = PresentIf(lambda plant: plant["rolls"] != 0)
UNUSED = PresentIf(lambda plant: False)


class Lag(NamedTuple):
    """Mark of a state with a first-order lag; it exists if the lag is above 0."""

    field: str  # of the ship record: the time constant
    probe: float = 1.0  # step of the state for the slope of its rate
    after: bool = False  # whether it follows the state of another lag and acts on that state


class State(NamedTuple):
    """Continuous states of the plant. States of absent effects stay at 0."""

    # of the pitch actuator [-]
    pitch_ratio: Annotated[Real, PresentIf(lambda p: p["pitch_ratio_min"] < p["pitch_ratio_max"])]
    shaft_speed: Annotated[Real, PresentIf(lambda plant: plant["speed_held"] == 0)]  # omega [rad/s]
    ship_speed: Annotated[Real, PresentIf(lambda p: p["hull_fixed"] == 0)]  # over ground [m/s]
    # Only the phase of the waves depends on the position.
    position: Annotated[Real, UNUSED] = 0.0  # along the track [m]
    brake_torque: Annotated[Real, Lag("engine_lag")] = 0.0  # of a diesel with a lag [N m]
    inflow: Annotated[Real, Lag("inflow_lag")] = 0.0  # advance velocity behind its lag [m/s]
    ventilation: Annotated[Real, PresentIf(can_ventilate)] = 0.0  # degree of ventilation [-]
    motor_current: Annotated[Real, Lag("armature_inductance")] = 0.0  # with inductance [A]
    # No rate depends on the shaft angle; recordings may contain it in place of the speed.
    shaft_angle: Annotated[Real, UNUSED] = 0.0  # turned by the shaft [rad]
    # Charge air and warmth of a diesel that limit its torque, relative to those at rated power.
    charge: Annotated[Real, Lag("charge_lag", 1e-3, after=True)] = 0.0  # [-]
    warmth: Annotated[Real, Lag("warmth_lag", 1e-3, after=True)] = 0.0  # [-]
    # Sway and yaw.
    sway_speed: Annotated[Real, TURNS] = 0.0  # to starboard, over ground [m/s]
    yaw_rate: Annotated[Real, TURNS] = 0.0  # to starboard [rad/s]
    heading: Annotated[Real, TURNS] = 0.0  # to starboard of the initial course [rad]
    cross_track: Annotated[Real, UNUSED] = 0.0  # to starboard of it [m]
    rudder_angle: Annotated[Real, Lag("rudder_lag")] = 0.0  # positive turns to starboard [rad]
    # Roll.
    roll_angle: Annotated[Real, ROLLS] = 0.0  # positive with starboard down [rad]
    roll_rate: Annotated[Real, ROLLS] = 0.0  # [rad/s]
    # States of terms, in the order of the terms.
    term_1: Annotated[Real, PresentIf(lambda plant: plant["term_states"] > 0)] = 0.0
    term_2: Annotated[Real, PresentIf(lambda plant: plant["term_states"] > 1)] = 0.0
    term_3: Annotated[Real, PresentIf(lambda plant: plant["term_states"] > 2)] = 0.0


_HINTS: dict[str, Any] = get_type_hints(State, include_extras=True)
_DECLARED: dict[str, PresentIf | Lag] = {n: hint.__metadata__[0] for n, hint in _HINTS.items()}

LAGS = {name: mark.field for name, mark in _DECLARED.items() if isinstance(mark, Lag)}
"""States with a lag, and the field of the ship record that holds its time constant."""


def active_states(plant: Any) -> list[str]:
    """Return the names of the states that a ship has, from its record."""
    return [
        name
        for name, mark in _DECLARED.items()
        if (plant[mark.field] > 0.0 if isinstance(mark, Lag) else mark.exists(plant))
    ]


def without_lags(plant: Any) -> Any:
    """Return a copy of a ship record without lags: every lag state follows at once."""
    prompt = plant.copy()
    for field in LAGS.values():
        prompt[field] = 0.0
    return prompt


STATE = np.dtype([(name, np.float64) for name in State._fields], align=True)

_MOTION = ("pitch_ratio", "shaft_speed", "ship_speed")
_STRAIGHT = State._fields[: State._fields.index("sway_speed")]


def _state_kernel(signature: str, entry: str, fields: Iterable[str] = State._fields) -> Any:
    return generate_tuple_kernel(signature, "State", entry, fields, globals())


motion_state: Callable[[Real, Real, Real], State] = _state_kernel(
    "motion_state(pitch_ratio, shaft_speed, ship_speed)",
    "{field}",
    [name if name in _MOTION else "0.0" for name in State._fields],
)
"""Return the state of pitch, shaft and hull alone. Kernels cannot use the defaults of a tuple."""

with_motion: Callable[[State, Real, Real, Real], State] = _state_kernel(
    "with_motion(state, pitch_ratio, shaft_speed, ship_speed)",
    "{field}",
    [name if name in _MOTION else f"state.{name}" for name in State._fields],
)
"""Return a state with other values of pitch ratio, shaft speed and ship speed."""

Straight = collections.namedtuple("Straight", _STRAIGHT)  # type: ignore[misc]
"""States of a ship that keeps its course and has no terms."""

straight_part: Callable[[State], Straight] = generate_tuple_kernel(
    "straight_part(state)", "Straight", "state.{field}", _STRAIGHT, globals()
)
"""Return the part of a state that such a ship changes."""

whole_state: Callable[[Straight], State] = _state_kernel(
    "whole_state(part)",
    "{field}",
    [
        f"part.{name}" if name in _STRAIGHT else "of_kind(0.0, part.pitch_ratio)"
        for name in State._fields
    ],
)
"""Return the state of such a ship, in which the other states are 0."""

set_straight: Callable[[Record, Straight], None] = generate_kernel(
    "def set_straight(record, part):\n    record.{field} = part.{field}", _STRAIGHT, globals()
)
"""Write the part into a STATE record."""

is_straight: Callable[[Record], bool] = generate_kernel(
    "def is_straight(record):\n    return (True\n    and record.{field} == 0.0\n    )",
    [name for name in State._fields if name not in _STRAIGHT],
    globals(),
)
"""Return whether the other states in a STATE record are 0."""

shift_state: Callable[[State, State, Real], State] = _state_kernel(
    "shift_state(state, rate, h)", "state.{field} + h * rate.{field}"
)
"""Return the state after ``h`` [s] at a rate: :math:`x + h \\dot x`."""

get_state: Callable[[Record], State] = _state_kernel("get_state(record)", "record.{field}")
"""Return the state in a STATE record."""

set_state: Callable[[Record, State], None] = generate_kernel(
    "def set_state(record, state):\n    record.{field} = state.{field}", State._fields, globals()
)
"""Write a state into a STATE record."""

directional_rate: Callable[[State, State], Real] = generate_kernel(
    "def along(rate, direction):\n    return (\n+ rate.{field} * direction.{field}\n)",
    State._fields,
    globals(),
)
"""Return the component of a rate along a direction: the sum of their products."""


def _unit_state(own: str) -> State:
    return State(*(float(name == own) for name in State._fields))


TERM_STATES = tuple(_unit_state(name) for name in State._fields if name.startswith("term_"))
"""Unit directions of the states of terms."""

VENTILATION_DIRECTION = _unit_state("ventilation")
"""Unit direction of the degree of ventilation."""

LAGGING, WAITING = (
    State(
        *(
            mark.probe if isinstance(mark, Lag) and mark.after == after else 0.0
            for mark in _DECLARED.values()
        )
    )
    for after in (False, True)
)
"""Probe steps of the lag states, 0 for all other states: lags that depend on no other lag, and lags that
follow the state of another one."""


@compiled
def _root(x: float, rate: float, rate_beside: float, probe: float) -> float:
    """Return the zero of the rate of a lag, from the rates at ``x`` and ``x + probe``."""
    slope = rate_beside - rate
    return x - probe * rate / slope if probe > 0.0 and slope != 0.0 else x


zero_lag_rates: Callable[[State, State, State, State], State] = _state_kernel(
    "zero_lag_rates(state, rate, rate_beside, probe)",
    "_root(state.{field}, rate.{field}, rate_beside.{field}, probe.{field})",
)
"""Return the state with some lag states at rest, from the rates here and at ``state + probe``."""


class Inputs(NamedTuple):
    """Inputs of the plant at one instant."""

    drive: Real  # fuel rack [mm], voltage [V], torque [N m] or speed [rad/s]
    pitch_command: Real  # P/D [-]
    inflow: Real = 0.0  # disturbance u_x of the advance velocity [m/s]
    inflow_slope: float = 0.0  # slope of the inflow along the wave travel [1/s]
    inflow_place: float = 0.0  # position along it for which inflow and elevation are given [m]
    wave_along: float = 0.0  # cosine of the angle between wave travel and heading 0 [-]
    wave_across: float = 0.0  # sine of that angle [-]
    elevation: Real = 0.0  # of the surface above the propeller [m]
    resistance_factor: Real = 1.0  # d_c1 [-]
    time: Real = 0.0  # since the start [s]
    drive_rate: Real = 0.0  # rate of a held shaft speed [rad/s2]
    head_sea: Real = 0.0  # significant height squared of waves from ahead [m2]
    rudder_command: Real = 0.0  # [rad]
    elevation_slope: float = 0.0  # slope of the elevation along the wave travel [-]
    wind: Real = 0.0  # true wind along the wave travel [m/s]
    outside: tuple[Real, ...] = NO_SIGNALS  # external signals of terms


@compiled
def inputs_without_sea(
    drive: Real,
    pitch_command: Real,
    inflow: Real,
    elevation: Real,
    resistance_factor: Real,
    time: Real,
    drive_rate: Real,
    rudder_command: Real,
    outside: tuple[Real, ...],
) -> Inputs:
    """Return inputs without waves and wind. Kernels cannot use the defaults of a tuple."""
    return Inputs(
        drive, pitch_command, inflow, 0.0, 0.0, 0.0, 0.0, elevation, resistance_factor, time,
        drive_rate, 0.0, rudder_command, 0.0, 0.0, outside,
    )  # fmt: skip


class Outputs(NamedTuple):
    """Algebraic outputs of the plant at one instant."""

    pitch_ratio: Real  # of the blades [-]
    advance_velocity: Real  # v_a [m/s]
    thrust: Real  # of one propeller [N]
    propeller_torque: Real  # M_p [N m]
    shaft_torque: Real  # M_m at the torque meter [N m]
    brake_torque: Real  # M_b [N m]
    shaft_acceleration: Real  # [rad/s2]
    resistance: Real  # R [N]
    motor_current: Real  # [A]
    thrust_coefficient: Real  # KT [-] without ventilation
    submergence: Real  # of the propeller's centre [m]
    shaft_power: Real  # at the torque meter [W]
    electric_power: Real  # of the drive [W]
