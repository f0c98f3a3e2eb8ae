"""Source of a policy as one C99 file, for a controller on board: no library but ``math.h``.

The file computes in double precision. It contains the scaling of the measurements, the memory of stacked
observations, and the network.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...baselines.controller import NORMALISED_BOUND
from ...envs.batch import Batch
from ...plant.signals import get_signal
from .policy import Policy

_TEMPLATE = """\
/* Policy {title}.
 * Call {name}_reset at the start, then {name}_step every {interval:g} s.
 *
 * measurements, in this order:
{measurements}
 *
 * actions, each from -1 to 1 ({mode}):
{actions}
 */
#include <math.h>
#include <string.h>

#define {upper}_MEASUREMENTS {width}
#define {upper}_FRAMES {frames}
#define {upper}_ACTIONS {outputs}

typedef struct {{
    double seen[{inputs}]; /* the last observations, the newest at the end */
}} {name}_state;

static const double {name}_middle[{width}] = {{
    {middle}}};
static const double {name}_half[{width}] = {{
    {half}}};
{layers}

void {name}_reset({name}_state *state)
{{
    memset(state->seen, 0, sizeof state->seen);
}}

static double {name}_bounded(double x, double bound)
{{
    return x < -bound ? -bound : x > bound ? bound : x;
}}

static void {name}_layer(const double *weights, const double *biases, int inputs, int outputs,
                         const double *x, double *y)
{{
    for (int i = 0; i < outputs; i++) {{
        double sum = biases[i];
        for (int j = 0; j < inputs; j++)
            sum += weights[i * inputs + j] * x[j];
        y[i] = sum;
    }}
}}

void {name}_step({name}_state *state, const double measurements[{width}], double actions[{outputs}])
{{
    double *seen = state->seen;
    memmove(seen, seen + {width}, ({inputs} - {width}) * sizeof *seen);
    for (int i = 0; i < {width}; i++)
        seen[{inputs} - {width} + i] = {name}_bounded(
            (measurements[i] - {name}_middle[i]) / {name}_half[i], {bound:g});
{calls}
}}
"""

_MEANING = {
    "increment": "changes of the command per step, in shares of the largest change",
    "absolute": "commands from their lowest to their highest value",
    "residual": "changes of the base controller's command, in shares of the largest change",
}


def c_source(policy: Policy, name: str) -> str:
    """Return a policy as the text of a C99 file.

    The functions are ``NAME_reset`` and ``NAME_step``; measurements are in the units of the comment at
    the top of the file.

    Args:
        policy: policy.
        name: prefix of the functions, a C identifier.

    Raises:
        ValueError: the name is no C identifier.

    Examples:
        >>> from shaftline.agents.policy.policy import load_policy
        >>> "void storm_step(" in c_source(load_policy("storm"), "storm")
        True
    """
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,40}", name):
        raise ValueError(f"{name!r} is no name of a C function: letters, digits and _, at most 41")
    batch = policy.make_batch()
    network, width = policy.network, len(batch.observed)
    layers, calls, source = [], [], "seen"
    last = len(network.weights) - 1
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        outputs, inputs = weight.shape
        layers.append(
            f"static const double {name}_weights_{k}[{outputs * inputs}] = "
            f"{{{_numbers(weight.ravel())}}};\n"
            f"static const double {name}_biases_{k}[{outputs}] = {{\n    {_numbers(bias)}}};"
        )
        target = "actions" if k == last else f"layer_{k}"
        if k != last:
            calls.append(f"    double {target}[{outputs}];")
        calls.append(
            f"    {name}_layer({name}_weights_{k}, {name}_biases_{k}, {inputs}, {outputs}, {source}, "
            f"{target});"
        )
        calls.append(f"    for (int i = 0; i < {outputs}; i++)")
        calls.append(f"        {target}[i] = {_activation(policy, k == last, name, target)};")
        source = target
    middle, half = batch.observed_scale
    return _TEMPLATE.format(
        title=policy.summary().splitlines()[0],
        name=name,
        upper=name.upper(),
        interval=policy.interval_s,
        width=width,
        frames=policy.frames,
        inputs=network.shape[0],
        outputs=network.shape[1],
        middle=_numbers(middle),
        half=_numbers(half),
        bound=NORMALISED_BOUND,
        measurements=_comment(_signal(name) for name in batch.observed),
        actions=_comment(action_names(batch)),
        mode=action_meaning(batch),
        layers="\n".join(layers),
        calls="\n".join(calls),
    )


def action_names(batch: Batch) -> tuple[str, ...]:
    """Return what each action of a policy commands, from an environment for which it is made."""
    return ("pitch ratio", f"drive: {_DRIVES[batch.command]}", "rudder")[: batch.actions]


_DRIVES = {
    "shaft-speed": "set-point of the shaft speed governor [rad/s]",
    "limited-rack": "fuel rack [mm], which idle speed, torque limit and highest speed limit",
    "fuel-rack": "fuel rack [mm], without limits",
}
"""What the second action commands, by the keyword ``command`` of the environment."""


def action_meaning(batch: Batch) -> str:
    """Return what a value of an action means, from an environment for which the policy is made."""
    return _MEANING[batch.settings.action_mode.partition(":")[0]]


def _activation(policy: Policy, last: bool, name: str, target: str) -> str:
    if last:
        squash, clip = f"tanh({target}[i])", f"{name}_bounded({target}[i], 1.0)"
        return squash if policy.network.squashed else clip
    if policy.network.activation == "tanh":
        return f"tanh({target}[i])"
    return f"fmax({target}[i], 0.0)"


def _signal(name: str) -> str:
    signal = get_signal(name)
    return f"{name} [{signal.unit}], {signal.description}"


def _comment(lines: Iterable[str]) -> str:
    return "\n".join(f" *   {k}: {line}" for k, line in enumerate(lines))


def _numbers(values: NDArray[np.float32]) -> str:
    """Return numbers as C doubles that have every bit, eight in a line."""
    texts = [repr(float(value)) for value in values]
    rows = [", ".join(texts[k : k + 8]) for k in range(0, len(texts), 8)]
    return ",\n    ".join(rows)
