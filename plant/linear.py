"""Linear models of the plant from exact derivatives, as python-control systems."""

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

INPUTS = {name: name for name in ("pitch_command", "drive", "resistance_factor", "inflow")}
"""Inputs of the linear model: P/D command, drive command, resistance factor d_c1, inflow u_x."""

STEERED_INPUTS = {**INPUTS, "rudder_command": "rudder_command"}
"""Inputs of the linear model of a ship with sway and yaw."""

_STEEPEST = 1e50  # derivative beyond which double precision cannot resolve the poles


def linearise(
    ship: Ship,
    point: Equilibrium,
    outputs: tuple[str, ...] = ("pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"),
) -> control.StateSpace:
    """Return the linear model x' = A x + B u, y = C x + D u of the plant about a steady state.

    Args:
        ship: the ship.
        point: steady state, from :func:`shaftline.plant.equilibrium`.
        outputs: names of states or of algebraic outputs.

    Returns:
        State-space system with named states, inputs and outputs. The inputs are :data:`INPUTS`, or
        :data:`STEERED_INPUTS` for a ship with sway and yaw. Dead time and the rack's rate limit are not
        part of the differential equations and are left out. Inside a dead band or backlash the
        derivative of the pitch is 0.

    The derivatives are those of the simulated equations themselves, exact to rounding, by complex steps
    (Squire & Trapp 1998). On the frigate they equal the thesis's eqs. 2-22 to 2-38.

    Raises:
        ValueError: an unknown output, or parameters so extreme that the derivatives are not finite.

    >>> from shaftline.plant import equilibrium, linearise, load_ship
    >>> ship = load_ship("frigate")
    >>> model = linearise(ship, equilibrium(ship, drive=22.0, pitch_ratio=1.2))
    >>> model.state_labels
    ['pitch_ratio', 'shaft_speed', 'ship_speed']
    >>> sorted(round(float(pole.real), 3) for pole in model.poles())  # [1/s]
    [-0.99, -0.5, -0.023]
    """
    states, by, model = matrices(ship, point, outputs)
    return control.ss(
        model.a,
        model.b,
        model.c,
        model.d,
        states=states,
        inputs=by,
        outputs=list(outputs),
        name=ship.name.replace(".", " "),  # python-control allows no dot in a name
    )


def matrices(
    ship: Ship, point: Equilibrium, outputs: tuple[str, ...] = ()
) -> tuple[list[str], list[str], Tangent]:
    """Return states, inputs and matrices of :func:`linearise`, without the import of python-control."""
    plant = ship.record()
    states = active_states(plant)
    by = STEERED_INPUTS if ship.turns else INPUTS
    blade = point.outputs.pitch_ratio
    model = tangent(plant, point.state, point.inputs, blade, states, outputs, by)
    if not all((np.abs(part) < _STEEPEST).all() for part in model):
        raise ValueError(
            f"{ship.name}: there is no linear model, because derivatives exceed {_STEEPEST:g}; check "
            "whether a mass, an inertia or a time constant of the ship file is many orders too small"
        )
    return states, list(by), model


class Tangent(NamedTuple):
    """First-order expansion of the plant about any point: rates and outputs there, and their slopes."""

    rates: NDArray[np.float64]  # of the states, shape (n,); 0 in a steady state
    values: NDArray[np.float64]  # of the outputs, shape (p,)
    a: NDArray[np.float64]  # d rates / d states, shape (n, n)
    b: NDArray[np.float64]  # d rates / d inputs, shape (n, m)
    c: NDArray[np.float64]  # d outputs / d states, shape (p, n)
    d: NDArray[np.float64]  # d outputs / d inputs, shape (p, m)


def tangent(
    plant: Any,
    state: State,
    inputs: Inputs,
    blade: Any,
    states: Sequence[str],
    outputs: Sequence[str],
    by: Mapping[str, str] = MappingProxyType(INPUTS),
) -> Tangent:
    """Return rates and outputs with their derivatives, by complex steps.

    Args:
        plant: ship record.
        state: state at the point.
        inputs: inputs at the point.
        blade: pitch ratio of the blades before [-], for an actuator with backlash.
        states: names of the states of the expansion.
        outputs: names of states or of algebraic outputs; an unknown one raises a ValueError.
        by: inputs of the expansion by name; the values are fields of :class:`Inputs`.
    """
    known = {*State._fields, *Outputs._fields}
    for name in outputs:
        if name not in known:
            raise ValueError(f"unknown output {name!r}; known: {', '.join(sorted(known))}")
    here = State(*(complex(value) for value in state))
    # The kernel needs all inputs of one type.
    acting: Any = [complex(value) for value in inputs[:-1]]
    acts = Inputs(*acting)._replace(outside=tuple(complex(x) for x in inputs.outside))
    held = float(np.real(blade))

    def rates_and_outputs(shifted: State, acted: Inputs) -> tuple[list[complex], list[complex]]:
        if plant["speed_held"]:  # The shaft speed is then an input and no state.
            shifted = shifted._replace(shaft_speed=acted.drive)
        rate, out = evaluate(plant, shifted, acted, held)
        values = {**shifted._asdict(), **out._asdict()}
        return (
            [complex(getattr(rate, name)) for name in states],
            [complex(values[name]) for name in outputs],
        )

    def slopes(columns: list[tuple[list[complex], list[complex]]], part: int) -> Any:
        return np.array([column[part] for column in columns]).T.imag / STEP

    rates, values = (np.array(part).real for part in rates_and_outputs(here, acts))

    def step_in(point: Any, name: str) -> Any:
        return point._replace(**{name: getattr(point, name) + 1j * STEP})

    by_states = [rates_and_outputs(step_in(here, name), acts) for name in states]
    by_inputs = [rates_and_outputs(here, step_in(acts, name)) for name in by.values()]
    return Tangent(
        rates,
        values,
        slopes(by_states, 0),
        slopes(by_inputs, 0),
        slopes(by_states, 1),
        slopes(by_inputs, 1),
    )


class LocalModel(NamedTuple):
    """Linear model of the plant about one instant of a simulation."""

    time_s: float
    states: tuple[str, ...]  # names
    state: NDArray[np.float64]  # shape (n,)
    tangent: Tangent

    def predict(self, seconds: float) -> NDArray[np.float64]:
        """Return the state after some time [s], shape (n,), with all inputs held constant.

        This is the exact solution of x' = f + A (x - x0).
        """
        n = len(self.state)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.tangent.a, self.tangent.rates
        return np.asarray(self.state + scipy.linalg.expm(block * seconds)[:n, n])


def linearise_along(
    ship: Ship,
    samples: NDArray[Any],
    every_s: float,
    outputs: tuple[str, ...] = ("pitch_ratio", "shaft_speed", "ship_speed", "shaft_torque"),
) -> list[LocalModel]:
    """Return linear models about instants of a simulation (thesis, end of section 2-7-2).

    The inputs at each instant follow from the samples: the commands directly, the inflow and the
    resistance factor from advance velocity and resistance. Unlike in a steady state, the rates of the
    states are not 0.

    Args:
        ship: simulated ship.
        samples: SAMPLE array of :func:`shaftline.plant.simulate`, shape (n,).
        every_s: interval between two models [s], a multiple of the samples' interval.
        outputs: names of states or of algebraic outputs.

    Raises:
        ShipError: the samples lack a state or an input of the ship.
        ValueError: the interval is no multiple of the samples' interval, or an output is unknown.
    """
    plant = ship.record()
    names = tuple(active_states(plant))
    missing = set(names) - set(samples.dtype.names or ())
    if missing or ship.external_signals or plant["pitch_backlash"]:
        raise ShipError(
            f"{ship.name}: the samples do not contain {', '.join(sorted(missing)) or 'all inputs'} "
            "of this ship, so no linear model along them can be formed"
        )
    interval = float(samples["time"][1] - samples["time"][0])
    step = round(every_s / interval)
    if step < 1 or abs(step * interval - every_s) > 1e-6 * interval:
        raise ValueError(
            f"every_s = {every_s:g} s must be a multiple of the samples' interval of {interval:g} s"
        )
    return [_model_at(plant, row, names, outputs, ship.turns) for row in samples[::step]]


def _model_at(
    plant: Any, row: Any, names: tuple[str, ...], outputs: tuple[str, ...], turns: bool
) -> LocalModel:
    values = {name: float(row[name]) for name in State._fields if name in row.dtype.names}
    values["pitch_ratio"] -= float(plant["pitch_actuator_offset"])
    state = State(**values)
    bare = Inputs(float(row["drive"]), float(row["pitch_command"]))
    if turns:
        bare = bare._replace(rudder_command=float(row["rudder_command"]))
    blade = float(row["pitch_ratio"])
    _, calm = evaluate(plant, state, bare, blade)
    factor = row["resistance"] / calm.resistance if calm.resistance else 1.0
    inflow = float(row["advance_velocity"] - calm.advance_velocity)
    acting = bare._replace(inflow=inflow, resistance_factor=float(factor))
    by = STEERED_INPUTS if turns else INPUTS
    expansion = tangent(plant, state, acting, blade, names, outputs, by)
    here = np.array([values[name] for name in names])
    return LocalModel(float(row["time"]), names, here, expansion)
