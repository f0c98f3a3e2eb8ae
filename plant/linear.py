"""Linear models of the plant by exact derivatives, as python-control systems."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

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
        State-space system with named states, the four inputs of :data:`INPUTS` and the outputs.
        Dead time and the rack's rate limit lie outside the differential equations and are left out;
        inside a dead band or backlash the pitch does not answer, and its derivative is 0.

    The derivatives are those of the simulated equations themselves, exact to rounding, by complex
    steps (Squire & Trapp 1998); they equal the thesis's eqs. 2-22 to 2-38 on the frigate.

    Raises:
        ValueError: an output that does not exist.
    """
    known = {*State._fields, *Outputs._fields}
    for name in outputs:
        if name not in known:
            raise ValueError(f"unknown output {name!r}; known: {', '.join(sorted(known))}")
    plant = ship.record()
    states = active_states(plant)
    state = State(*(complex(value) for value in point.state))
    acting: Any = [complex(value) for value in point.inputs]  # all of one type, for the kernel
    inputs = Inputs(*acting)
    blade = float(np.real(point.outputs.pitch_ratio))

    def derivatives(shifted: State, acted: Inputs) -> tuple[list[float], list[float]]:
        if not ship.turns_freely:  # then an input, and no state
            shifted = shifted._replace(shaft_speed=acted.drive)
        rate, out = evaluate(plant, shifted, acted, blade, False)
        values = {**shifted._asdict(), **out._asdict()}
        return (
            [getattr(rate, name).imag / STEP for name in states],
            [complex(values[name]).imag / STEP for name in outputs],
        )

    columns_x = [
        derivatives(state._replace(**{n: getattr(state, n) + 1j * STEP}), inputs) for n in states
    ]
    columns_u = [
        derivatives(state, inputs._replace(**{n: getattr(inputs, n) + 1j * STEP}))
        for n in INPUTS.values()
    ]
    a, c = (np.array([column[i] for column in columns_x]).T for i in (0, 1))
    b, d = (np.array([column[i] for column in columns_u]).T for i in (0, 1))
    return control.ss(
        a, b, c, d, states=states, inputs=list(INPUTS), outputs=list(outputs), name=ship.name
    )
