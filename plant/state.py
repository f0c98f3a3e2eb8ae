"""The plant's continuous states, declared once, and what acts on it and comes out at one instant.

A new state is a field of :class:`State` and its rate in :mod:`.dynamics`; the record, its copies, the
initial state and the linear model follow from the declaration.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from ..core.compiled import Real, Record, compiled, spelled_out
from .expressions import NO_SIGNALS
from .ventilation import can_ventilate


class Where(NamedTuple):
    """A state that a ship has where its record says so."""

    exists: Callable[[Record], bool]


TURNS = Where(lambda plant: plant["turns"] != 0)


class Lag(NamedTuple):
    """A state that follows the others with a lag, and is there where the lag is above 0."""

    field: str  # of the ship's record
    probe: float = 1.0  # by which it is moved to see how its rate follows it
    after: bool = False  # it is led by another lag's state, and acts on that


class State(NamedTuple):
    """Continuous states of the plant. Those of absent effects stay at 0."""

    pitch_ratio: Annotated[
        Real, Where(lambda plant: plant["pitch_ratio_min"] < plant["pitch_ratio_max"])
    ]  # of the actuator [-]
    shaft_speed: Annotated[Real, Where(lambda plant: plant["speed_held"] == 0)]  # omega [rad/s]
    ship_speed: Annotated[Real, Where(lambda plant: plant["hull_fixed"] == 0)]  # over ground [m/s]
    # nothing depends on the position but the phase of the waves
    position: Annotated[Real, Where(lambda plant: False)] = 0.0  # along the track [m]
    brake_torque: Annotated[Real, Lag("engine_lag")] = 0.0  # of a diesel with lag [N m]
    inflow: Annotated[Real, Lag("inflow_lag")] = 0.0  # advance velocity where it lags [m/s]
    ventilation: Annotated[Real, Where(can_ventilate)] = 0.0  # degree of ventilation [-]
    motor_current: Annotated[Real, Lag("armature_inductance")] = 0.0  # where it has dynamics [A]
    # nothing depends on the angle but a recording that has it in place of the speed
    shaft_angle: Annotated[Real, Where(lambda plant: False)] = 0.0  # turned by the shaft [rad]
    # of a diesel whose torque waits for air, or for its parts to warm: shares of those at rated power
    charge: Annotated[Real, Lag("charge_lag", 1e-3, after=True)] = 0.0  # [-]
    warmth: Annotated[Real, Lag("warmth_lag", 1e-3, after=True)] = 0.0  # [-]
    # of a ship that turns
    sway_speed: Annotated[Real, TURNS] = 0.0  # to starboard, over ground [m/s]
    yaw_rate: Annotated[Real, TURNS] = 0.0  # to starboard [rad/s]
    heading: Annotated[Real, TURNS] = 0.0  # to starboard of the first course [rad]
    cross_track: Annotated[Real, Where(lambda plant: False)] = 0.0  # to starboard of it [m]
    rudder_angle: Annotated[Real, Lag("rudder_lag")] = 0.0  # positive turns to starboard [rad]
    # of terms that have one, in their order
    term_1: Annotated[Real, Where(lambda plant: plant["term_states"] > 0)] = 0.0
    term_2: Annotated[Real, Where(lambda plant: plant["term_states"] > 1)] = 0.0
    term_3: Annotated[Real, Where(lambda plant: plant["term_states"] > 2)] = 0.0


def _declared() -> dict[str, Where | Lag]:
    hints = get_type_hints(State, include_extras=True)
    found = {}
    for name in State._fields:
        marks = getattr(hints[name], "__metadata__", ())
        found[name] = marks[0] if marks else Where(lambda plant: True)
    return found


_DECLARED = _declared()

LAGS = {name: mark.field for name, mark in _DECLARED.items() if isinstance(mark, Lag)}
"""States that lag, and the field of the ship's record that holds the lag."""


def active_states(plant: Any) -> list[str]:
    """Names of the states that a ship has, given its record."""
    return [
        name
        for name, mark in _DECLARED.items()
        if (plant[mark.field] > 0.0 if isinstance(mark, Lag) else mark.exists(plant))
    ]


def without_lags(plant: Any) -> Any:
    """A copy of a ship's record in which every state that lags follows at once."""
    prompt = plant.copy()
    for field in LAGS.values():
        prompt[field] = 0.0
    return prompt


STATE = np.dtype([(name, np.float64) for name in State._fields], align=True)

_MOTION = ("pitch_ratio", "shaft_speed", "ship_speed")

motion_state: Callable[[Real, Real, Real], State] = spelled_out(
    """
def motion_state(pitch_ratio, shaft_speed, ship_speed):
    return State(
        {field},
    )
""",
    [name if name in _MOTION else "0.0" for name in State._fields],
    globals(),
)
"""The state of pitch, shaft and hull alone, for kernels, where a tuple's defaults do not act."""

with_motion: Callable[[State, Real, Real, Real], State] = spelled_out(
    """
def with_motion(state, pitch_ratio, shaft_speed, ship_speed):
    return State(
        {field},
    )
""",
    [name if name in _MOTION else f"state.{name}" for name in State._fields],
    globals(),
)
"""A state with other values of pitch ratio, shaft speed and ship speed, for kernels."""

moved: Callable[[State, State, Real], State] = spelled_out(
    """
def moved(state, rate, h):
    return State(
        state.{field} + h * rate.{field},
    )
""",
    State._fields,
    globals(),
)
"""The state after ``h`` [s] at a rate: :math:`x + h \\dot x`."""

get_state: Callable[[Record], State] = spelled_out(
    """
def get_state(record):
    return State(
        record.{field},
    )
""",
    State._fields,
    globals(),
)
"""State of a STATE record."""

set_state: Callable[[Record, State], None] = spelled_out(
    """
def set_state(record, state):
    record.{field} = state.{field}
""",
    State._fields,
    globals(),
)
"""Write a state into a STATE record."""


along: Callable[[State, State], Real] = spelled_out(
    """
def along(rate, direction):
    return (
        + rate.{field} * direction.{field}
    )
""",
    State._fields,
    globals(),
)
"""How fast a state moves along a direction: the sum of their products."""

TERM_STATES = tuple(
    State(*(1.0 if name == own else 0.0 for name in State._fields))
    for own in State._fields
    if own.startswith("term_")
)
"""Directions of the states of terms, one by one."""

AIR = State(*(1.0 if name == "ventilation" else 0.0 for name in State._fields))
"""Direction of the degree of ventilation."""

LAGGING, WAITING = (
    State(
        *(
            mark.probe if isinstance(mark, Lag) and mark.after == after else 0.0
            for mark in _DECLARED.values()
        )
    )
    for after in (False, True)
)
"""The probe of each state that lags, 0 for the others: those that follow at once, and those that wait
for another that lags."""


@compiled
def _root(x: float, rate: float, rate_beside: float, probe: float) -> float:
    """Where the rate of a lag vanishes, from the rates at ``x`` and ``x + probe``."""
    slope = rate_beside - rate
    return x - probe * rate / slope if probe > 0.0 and slope != 0.0 else x


without_rates: Callable[[State, State, State, State], State] = spelled_out(
    """
def without_rates(state, rate, rate_beside, probe):
    return State(
        _root(state.{field}, rate.{field}, rate_beside.{field}, probe.{field}),
    )
""",
    State._fields,
    globals(),
)
"""The state with some lags where their rates vanish, from the rates here and at ``state + probe``."""


class Inputs(NamedTuple):
    """What acts on the plant at one instant."""

    drive: Real  # fuel rack [mm], voltage [V], torque [N m] or speed [rad/s]
    pitch_command: Real  # P/D [-]
    inflow: Real = 0.0  # disturbance u_x of the advance velocity [m/s]
    inflow_slope: float = 0.0  # of the wave field along the waves' travel [1/s]
    inflow_place: float = 0.0  # along it, where ``inflow`` and ``elevation`` hold [m]
    wave_along: float = 0.0  # cosine of the waves' travel's angle to a heading of 0 [-]
    wave_across: float = 0.0  # its sine [-]
    elevation: Real = 0.0  # of the surface above the propeller [m]
    resistance_factor: Real = 1.0  # d_c1 [-]
    time: Real = 0.0  # since the start [s]
    drive_rate: Real = 0.0  # of a speed that is held [rad/s2]
    head_sea: Real = 0.0  # significant height squared of waves from ahead [m2]
    rudder_command: Real = 0.0  # [rad]
    elevation_slope: float = 0.0  # of the wave field along the waves' travel [-]
    outside: tuple[Real, ...] = NO_SIGNALS  # signals from outside that terms hear


@compiled
def steady_inputs(drive: Real, pitch_command: Real, inflow: Real, elevation: Real) -> Inputs:
    """What acts with nothing else beside these, for kernels, where a tuple's defaults do not act."""
    return Inputs(
        drive, pitch_command, inflow, 0.0, 0.0, 0.0, 0.0, elevation, 1.0, 0.0, 0.0, 0.0, 0.0,
        0.0, NO_SIGNALS,
    )  # fmt: skip


class Outputs(NamedTuple):
    """Algebraic quantities of the plant at one instant."""

    pitch_ratio: Real  # of the blades [-]
    advance_velocity: Real  # v_a [m/s]
    thrust: Real  # of one propeller [N]
    propeller_torque: Real  # M_p [N m]
    shaft_torque: Real  # M_m at the gauge [N m]
    brake_torque: Real  # M_b [N m]
    shaft_acceleration: Real  # [rad/s2]
    resistance: Real  # R [N]
    motor_current: Real  # [A]
    thrust_coefficient: Real  # KT [-] without air
    submergence: Real  # of the propeller's centre [m]
    shaft_power: Real  # at the gauge [W]
    electric_power: Real  # of the drive [W]
