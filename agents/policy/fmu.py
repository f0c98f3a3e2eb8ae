"""A policy as an FMU: the C file of :mod:`.c_source` behind the co-simulation interface."""

from __future__ import annotations

from pathlib import Path

from ...fmi.archive import Model, write_fmu
from ...fmi.description import INPUT, OUTPUT, Variable, measured_column
from ...plant.signals import get_signal
from .c_source import action_meaning, action_names, c_source
from .policy import Policy

_CODE = """\
#include "policy.c"

typedef policy_state model_memory;

static int model_begin(model_memory *memory, double *slots)
{
    policy_reset(memory);
    memset(slots + MODEL_SETTABLE, 0, (MODEL_SLOTS - MODEL_SETTABLE) * sizeof *slots);
    return 0;
}

static int model_advance(model_memory *memory, double *slots, long steps)
{
    while (steps-- > 0)
        policy_step(memory, slots, slots + MODEL_SETTABLE);
    return 0;
}
"""


def export_policy(policy: Policy, path: Path) -> None:
    """Write a policy as an FMU for co-simulation that contains its C source.

    Inputs are the measurements in physical units, outputs the actions after each control interval; the
    actions are 0 before the first one. Communication steps are whole multiples of the control interval.

    Raises:
        FmuError: the name of the file does not end in ``.fmu``, or no C compiler works here.
    """
    batch = policy.make_batch()
    middle = batch.observed_scale[0].tolist()
    variables = []
    for slot, name in enumerate(batch.observed):
        signal = get_signal(name)
        variables.append(
            Variable(
                slot, measured_column(name), INPUT, signal.unit, signal.description, middle[slot]
            )
        )
    width = len(variables)
    for k, name in enumerate(action_names(batch)):
        column = f"{name.split(':')[0].replace(' ', '_')}_action"
        variables.append(
            Variable(width + k, column, OUTPUT, "-", f"{name}, -1 to 1: {action_meaning(batch)}")
        )
    starts = [*middle, *[0.0] * (len(variables) - width)]
    about = f"policy: {policy.summary().splitlines()[0]}"
    model = Model(
        about,
        variables,
        policy.interval_s,
        starts,
        width,
        width,
        _CODE,
        {"policy.c": c_source(policy, "policy")},
    )
    write_fmu(path, model)
