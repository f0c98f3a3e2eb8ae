"""Steps of several ships at once, with the equations of :mod:`.stepping` and results equal to the bit.

A batch is divided into groups of :data:`LANES` ships. Each ship of a group begins its step by itself,
all respond at once, and each completes its step by itself. Ships that turn, roll or have terms, ships
with different equations, and ships that do not agree on a branch respond one after the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.lanes import (
    LANES,
    are_alike,
    block_shape,
    box_shape,
    fill_block,
    put_lane,
    put_lanes,
    ships_of,
    take_lane,
    take_lanes,
)
from .expressions import NO_SIGNALS
from .record import PLANT
from .state import (
    Inputs,
    Outputs,
    Straight,
    is_straight,
    set_state,
    set_straight,
    straight_part,
    whole_state,
)
from .stepping import (
    Begun,
    StepInputs,
    advance_apart,
    advance_together,
    begin,
    complete,
    step,
)

_ALONE, _TOGETHER, _RESPONDED = 0, 1, 2  # status of a group

_STRAIGHT = Straight(*(0.0 for _ in Straight._fields))
_BEGUN = (_STRAIGHT, ((0.0,) * 4,) * 3, (0.0,) * 2, 0.0)
_WAVES = (((0.0,) * 3,) * 3, (0.0,) * 4)
_RESPONSE = (Outputs(*(0.0 for _ in Outputs._fields)), _STRAIGHT)


GROUP = np.dtype(
    [
        ("status", np.int64),
        ("plants", np.float64, block_shape(PLANT)),  # block of the ship records
        ("begun", np.float64, box_shape(_BEGUN)),  # what a step needs in calm water
        ("waves", np.float64, box_shape(_WAVES)),  # what it needs in addition at sea
        ("response", np.float64, box_shape(_RESPONSE)),  # outputs and following states
    ],
    align=True,
)
"""Working memory for a group of ships.

It is a record, because kernels count the uses of an array. Who calls a kernel allocates it: a record
does not keep the array alive to which it belongs.
"""


@compiled
def gather(group: Record, plants: Any, states: Any, first: int, last: int) -> int:
    """Form a group of a batch, from the index ``first`` on, and return how many ships it has.

    Args:
        group: GROUP record.
        plants: PLANT array of the batch.
        states: STATE array of the batch.
        first: first ship of the group.
        last: one past the last ship of the batch.
    """
    group.status = _ALONE
    if first + LANES > last:
        return last - first
    one = plants[first]
    straight = one.turns == 0 and one.rolls == 0 and one.term_count == 0
    for lane in range(LANES):
        straight = straight and is_straight(states[first + lane])
    if straight:
        fill_block(group.plants, plants, first)
        group.waves[:] = 0.0
        if are_alike(group.plants, plants):
            group.status = _TOGETHER
    return LANES


@compiled
def _of_instant(inputs: Inputs) -> tuple[Real, Real, Real, Real]:
    return inputs.drive, inputs.inflow, inputs.elevation, inputs.resistance_factor


@compiled
def _waves_of_instant(inputs: Inputs) -> tuple[Real, Real, Real]:
    return inputs.inflow_slope, inputs.inflow_place, inputs.elevation_slope


@compiled
def _inputs(instant: Any, waves: Any, shared: Any, sea: Any) -> Inputs:
    """Return the inputs at one instant of a ship on a straight course, from the numbers of its boxes."""
    drive, inflow, elevation, factor = instant
    slope, place, elevation_slope = waves
    pitch_command, drive_rate = shared
    along, across, head_sea, wind = sea
    return Inputs(
        drive, pitch_command, inflow, slope, place, along, across, elevation, factor, 0.0,
        drive_rate, head_sea, 0.0, elevation_slope, wind, NO_SIGNALS,
    )  # fmt: skip


@compiled
def _begun(numbers: Any, waves: Any) -> Begun:
    """Return the step that the numbers of the boxes describe, of one ship or of all."""
    part, instants, shared, blade = numbers
    of_instants, sea = waves
    return Begun(
        whole_state(part),
        _inputs(instants[0], of_instants[0], shared, sea),
        _inputs(instants[1], of_instants[1], shared, sea),
        _inputs(instants[2], of_instants[2], shared, sea),
        blade,
    )


@compiled
def begin_lane(
    group: Record,
    lane: int,
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    acting: StepInputs,
    dt: float,
) -> None:
    """Begin a step of one ship of a group, with the arguments of :func:`.stepping.step`.

    The state is not changed before :func:`complete_lane`, which must have the same arguments.
    """
    if group.status == _ALONE:
        return
    begun = begin(plant, state, memory, sea, acting, dt)
    first, second, third = begun.first, begun.second, begun.third
    instants = _of_instant(first), _of_instant(second), _of_instant(third)
    shared = first.pitch_command, first.drive_rate
    put_lane(group.begun, lane, (straight_part(begun.now), instants, shared, begun.blade))
    if sea.present != 0 or sea.wind != 0.0:
        waves = _waves_of_instant(first), _waves_of_instant(second), _waves_of_instant(third)
        of_sea = first.wave_along, first.wave_across, first.head_sea, first.wind
        put_lane(group.waves, lane, (waves, of_sea))


@compiled_apart
def respond(group: Record, plants: Any, dt: float) -> None:
    """Compute the step of all ships of a group at once, if they agree on all branches.

    ``plants`` is the PLANT array from which they were gathered.
    """
    if group.status == _ALONE:
        return
    group.status = _TOGETHER
    try:
        begun = _begun(take_lanes(group.begun, _BEGUN), take_lanes(group.waves, _WAVES))
        outputs, following = advance_together(ships_of(group.plants, plants), begun, dt)
        put_lanes(group.response, (outputs, straight_part(following)))
        group.status = _RESPONDED
    except Exception:  # kernels know no other kind; here it is a DisagreementError
        pass


@compiled
def complete_lane(
    group: Record,
    lane: int,
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    acting: StepInputs,
    dt: float,
) -> Outputs:
    """Complete a step of one ship of a group, and return the outputs at the start of the step."""
    if group.status == _ALONE:
        return step(plant, state, memory, sea, acting, dt)
    shaft_speed = state.shaft_speed
    if group.status == _RESPONDED:
        outputs, part = take_lane(group.response, lane, _RESPONSE)
        set_straight(state, part)
    else:
        numbers = take_lane(group.begun, lane, _BEGUN)
        begun = _begun(numbers, take_lane(group.waves, lane, _WAVES))
        outputs, following = advance_apart(plant, begun, dt)
        set_state(state, following)
    complete(plant, state, memory, shaft_speed, outputs, dt)
    return outputs  # type: ignore[no-any-return]
