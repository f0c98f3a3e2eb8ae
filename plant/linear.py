"""Linear models of the plant by exact derivatives, as python-control systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.lazy import control
from .derivatives import STEP
from .dynamics import evaluate
from .ship import Ship
from .state import Inputs, Outputs, State, active_states
from .steady_state import Equilibrium

INPUTS = {
    "pitch_command": "pitch_command",
    "drive": "drive",
    "resistance_factor": "resistance_factor",
    "inflow": "inflow",
}
"""Inputs of the linear model, in order: P/D command, rack (voltage, torque, speed), d_c1, u_x."""

STEERED = {**INPUTS, "rudder_command": "rudder_command"}
"""Those of a ship that turns."""


def linearise(
    ship: Ship,
    point: Equilibrium,
    outputs: tuple[str, ...] = ("pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"),
) -> control.StateSpace:
    """Linear model x' = A x + B u, y = C x + D u of the plant about a working point.

    Args:
        ship: the ship.
        point: working point, from :func:`shaftline.plant.equilibrium`.
        outputs: names of states or of algebraic outputs.

    Returns:
        State-space system with named states, the inputs of :data:`INPUTS`, or :data:`STEERED` of a ship
        that turns, and the outputs.
        Dead time and the rack's rate limit lie outside the differential equations and are left out;
        inside a dead band or backlash the pitch does not answer, and its derivative is 0.

    The derivatives are those of the simulated equations themselves, exact to rounding, by complex
    steps (Squire & Trapp 1998); they equal the thesis's eqs. 2-22 to 2-38 on the frigate.

    Raises:
        ValueError: an output that does not exist.
    """
    plant = ship.record()
    states = active_states(plant)
    by = STEERED if ship.turns else INPUTS
    found = tangent(
        plant, point.state, point.inputs, point.outputs.pitch_ratio, states, outputs, by
    )
    return control.ss(
        found.a, found.b, found.c, found.d,
        states=states, inputs=list(by), outputs=list(outputs), name=ship.name,
    )  # fmt: skip


class Tangent(NamedTuple):
    """The plant about any point, to first order: rates and values there, and their slopes."""

    rates: NDArray[np.float64]  # of the states, shape (n,); 0 in a steady state
    values: NDArray[np.float64]  # of the outputs, shape (p,)
    a: NDArray[np.float64]  # rates by states, shape (n, n)
    b: NDArray[np.float64]  # rates by the inputs, shape (n, m)
    c: NDArray[np.float64]  # outputs by states, shape (p, n)
    d: NDArray[np.float64]  # outputs by inputs, shape (p, m)


def tangent(
    plant: Any,
    state: State,
    inputs: Inputs,
    blade: Any,
    states: Sequence[str],
    outputs: Sequence[str],
    by: Mapping[str, str] = MappingProxyType(INPUTS),
) -> Tangent:
    """Rates and outputs with their derivatives, by complex steps.

    Args:
        plant: ship record.
        state: where.
        inputs: what acts there.
        blade: pitch ratio of the blades before [-], of a mechanism that has play.
        states: names of those that move.
        outputs: names of states or of algebraic outputs.
        by: inputs, by their names; the values are fields of :class:`Inputs`.

    Raises:
        ValueError: an output that does not exist.
    """
    known = {*State._fields, *Outputs._fields}
    for name in outputs:
        if name not in known:
            raise ValueError(f"unknown output {name!r}; known: {', '.join(sorted(known))}")
    here = State(*(complex(value) for value in state))
    # all of one type, for the kernel
    acting: Any = [complex(value) for value in inputs[:-1]]
    acts = Inputs(*acting)._replace(outside=tuple(complex(x) for x in inputs.outside))
    held = float(np.real(blade))

    def found(shifted: State, acted: Inputs) -> tuple[list[complex], list[complex]]:
        if plant["speed_held"]:  # then an input, and no state
            shifted = shifted._replace(shaft_speed=acted.drive)
        rate, out = evaluate(plant, shifted, acted, held, False)
        values = {**shifted._asdict(), **out._asdict()}
        return (
            [complex(getattr(rate, name)) for name in states],
            [complex(values[name]) for name in outputs],
        )

    def slopes(columns: list[tuple[list[complex], list[complex]]], part: int) -> Any:
        return np.array([column[part] for column in columns]).T.imag / STEP

    rates, values = (np.array(part).real for part in found(here, acts))
    by_states = [found(here._replace(**{n: getattr(here, n) + 1j * STEP}), acts) for n in states]
    by_inputs = [
        found(here, acts._replace(**{n: getattr(acts, n) + 1j * STEP})) for n in by.values()
    ]
    return Tangent(
        rates, values, slopes(by_states, 0), slopes(by_inputs, 0), slopes(by_states, 1),
        slopes(by_inputs, 1),
    )  # fmt: skip
