"""Linear models of the plant by exact derivatives, as python-control systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ..core.lazy import control
from .derivatives import STEP
from .dynamics import evaluate
from .ship import Ship, ShipError
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

_STEEPEST = 1e50  # derivative beyond which poles cannot be told in double precision


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
        ValueError: an output that does not exist, or numbers of a ship too extreme to be derived.
    """
    plant = ship.record()
    states = active_states(plant)
    by = STEERED if ship.turns else INPUTS
    found = tangent(
        plant, point.state, point.inputs, point.outputs.pitch_ratio, states, outputs, by
    )
    if not all((np.abs(part) < _STEEPEST).all() for part in found):
        raise ValueError(
            f"{ship.name}: no linear model, for its equations are all but vertical here; is a mass, an "
            "inertia or a time constant of its file many orders too small?"
        )
    return control.ss(
        found.a, found.b, found.c, found.d,
        states=states, inputs=list(by), outputs=list(outputs),
        name=ship.name.replace(".", " "),  # where python-control has a dot, a name parts

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
        rate, out = evaluate(plant, shifted, acted, held)
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


class Local(NamedTuple):
    """The plant about one instant of a run, to first order."""

    time_s: float
    states: tuple[str, ...]  # names
    state: NDArray[np.float64]  # shape (n,)
    tangent: Tangent

    def ahead(self, seconds: float) -> NDArray[np.float64]:
        """State some time later, shape (n,), by this model alone, all that acts on the ship held.

        The exact solution of x' = f + A (x - x0).

        Args:
            seconds: how much later [s].
        """
        n = len(self.state)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.tangent.a, self.tangent.rates
        return np.asarray(self.state + scipy.linalg.expm(block * seconds)[:n, n])


def along(
    ship: Ship,
    samples: NDArray[Any],
    every_s: float,
    outputs: tuple[str, ...] = ("pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"),
) -> list[Local]:
    """Linear models about the instants of a run, one after the other (thesis, end of section 2-7-2).

    What acts on the ship is read from the run and held about each instant: the demands as they stand in
    it, the inflow and the factor on the resistance as its advance velocity and resistance ask for. The
    rates of the states are not 0 there, as they are in a steady state.

    Args:
        ship: that sailed.
        samples: SAMPLE array of :func:`shaftline.plant.simulate`, shape (n,).
        every_s: between two models [s], a multiple of the samples' interval.
        outputs: names of states or of algebraic outputs.

    Raises:
        ShipError: a ship with states of which samples tell nothing.
        ValueError: an interval that is none of the samples', or an output that does not exist.
    """
    plant = ship.record()
    names = tuple(active_states(plant))
    untold = set(names) - set(samples.dtype.names or ())
    if untold or ship.hears or plant["pitch_backlash"]:
        raise ShipError(
            f"{ship.name}: samples do not tell {', '.join(sorted(untold)) or 'all that acts on it'}"
        )
    interval = float(samples["time"][1] - samples["time"][0])
    step = round(every_s / interval)
    if step < 1 or abs(step * interval - every_s) > 1e-6 * interval:
        raise ValueError(
            f"every_s = {every_s:g}: must be a multiple of the samples' {interval:g} s, at least one"
        )
    return [_local(plant, row, names, outputs, ship.turns) for row in samples[::step]]


def _local(
    plant: Any, row: Any, names: tuple[str, ...], outputs: tuple[str, ...], turns: bool
) -> Local:
    told = {name: float(row[name]) for name in State._fields if name in row.dtype.names}
    told["pitch_ratio"] -= float(plant["pitch_actuator_offset"])
    state = State(**told)
    bare = Inputs(float(row["drive"]), float(row["pitch_command"]))
    if turns:
        bare = bare._replace(rudder_command=float(row["rudder_command"]))
    blade = float(row["pitch_ratio"])
    _, calm = evaluate(plant, state, bare, blade)
    factor = row["resistance"] / calm.resistance if calm.resistance else 1.0
    acting = bare._replace(
        inflow=float(row["advance_velocity"] - calm.advance_velocity),
        resistance_factor=float(factor),
    )
    by = STEERED if turns else INPUTS
    found = tangent(plant, state, acting, blade, names, outputs, by)
    return Local(float(row["time"]), names, np.array([told[name] for name in names]), found)
